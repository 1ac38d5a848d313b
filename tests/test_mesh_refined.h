/* The linear pieces of cells of higher order that fill the cube [-1, 1]^3. */
#ifndef TEST_MESH_REFINED_H
#define TEST_MESH_REFINED_H

#include "test_meshes.h"

typedef enum refined_kind {
    REFINED_TETS,
    REFINED_HEXES_20,
    REFINED_HEXES_27,
    REFINED_WEDGES,
    REFINED_MIXED
} refined_kind;

/* Makes side^3 cubes of quadratic cells, with two pieces between two nodes: tets of 10 nodes, hexes of 20 or 27, wedges
 * of 18, or columns of the last two in turn. bend: how far nodes inside and on the faces of the cube are moved. Each
 * cell has vertices of its own, as the library has them. */
void test_mesh_make_refined(refined_kind kind, int side, double bend, test_function *f, test_mesh *out);

#endif
