/* Computes samples of volumes in hexes, wedges and pyramids, one sample per lane, each lane with its own ray and cell.
 * A cell of a few pixels would leave most lanes of a packet idle, and each sample's value requires Newton's method. So
 * the samples of several cells are listed one after the other and processed in vectors. The stages, with their input,
 * question and method, are:
 *     cells of one type       where are they, and what are their maps?     kernel_local.h
 *     pixels of their boxes   which samples may be in the cell?           by planes around it
 *     samples                 where in the cell, and what is the field?   Newton's method
 * A sample belongs to the cell that contains it by the cell's reference coordinates. At a face one of these coordinates
 * is at its limit, so that the test by the ray's crossings of faces gives the same result up to rounding. For samples
 * near a face the crossings decide (kernel_crossings.h), because they are bit-identical in both cells of the face. In
 * cells with strongly nonlinear maps the crossings decide for all samples. */
#ifndef RENDER_KERNEL_LOCAL_SAMPLES_H
#define RENDER_KERNEL_LOCAL_SAMPLES_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_crossings.h"
#include "kernel_curved_rays.h"
#include "kernel_local.h"
#include "kernel_local_queue.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_transformed_tets.h"
#include "kernel_samples.h"
#include "kernel_shapes.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

enum {
    /* maximum number of listed samples */
    KERNEL_LOCAL_SAMPLES = 1024,
    /* Layout of the 32-bit word that describes a listed sample: its pixel in the tile (16 * row + column) begins at bit
     * 0, the lane of its cell at bit KERNEL_LOCAL_LANE, and its number in the window at bit KERNEL_LOCAL_NUMBER. */
    KERNEL_LOCAL_LANE = 8,
    KERNEL_LOCAL_NUMBER = 16
};

/* The samples of a tile's rays in a window. */
typedef struct kernel_tile_volume {
    kernel_samples packets[KERNEL_TILE_PACKETS];
    int first, count; /* number of the window's first sample on its ray; number of samples in the window */
    float pad;        /* error bound of sample numbers, as in kernel_samples */
    /* steps: for each ray, by packet and lane, the depth of sample number 0 and the distance between samples in depth,
     * side by side; far: the depth at which the ray ends (its nearest opaque hit), -inf for inactive rays */
    float steps[2 * KERNEL_TILE_PIXELS], far[KERNEL_TILE_PIXELS];
    /* listed samples, whose values are still to be computed. t: depth of each; bits: the word that describes it
     * (KERNEL_LOCAL_LANE, KERNEL_LOCAL_NUMBER) */
    int sample_count;
    float t[KERNEL_LOCAL_SAMPLES + SIMD_WIDTH], bits[KERNEL_LOCAL_SAMPLES + SIMD_WIDTH];
    /* The members from here on choose the depth of windows (kernel_tile_depth.h). A ray is dark if it has no light left
     * (KERNEL_DARK); depths are in units of t. */
    /* Depth at which the previous tile became dark, relative to that tile's `begin`; +inf if it did not. A tile becomes
     * dark when at least half of its rays that have lost light are dark. */
    float dark;
    /* The following members describe the current tile. */
    float own_dark; /* depth, relative to `begin`, at which this tile became dark; +inf until it is known */
    /* depth of the first cell if it is known, else the least depth of samples on rays that have lost light; +inf before
     * that */
    float begin;
    bool has_met; /* set if some ray of the tile has lost light */
    /* expected further depth until the rays are dark, computed from the light left after the last window */
    float expected;
    float before; /* light of the brightest ray at the begin of the last window */
    /* Collected from the packets after a window (kernel_depth_add_packet()): number of rays that have lost light, and
     * number of those among them that are dark. */
    int lit_count, dark_count;
    /* Collected in the same way. brightest: largest light that is left on a ray that has lost light but is not dark;
     * first_lit: least depth of samples on rays that have lost light; last_dark: greatest depth at which a ray became
     * dark. */
    float brightest, first_lit, last_dark;
} kernel_tile_volume;

/* ---- samples ---- */

/* Finds the samples of the window that may lie between the depths `near` and `far` on each ray. *number, *last: indices
 * in the window of the first and the last of them; *last is less than *number if there are none. *number is limited to
 * the window's end, so that it does not overflow an int. base, step: depth of sample number 0, and distance between
 * samples in depth. */
SIMD_INLINE void kernel_local_find_sample_range(const kernel_tile_volume *v, vf base, vf step, vf near, vf far,
                                                vf *number, vf *last)
{
    const vf inverse = 1.0f / step, first = vf_set((float)v->first);
    const vf before = vf_floor(v->pad - ((near - base) * inverse - first));
    *number = vf_min(vf_max(-before, vf_set(0)), vf_set((float)v->count));
    *last = vf_min(vf_floor(((far - base) * inverse - first) + v->pad), vf_set((float)(v->count - 1)));
}

