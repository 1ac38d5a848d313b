/* The shapes of cells, as tables: edges, faces and corners. A new cell type goes here. */
#ifndef RENDER_KERNEL_SHAPES_H
#define RENDER_KERNEL_SHAPES_H

#include "grid.h"
#include "simd.h"

/* Edges 01, 02, 03, 12, 13, 23, and the faces without vertex 3, 2, 1, 0: their edges ij, jk and ik. */
enum { KERNEL_TET_EDGES = 6 };
static const signed char kernel_tet_edge[KERNEL_TET_EDGES][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* The faces' vertices and edges. */
static const signed char kernel_tet_face[4][6] = {
    {0, 1, 2, 0, 3, 1}, {0, 1, 3, 0, 4, 2}, {0, 2, 3, 1, 5, 2}, {1, 2, 3, 3, 5, 4}};

typedef struct kernel_shape {
    int edge_count;
    signed char edges[12][2];
    int face_count;
    struct {
        int count;
        signed char vertices[4];
        signed char sides[4][2]; /* edges from each vertex to the next, and whether they are the other way */
    } faces[6];
    float corners[GRID_MAX_CELL_VERTICES][3]; /* the cell's own coordinates of its vertices */
} kernel_shape;

/* Corners of the pyramid are in the coordinates a = (1-q) r, b = (1-q) s, k = 1-q (see kernel_map.h). */
static const kernel_shape kernel_shapes[3] = {
    {12,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}},
     6,
     {{4, {0, 4, 7, 3}, {{8, 0}, {7, 1}, {11, 1}, {3, 0}}},
      {4, {1, 2, 6, 5}, {{1, 0}, {10, 0}, {5, 1}, {9, 1}}},
      {4, {0, 1, 5, 4}, {{0, 0}, {9, 0}, {4, 1}, {8, 1}}},
      {4, {3, 7, 6, 2}, {{11, 0}, {6, 1}, {10, 1}, {2, 0}}},
      {4, {0, 3, 2, 1}, {{3, 1}, {2, 1}, {1, 1}, {0, 1}}},
      {4, {4, 5, 6, 7}, {{4, 0}, {5, 0}, {6, 0}, {7, 0}}}},
     {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}},
    {9,
     {{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}},
     5,
     {{3, {0, 1, 2, 0}, {{0, 0}, {1, 0}, {2, 0}}},
      {3, {3, 5, 4, 0}, {{5, 1}, {4, 1}, {3, 1}}},
      {4, {0, 3, 4, 1}, {{6, 0}, {3, 0}, {7, 1}, {0, 1}}},
      {4, {1, 4, 5, 2}, {{7, 0}, {4, 0}, {8, 1}, {1, 1}}},
      {4, {2, 5, 3, 0}, {{8, 0}, {5, 0}, {6, 1}, {2, 1}}}},
     {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}}},
    {8,
     {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 4}, {2, 4}, {3, 4}},
     5,
     {{4, {0, 3, 2, 1}, {{3, 1}, {2, 1}, {1, 1}, {0, 1}}},
      {3, {0, 1, 4, 0}, {{0, 0}, {5, 0}, {4, 1}}},
      {3, {1, 2, 4, 0}, {{1, 0}, {6, 0}, {5, 1}}},
      {3, {2, 3, 4, 0}, {{2, 0}, {7, 0}, {6, 1}}},
      {3, {3, 0, 4, 0}, {{3, 0}, {4, 0}, {7, 1}}}},
     {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {0, 0, 0}}},
};

/* The row of a hex, wedge or pyramid in tables of their shapes. */
SIMD_INLINE int kernel_shape_number(int type)
{
    return type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : 2;
}

SIMD_INLINE const kernel_shape *kernel_cell_shape(int type)
{
    return &kernel_shapes[kernel_shape_number(type)];
}

/* Calls a function, whose last argument is the type, with a constant for a hex, wedge or pyramid: inlined, it has loops
 * of known lengths. */
#define KERNEL_OF_TYPE(type, function, ...)                                                                            \
    ((type) == GRID_HEX     ? function(__VA_ARGS__, GRID_HEX)                                                          \
     : (type) == GRID_WEDGE ? function(__VA_ARGS__, GRID_WEDGE)                                                        \
                            : function(__VA_ARGS__, GRID_PYRAMID))

#endif
