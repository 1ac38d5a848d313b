/* Tables of the shapes of tets, hexes, wedges and pyramids: edges, faces and reference coordinates of vertices. A new
 * cell type must be added here and in kernel_cell_types.h. */
#ifndef RENDER_KERNEL_SHAPES_H
#define RENDER_KERNEL_SHAPES_H

#include "grid.h"
#include "kernel_cell_types.h"
#include "simd.h"

/* A tet's edges as pairs of vertices. */
enum { KERNEL_TET_EDGES = 6 };
static const signed char kernel_tet_edge[KERNEL_TET_EDGES][2] = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};

/* The faces of a tet: for each face, its vertices i, j, k, then the indices of the edges ij, jk and ik in
 * kernel_tet_edge. Face n is opposite to vertex 3 - n. */
static const signed char kernel_tet_face[4][6] = {
    {0, 1, 2, 0, 3, 1}, {0, 1, 3, 0, 4, 2}, {0, 2, 3, 1, 5, 2}, {1, 2, 3, 3, 5, 4}};

enum { KERNEL_MAX_LINES = 18 }; /* a hex has 12 edges and 6 diagonals */

typedef struct kernel_shape {
    int edge_count;
    signed char edges[12][2];
    int face_count;
    struct {
        int count;
        signed char vertices[4];
        /* sides[n], for the side from vertex n of the face to the next: index in `edges` of the cell's edge that is
         * this side; then 1 if this edge is stored in the opposite direction, otherwise 0 */
        signed char sides[4][2];
    } faces[6];
    float corners[GRID_MAX_CELL_VERTICES][3]; /* reference coordinates of the vertices */
} kernel_shape;

/* The shapes of the hex, the wedge and the pyramid. The reference coordinates of a pyramid's vertices are a, b and k of
 * kernel_map.h: k is 0 at the apex and 1 at the base. */
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

SIMD_INLINE const kernel_shape *kernel_cell_shape(int type)
{
    return &kernel_shapes[kernel_shape_number(type)];
}

/* Magnitude of an edge function (kernel_cell.h) below which its sign may be wrong in float32, because the rounding
 * errors of its products may underflow. */
#define KERNEL_EDGE_LEAST 1e-30f

/* Returns a vector whose sign bits are set for the rays that are on the same side of all edges of a face with `count`
 * edges. around: edge functions of the face's edges, in cyclic order; only their sign bits are used. */
SIMD_INLINE vi kernel_are_on_same_side_of_edges(const vi around[4], int count)
{
    vi differ = (around[0] ^ around[1]) | (around[1] ^ around[2]);
    if (count == 4) differ |= around[2] ^ around[3];
    return ~differ;
}

/* Returns, for each ray, a reference coordinate of a vertex of the ray's cell: 0 or 1. corner: index of the vertex in
 * the cell; axis: which of the three reference coordinates; count: number of vertices. */
SIMD_INLINE vf kernel_curved_vertex_coordinate(const kernel_shape *shape, int count, int axis, vi corner)
{
    int bits = 0;
    for (int i = 0; i < count; i++) bits |= (shape->corners[i][axis] > 0) << i;
    return vf_from_vi(vi_set(bits) >> corner & 1);
}

/* Returns the rays on which a crossed face is a quad. face: index, in each ray's cell, of one of the two faces that the
 * ray crosses; n: 0 if it is the one with the smaller index, 1 if it is the other one. In a wedge, faces 0 and 1 are
 * triangles. In a pyramid, face 0 is the only quad, so that it never has the larger index. */
SIMD_INLINE vm kernel_is_crossed_face_a_quad(int type, int n, vi face)
{
    const vf number = vf_from_vi(face);
    return KERNEL_BY_SHAPE(type, vm_all_lanes(), vf_lt(vf_set(1.5f), number),
                           n ? vm_none() : vf_lt(number, vf_set(0.5f)));
}

/* Calls a function whose last argument is the cell type, and passes the type as a compile-time constant, so that loops
 * over vertices or faces have constant lengths if the function is inlined. */
#define KERNEL_OF_TYPE(type, function, ...)                                                                            \
    KERNEL_BY_SHAPE(type, function(__VA_ARGS__, GRID_HEX), function(__VA_ARGS__, GRID_WEDGE),                          \
                    function(__VA_ARGS__, GRID_PYRAMID))

#endif
