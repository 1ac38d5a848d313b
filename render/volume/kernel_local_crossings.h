/* Where rays cross the faces of hexes, a ray and its cell a lane: the faces by the signs of projected edges, the places
 * by kernel_quad.h, both as kernel_poly_intervals() has them for a packet in one cell, and so with the same bits. */
#ifndef RENDER_KERNEL_LOCAL_CROSSINGS_H
#define RENDER_KERNEL_LOCAL_CROSSINGS_H

#include <math.h>
#include <string.h>

#include "kernel_crossings.h"
#include "kernel_local.h"
#include "kernel_placed_hexes.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_wide.h"
#include "simd.h"

/* Hexes in lanes: places and the field by vertex, and kernel_quad_corners() of each face, four bits a corner. */
typedef struct kernel_local_faces {
    float at[4][8][SIMD_WIDTH];
    float words[KERNEL_HEX_FACES][SIMD_WIDTH];
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

SIMD_INLINE void kernel_local_faces_of(vf (*const lists)[8], kernel_local_faces *out)
{
    for (int n = 0; n < 4; n++)
        for (int i = 0; i < 8; i++) vf_store(out->at[n][i], lists[n][i]);
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        vm odd;
        vf_store(out->words[face],
                 vf_from_bits(kernel_hex_quad_word(kernel_shapes[0].faces[face].vertices, lists[4], &odd)));
    }
}

/* ---- rays ---- */

/* Vertices in the rays' planes. */
typedef struct kernel_local_seen {
    vf at[4][8];
} kernel_local_seen;

SIMD_INLINE void kernel_local_see(const kernel_local_faces *f, const kernel_local_rays *rays, kernel_local_seen *out)
{
    for (int i = 0; i < 8; i++) {
        const vf z = kernel_local_take(f->at[2][i], rays->lane);
        for (int a = 0; a < 2; a++)
            out->at[a][i] = (kernel_local_take(f->at[a][i], rays->lane) - rays->origin[a]) - rays->slope[a] * z;
        out->at[2][i] = z;
        out->at[3][i] = kernel_local_take(f->at[3][i], rays->lane);
    }
}

/* The sign of an edge function, and where it is so small that its sign is not known. */
SIMD_INLINE vm kernel_local_edge(const kernel_local_seen *s, int a, int b, vf *least)
{
    const vf e = vf_diff_of_products(s->at[0][a], s->at[1][b], s->at[0][b], s->at[1][a]);
    *least = vf_min(vf_abs(e), *least);
    return vm_sign(vi_from_bits(e));
}

/* The two faces that rays cross once each. Rays that may do anything else are for the cell alone. */
SIMD_INLINE void kernel_local_find_faces(const kernel_local_seen *s, vm rays, kernel_hex_crossed *out)
{
    kernel_hex_count count = {vm_none(), vm_none(), vm_none(), vf_set(0), vf_set(0)};
    vm negative[KERNEL_HEX_EDGES], alone = vm_none();
    vf least = vf_set(INFINITY);
    for (int n = 0; n < KERNEL_HEX_EDGES; n++)
        negative[n] = kernel_local_edge(s, kernel_shapes[0].edges[n][0], kernel_shapes[0].edges[n][1], &least);
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        const signed char *loop = kernel_shapes[0].faces[face].vertices;
        const vm side = kernel_local_edge(s, loop[0], loop[2], &least);
        vm around[4];
        for (int i = 0; i < 4; i++) {
            const signed char *edge = kernel_shapes[0].faces[face].sides[i];
            around[i] = edge[1] ? vm_not(negative[(int)edge[0]]) : negative[(int)edge[0]];
        }
        const vm outside = vm_and(rays, vm_and(vm_xor(around[0], around[2]), vm_xor(around[1], around[3])));
        alone = vm_or(alone, kernel_hex_bends(s->at[0], s->at[1], loop, outside, around[0], around[3]));
        kernel_hex_count_face(&count, face, vm_and(rays, kernel_halves_once(around, side)));
    }
    alone = vm_or(alone, vm_not(vf_lt(vf_set(KERNEL_EDGE_LEAST), least)));
    kernel_hex_count_end(&count, rays, alone, out);
}

