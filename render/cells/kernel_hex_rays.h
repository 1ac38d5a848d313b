/* Rays of several hexes side by side (kernel_hexes.h): which two faces of its cell a ray crosses, and where. A lane
 * takes its cell's numbers out of the batch's vectors. */
#ifndef RENDER_KERNEL_HEX_RAYS_H
#define RENDER_KERNEL_HEX_RAYS_H

#include <math.h>
#include <string.h>

#include "kernel_packet.h"
#include "kernel_placed_hexes.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

/* Rays between two faces of their cells. */
typedef struct kernel_hex_ends {
    float t[2][KERNEL_HEX_ROOM], v[2][KERNEL_HEX_ROOM], r[2][3][KERNEL_HEX_ROOM];
} kernel_hex_ends;

typedef struct kernel_hex_packet {
    vm active;
    vi lane, at;
    vf far, u, v;
    kernel_rays rays;
} kernel_hex_packet;

SIMD_INLINE void kernel_hex_packet_begin(kernel_hex_packet *p, const kernel_tile_trace *t, const kernel_hex_rays *rays,
                                         int first)
{
    const kernel_tile *tile = &t->tile;
    const bool flat = t->frame->job->camera.is_orthographic;
    const int left = rays->count - first;
    const vi pixel = kernel_bytes(rays->pixel + first), column = pixel & (KERNEL_TILE - 1), row = pixel >> 4;
    p->active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    p->lane = kernel_bytes(rays->lane + first) & (SIMD_WIDTH - 1);
    p->at = kernel_batch_at(column & (KERNEL_TILE - 1), row & (KERNEL_TILE - 1));
    p->far = kernel_batch_far(t, p->at);
    p->rays = (kernel_rays){kernel_batch_of_tile(tile->origin_x, column), kernel_batch_of_tile(tile->origin_y, row),
                            kernel_batch_of_tile(tile->slope_x, column), kernel_batch_of_tile(tile->slope_y, row)};
    p->u = flat ? p->rays.origin_x : p->rays.slope_x;
    p->v = flat ? p->rays.origin_y : p->rays.slope_y;
}

SIMD_INLINE vf kernel_hex_take(const float *of, vi lane)
{
    return vf_permute(vf_load(of), lane);
}

SIMD_INLINE void kernel_hex_ray_add(kernel_hex_rays *to, const kernel_hex_rays *from, int i)
{
    to->pixel[to->count] = from->pixel[i];
    to->lane[to->count] = from->lane[i];
    to->count++;
}

SIMD_INLINE void kernel_hex_faces(const kernel_placed_hexes *h, const kernel_hex_packet *p, kernel_hex_crossed *out)
{
    vm negative[KERNEL_HEX_LINES], one = vm_none(), two = one, bends = one;
    vf least = vf_set(INFINITY), x[8], y[8];
    for (int n = 0; n < KERNEL_HEX_LINES; n++) {
        const vf e = vf_muladd(kernel_hex_take(h->cv[n], p->lane), p->v,
                               vf_muladd(kernel_hex_take(h->cu[n], p->lane), p->u, kernel_hex_take(h->c[n], p->lane)));
        least = vf_min(vf_abs(e), least);
        negative[n] = vm_sign(vi_from_bits(e));
    }
    out->alone = vm_not(vf_lt(kernel_hex_take(h->doubt, p->lane), least));
    for (int i = 0; i < 8; i++) {
        const vf z = kernel_hex_take(h->at[2][i], p->lane);
        x[i] = (kernel_hex_take(h->at[0][i], p->lane) - p->rays.origin_x) - p->rays.slope_x * z;
        y[i] = (kernel_hex_take(h->at[1][i], p->lane) - p->rays.origin_y) - p->rays.slope_y * z;
    }
    const vi turned = vi_from_bits(kernel_hex_take((const float *)(const void *)h->turned, p->lane));
    vf first = vf_set(0), last = first;
    for (int face = 0; face < KERNEL_HEX_FACES; face++) {
        vm around[4];
        for (int i = 0; i < 4; i++) {
            const signed char *edge = kernel_hex_around[face][i];
            around[i] = edge[1] ? vm_not(negative[edge[0]]) : negative[edge[0]];
        }
        /* From the diagonal's begin. */
        const vm turn = vm_sign(turned << (31 - face)), side = negative[KERNEL_HEX_EDGES + face];
        vm from[4];
        for (int i = 0; i < 4; i++) from[i] = vm_or(vm_and(turn, around[(i + 1) & 3]), vm_andnot(around[i], turn));
        const vm half0 = vm_andnot(vm_xor(from[1], side), vm_xor(from[0], from[1]));
        const vm half1 = vm_not(vm_or(vm_xor(side, from[2]), vm_xor(from[2], from[3])));
        const vm once = vm_and(p->active, vm_xor(half0, half1));
        const vm outside = vm_and(p->active, vm_and(vm_xor(around[0], around[2]), vm_xor(around[1], around[3])));
        bends =
            vm_or(bends, kernel_hex_bends(x, y, kernel_shapes[0].faces[face].vertices, outside, around[0], around[3]));
        out->alone = vm_or(out->alone, vm_and(two, once));
        two = vm_or(two, vm_and(one, once));
        first = vf_select(vm_andnot(once, one), vf_set((float)face), first);
        last = vf_select(once, vf_set((float)face), last);
        one = vm_or(one, once);
    }
    out->alone = vm_and(p->active, vm_or(out->alone, bends));
    out->two = vm_andnot(two, out->alone);
    out->first = vi_from_vf(first);
    out->last = vi_from_vf(last);
}

