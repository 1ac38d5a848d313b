/* Where a cell's isosurface can be: points in tile space whose convex hull holds it.
 *
 * In a tet it is flat: the triangle or quadrangle between the points on the edges where the field is zero. Rays hit
 * it there in float32 as well: the weights by which a face's depth and value are made have one sign (kernel_cell.h)
 * and err by some units in the last place, so both are exact at some place on the face beside the ray by as little,
 * and the line between two such places, of opposite signs, goes through the flat. Other cells are within their
 * vertices, and so are their faces, triangles or patches. */
#ifndef RENDER_KERNEL_OUTLINE_H
#define RENDER_KERNEL_OUTLINE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "simd.h"

SIMD_INLINE kernel_four kernel_four_pick(kernel_four v, const int32_t *index)
{
#if defined(__AVX__)
    return (kernel_four)_mm_permutevar_ps((__m128)v, _mm_loadu_si128((const __m128i *)(const void *)index));
#else
    return (kernel_four){v[index[0]], v[index[1]], v[index[2]], v[index[3]]};
#endif
}

SIMD_INLINE float kernel_largest(const float *v, int count)
{
    float largest = 0;
    for (int i = 0; i < count; i++) largest = fabsf(v[i]) > largest ? fabsf(v[i]) : largest;
    return largest;
}

