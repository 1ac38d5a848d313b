/* Where a cell's isosurface can be: points whose convex hull holds it (kernel_candidate_surfaces.h).
 *
 * In a tet it is flat: the triangle or quadrangle between the points on the edges where the field is zero. Rays hit
 * it there in float32 as well: the weights by which a face's depth and value are made have one sign (kernel_cell.h)
 * and err by some units in the last place, so both are exact at some place on the face beside the ray by as little,
 * and the line between two such places, of opposite signs, goes through the flat. Other cells are within their
 * vertices, and so are their faces, triangles or patches. */
#ifndef RENDER_KERNEL_OUTLINE_H
#define RENDER_KERNEL_OUTLINE_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "simd.h"

SIMD_INLINE float kernel_largest(const float *v, int count)
{
    float largest = 0;
    for (int i = 0; i < count; i++) largest = fabsf(v[i]) > largest ? fabsf(v[i]) : largest;
    return largest;
}

/* The hull of the vertices. */
SIMD_INLINE void kernel_vertex_outline(const kernel_cell *c, kernel_outline *o)
{
    const float *places[3] = {c->x, c->y, c->z};
    o->count = c->count;
    for (int a = 0; a < 3; a++) {
        for (int i = 0; i < c->count; i++) o->point[a][i] = places[a][i];
        o->size[a] = kernel_largest(places[a], c->count);
    }
}

/* ---- cells with quads ----
 *
 * Let L be linear in the point, and E its largest difference from the field at a vertex. The field less L is the
 * vertices' differences weighed by the shape functions, which in the cell are not negative and sum to 1: so |F - L| <=
 * E in all of it, however distorted it is; faces' values, on their patches, are the field's. A hit is a zero of F, or
 * between two values of opposite signs and in proportion to them, so that |L| <= E there too: it is in a slab of the
 * cell's hull, thin where the field is smooth.
 *
 * That is so where the point has coordinates in the cell. Where its map is folded, solutions up to a quarter outside
 * count (kernel_map.h), where the weights' sizes sum to at most 1.5³. Folded it is not if its Jacobian differs from
 * that at the middle, J0, by so little that |J0^-1 J - 1| < 1 (in the Frobenius norm, at all corners, and so
 * everywhere, J being linear in each coordinate): then no two coordinates have one place, and those between a ray's
 * crossings of the faces are in the cell. */

/* A type's Jacobian: at the middle, columns as sums of the vertices' places with weights; at the corners, columns as
 * vertex 1 - vertex 0, and + vertex 3 - vertex 2 where these are not the same. */
typedef struct kernel_differential {
    float middle[3][GRID_MAX_CELL_VERTICES];
    int column_count, corner_count;
    struct {
        signed char along, vertex[4];
    } columns[12];
    signed char corners[8][3]; /* columns */
} kernel_differential;

static const kernel_differential kernel_differentials[3] = {
    {{{-0.25f, 0.25f, 0.25f, -0.25f, -0.25f, 0.25f, 0.25f, -0.25f},
      {-0.25f, -0.25f, 0.25f, 0.25f, -0.25f, -0.25f, 0.25f, 0.25f},
      {-0.25f, -0.25f, -0.25f, -0.25f, 0.25f, 0.25f, 0.25f, 0.25f}},
     12,
     8,
     {{0, {0, 1}},
      {0, {3, 2}},
      {0, {4, 5}},
      {0, {7, 6}},
      {1, {0, 3}},
      {1, {1, 2}},
      {1, {4, 7}},
      {1, {5, 6}},
      {2, {0, 4}},
      {2, {1, 5}},
      {2, {2, 6}},
      {2, {3, 7}}},
     {{0, 4, 8}, {0, 5, 9}, {1, 5, 10}, {1, 4, 11}, {2, 6, 8}, {2, 7, 9}, {3, 7, 10}, {3, 6, 11}}},
    {{{-0.5f, 0.5f, 0, -0.5f, 0.5f, 0},
      {-0.5f, 0, 0.5f, -0.5f, 0, 0.5f},
      {-1.0f / 3, -1.0f / 3, -1.0f / 3, 1.0f / 3, 1.0f / 3, 1.0f / 3}},
     7,
     6,
     {{0, {0, 1}}, {0, {3, 4}}, {1, {0, 2}}, {1, {3, 5}}, {2, {0, 3}}, {2, {1, 4}}, {2, {2, 5}}},
     {{0, 2, 4}, {0, 2, 5}, {0, 2, 6}, {1, 3, 4}, {1, 3, 5}, {1, 3, 6}}},
    /* In the pyramid's own coordinates (kernel_map.h), k from the apex. */
    {{{-0.5f, 0.5f, 0.5f, -0.5f}, {-0.5f, -0.5f, 0.5f, 0.5f}, {0.75f, 0.25f, -0.25f, 0.25f, -1}},
     6,
     4,
     {{0, {0, 1}}, {0, {3, 2}}, {1, {0, 3}}, {1, {1, 2}}, {2, {4, 0}}, {2, {4, 1, 2, 3}}},
     {{0, 2, 4}, {0, 3, 4}, {1, 2, 4}, {1, 3, 5}}}};

SIMD_INLINE const kernel_differential *kernel_cell_differential(int type)
{
    return &kernel_differentials[kernel_shape_number(type)];
}

#endif