/* A number of each ray's own vertex. */
SIMD_INLINE vf kernel_local_pick(const vf of[8], const vm bits[3])
{
    vf four[4], two[2];
    for (int i = 0; i < 4; i++) four[i] = vf_select(bits[0], of[2 * i + 1], of[2 * i]);
    for (int i = 0; i < 2; i++) two[i] = vf_select(bits[1], four[2 * i + 1], four[2 * i]);
    return vf_select(bits[2], two[1], two[0]);
}

/* A face's corners as rays see them, the field there, and the corners' own coordinates, 0 or 1. */
typedef struct kernel_local_quad {
    kernel_quad quad;
    vf f[4], r[4][3];
} kernel_local_quad;

SIMD_INLINE void kernel_local_quad_of(const kernel_local_faces *f, const kernel_local_seen *s, vi lane, vi face,
                                      kernel_local_quad *out)
{
    kernel_quad *q = &out->quad;
    const vf zero = vf_set(0), one = vf_set(1);
    vi word = vi_set(0);
    for (int n = 0; n < KERNEL_HEX_FACES; n++) {
        const vm own = vf_eq(vf_from_vi(face), vf_set((float)n));
        word = vi_select(own, vi_from_bits(kernel_local_take(f->words[n], lane)), word);
    }
    for (int i = 0; i < 4; i++) {
        const vi corner = word >> (4 * i);
        const vm bits[3] = {vm_sign(corner << 31), vm_sign(corner << 30), vm_sign(corner << 29)};
        q->x[i] = kernel_local_pick(s->at[0], bits);
        q->y[i] = kernel_local_pick(s->at[1], bits);
        q->z[i] = kernel_local_pick(s->at[2], bits);
        out->f[i] = kernel_local_pick(s->at[3], bits);
        out->r[i][0] = vf_select(vm_xor(bits[0], bits[1]), one, zero);
        out->r[i][1] = vf_select(bits[1], one, zero);
        out->r[i][2] = vf_select(bits[2], one, zero);
    }
    q->e01 = vf_diff_of_products(q->x[0], q->y[1], q->x[1], q->y[0]);
    q->e03 = vf_diff_of_products(q->x[0], q->y[3], q->x[3], q->y[0]);
    q->e12 = vf_diff_of_products(q->x[1], q->y[2], q->x[2], q->y[1]);
    q->e32 = vf_diff_of_products(q->x[3], q->y[2], q->x[2], q->y[3]);
}

SIMD_INLINE void kernel_local_crossing_select(vm m, const kernel_local_crossing *a, const kernel_local_crossing *b,
                                              kernel_local_crossing *out)
{
    out->t = vf_select(m, a->t, b->t);
    out->v = vf_select(m, a->v, b->v);
    for (int i = 0; i < 3; i++) out->r[i] = vf_select(m, a->r[i], b->r[i]);
}

/* Where rays come in and go out. */
SIMD_INLINE void kernel_local_cross(const kernel_local_faces *f, const kernel_local_seen *s, vi lane,
                                    const kernel_hex_crossed *crossed, kernel_local_crossing out[2])
{
    kernel_local_quad own[2];
    kernel_quad_place places[2];
    kernel_local_crossing ends[2];
    kernel_local_quad_of(f, s, lane, crossed->first, &own[0]);
    kernel_local_quad_of(f, s, lane, crossed->last, &own[1]);
    const kernel_quad quads[2] = {own[0].quad, own[1].quad};
    kernel_quads_meet(quads, 2, crossed->two, places);
    for (int n = 0; n < 2; n++) {
        ends[n].t = places[n].t;
        ends[n].v = kernel_bilinear(own[n].f, places[n].s, places[n].r);
        for (int a = 0; a < 3; a++) {
            const vf base = own[n].r[0][a], along = own[n].r[1][a] - base, across = own[n].r[3][a] - base;
            ends[n].r[a] = ((base - 0.5f) + places[n].s * along) + places[n].r * across;
        }
    }
    const vm swap = vf_lt(ends[1].t, ends[0].t);
    kernel_local_crossing_select(swap, &ends[1], &ends[0], &out[0]);
    kernel_local_crossing_select(swap, &ends[0], &ends[1], &out[1]);
}

#endif
