/* Where rays cross the faces of hexes, wedges and pyramids, a ray and its cell a lane: the faces by the signs of
 * projected edges, the places on quads by kernel_quad.h and on triangles by weights, both as kernel_curved_intervals()
 * has them for a packet in one cell, and so with the same bits. A function's type is a constant where it is called
 * from. */
#ifndef RENDER_KERNEL_LOCAL_CROSSINGS_H
#define RENDER_KERNEL_LOCAL_CROSSINGS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_crossings.h"
#include "kernel_local.h"
#include "kernel_placed_curved.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_wide.h"
#include "simd.h"

/* Cells in lanes: places and the field by vertex, and of each face kernel_quad_corners() or kernel_triangle_order(),
 * four bits a corner. */
typedef struct kernel_local_faces {
    float at[4][8][SIMD_WIDTH];
    float words[KERNEL_CURVED_FACES][SIMD_WIDTH];
    float dents[SIMD_WIDTH]; /* kernel_curved_dents() over the pixels of the cell */
} kernel_local_faces;

/* ---- cells ---- */

/* kernel_rank_positions() of the vertices as they came, as numbers. */
SIMD_INLINE void kernel_local_rank(double (*const world)[8][SIMD_WIDTH], int count, vf rank[8])
{
    kernel_half sum[2][8] = {0};
    for (int half = 0; half < 2; half++) {
        kernel_half at[3][8];
        for (int a = 0; a < 3; a++)
            for (int i = 0; i < count; i++) memcpy(&at[a][i], world[a][i] + half * KERNEL_HALF, sizeof at[a][i]);
        for (int i = 0; i < count; i++)
            for (int j = i + 1; j < count; j++) {
                kernel_half_mask after = (kernel_half_mask)(at[2][j] < at[2][i]);
                for (int a = 1; a >= 0; a--)
                    after =
                        (kernel_half_mask)(at[a][j] < at[a][i]) | ((kernel_half_mask)(at[a][j] == at[a][i]) & after);
                const kernel_half one = kernel_half_select(after, (kernel_half){0} + 1, (kernel_half){0});
                sum[half][i] += one;
                sum[half][j] += 1 - one;
            }
    }
    for (int i = 0; i < count; i++)
        for (int half = 0; half < 2; half++) kernel_half_put(&rank[i], half, sum[half][i]);
}

/* Rays of the tile from the first to the last of columns and rows, lane by lane. */
SIMD_INLINE void kernel_local_ray_box(const kernel_tile *tile, int32_t ends[4][SIMD_WIDTH], kernel_ray_box *out)
{
    const vf first = vf_set(0), last = vf_set(KERNEL_TILE - 1);
    for (int n = 0; n < 4; n++) {
        const int a = n / 2, end = n % 2;
        vi at;
        memcpy(&at, ends[n], sizeof at);
        at = vi_from_vf(vf_clamp(vf_from_vi(at), first, last));
        out->slope[a][end] = kernel_batch_of_tile(a ? tile->slope_y : tile->slope_x, at);
        out->origin[a][end] = kernel_batch_of_tile(a ? tile->origin_y : tile->origin_x, at);
    }
}

/* lists: places, the field and ranks by vertex. ends: kernel_local_pixels(). */
SIMD_INLINE void kernel_local_faces_of(const kernel_tile *tile, vf (*const lists)[8], int32_t ends[4][SIMD_WIDTH],
                                       int type, kernel_local_faces *out)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    kernel_ray_box box;
    kernel_local_ray_box(tile, ends, &box);
    vf_store(out->dents, vf_from_bits(kernel_curved_dents(lists, &box, type)));
    for (int n = 0; n < 4; n++)
        for (int i = 0; i < grid_type_vertices(type); i++) vf_store(out->at[n][i], lists[n][i]);
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        kernel_lanes_order unused;
        vm odd, falls[3];
        const vi word = shape->faces[face].count == 3 ? kernel_triangle_word(loop, lists[4], &unused, falls)
                                                      : kernel_curved_quad_word(loop, lists[4], &odd);
        vf_store(out->words[face], vf_from_bits(word));
    }
}

