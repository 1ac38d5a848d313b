/* Samples volumes for a whole tile, one window at a time, for all blocks of the tile. A window is a range of sample
 * numbers, which is the same on all of the tile's rays. Hexes, wedges and pyramids are processed one sample per lane
 * (kernel_local_samples.h), and tets one ray-tet pair per lane (kernel_tets.h). Other cells are read and transformed,
 * and their edge functions computed, once per window (kernel_tile_cells.h). Each of these cells is passed to the
 * packets of the blocks that it may meet, and the packets set the values of the samples that lie in the cell. A window
 * has at most job->sample_group samples:
 *
 *     block 0  |--s--s--s--s--s--s--|--s--s--s--s--s--...
 *     block 1  |--s--s--s--s--s--s--|--s--s--x  opaque hit: its far ends here
 *     block 2  |--s--s--s--s--s--s--|  dark: takes no part in the next window
 *              ^ t_near of window 1 ^ t_near of window 2
 *
 * The traversal is that for surfaces (kernel_tile_trace.h), with the window's begin in place of the eye, and the end of
 * the window on a block's rays in place of their nearest hits. The picture does not depend on windows, because a
 * sample's position and cell do not. */
#ifndef RENDER_KERNEL_TILE_VOLUME_H
#define RENDER_KERNEL_TILE_VOLUME_H

#include <limits.h>
#include <math.h>

#include "grid.h"
#include "kernel_local_samples.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_samples.h"
#include "kernel_tets.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_depth.h"
#include "kernel_tile_trace.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* ---- cells ---- */

/* Sets the values of the window's samples that lie in the current interval of the rays in a polyhedron, on which the
 * field is piecewise linear: the ray's profile (kernel_polyhedron.h). */
static void kernel_sample_polyhedron_interval(kernel_packet *p, kernel_samples *s, kernel_poly_crossings *r)
{
    const kernel_interval *i = &r->interval;
    kernel_interval piece;
    int begin, end;
    kernel_find_samples_in_interval(p, s, i, &begin, &end);
    if (begin >= end) return;
    if (!r->cell->is_constant) kernel_poly_prepare_piecewise_field(r);
    kernel_begin_linear_pieces(r, &piece);
    while (vm_any(kernel_has_next_linear_piece(r, &piece, i->mask))) {
        kernel_find_next_linear_piece(r, r->u_out, &piece);
        kernel_fill_interval_samples(p, s, NULL, &piece, i);
    }
}

/* Sets the values of the samples of a packet's rays in the polyhedron c or, if c is NULL, in the tile's current cell.
 */
static void kernel_sample_polyhedron_or_cell(kernel_tile_trace *t, int packet, const polyhedron *c)
{
    kernel_packet *p = &t->packets[packet];
    kernel_poly_crossings r;
    if (!c) kernel_sample_current_cell(t, packet, p->active, 0, KERNEL_MAX_GROUP);
    if (!c || !kernel_poly_allocate(p, c, &r) || !kernel_poly_cross(&r, p->active, false)) return;
    while (kernel_poly_find_next_interval(&r))
        kernel_sample_polyhedron_interval(p, &t->thread->tile_volume->packets[packet], &r);
}

/* ---- tets: pairs from the list and whole packets give bit-identical samples ---- */

/* Emits samples as fragments of their own: those that also lie in another cell or, with separate_samples (render.h),
 * all samples. lanes: mask of the lanes that hold such a sample; places: position of each ray among the tile's packets;
 * t_in, t_out: the rays' intervals in their tets; depth, value: of the samples. */
static __attribute__((noinline, cold)) void kernel_emit_tet_samples_separately(kernel_tile_trace *t, unsigned lanes,
                                                                               vi places, vf t_in, vf t_out, vf depth,
                                                                               vf value)
{
    int32_t at[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes), packet = at[n] / SIMD_WIDTH;
        const kernel_interval cell = {.t_in = vf_set(t_in[n]), .t_out = vf_set(t_out[n])};
        kernel_emit_sample(&t->packets[packet], &t->thread->tile_volume->packets[packet], &cell,
                           vm_from_bits(1u << at[n] % SIMD_WIDTH), vf_set(depth[n]), vf_set(value[n]));
    }
}

/* Sets the values of the window's samples that lie in the rays' intervals i in their tets. at: position of each ray
 * among the tile's packets. */
