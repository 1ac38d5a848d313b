/* Samples of small tets, a pixel and its tet a lane: packets would be asked for rays most of which lie beside the tet.
 * Tets are placed many at once in any case (kernel_placed.h); the pixels of their boxes are put side by side, and each
 * has its crossings (kernel_tet_rays.h) and then its samples, by kernel_samples.h's operations, to the same bits. */
#ifndef RENDER_KERNEL_TET_SAMPLES_H
#define RENDER_KERNEL_TET_SAMPLES_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_local_queue.h"
#include "kernel_local_samples.h"
#include "kernel_packet.h"
#include "kernel_placed.h"
#include "kernel_samples.h"
#include "kernel_tet_rays.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_TET_PIXELS = 12 /* of a tet's box: one with more is traced block by block */ };

/* As kernel_local_fits(). */
SIMD_INLINE bool kernel_tet_samples_fit(const kernel_frame *f)
{
    return !f->surface_count && !f->job->separate_samples;
}

/* A sample that has an owner before this one. */
static __attribute__((noinline, cold)) void kernel_tet_sample_apart(kernel_tile_trace *t, kernel_local_batch *b, int at,
                                                                    float depth, float value)
{
    const int packet = at / SIMD_WIDTH;
    const kernel_interval cell = {0};
    kernel_volume_state state = {b->lanes.volume, &b->packets[packet].samples};
    kernel_emit_sample(&t->packets[packet], &state, &cell, vm_from_bits(1u << at % SIMD_WIDTH), vf_set(depth),
                       vf_set(value));
}

/* The values of samples of the window, one a lane, go where the window has them. */
SIMD_INLINE void kernel_tet_samples_put(kernel_tile_trace *t, kernel_local_batch *b, vm own, vi places, vi numbers,
                                        vf depth, vf value)
{
    int32_t at[SIMD_WIDTH], number[SIMD_WIDTH];
    float values[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    memcpy(number, &numbers, sizeof number);
    vf_store(values, value);
    for (unsigned lanes = vm_bits(own); lanes; lanes &= lanes - 1) {
        const int i = __builtin_ctz(lanes);
        float *to = (float *)(void *)&b->packets[at[i] / SIMD_WIDTH].samples.value[b->lanes.volume][number[i]];
        to += at[i] % SIMD_WIDTH;
        if (__builtin_expect(*to == *to, 0))
            kernel_tet_sample_apart(t, b, at[i], depth[i], values[i]);
        else
            *to = values[i];
    }
}

/* kernel_fill() of the rays. */
SIMD_INLINE void kernel_tet_samples_fill(kernel_tile_trace *t, kernel_local_batch *b, const kernel_interval *i, vi at)
{
    vf base, step;
    vf_gather_pair(b->steps, 2 * at, &base, &step);
    const vf inverse = 1.0f / step, length = i->t_out - i->t_in;
    const vf slope = vf_select(vf_lt(vf_set(0), length), (i->v_out - i->v_in) / length, vf_set(0));
    const float zero = (float)b->first;
    vf number = vf_max(-vf_floor(b->pad - ((i->t_in - base) * inverse - zero)), vf_set(0));
    const vf last = vf_min(vf_floor(((i->t_out - base) * inverse - zero) + b->pad), vf_set((float)(b->count - 1)));
    for (vm more = vm_and(i->mask, vf_le(number, last)); vm_any(more); more = vm_and(more, vf_le(number, last))) {
        const vi whole = vi_from_vf(number);
        const vf depth = base + step * vf_from_vi(whole + b->first);
        const vm own = vm_and(more, vm_andnot(vf_lt(depth, i->t_out), vf_lt(depth, i->t_in)));
        const vf value = i->v_in + slope * (depth - i->t_in);
        if (vm_any(own)) kernel_tet_samples_put(t, b, own, at, whole, depth, value);
        number += 1.0f;
    }
}

/* The samples of the rays that are listed. */
static __attribute__((noinline)) void kernel_tet_samples_cast(kernel_tile_trace *t, kernel_local_batch *b)
{
    const kernel_placed *tets = &t->thread->tile_cells->placed;
    kernel_hex_rays_close(&b->rays);
    for (int n = 0; n < b->rays.count; n += SIMD_WIDTH) {
        const int left = b->rays.count - n;
        kernel_tet_rays r;
        kernel_interval i;
        kernel_tet_rays_of(&r, t->frame, &t->tile, kernel_bytes(b->rays.pixel + n), kernel_bytes(b->rays.lane + n));
        const vi at = kernel_batch_at(r.column, r.row);
        r.active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
        r.active = vm_and(r.active, vf_lt(vf_set(-INFINITY), vf_gather(b->far, at)));
        kernel_tet_rays_interval(tets, &t->tile, &r, &i);
        if (vm_any(i.mask)) kernel_tet_samples_fill(t, b, &i, at);
    }
    b->rays.count = 0;
}

/* Takes the samples of those of the tile's pending tets in the given lanes whose boxes are small, and leaves out those
 * that lie between pixels. Returns the others. */
static unsigned kernel_tet_samples(kernel_tile_trace *t, kernel_local_batch *b, unsigned lanes)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    vf places[3][8];
    unsigned others = 0;
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 4; i++) places[a][i] = cells->placed.at[a][i];
    kernel_local_pixels(t, 4, (const vf(*)[8])places, b->lanes.ends);
    b->rays.count = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = cells->wait_box[n];
        if (!kernel_local_cut(b->lanes.ends, n, &box)) continue;
        const int columns = (int)(box >> 4 & 15) - (int)(box & 15) + 1;
        const int rows = (int)(box >> 12) - (int)(box >> 8 & 15) + 1;
        if (columns * rows > KERNEL_TET_PIXELS)
            others |= 1u << n;
        else
            kernel_hex_rays_of(&b->rays, box, n);
    }
    kernel_tet_samples_cast(t, b);
    return others;
}

#endif