/* ---- rays ---- */

/* Vertices in the rays' planes: x, y, z and the field. */
typedef struct kernel_local_seen {
    vf at[4][8];
} kernel_local_seen;

SIMD_INLINE void kernel_local_see(const kernel_local_faces *f, const kernel_local_rays *rays, int type,
                                  kernel_local_seen *out)
{
    for (int i = 0; i < grid_type_vertices(type); i++) {
        const vf z = kernel_local_take(f->at[2][i], rays->lane);
        for (int a = 0; a < 2; a++)
            out->at[a][i] = (kernel_local_take(f->at[a][i], rays->lane) - rays->origin[a]) - rays->slope[a] * z;
        out->at[2][i] = z;
        out->at[3][i] = kernel_local_take(f->at[3][i], rays->lane);
    }
}

/* An edge function, by its sign bit, and where it is so small that its sign is not known. */
SIMD_INLINE vi kernel_local_edge(const kernel_local_seen *s, int a, int b, vf *least)
{
    const vf e = vf_diff_of_products(s->at[0][a], s->at[1][b], s->at[0][b], s->at[1][a]);
    *least = vf_min(vf_abs(e), *least);
    return vi_from_bits(e);
}

/* Rays that cross a quad once, by the sign bit, whatever it looks like, and those that may cross it twice. diagonal is
 * the edge function from the loop's vertex 0 to 2. */
SIMD_INLINE vi kernel_local_quad_sides(const kernel_local_seen *s, const signed char *loop, const vi around[4],
                                       vi diagonal, vm rays, vm *alone)
{
    const vm side[4] = {vm_sign(around[0]), vm_sign(around[1]), vm_sign(around[2]), vm_sign(around[3])};
    const vm outside = vm_and(rays, vm_sign((around[0] ^ around[2]) & (around[1] ^ around[3])));
    *alone = vm_or(*alone, kernel_curved_bends(s->at[0], s->at[1], loop, outside, side[0], side[3]));
    return vi_select(kernel_halves_once(side, vm_sign(diagonal)), vi_set(-1), vi_set(0));
}

/* The two faces that rays cross once each. Rays that may do anything else are for the cell alone. dents: bits of the
 * quads that may not look convex. */
SIMD_INLINE void kernel_local_find_faces(const kernel_local_seen *s, vi dents, vm rays, int type,
                                         kernel_curved_crossed *out)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    const bool all_convex = !vm_any(vm_and(rays, vm_sign(-dents)));
    kernel_curved_sides sides = {.least = vf_set(INFINITY)};
    vi faces = vi_set(0);
    vm alone = vm_none();
    for (int n = 0; n < shape->edge_count; n++)
        sides.side[n] = kernel_local_edge(s, shape->edges[n][0], shape->edges[n][1], &sides.least);
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        const int count = shape->faces[face].count;
        vi around[4], once;
        kernel_face_sides(shape, face, &sides, around);
        once = kernel_sides_agree(around, count);
        if (count == 4) {
            const vi diagonal = kernel_local_edge(s, loop[0], loop[2], &sides.least);
            if (__builtin_expect(!all_convex, 0) && vm_any(vm_sign(dents << (31 - face))))
                once = kernel_local_quad_sides(s, loop, around, diagonal, rays, &alone);
        }
        faces |= kernel_face_bit(once, face);
    }
    alone = vm_or(alone, vm_not(vf_lt(vf_set(KERNEL_EDGE_LEAST), sides.least)));
    kernel_curved_count(faces, rays, alone, out);
}

/* ---- corners ---- */

/* A vertex of each ray's cell: as the ray sees it, and its own coordinates from the middle. */
typedef struct kernel_local_corner {
    vf at[4], r[3];
} kernel_local_corner;

