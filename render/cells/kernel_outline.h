/* Computes an outline of a cell: points whose convex hull contains its isosurface (kernel_candidate_surfaces.h).
 *
 * In a tet the isosurface is flat: a triangle or quadrangle whose corners are the points on the edges at which the
 * field is zero. Hits in float32 lie on it as well. The weights from which a face's depth and value are computed all
 * have one sign (kernel_cell.h) and err by a few units in the last place. So both are exact for some point of the face
 * very close to the ray, and the line between two such points with values of opposite signs passes through the
 * isosurface. Other cells lie in the convex hull of their vertices, and so do their faces, whether triangles or
 * patches. */
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

/* Sets the outline to the cell's vertices. */
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
 * Let L be linear in the point, and E its largest difference from the field F at a vertex. F - L is the mean of these
 * differences, weighted by the shape functions, which are non-negative in the cell and sum to 1. So |F - L| <= E in the
 * whole cell, however distorted it is; the values of faces, on their patches, are the field's. A hit is a zero of F, or
 * is interpolated between two values of opposite signs, so that |L| <= E there too: it lies in a slab of the cell's
 * hull, which is thin if the field is smooth.
 *
 * This holds for points with reference coordinates in the cell. If the cell's map is folded, solutions up to a quarter
 * outside are accepted (kernel_map.h), where the weights' absolute values sum to at most 1.5³. The map is not folded if
 * its Jacobian differs from that at the middle, J0, by so little that |J0^-1 J - 1| < 1 (in the Frobenius norm, at all
 * corners, and so everywhere, because J is linear in each coordinate). Then no two reference points have the same
 * position, and points between a ray's crossings of the faces are in the cell. */

/* Constants from which the Jacobian of a type of cell is computed. At the cell's middle its columns are weighted sums
 * of the vertices' positions (`middle`). At the corners each column is vertex 1 - vertex 0, plus vertex 3 - vertex 2 if
 * these two differ. */
typedef struct kernel_differential {
    float middle[3][GRID_MAX_CELL_VERTICES];
    int column_count, corner_count;
    struct {
        signed char along, vertex[4];
    } columns[12];
    signed char corners[8][3]; /* the three columns of the Jacobian at each corner, as indices into `columns` */
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
    /* The pyramid, in the coordinates a, b, k of kernel_map.h, where k is 0 at the apex. */
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
