/* Integrates volumes by segments for a whole tile, window by window, for all blocks of the tile at once.
 * kernel_segments.h defines segment and window. Cells are read and transformed once per window (kernel_tile_cells.h),
 * and processed with one ray-cell pair per lane, or passed to the packets of the blocks that they may meet. For each
 * ray, the segments that begin in its window are stored in a list, which is sorted and integrated at the end of the
 * window.
 *
 * The depth of a window is chosen so that the longest list of a ray is nearly full: as many cells as possible then lie
 * in a single window, and the lists of all of a tile's rays stay in the cache. If a ray has more segments than its list
 * holds, its window ends in front of the end of the tile's window, and its next window begins there:
 *
 *     ray 0  |--s-s-s--s--s---s--|--s--s-...
 *     ray 1  |ssssssssssss|ssssss|sssssss...   full: the rest comes in the tile's next window
 *     ray 2  |--s---s--s--|--x  opaque hit       (which begins where the first ray's next window begins)
 *            ^ tile's window 1   ^ end of the tile's window 1; window 2 begins at ray 1's next window
 *
 * The depth of windows is adapted from window to window and from tile to tile; the picture does not depend on it. */
#ifndef RENDER_KERNEL_TILE_SEGMENTS_H
#define RENDER_KERNEL_TILE_SEGMENTS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_exact.h"
#include "kernel_local_queue.h"
#include "kernel_local_segments.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_samples.h"
#include "kernel_segment_list.h"
#include "kernel_segments.h"
#include "kernel_tets.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

/* ---- cells ---- */

/* Adds the segments of a packet's rays in a polyhedron, between the depths reach[0] and reach[1]: one for each linear
 * piece of the field along a ray, which is piecewise linear in a polyhedron (kernel_polyhedron.h). */
static void kernel_add_polyhedron_segments(kernel_tile_trace *t, int packet, const polyhedron *c, const vf reach[2])
{
    kernel_tile_segments *s = t->thread->tile_segments;
    const kernel_packet *p = &t->packets[packet];
    kernel_poly_crossings r;
    kernel_interval piece;
    if (!kernel_poly_allocate(p, c, &r) || !kernel_poly_cross(&r, p->active, false)) return;
    while (kernel_poly_find_next_interval(&r)) {
        if (!c->is_constant) kernel_poly_prepare_piecewise_field(&r);
        kernel_begin_linear_pieces(&r, &piece);
        for (;;) {
            piece.mask = kernel_has_next_linear_piece(&r, &piece, piece.mask);
            if (!vm_any(piece.mask)) break;
            kernel_find_next_linear_piece(&r, r.u_out, &piece);
            const kernel_unit_segment whole =
                kernel_unit_segment_of((piece.t_out - piece.t_in) * s->packets[packet].per_t, piece.v_in, piece.v_out);
            kernel_add_linear_segments(t, s, kernel_list_positions_in_packet(packet), piece.mask, &piece, reach,
                                       &whole);
        }
    }
}

/* Adds the segments of a packet's rays in the polyhedron c or, if c is NULL, in the tile's current cell. */
static void kernel_add_segments_in_cell(kernel_tile_trace *t, int packet, const polyhedron *c)
{
    const kernel_packet *p = &t->packets[packet];
    const vf reach[2] = {p->t_near, t->thread->tile_segments->packets[packet].t_cut};
    if (c)
        kernel_add_polyhedron_segments(t, packet, c, reach);
    else
        kernel_add_segments_in_current_cell(t, packet, p->active, reach, 1, -1);
}

/* ---- tets ---- */

/* Replaces the length and the values of *run, the rays' segments in tets in float32, by those computed in double.
 * lanes: lane of each ray's tet; first, second: indices of the two faces that the ray crosses. */
static __attribute__((noinline)) void kernel_tet_segments_refine(const kernel_tile_segments *s, vi places, vi lanes,
                                                                 vi first, vi second, kernel_unit_segment *run)
{
    kernel_f64 u[2], v[2];
    for (int half = 0; half < 2; half++) {
        u[half] = vd_gather((const float *)(const void *)s->u, 2 * places, half);
        v[half] = vd_gather((const float *)(const void *)s->v, 2 * places, half);
    }
    kernel_refine_segments_in_double(s->faces, lanes, first, second, u, v, run);
    run->length *= vf_gather(s->per_t, places);
}

/* Adds the segments of a vector of rays in their tets. is_uniform: set if the rays are those of one packet and share
 * one tet, the current packet and lane of kernel_tet_pairs. */