/* Sets the values of samples, one per lane in `own`, unless another cell has set them. places: position of each ray
 * among the tile's packets; numbers: the samples' indices in the window. Returns the lanes whose samples already have
 * the value of another cell. */
SIMD_INLINE unsigned kernel_local_store_samples(kernel_tile_volume *v, vm own, vi places, vi numbers, vf value)
{
    int32_t at[SIMD_WIDTH], number[SIMD_WIDTH];
    float values[SIMD_WIDTH];
    unsigned taken = 0;
    memcpy(at, &places, sizeof at);
    memcpy(number, &numbers, sizeof number);
    vf_store(values, value);
    for (unsigned lanes = vm_bits(own); lanes; lanes &= lanes - 1) {
        const int i = __builtin_ctz(lanes);
        kernel_samples *s = &v->packets[at[i] / SIMD_WIDTH];
        float *to = (float *)(void *)&s->value[s->volume][number[i]] + at[i] % SIMD_WIDTH;
        const bool is_taken = *to == *to;
        taken |= (unsigned)is_taken << i;
        if (!is_taken) *to = values[i];
    }
    return taken;
}

/* Stores the ends of the rays' intervals in their cells (kernel_samples.t_in and t_out) for the samples in the given
 * lanes. places: position of each ray among the tile's packets; numbers: the samples' indices in the window. */
static __attribute__((noinline, cold)) void
kernel_local_store_cell_interval_ends(kernel_tile_volume *v, unsigned lanes, vi places, vi numbers, vf t_in, vf t_out)
{
    int32_t at[SIMD_WIDTH], number[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    memcpy(number, &numbers, sizeof number);
    for (; lanes; lanes &= lanes - 1) {
        const int i = __builtin_ctz(lanes);
        kernel_samples *s = &v->packets[at[i] / SIMD_WIDTH];
        s->t_in[number[i]][at[i] % SIMD_WIDTH] = t_in[i];
        s->t_out[number[i]][at[i] % SIMD_WIDTH] = t_out[i];
    }
}

/* Sets the values of those of the window's samples begin .. end - 1 that lie in the tile's current cell
 * (kernel_tile_cells.cell), on the given rays of a packet. */
static __attribute__((noinline)) void kernel_sample_current_cell(kernel_tile_trace *t, int packet, vm rays, int begin,
                                                                 int end)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_packet *p = &t->packets[packet];
    kernel_samples *s = &t->thread->tile_volume->packets[packet];
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const int intervals = kernel_curved_intervals(p, &cells->cell, vm_and(p->active, rays), list);
    for (int k = 0; k < intervals; k++) {
        int first, last;
        kernel_find_samples_in_interval(p, s, &list[k], &first, &last);
        kernel_fill_sample_range(p, s, cells->cell_map, &list[k], &list[k], first > begin ? first : begin,
                                 last < end ? last : end);
    }
}

/* Computes the values of the samples n to n + SIMD_WIDTH - 1 of the list, as far as they lie inside their cells. */
SIMD_INLINE void kernel_local_compute_sample_vector(kernel_tile_trace *t, kernel_tile_volume *b, int type, int n)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    const int left = b->sample_count - n;
    const vm active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    const vi bits = vi_from_bits(vf_load(b->bits + n));
    const vf depth = vf_load(b->t + n);
    kernel_lane_rays rays;
    kernel_local_points points;
    int32_t at[SIMD_WIDTH], number[SIMD_WIDTH], lane[SIMD_WIDTH];
    kernel_lane_rays_through_pixels(&rays, &t->tile, bits & (KERNEL_TILE_PIXELS - 1), bits >> KERNEL_LOCAL_LANE);
    const vf place[3] = {rays.rays.origin_x + rays.rays.slope_x * depth, rays.rays.origin_y + rays.rays.slope_y * depth,
                         depth};
    const vm known = kernel_local_invert_maps(type, &cells->maps, rays.lane, place, &points);
    const vf inside = kernel_local_border_distance(type, points.r),
             error_bound = kernel_gather_lane(cells->maps.error_bound, rays.lane);
    const vm own = vm_and(vm_and(active, known), vf_lt(error_bound, inside));
    const vm doubt = vm_andnot(vm_andnot(active, own), vm_and(known, vf_lt(inside, -error_bound)));
    const vi numbers = bits >> KERNEL_LOCAL_NUMBER;
    const vf value = kernel_local_evaluate_field(type, &cells->maps, rays.lane, &points);
    unsigned undecided = vm_bits(doubt) | kernel_local_store_samples(b, own, rays.at, numbers, value);
    memcpy(at, &rays.at, sizeof at);
    memcpy(number, &numbers, sizeof number);
    memcpy(lane, &rays.lane, sizeof lane);
    for (; __builtin_expect(undecided, 0); undecided &= undecided - 1) {
        const int i = __builtin_ctz(undecided);
        /* near the cell's border, the ray's crossings of faces decide whether the sample lies in the cell */
        if (kernel_tile_set_current_cell(t, lane[i]))
            kernel_sample_current_cell(t, at[i] / SIMD_WIDTH, vm_from_bits(1u << at[i] % SIMD_WIDTH), number[i],
                                       number[i] + 1);
    }
}