/* A number of each ray's own vertex of its cell, which has count. */
SIMD_INLINE vf kernel_local_pick(const vf of[8], int count, const vm bits[3])
{
    vf four[4], two[2];
    for (int i = 0; 2 * i < count; i++)
        four[i] = 2 * i + 1 < count ? vf_select(bits[0], of[2 * i + 1], of[2 * i]) : of[2 * i];
    for (int i = 0; 4 * i < count; i++)
        two[i] = 4 * i + 2 < count ? vf_select(bits[1], four[2 * i + 1], four[2 * i]) : four[2 * i];
    return count > 4 ? vf_select(bits[2], two[1], two[0]) : two[0];
}

SIMD_INLINE void kernel_local_corner_of(const kernel_local_seen *s, int type, vi vertex, kernel_local_corner *out)
{
    const int count = grid_type_vertices(type);
    const kernel_shape *shape = kernel_cell_shape(type);
    const vm bits[3] = {vm_sign(vertex << 31), vm_sign(vertex << 30), vm_sign(vertex << 29)};
    for (int n = 0; n < 4; n++) out->at[n] = kernel_local_pick(s->at[n], count, bits);
    if (type == GRID_HEX) {
        const vf low = vf_set(-0.5f), high = vf_set(0.5f);
        out->r[0] = vf_select(vm_xor(bits[0], bits[1]), high, low);
        out->r[1] = vf_select(bits[1], high, low);
        out->r[2] = vf_select(bits[2], high, low);
        return;
    }
    vf own[3];
    for (int a = 0; a < 3; a++) own[a] = kernel_curved_own(shape, count, a, vertex & 7);
    for (int a = 0; a < 2; a++) out->r[a] = type == GRID_WEDGE ? own[a] - 1.0f / 3 : own[a] - 0.5f * own[2];
    out->r[2] = own[2] - (type == GRID_WEDGE ? 0.5f : 0);
}

SIMD_INLINE vi kernel_local_word(const kernel_local_faces *f, int type, vi lane, vi face)
{
    const vf number = vf_from_vi(face);
    vi word = vi_set(0);
    for (int n = 0; n < kernel_cell_shape(type)->face_count; n++)
        word = vi_select(vf_eq(number, vf_set((float)n)), vi_from_bits(kernel_local_take(f->words[n], lane)), word);
    return word;
}

/* ---- places ---- */

SIMD_INLINE void kernel_local_quad_of(const kernel_local_seen *s, int type, vi word, kernel_quad *q,
                                      kernel_local_corner corners[4])
{
    for (int i = 0; i < 4; i++) {
        kernel_local_corner_of(s, type, word >> (4 * i), &corners[i]);
        q->x[i] = corners[i].at[0];
        q->y[i] = corners[i].at[1];
        q->z[i] = corners[i].at[2];
    }
    q->e01 = vf_diff_of_products(q->x[0], q->y[1], q->x[1], q->y[0]);
    q->e03 = vf_diff_of_products(q->x[0], q->y[3], q->x[3], q->y[0]);
    q->e12 = vf_diff_of_products(q->x[1], q->y[2], q->x[2], q->y[1]);
    q->e32 = vf_diff_of_products(q->x[3], q->y[2], q->x[2], q->y[3]);
}

SIMD_INLINE void kernel_local_quad_end(const kernel_local_corner corners[4], const kernel_quad_place *place,
                                       kernel_local_crossing *out)
{
    const vf f[4] = {corners[0].at[3], corners[1].at[3], corners[2].at[3], corners[3].at[3]};
    out->t = place->t;
    out->v = kernel_bilinear(f, place->s, place->r);
    for (int a = 0; a < 3; a++) {
        const vf base = corners[0].r[a], along = corners[1].r[a] - base, across = corners[3].r[a] - base;
        out->r[a] = (base + place->s * along) + place->r * across;
    }
}

SIMD_INLINE vf kernel_local_weigh(const vf e[3], vf inverse, vf i, vf j, vf k)
{
    return vf_muladd(e[0], k, vf_muladd(-e[2], j, e[1] * i)) * inverse;
}