SIMD_INLINE void kernel_add_segments_of_tet_pairs(kernel_tile_trace *t, kernel_tile_segments *s, kernel_lane_rays *r,
                                                  bool is_uniform)
{
    const kernel_tet_pairs *pairs = &t->thread->tile_cells->tet_pairs;
    kernel_segments *lists = is_uniform ? &s->packets[pairs->packet] : s->packets;
    const vi places = r->at;
    kernel_interval i;
    vf begin, end, reach[2];
    vm hit[4];
    if (is_uniform)
        begin = lists->t_begin, end = lists->t_end;
    else
        vf_gather_pair(s->window, 2 * places, &begin, &end);
    r->active = vm_and(r->active, vf_lt(begin, end));
    kernel_tet_rays_find_intervals_and_faces(&t->thread->tile_cells->tets, r, is_uniform, pairs->lane, false, false,
                                             hit, &i);
    if (!vm_any(i.mask)) return;
    if (is_uniform)
        reach[0] = t->packets[pairs->packet].t_near, reach[1] = lists->t_cut;
    else
        vf_gather_pair(s->reach, 2 * places, &reach[0], &reach[1]);
    const vm met = vm_and(i.mask, vm_and(vf_le(begin, i.t_out), vf_lt(i.t_in, end)));
    const vm cut = vm_and(met, kernel_local_find_cut_intervals(t, s, places, met, i.t_in, i.t_out, reach));
    const vm own = vm_and(vm_andnot(met, cut), vf_le(begin, i.t_in));
    if (!vm_any(vm_or(own, cut))) return;
    kernel_unit_segment run = kernel_unit_segment_of(i.t_out - i.t_in, i.v_in, i.v_out);
    if (s->is_double)
        kernel_tet_segments_refine(s, places, r->lane, kernel_tets_first_face(hit), kernel_tets_second_face(hit), &run);
    /* segments are kept if their length is positive, not if t_in < t_out, because in double the length may be positive
     * although both depths are the same float32 */
    kernel_segments_add(lists, is_uniform, s->is_double, places, vm_and(own, vf_lt(vf_set(0), run.length)), i.t_in,
                        i.t_out, &run);
    if (__builtin_expect(vm_any(cut), 0)) kernel_add_linear_segments(t, s, places, cut, &i, reach, &run);
}

/* Adds the segments in the current vector of tets. */
static __attribute__((noinline)) void kernel_add_tet_segments(kernel_tile_trace *t)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    kernel_lane_rays r;
    if (s->is_double)
        kernel_double_compute_tet_functions(t->frame, &t->tile, &t->thread->tile_cells->tets,
                                            &t->frame->volumes[s->volume], s->faces);
    while (kernel_tet_pairs_next(t, &r)) {
        if (t->thread->tile_cells->tet_pairs.packet < 0)
            kernel_add_segments_of_tet_pairs(t, s, &r, false);
        else
            kernel_add_segments_of_tet_pairs(t, s, &r, true);
    }
    kernel_update_shortened_windows(t, s->blocks);
}

static const kernel_volume_method kernel_volume_by_segments = {
    .is_pencil = false,
    .process_packet = kernel_add_segments_in_cell,
    .process_tets = kernel_add_tet_segments,
    .transform = kernel_local_segments_transform,
    .process_pixels = kernel_local_segments_process_pixels,
    .finish = kernel_local_segments_finish,
};

/* ---- windows of depth ---- */

/* Prepares the packet and its lists for segments of all volumes. far: depth behind all cells; hits: the packet's hits
 * on surfaces. */
SIMD_INLINE void kernel_ray_segments_begin(kernel_packet *p, kernel_segments *list, float far, const kernel_hits *hits)
{
    const kernel_frame *f = p->frame;
    p->is_pencil = false;
    list->active = p->active;
    list->blend = kernel_blend_begin();
    list->t_last = vf_min(p->t_far, vf_set(far));
    list->cut = f->has_transparent && !f->job->separate_samples ? hits : NULL;
    list->is_double = f->is_double && !f->job->separate_samples;
    list->capacity = list->is_double ? KERNEL_WINDOW / 2 : KERNEL_WINDOW;
}

/* Prepares the packet and its lists for one volume: sets the volume's transfer function, its unit distances and the
 * error limit, and lets the first window begin where the rays begin. */
SIMD_INLINE void kernel_ray_segments_begin_volume(kernel_packet *p, kernel_segments *list, int volume)
{
    const kernel_frame *f = p->frame;
    p->active = list->active;
    list->t_begin = p->t_near;
    list->per_t = f->volumes[volume].exponent / p->sample_step * p->clip_length_ratio;
    list->volume = volume;
    list->pieces = &f->pieces[volume];
    list->mixing = f->job->separate_samples ? f->mixing : 0;
    list->t_cut = list->mixing > 0 ? p->clip_out : p->t_far;
}

/* Deactivates rays that have ended or are dark (have less light left than KERNEL_DARK). Returns the least depth at
 * which the window of a ray that is still active begins; +inf if no ray is active. */
