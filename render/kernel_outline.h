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

/* ---- cells with quads ----
 *
 * Let L be linear in the point, and E its largest difference from the field at a vertex. The field less L is the
 * vertices' differences weighed by the shape functions, which in the cell are not negative and sum to 1: so |F - L| <=
 * E in all of it, however distorted it is, and at most 3.4 E (1.5³) on the quarter around in which solutions of a
 * folded map count (kernel_map.h). A face's value is that of
 * its patch at the ray, within the corners'. A hit is a zero of F, or between two values of opposite signs, so L is no
 * larger there than these sums: the hit is in a slab of the cell's hull, thin where the field is smooth. */

/* Sums over the edges along each of the cell's coordinates: a mean edge times their number. */
static inline int kernel_cell_edges(int type, signed char edges[3][4][2], int count[3])
{
    static const signed char hex[3][4][2] = {
        {{0, 1}, {3, 2}, {4, 5}, {7, 6}}, {{0, 3}, {1, 2}, {4, 7}, {5, 6}}, {{0, 4}, {1, 5}, {2, 6}, {3, 7}}};
    static const signed char wedge[3][4][2] = {{{0, 1}, {3, 4}}, {{0, 2}, {3, 5}}, {{0, 3}, {1, 4}, {2, 5}}};
    static const signed char pyramid[3][4][2] = {{{0, 1}, {3, 2}}, {{0, 3}, {1, 2}}, {{0, 4}, {1, 4}, {2, 4}, {3, 4}}};
    static const int counts[3][3] = {{4, 4, 4}, {2, 2, 3}, {2, 2, 4}};
    const int which = type == GRID_HEX ? 0 : type == GRID_WEDGE ? 1 : 2;
    memcpy(edges, which == 0 ? hex : which == 1 ? wedge : pyramid, sizeof hex);
    memcpy(count, counts[which], sizeof counts[which]);
    return which;
}

/* L at the vertices, and how thick the slab is: |L| <= *thickness. False where no L is of use. */
static inline bool kernel_linear_part(const kernel_cell *c, float at[GRID_MAX_CELL_VERTICES], float *thickness)
{
    const float *places[4] = {c->x, c->y, c->z, c->f};
    signed char edges[3][4][2];
    int count[3];
    float d[3][4], n[3][3], middle[4], g[3], size = 0, error = 0, bend = 0;
    kernel_cell_edges(c->type, edges, count);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 4; a++) {
            d[i][a] = 0;
            for (int e = 0; e < count[i]; e++) d[i][a] += places[a][edges[i][e][1]] - places[a][edges[i][e][0]];
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
            const float part = g[a] * (places[a][i] - middle[a]);
            at[i] += part;
            size = fabsf(part) > size ? fabsf(part) : size;
        }
        error = fabsf(at[i] - c->f[i]) > error ? fabsf(at[i] - c->f[i]) : error;
    }
    const kernel_shape *shape = kernel_cell_shape(c->type);
    for (int i = 0; i < shape->face_count; i++) {
        const signed char *v = shape->faces[i].vertices;
        if (shape->faces[i].count == 3) continue;
        float sum = 0;
        for (int a = 0; a < 3; a++)
            sum += fabsf(g[a] * ((places[a][v[0]] - places[a][v[1]]) + (places[a][v[2]] - places[a][v[3]])));
        bend = sum > bend ? sum : bend;
    }
    /* f is at most about 1. Places are known to a rounding of where they are: X, Y and Z to r, their middle to 8 r. */
    float blur = 0;
    for (int a = 0; a < 3; a++) blur += fabsf(g[a]) * kernel_largest(places[a], c->count);
    *thickness = 3.4f * error + bend + KERNEL_OUTLINE_PAD * (1 + size) + 16 * 6e-8f * blur;
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
    if (!kernel_linear_part(c, at, &thickness)) return true;
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
