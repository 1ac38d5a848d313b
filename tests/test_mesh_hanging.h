/* Meshes with hanging nodes: lattices of cubes of which some are refined, so that a face of one cell coincides with
 * four or sixteen faces of other cells. */
#ifndef TEST_MESH_HANGING_H
#define TEST_MESH_HANGING_H

#include "test_meshes.h"

typedef enum test_hanging_shape {
    TEST_HANGING_DYADIC,  /* the cube [-1, 1]^3; all coordinates are exact in float32 if n is a power of two */
    TEST_HANGING_ROTATED, /* rotated and scaled; faces are plane, but no coordinate is exact */
    /* mapped into a ball; hanging nodes lie on the bilinear patch of the coarse face, up to rounding */
    TEST_HANGING_CURVED,
    /* mapped into a ball including the hanging nodes, so that there are real gaps and overlaps between the patches */
    TEST_HANGING_ROUND,
    TEST_HANGING_SHAPE_COUNT
} test_hanging_shape;

const char *test_hanging_shape_name(test_hanging_shape shape);

/* Makes n^3 cubes, of which a third are divided into side^3 smaller cubes (side is 2 or 4). Cubes consist of hexes,
 * wedges or tets, for TEST_HEXES, TEST_WEDGES and TEST_TETS. In curved shapes, only hexes have the same patch on both
 * sides of a face. Values at hanging nodes are bilinear on the coarse face: they agree with a coarse hex, and with
 * other cells if the function is linear. */
void test_mesh_make_hanging(test_mesh_kind kind, int n, int side, test_hanging_shape shape, test_function *f,
                            test_mesh *out);

#endif
