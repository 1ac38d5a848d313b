/* The four cell types, with VTK's ids and vertex orders. The tables are in the header so that loops over a cell's faces
 * can be compiled for each type. */
#ifndef WAVE_SHAPE_H
#define WAVE_SHAPE_H

#include <stddef.h>
#include <stdint.h>

enum { WAVE_TYPE_TET = 10, WAVE_TYPE_HEX = 12, WAVE_TYPE_WEDGE = 13, WAVE_TYPE_PYRAMID = 14 };

/* The vertices and faces of a cell type. The faces are oriented outward for cells of positive volume. */
typedef struct wave_cell_shape {
    int vertex_count, face_count;
    int face_size[6];  /* number of vertices of each face: 3 or 4 */
    int8_t face[6][4]; /* indices of the cell's vertices around each face */
    /* weight of each vertex in the centroid; the centroid is exact for affine images of the regular cell */
    double centre[8];
} wave_cell_shape;

static const wave_cell_shape wave_tet_shape = {
    4, 4, {3, 3, 3, 3}, {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}}, {0.25, 0.25, 0.25, 0.25}};
static const wave_cell_shape wave_hex_shape = {
    8,
    6,
    {4, 4, 4, 4, 4, 4},
    {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}},
    {0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125}};
static const wave_cell_shape wave_wedge_shape = {6,
                                                 5,
                                                 {3, 3, 4, 4, 4},
                                                 {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}},
                                                 {1.0 / 6, 1.0 / 6, 1.0 / 6, 1.0 / 6, 1.0 / 6, 1.0 / 6}};
static const wave_cell_shape wave_pyramid_shape = {5,
                                                   5,
                                                   {4, 3, 3, 3, 3},
                                                   {{0, 3, 2, 1}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}},
                                                   {0.1875, 0.1875, 0.1875, 0.1875, 0.25}};

/* Returns the shape of a cell type, or NULL for any other type. */
static inline const wave_cell_shape *wave_cell_shape_of(int type)
{
    switch (type) {
    case WAVE_TYPE_TET: return &wave_tet_shape;
    case WAVE_TYPE_HEX: return &wave_hex_shape;
    case WAVE_TYPE_WEDGE: return &wave_wedge_shape;
    case WAVE_TYPE_PYRAMID: return &wave_pyramid_shape;
    default: return NULL;
    }
}

#endif