/* False where the field has one sign at all vertices. Not negative counts as inside. */
SIMD_INLINE bool kernel_tet_outline(const kernel_cell *c, kernel_outline *o)
{
    /* Indexed by the bits of the negative vertices: the ends of the crossed edges. Triangles have one edge twice. */
    static const int32_t from[16][4] = {
        {0, 0, 0, 0}, {0, 0, 0, 0}, {1, 1, 1, 1}, {0, 0, 1, 1}, {2, 2, 2, 2}, {0, 0, 2, 2}, {1, 1, 2, 2}, {3, 3, 3, 3},
        {3, 3, 3, 3}, {0, 0, 3, 3}, {1, 1, 3, 3}, {2, 2, 2, 2}, {2, 2, 3, 3}, {1, 1, 1, 1}, {0, 0, 0, 0}, {0, 0, 0, 0}};
    static const int32_t to[16][4] = {
        {0, 0, 0, 0}, {1, 2, 3, 3}, {0, 2, 3, 3}, {2, 3, 2, 3}, {0, 1, 3, 3}, {1, 3, 1, 3}, {0, 3, 0, 3}, {0, 1, 2, 2},
        {0, 1, 2, 2}, {1, 2, 1, 2}, {0, 2, 0, 2}, {0, 1, 3, 3}, {0, 1, 0, 1}, {0, 2, 3, 3}, {1, 2, 3, 3}, {0, 0, 0, 0}};
    const unsigned signs = (unsigned)(c->f[0] < 0) | (unsigned)(c->f[1] < 0) << 1 | (unsigned)(c->f[2] < 0) << 2 |
                           (unsigned)(c->f[3] < 0) << 3;
    if (signs == 0 || signs == 15) return false;
    const float *places[3] = {c->x, c->y, c->z};
    const kernel_four f = kernel_four_load(c->f);
    const kernel_four fa = kernel_four_pick(f, from[signs]), fb = kernel_four_pick(f, to[signs]);
    const kernel_four along = fa / (fa - fb);
    o->count = 4;
    for (int a = 0; a < 3; a++) {
        const kernel_four p = kernel_four_load(places[a]);
        const kernel_four pa = kernel_four_pick(p, from[signs]), pb = kernel_four_pick(p, to[signs]);
        const kernel_four point = pa + along * (pb - pa);
        memcpy(o->point[a], &point, sizeof point);
        o->size[a] = kernel_largest(places[a], 4);
    }
    return true;
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

/* inverse: that of the Jacobian at the middle, times volume. What is left to 1 is far more than all rounding. */
static inline bool kernel_is_unfolded(const kernel_cell *c, const kernel_differential *d, const float inverse[3][3],
                                      float volume)
{
    const float scale = 1 / volume;
    float y[GRID_MAX_CELL_VERTICES][3], off[12];
    for (int i = 0; i < c->count; i++)
        for (int a = 0; a < 3; a++)
            y[i][a] = scale * (inverse[a][0] * (c->x[i] - c->x[0]) + inverse[a][1] * (c->y[i] - c->y[0]) +
                               inverse[a][2] * (c->z[i] - c->z[0]));
    for (int n = 0; n < d->column_count; n++) {
        const signed char *v = d->columns[n].vertex;
        off[n] = 0;
        for (int a = 0; a < 3; a++) {
            const float more = v[2] != v[3] ? y[v[3]][a] - y[v[2]][a] : 0;
            const float term = (y[v[1]][a] - y[v[0]][a]) + more - (a == d->columns[n].along ? 1.0f : 0);
            off[n] += term * term;
        }
    }
    for (int n = 0; n < d->corner_count; n++) {
        const signed char *columns = d->corners[n];
        if (!(off[columns[0]] + off[columns[1]] + off[columns[2]] < 0.9f)) return false;
    }
    return true;
}

/* L at the vertices, and how thick the slab is: |L| <= *thickness. False where no L is of use. */
static inline bool kernel_linearize(const kernel_cell *c, float at[GRID_MAX_CELL_VERTICES], float *thickness)
{
    const float *places[4] = {c->x, c->y, c->z, c->f};
    const kernel_differential *differential = kernel_cell_differential(c->type);
    float d[3][4], n[3][3], middle[4], g[3], size = 0, error = 0, blur = 0;
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 4; a++) {
            d[i][a] = 0;
            for (int v = 0; v < c->count; v++) d[i][a] += differential->middle[i][v] * places[a][v];
        }
    for (int i = 0; i < 3; i++) {
        const float *u = d[(i + 1) % 3], *v = d[(i + 2) % 3];
        for (int a = 0; a < 3; a++) n[i][a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
    }
    const float volume = d[0][0] * n[0][0] + d[0][1] * n[0][1] + d[0][2] * n[0][2];
    if (!(fabsf(volume) > 0)) return false;
    for (int a = 0; a < 3; a++) g[a] = (d[0][3] * n[0][a] + d[1][3] * n[1][a] + d[2][3] * n[2][a]) / volume;
    for (int a = 0; a < 4; a++) {
        middle[a] = 0;
        for (int i = 0; i < c->count; i++) middle[a] += places[a][i];
        middle[a] /= (float)c->count;
    }
    for (int i = 0; i < c->count; i++) {
        at[i] = middle[3];
        for (int a = 0; a < 3; a++) {
            const float term = g[a] * (places[a][i] - middle[a]);
            at[i] += term;
            size = fabsf(term) > size ? fabsf(term) : size;
        }
        error = fabsf(at[i] - c->f[i]) > error ? fabsf(at[i] - c->f[i]) : error;
    }
    if (!kernel_is_unfolded(c, differential, (const float(*)[3])n, volume)) error *= 3.4f;
    /* f is at most about 1. Places are known to a rounding of where they are: X, Y and Z to r, their middle to 8 r. */
    for (int a = 0; a < 3; a++) blur += fabsf(g[a]) * kernel_largest(places[a], c->count);
    *thickness = error + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * blur;
    return *thickness < 1;
}

static inline void kernel_outline_add(kernel_outline *o, const kernel_cell *c, int i, int j, float along)
{
    const float *places[3] = {c->x, c->y, c->z};
    for (int a = 0; a < 3; a++) o->point[a][o->count] = places[a][i] + along * (places[a][j] - places[a][i]);
    o->count++;
}

/* The corners of the hull's slab, and points within it: vertices in the slab, and where lines between two vertices meet
 * its sides. False where there are none. o has the vertices at first, which stay where no slab is to be had. */
static inline bool kernel_slab_outline(const kernel_cell *c, kernel_outline *o)
{
    float at[GRID_MAX_CELL_VERTICES], thickness;
    if (!kernel_linearize(c, at, &thickness)) return true;
    o->count = 0;
    for (int i = 0; i < c->count; i++) {
        if (fabsf(at[i]) <= thickness) kernel_outline_add(o, c, i, i, 0);
        for (int j = 0; j < i; j++)
            for (int side = -1; side <= 1; side += 2) {
                const float level = (float)side * thickness;
                if ((at[i] < level) != (at[j] < level))
                    kernel_outline_add(o, c, i, j, (level - at[i]) / (at[j] - at[i]));
            }
    }
    return o->count > 0;
}

#endif