/* kernel_triangle_crossing() of triangles whose corners are in the order. */
SIMD_INLINE void kernel_local_triangle_end(const kernel_local_seen *s, int type, vi word, kernel_local_crossing *out)
{
    kernel_local_corner c[3];
    for (int i = 0; i < 3; i++) kernel_local_corner_of(s, type, word >> (4 * i), &c[i]);
    const vf e[3] = {vf_diff_of_products(c[0].at[0], c[1].at[1], c[1].at[0], c[0].at[1]),
                     vf_diff_of_products(c[1].at[0], c[2].at[1], c[2].at[0], c[1].at[1]),
                     vf_diff_of_products(c[0].at[0], c[2].at[1], c[2].at[0], c[0].at[1])};
    const vf inverse = 1.0f / kernel_weight(e[0], e[1], e[2]);
    out->t = kernel_local_weigh(e, inverse, c[0].at[2], c[1].at[2], c[2].at[2]);
    out->v = kernel_local_weigh(e, inverse, c[0].at[3], c[1].at[3], c[2].at[3]);
    for (int a = 0; a < 3; a++) out->r[a] = kernel_local_weigh(e, inverse, c[0].r[a], c[1].r[a], c[2].r[a]);
}

SIMD_INLINE void kernel_local_crossing_select(vm m, const kernel_local_crossing *a, const kernel_local_crossing *b,
                                              kernel_local_crossing *out)
{
    out->t = vf_select(m, a->t, b->t);
    out->v = vf_select(m, a->v, b->v);
    for (int i = 0; i < 3; i++) out->r[i] = vf_select(m, a->r[i], b->r[i]);
}

/* Where rays cross quads, and whatever elsewhere. */
SIMD_INLINE void kernel_local_cross_quads(const kernel_local_seen *s, int type, const vi words[2], const vm on_quad[2],
                                          kernel_local_crossing ends[2])
{
    const int count = type == GRID_PYRAMID ? 1 : 2;
    kernel_quad quads[2];
    kernel_local_corner corners[2][4];
    kernel_quad_place places[2];
    for (int n = 0; n < count; n++) kernel_local_quad_of(s, type, words[n], &quads[n], corners[n]);
    kernel_quads_cross(quads, count, on_quad, places);
    for (int n = 0; n < count; n++) kernel_local_quad_end(corners[n], &places[n], &ends[n]);
}

/* Where rays that cross two faces come in and go out. */
SIMD_INLINE void kernel_local_cross(const kernel_local_faces *f, const kernel_local_seen *s, vi lane,
                                    const kernel_curved_crossed *crossed, int type, kernel_local_crossing out[2])
{
    const vi face[2] = {crossed->first, crossed->last};
    vi words[2];
    vm on_quad[2];
    kernel_local_crossing ends[2];
    for (int n = 0; n < 2; n++) {
        words[n] = kernel_local_word(f, type, lane, face[n]);
        on_quad[n] = vm_and(crossed->two, kernel_curved_on_quad(type, n, face[n]));
    }
    if (type != GRID_HEX) memset(ends, 0, sizeof ends);
    if (type == GRID_HEX || vm_any(vm_or(on_quad[0], on_quad[1])))
        kernel_local_cross_quads(s, type, words, on_quad, ends);
    for (int n = 0; n < 2 && type != GRID_HEX; n++) {
        const vm on_triangle = vm_andnot(crossed->two, on_quad[n]);
        kernel_local_crossing end;
        if (!vm_any(on_triangle)) continue;
        kernel_local_triangle_end(s, type, words[n], &end);
        kernel_local_crossing_select(on_triangle, &end, &ends[n], &ends[n]);
    }
    const vm swap = vf_lt(ends[1].t, ends[0].t);
    kernel_local_crossing_select(swap, &ends[1], &ends[0], &out[0]);
    kernel_local_crossing_select(swap, &ends[0], &ends[1], &out[1]);
}

#endif
