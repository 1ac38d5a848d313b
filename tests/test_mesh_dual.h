/* Makes polyhedra whose faces are not plane: random single ones, and the dual of a tet mesh. */
#ifndef TEST_MESH_DUAL_H
#define TEST_MESH_DUAL_H

#include "test_meshes.h"

typedef enum test_random_polyhedron {
    /* the triangles of the convex hull of 6 to 22 random directions, with vertices at distances of 0.75 to 1 from the
     * origin */
    TEST_RANDOM_HULL,
    /* 6 to 22 faces of 3 or more vertices, not plane, with vertices at distances of 0.75 to 1 from the origin */
    TEST_RANDOM_DUAL,
    /* like TEST_RANDOM_DUAL with distances of 0.2 to 1; most are not star-shaped from their centre */
    TEST_RANDOM_SPIKY,
    TEST_RANDOM_COUNT
} test_random_polyhedron;

const char *test_random_polyhedron_name(test_random_polyhedron kind);

/* Makes a mesh with one random cell around the origin, inside the unit ball. Values are random in [-1, 1]. */
void test_mesh_make_random_polyhedron(test_random_polyhedron kind, uint64_t seed, test_mesh *out);

/* Makes the dual of a tet mesh. The tet mesh divides the cube [-1, 1]^3 into n^3 cubes, moves their inner corners by up
 * to jitter of a cube's side, and divides each cube into twelve tets around its centre, with random diagonals of its
 * faces. The dual has a cell for every inner corner and for every centre, a face for every edge, and a vertex at the
 * mean of every tet. Cells that the hull cuts are left out. Cells have 8 to 26 faces with 3 to 8 vertices. */
void test_mesh_make_dual(int n, double jitter, test_function *f, test_mesh *out);

/* Splits each face with four vertices, which would be bilinear, into two triangles, the same for both cells at the
 * face. All cells must be polyhedra. */
void test_mesh_split_quads(test_mesh *mesh);

#endif