SIMD_INLINE float kernel_tile_find_next_window_begin(kernel_tile_trace *t, kernel_tile_segments *s, const int *packets,
                                                     int count)
{
    vf front = vf_set(INFINITY);
    for (int n = 0; n < count; n++) {
        kernel_packet *p = &t->packets[packets[n]];
        const kernel_segments *list = &s->packets[packets[n]];
        p->active = vm_and(p->active,
                           vm_and(vf_lt(list->t_begin, list->t_last), vf_lt(vf_set(KERNEL_DARK), list->blend.light)));
        front = vf_min(front, vf_select(p->active, list->t_begin, vf_set(INFINITY)));
    }
    return vf_reduce_min(front);
}

/* Finds and stores the segments of all rays of the given blocks in the window that ends at depth `end`. */
SIMD_INLINE void kernel_tile_segments_find(kernel_tile_trace *t, kernel_tile_segments *s, int volume, unsigned blocks,
                                           float end)
{
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++) t->far[v] = vf_set(-INFINITY);
    for (unsigned left = blocks; left; left &= left - 1) {
        const int block = __builtin_ctz(left);
        for (int i = block * KERNEL_BLOCK_PACKETS; i < (block + 1) * KERNEL_BLOCK_PACKETS; i++) {
            kernel_segments *list = &s->packets[i];
            kernel_segments_begin(list, vf_max(list->t_begin, vf_min(list->t_last, vf_set(end))));
        }
        kernel_block_set_window_end(t, s->packets, block);
    }
    kernel_local_segments_begin(t, s, blocks, volume);
    kernel_tile_process_window(t, volume, blocks);
}

/* Chooses the next window's depth (s->depth) from the largest number of segments that a ray has in this window, so that
 * the longest list will be three quarters full. begin, end: depths at which this window begins and ends. */
SIMD_INLINE void kernel_tile_segments_adapt_window(kernel_tile_segments *s, const int *packets, int count, float begin,
                                                   float end)
{
    const int room = s->packets[packets[0]].capacity;
    int most = room / 16;
    vf least = vf_set(end);
    for (int n = 0; n < count; n++) {
        const kernel_segments *list = &s->packets[packets[n]];
        const vm is_full = vf_lt(list->t_end, list->t_last);
        least = vf_min(least, vf_select(is_full, list->t_end, least));
        for (int lane = 0; lane < SIMD_WIDTH; lane++) most = list->count[lane] > most ? list->count[lane] : most;
    }
    s->depth = (vf_reduce_min(least) - begin) * (0.75f * (float)room) / (float)most;
}

/* Integrates a volume's segments, window by window. packets: indices of the `count` packets; reach: the depths and
 * blocks in which there are cells. */
SIMD_INLINE void kernel_tile_integrate_volume_segments(kernel_tile_trace *t, kernel_tile_segments *s,
                                                       const int *packets, int count, int volume,
                                                       const kernel_placement *reach)
{
    for (int n = 0; n < count; n++)
        kernel_ray_segments_begin_volume(&t->packets[packets[n]], &s->packets[packets[n]], volume);
    for (;;) {
        const float front = kernel_tile_find_next_window_begin(t, s, packets, count);
        if (!(front < INFINITY)) break;
        t->t_near = fmaxf(front, reach->near);
        const float end = s->depth > 0 ? t->t_near + s->depth : reach->far;
        kernel_tile_segments_find(t, s, volume, reach->blocks, end);
        kernel_tile_segments_adapt_window(s, packets, count, t->t_near, fminf(end, reach->far));
        for (int n = 0; n < count; n++) {
            kernel_segments *list = &s->packets[packets[n]];
            if (vm_any(t->packets[packets[n]].active)) kernel_blend_segments(&t->packets[packets[n]], list);
            list->t_begin = list->t_end;
        }
    }
}

/* Traces the tile's volumes after its opaque surfaces, whose hits are in the packets. Transparent surfaces, whose hits
 * are fragments, cut segments. */
static void kernel_tile_integrate_volumes(kernel_tile_trace *t)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    if (!kernel_tile_cells_begin(t, &kernel_volume_by_segments, true)) return;
    const kernel_placement reach = kernel_tile_find_placement_of_trees(t);
    int packets[KERNEL_TILE_PACKETS];
    const int count = kernel_tile_volume_begin(t, reach.blocks, packets);
    s->has_overflowed = false;
    for (int n = 0; n < count; n++) {
        const int i = packets[n];
        kernel_ray_segments_begin(&t->packets[i], &s->packets[i], reach.far, &t->hits[i]);
        if (s->packets[i].is_double)
            kernel_get_ray_parameters_in_double(&t->packets[i], s->u + i * SIMD_WIDTH, s->v + i * SIMD_WIDTH);
        s->has_overflowed = s->has_overflowed || vm_any(t->hits[i].overflowed);
    }
    for (int volume = 0; volume < t->frame->volume_count; volume++)
        kernel_tile_integrate_volume_segments(t, s, packets, count, volume, &reach);
    for (int n = 0; n < count; n++) {
        kernel_segments *list = &s->packets[packets[n]];
        t->packets[packets[n]].active = list->active;
        kernel_segments_close(&t->packets[packets[n]], &list->blend, list->active);
    }
}

#endif