/* The place where rays cross a face, as kernel_quad_crossings() finds it. */
typedef struct kernel_hex_place {
    vf t, v, r[3];
} kernel_hex_place;

/* A quad's corners as rays see them, each ray's of its own face: as vertices of the cell, and their values. */
typedef struct kernel_hex_quad {
    vi corner[4];
    vf f[4];
} kernel_hex_quad;

/* A number of each ray's own vertex of its cell. Of 16 lanes, selections among all vertices' are faster than a gather,
 * of 8 they are slower. */
SIMD_INLINE vf kernel_hex_pick(const float of[8][SIMD_WIDTH], vi lane, vi corner)
{
    if (SIMD_WIDTH < 16) return vf_gather(of[0], corner * SIMD_WIDTH + lane);
    vf four[4], two[2];
    const vm odd = vm_sign(corner << 31), second = vm_sign(corner << 30), upper = vm_sign(corner << 29);
    for (int i = 0; i < 4; i++)
        four[i] = vf_select(odd, kernel_hex_take(of[2 * i + 1], lane), kernel_hex_take(of[2 * i], lane));
    for (int i = 0; i < 2; i++) two[i] = vf_select(second, four[2 * i + 1], four[2 * i]);
    return vf_select(upper, two[1], two[0]);
}

SIMD_INLINE void kernel_hex_quad_take(const kernel_placed_hexes *h, const kernel_hex_packet *p, vi face, kernel_quad *q,
                                      kernel_hex_quad *out)
{
    const float *quads = (const float *)(const void *)h->quads;
    const vi word = vi_from_bits(vf_gather(quads, face * SIMD_WIDTH + p->lane));
    for (int i = 0; i < 4; i++) {
        const vi corner = word >> (4 * i) & 7;
        out->corner[i] = corner;
        q->z[i] = kernel_hex_pick(h->at[2], p->lane, corner);
        q->x[i] = (kernel_hex_pick(h->at[0], p->lane, corner) - p->rays.origin_x) - p->rays.slope_x * q->z[i];
        q->y[i] = (kernel_hex_pick(h->at[1], p->lane, corner) - p->rays.origin_y) - p->rays.slope_y * q->z[i];
        out->f[i] = kernel_hex_pick(h->at[3], p->lane, corner);
    }
    /* Not in doubt, so these have the lines' signs. */
    q->e01 = vf_diff_of_products(q->x[0], q->y[1], q->x[1], q->y[0]);
    q->e03 = vf_diff_of_products(q->x[0], q->y[3], q->x[3], q->y[0]);
    q->e12 = vf_diff_of_products(q->x[1], q->y[2], q->x[2], q->y[1]);
    q->e32 = vf_diff_of_products(q->x[3], q->y[2], q->x[2], q->y[3]);
}

SIMD_INLINE void kernel_hex_cross(const kernel_placed_hexes *h, const kernel_hex_packet *p, vi faces,
                                  kernel_hex_place out[2])
{
    kernel_quad quads[2];
    kernel_hex_quad own[2];
    kernel_quad_place places[2];
    for (int n = 0; n < 2; n++) kernel_hex_quad_take(h, p, faces >> (3 * n) & 7, &quads[n], &own[n]);
    kernel_quads_meet(quads, 2, p->active, places);
    for (int n = 0; n < 2; n++) {
        out[n].t = places[n].t;
        out[n].v = kernel_bilinear(own[n].f, places[n].s, places[n].r);
        for (int a = 0; a < 3; a++) {
            vf at[4];
            for (int i = 0; i < 4; i++) {
                const vi bits = own[n].corner[i] ^ (own[n].corner[i] >> 1 & 1);
                at[i] = vf_from_vi(bits >> a & 1);
            }
            out[n].r[a] = (at[0] + places[n].s * (at[1] - at[0])) + places[n].r * (at[3] - at[0]);
        }
    }
}

SIMD_INLINE void kernel_hex_place_select(vm m, const kernel_hex_place *a, const kernel_hex_place *b,
                                         kernel_hex_place *out)
{
    out->t = vf_select(m, a->t, b->t);
    out->v = vf_select(m, a->v, b->v);
    for (int i = 0; i < 3; i++) out->r[i] = vf_select(m, a->r[i], b->r[i]);
}

SIMD_INLINE void kernel_hex_ends_add(const kernel_hex_rays *met, int n, const kernel_hex_place ends[2], unsigned bits,
                                     kernel_hex_rays *rays, kernel_hex_ends *out)
{
    if (!bits) return;
    float lanes[2][5][SIMD_WIDTH];
    for (int e = 0; e < 2; e++) {
        vf_store(lanes[e][0], ends[e].t);
        vf_store(lanes[e][1], ends[e].v);
        for (int a = 0; a < 3; a++) vf_store(lanes[e][2 + a], ends[e].r[a]);
    }
    for (; bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits), to = rays->count;
        for (int e = 0; e < 2; e++) {
            out->t[e][to] = lanes[e][0][i];
            out->v[e][to] = lanes[e][1][i];
            for (int a = 0; a < 3; a++) out->r[e][a][to] = lanes[e][2 + a][i];
        }
        kernel_hex_ray_add(rays, met, n + i);
    }
}

#endif
