/* Meshes of the linear pieces into which cells of higher order are split. They fill the cube [-1, 1]^3. */
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

/* Makes side^3 cubes of quadratic cells, each edge between two neighbouring nodes divided into two pieces. Cells are
 * tets of 10 nodes, hexes of 20 or 27 nodes, wedges of 18 nodes, or columns of 27-node hexes and wedges in turn. bend:
 * distance by which nodes inside and on the faces of the cube are moved. Each cell has its own vertices, as in the
 * library. */
void test_mesh_make_refined(refined_kind kind, int side, double bend, test_function *f, test_mesh *out);

#endif