SIMD_INLINE void kernel_sample_tet_intervals(kernel_tile_trace *t, kernel_tile_volume *b, const kernel_interval *i,
                                             vi at)
{
    vf base, step, number, last;
    vf_gather_pair(b->steps, 2 * at, &base, &step);
    kernel_local_find_sample_range(b, base, step, i->t_in, i->t_out, &number, &last);
    const vf length = i->t_out - i->t_in;
    const vf slope = vf_select(vf_lt(vf_set(0), length), (i->v_out - i->v_in) / length, vf_set(0));
    for (vm more = vm_and(i->mask, vf_le(number, last)); vm_any(more); more = vm_and(more, vf_le(number, last))) {
        const vi whole = vi_from_vf(number);
        const vf depth = base + step * vf_from_vi(whole + b->first), value = i->v_in + slope * (depth - i->t_in);
        const vm own = vm_and(more, vm_andnot(vf_lt(depth, i->t_out), vf_lt(depth, i->t_in)));
        const unsigned taken = kernel_local_store_samples(b, own, at, whole, value);
        if (t->frame->needs_contact)
            kernel_local_store_cell_interval_ends(b, vm_bits(own) & ~taken, at, whole, i->t_in, i->t_out);
        if (__builtin_expect(taken, 0))
            kernel_emit_tet_samples_separately(t, taken, at, i->t_in, i->t_out, depth, value);
        number += 1.0f;
    }
}

/* Computes the samples in the current vector of tets. */
static __attribute__((noinline)) void kernel_sample_tets(kernel_tile_trace *t)
{
    kernel_tile_volume *b = t->thread->tile_volume;
    const kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_lane_rays r;
    while (kernel_tet_pairs_next(t, &r)) {
        const int packet = cells->tet_pairs.packet;
        kernel_interval i;
        if (packet < 0) {
            r.active = vm_and(r.active, vf_lt(vf_set(-INFINITY), vf_gather(b->far, r.at)));
            kernel_tet_rays_interval(&cells->tets, &r, false, &i);
            if (vm_any(i.mask)) kernel_sample_tet_intervals(t, b, &i, r.at);
        } else if (vm_any(r.active)) {
            kernel_tet_rays_interval_in_one(&cells->tets, &r, cells->tet_pairs.lane, true, false, &i);
            if (!vm_any(i.mask)) continue;
            /* a copy, because passing the address of `i` would keep `i` in memory instead of registers, also for listed
             * pairs */
            const kernel_interval own = i;
            kernel_fill_interval_samples(&t->packets[packet], &b->packets[packet], NULL, &own, &own);
        }
    }
}

static const kernel_volume_method kernel_volume_by_samples = {
    .is_pencil = true,
    .process_packet = kernel_sample_polyhedron_or_cell,
    .process_tets = kernel_sample_tets,
    .transform = kernel_local_transform_lanes,
    .process_pixels = kernel_local_queue_samples,
    .finish = kernel_local_compute_samples,
};

/* Prepares the packet for samples of volumes. Extends the range *first .. *last so that it includes the numbers of all
 * samples of the packet's rays between the depths near and far. */
SIMD_INLINE void kernel_ray_samples_begin(kernel_packet *p, kernel_samples *s, float near, float far, int *first,
                                          int *last)
{
    s->active = p->active;
    s->blend = kernel_blend_begin();
    s->overlap_depth = vf_set(INFINITY);
    const vf end = vf_min(p->t_far, vf_set(far));
    const vf from = (near - p->sample_base) * p->sample_inverse, to = (end - p->sample_base) * p->sample_inverse;
    const int lowest = (int)floorf(vf_reduce_min(from)) - 1, highest = (int)floorf(vf_reduce_max(to)) + 1;
    const int begin = lowest < p->sample_first ? p->sample_first : lowest;
    *first = begin < *first ? begin : *first;
    *last = highest > *last ? highest : *last;
}

/* Prepares the packet for a window. Deactivates rays on which no light is left, and rays that end in front of the
 * window. Resets the values of all samples to NaN or, if every sample is emitted as a fragment of its own
 * (separate_samples), to 0. Returns the greatest depth of the active rays' samples in the window; -inf if no ray is
 * active. Lowers *near to the least depth of these samples. */
SIMD_INLINE float kernel_ray_samples_begin_window(kernel_packet *p, kernel_samples *s, int volumes, float *near)
{
    const vf t_first = kernel_get_sample_depth(p, s->first),
             t_last = kernel_get_sample_depth(p, s->first + s->count - 1);
    const vf t_end = vf_min(t_last, p->t_far);
    const vf nothing = vf_set(p->frame->job->separate_samples ? 0 : NAN);
    p->active = vm_and(p->active, vm_and(vf_lt(vf_set(KERNEL_DARK), s->blend.light), vf_le(t_first, t_end)));
    if (!vm_any(p->active)) return -INFINITY;
    for (int v = 0; v < volumes; v++)
        for (int n = 0; n < s->count; n++) s->value[v][n] = nothing;
    *near = simd_min(vf_reduce_min(vf_select(p->active, t_first, vf_set(INFINITY))), *near);
    return vf_reduce_max(vf_select(p->active, t_end, vf_set(-INFINITY)));
}

/* Computes the samples with the numbers first .. last of all volumes, for the given blocks. Returns false if no ray
 * receives light any more. */
