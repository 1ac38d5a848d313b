/* Hanging nodes: cubes of a lattice, some of them refined, so that one cell's face lies on four or sixteen others'. */
#ifndef TEST_MESH_HANGING_H
#define TEST_MESH_HANGING_H

#include "test_meshes.h"

typedef enum test_hanging_shape {
    TEST_HANGING_DYADIC,  /* the cube [-1, 1]^3: coordinates that float32 holds, if n is a power of two */
    TEST_HANGING_ROTATED, /* turned and shrunk: the same planes, but no coordinate that is exact */
    TEST_HANGING_CURVED,  /* into a ball; hanging nodes are on the patch of the coarse face, exact but for rounding */
    TEST_HANGING_ROUND,   /* into a ball, hanging nodes too: there are gaps and overlaps between the patches in truth */
    TEST_HANGING_SHAPE_COUNT
} test_hanging_shape;

const char *test_hanging_shape_name(test_hanging_shape shape);

/* n^3 cubes, of which a third is cut into side^3 each (2 or 4): hexes, wedges or tets, by TEST_HEXES, TEST_WEDGES and
 * TEST_TETS. In curved shapes only hexes meet on one patch. Values at hanging nodes are the bilinear ones of the coarse
 * face: they agree with a coarse hex, and with other cells where the function is linear. */
void test_mesh_hanging(test_mesh_kind kind, int n, int side, test_hanging_shape shape, test_function *f,
                       test_mesh *out);

#endif
