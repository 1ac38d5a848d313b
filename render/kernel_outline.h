/* Where a cell's isosurface can be: points in tile space whose convex hull holds it.
 *
 * In a tet it is flat: the triangle or quadrangle between the points on the edges where the field is zero. Rays hit
 * it there in float32 as well: the weights by which a face's depth and value are made have one sign (kernel_cell.h)
 * and err by some units in the last place, so both are exact at some place on the face beside the ray by as little,
 * and the line between two such places, of opposite signs, goes through the flat. Other cells are within their
 * vertices, and so are their faces, triangles or patches. */
#ifndef RENDER_KERNEL_OUTLINE_H
#define RENDER_KERNEL_OUTLINE_H

#include "kernel_cell.h"
#include "kernel_tile.h"

typedef float kernel_four __attribute__((vector_size(16)));

SIMD_INLINE kernel_four kernel_four_load(const float *p)
{
    kernel_four v;
    memcpy(&v, p, sizeof v);
    return v;
}

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
    /* By the bits of the vertices that are negative: the edges' ends, those of triangles with one twice. */
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

#endif