SIMD_INLINE bool kernel_tile_sample_window(kernel_tile_trace *t, kernel_tile_volume *v, unsigned blocks, int first,
                                           int last)
{
    const render_job *job = t->frame->job;
    bool is_lit = false;
    t->t_near = INFINITY;
    for (int b = 0; b < KERNEL_BLOCKS; b++) {
        float far = -INFINITY;
        for (int n = 0; n < KERNEL_BLOCK_PACKETS && blocks >> b & 1; n++) {
            const int i = b * KERNEL_BLOCK_PACKETS + n;
            kernel_samples_set_window(&t->packets[i], &v->packets[i], first, last - first + 1);
            far = simd_max(
                kernel_ray_samples_begin_window(&t->packets[i], &v->packets[i], job->volume_count, &t->t_near), far);
        }
        t->far[b / SIMD_WIDTH][b % SIMD_WIDTH] = far;
        is_lit = is_lit || far > -INFINITY;
    }
    if (!is_lit) return false;
    for (int volume = 0; volume < job->volume_count; volume++) {
        kernel_local_samples_begin(t, v, blocks, volume);
        kernel_tile_process_window(t, volume, blocks);
    }
    return true;
}

/* Chooses the number of samples in the window that begins with sample number `first`: as many as are expected to
 * receive light (kernel_depth_choose_window_length()), at most job->sample_group. */
SIMD_INLINE int kernel_tile_choose_window_sample_count(const kernel_tile_volume *v, const kernel_packet *p, int first)
{
    enum { LEAST = 8 };
    const int most = p->frame->job->sample_group, least = most < LEAST ? most : LEAST;
    const float wanted =
        kernel_depth_choose_window_length(v, kernel_get_sample_depth(p, first)[0]) * p->sample_inverse[0];
    return wanted < (float)most ? wanted < (float)least ? least : (int)wanted + 1 : most;
}

/* Adds the light of the window's samples to the rays' fragments, from front to back, and updates the estimate of
 * depths. */
SIMD_INLINE void kernel_tile_window_blend(kernel_tile_trace *t, kernel_tile_volume *v, const int *packets, int count,
                                          int samples)
{
    for (int n = 0; n < count; n++) {
        const int i = packets[n];
        kernel_samples *s = &v->packets[i];
        if (vm_any(t->packets[i].active)) kernel_blend_window(&t->packets[i], s, &t->hits[i]);
        kernel_depth_add_packet(v, s->active, &s->blend);
    }
    kernel_depth_end_window(v, (float)samples * t->packets[packets[0]].sample_step[0]);
}

/* Traces the tile's volumes after its opaque surfaces, whose hits are in the packets. */
static void kernel_tile_sample_volumes(kernel_tile_trace *t)
{
    kernel_tile_volume *v = t->thread->tile_volume;
    /* Hexes, wedges and pyramids are sampled one sample per lane, except in two cases: if the frame has surfaces, which
     * may end rays, and because of which kernel_blend_must_end_before_sample() needs the ends of intervals in cells;
     * and if each sample becomes a fragment of its own. */
    const bool has_lanes = !t->frame->surface_count && !t->frame->job->separate_samples;
    if (!kernel_tile_cells_begin(t, &kernel_volume_by_samples, has_lanes)) return;
    kernel_placement reach = kernel_tile_find_placement_of_trees(t);
    const unsigned blocks = reach.blocks;
    /* depth at which the tile's first cell begins; +inf if cells are found only by traversing the trees */
    const float cells_near = t->frame->volume_candidates ? t->thread->tile_cells->items[0].near : INFINITY;
    if (cells_near < INFINITY) reach.near = fmaxf(reach.near, cells_near);
    int packets[KERNEL_TILE_PACKETS], first = INT_MAX, last = INT_MIN;
    const int count = kernel_tile_volume_begin(t, blocks, packets);
    for (int n = 0; n < count; n++)
        kernel_ray_samples_begin(&t->packets[packets[n]], &v->packets[packets[n]], reach.near, reach.far, &first,
                                 &last);
    kernel_depth_begin_tile(v, cells_near);
    for (int from = first, to; from <= last; from = to) {
        const int samples = kernel_tile_choose_window_sample_count(v, &t->packets[packets[0]], from);
        to = last - from < samples ? last + 1 : from + samples;
        if (!kernel_tile_sample_window(t, v, blocks, from, to - 1)) break;
        if (!t->frame->job->separate_samples) kernel_tile_window_blend(t, v, packets, count, to - from);
    }
    for (int n = 0; n < count; n++) {
        t->packets[packets[n]].active = v->packets[packets[n]].active;
        kernel_blend_close(&t->packets[packets[n]], &v->packets[packets[n]].blend, t->packets[packets[n]].active);
    }
}

#endif
