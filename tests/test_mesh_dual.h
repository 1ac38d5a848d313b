/* Polyhedra with faces that are not plane: random single ones, and the dual of a tet mesh. */
#ifndef TEST_MESH_DUAL_H
#define TEST_MESH_DUAL_H

#include "test_meshes.h"

typedef enum test_random_polyhedron {
    /* triangles between 6 to 22 points in random directions, at distances of 0.75 to 1 from the origin */
    TEST_RANDOM_HULL,
    TEST_RANDOM_DUAL,  /* 6 to 22 faces of 3 or more vertices, not plane, at distances of 0.75 to 1 from the origin */
    TEST_RANDOM_SPIKY, /* like TEST_RANDOM_DUAL, at distances of 0.2 to 1: most are not star-shaped from their centre */
    TEST_RANDOM_COUNT
} test_random_polyhedron;

const char *test_random_name(test_random_polyhedron kind);

/* Makes one cell around the origin, inside the unit ball, with random values in [-1, 1]. */
void test_mesh_make_random_polyhedron(test_random_polyhedron kind, uint64_t seed, test_mesh *out);

/* Makes the dual of a tet mesh, which divides the cube [-1, 1]^3 into n^3 cubes, with inner corners moved by up to
 * jitter of a cube's side, and each cube into twelve tets around its centre with random diagonals of its faces. The
 * dual has a cell for every inner corner and centre, a face for every edge, and a vertex at the mean of every tet;
 * cells cut by the hull are left out. Cells have 8 to 26 faces of 3 to 8 vertices. */
void test_mesh_make_dual(int n, double jitter, test_function *f, test_mesh *out);

/* Splits faces of four vertices, which are bilinear, into two triangles each, the same in both of their cells. All
 * cells must be polyhedra. */
void test_mesh_split_quads(test_mesh *mesh);

#endif
