/* Polyhedra with faces that are not plane: single ones at random, and the dual of a mesh of tets. */
#ifndef TEST_MESH_DUAL_H
#define TEST_MESH_DUAL_H

#include "test_meshes.h"

typedef enum test_random_polyhedron {
    TEST_RANDOM_HULL,  /* triangles between 6 to 22 random directions, at distances from the origin of 0.75 to 1 */
    TEST_RANDOM_DUAL,  /* 6 to 22 faces of 3 vertices and more, not plane; distances as above */
    TEST_RANDOM_SPIKY, /* as the second, at distances of 0.2 to 1: most are not star-shaped from their centre */
    TEST_RANDOM_COUNT
} test_random_polyhedron;

const char *test_random_name(test_random_polyhedron kind);

/* One cell about the origin, within the unit ball, with random values in [-1, 1]. */
void test_mesh_random(test_random_polyhedron kind, uint64_t seed, test_mesh *out);

/* The cube [-1, 1]^3 as n^3 cubes, inner corners moved by up to jitter of a cube's side, each cube twelve tets about
 * its centre with random diagonals of its faces; and of this mesh the dual, without cells cut by the hull: it has a
 * cell for every inner corner and centre, a face for every edge, and a vertex at the mean of every tet. Cells have 8 to
 * 26 faces of 3 to 8 vertices. */
void test_mesh_dual(int n, double jitter, test_function *f, test_mesh *out);

/* Faces of four vertices, which are bilinear, to two triangles each, in both of their cells alike. All cells are
 * polyhedra. */
void test_mesh_split_quads(test_mesh *mesh);

#endif