SIMD_INLINE void kernel_local_compute_sample_vectors(kernel_tile_trace *t, kernel_tile_volume *b, int type)
{
    for (int n = 0; n < b->sample_count; n += SIMD_WIDTH) kernel_local_compute_sample_vector(t, b, type, n);
}

/* Computes the values of all listed samples, and empties the list. */
static __attribute__((noinline)) void kernel_local_compute_samples(kernel_tile_trace *t, int type)
{
    kernel_tile_volume *b = t->thread->tile_volume;
    if (!b->sample_count) return;
    vf_store(b->bits + b->sample_count, vf_set(0));
    vf_store(b->t + b->sample_count, vf_set(0));
    KERNEL_OF_TYPE(type, kernel_local_compute_sample_vectors, t, b);
    b->sample_count = 0;
}

/* ---- pixels ---- */

/* Adds to the list of samples those that may lie inside their cells, for the rays n to n + SIMD_WIDTH - 1 of the list
 * of rays. Computes the listed samples if the list is full. */
SIMD_INLINE void kernel_local_queue_samples_lanes(kernel_tile_trace *t, const kernel_tile_cells *cells, int type, int n)
{
    kernel_tile_volume *b = t->thread->tile_volume;
    const vi pixel = kernel_load_bytes(cells->rays.pixel + n);
    kernel_lane_rays rays;
    vf base, step, near, far, number, last;
    kernel_lane_rays_begin(&rays, t, &cells->rays, n);
    const vf depth = kernel_gather_lane(cells->maps.origin[2], rays.lane);
    kernel_local_intersect_slabs(&cells->maps, &rays, depth, &near, &far);
    vf_gather_pair(b->steps, 2 * rays.at, &base, &step);
    kernel_local_find_sample_range(b, base, step, depth + near, vf_min(depth + far, vf_gather(b->far, rays.at)),
                                   &number, &last);
    const vi key = pixel | rays.lane << KERNEL_LOCAL_LANE;
    for (vm more = vm_and(rays.active, vf_le(number, last)); vm_any(more); more = vm_and(more, vf_le(number, last))) {
        if (b->sample_count > KERNEL_LOCAL_SAMPLES - SIMD_WIDTH) kernel_local_compute_samples(t, type);
        const vi whole = vi_from_vf(number);
        const vf place = base + step * vf_from_vi(whole + b->first);
        vf_compress(b->bits + b->sample_count, more, vf_from_bits(key | whole << KERNEL_LOCAL_NUMBER));
        b->sample_count += vf_compress(b->t + b->sample_count, more, place);
        number += 1.0f;
    }
}

/* Lists the samples of all listed rays, and empties the list of rays. */
static __attribute__((noinline)) void kernel_local_queue_samples(kernel_tile_trace *t, int type)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_pixel_list_pad(&cells->rays);
    for (int n = 0; n < cells->rays.count; n += SIMD_WIDTH) kernel_local_queue_samples_lanes(t, cells, type, n);
    cells->rays.count = 0;
}

/* ---- cells ---- */

static unsigned kernel_local_transform_lanes(kernel_tile_trace *t, int type, unsigned *lanes)
{
    return kernel_local_transform_cells(t, t->thread->tile_cells, KERNEL_LOCAL_BENT, lanes, type);
}

/* Prepares the sampling of a volume in a window. Copies, from the packets of the given blocks, which must be set up,
 * the rays' samples and ends into the arrays by packet and lane that functions for samples in lanes read. */
SIMD_INLINE void kernel_local_samples_begin(const kernel_tile_trace *t, kernel_tile_volume *b, unsigned blocks,
                                            int volume)
{
    b->pad = 0;
    b->sample_count = 0;
    for (int i = 0; i < KERNEL_TILE_PIXELS; i++) b->far[i] = -INFINITY;
    for (; blocks; blocks &= blocks - 1) {
        const int begin = __builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS;
        for (int i = begin; i < begin + KERNEL_BLOCK_PACKETS; i++) {
            const kernel_packet *p = &t->packets[i];
            kernel_samples *s = &b->packets[i];
            s->volume = volume;
            vf_store(b->far + i * SIMD_WIDTH, vf_select(p->active, p->t_far, vf_set(-INFINITY)));
            for (int n = 0; n < SIMD_WIDTH; n++) {
                b->steps[2 * (i * SIMD_WIDTH + n)] = p->sample_base[n];
                b->steps[2 * (i * SIMD_WIDTH + n) + 1] = p->sample_step[n];
            }
            b->pad = simd_max(s->pad, b->pad);
            b->first = s->first;
            b->count = s->count;
        }
    }
}

#endif
