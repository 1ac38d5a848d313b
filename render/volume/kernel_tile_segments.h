/* Integrates volumes by segments for a whole tile, window by window, for all blocks of the tile at once.
 * kernel_segments.h defines segment and window. A cell is read and transformed once per window (kernel_tile_cells.h)
 * and passed to the packets of the blocks that it may meet. For each ray, the segments that begin in its window are
 * stored in a list, which is sorted and integrated at the end of the window.
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
#include "kernel_cell.h"
#include "kernel_cell_segments.h"
#include "kernel_exact.h"
#include "kernel_local_queue.h"
#include "kernel_local_segments.h"
#include "kernel_map.h"
#include "kernel_packet.h"
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

/* Adds the segments of the rays of the given blocks in the cell. */
static void kernel_tile_cell_segments(kernel_tile_trace *t, int part, const kernel_cell *c, const kernel_map *map,
                                      unsigned blocks)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    if (kernel_is_linear(c->type) && t->frame->is_double)
        kernel_double_compute_faces(t->frame, &t->tile, c, &t->frame->volumes[0], s->precise);
    for (unsigned left = blocks; left; left &= left - 1) {
        const int first = __builtin_ctz(left) * KERNEL_BLOCK_PACKETS;
        for (int i = first; i < first + KERNEL_BLOCK_PACKETS; i++) {
            kernel_packet *p = &t->packets[i];
            if (kernel_has_own_faces(c->type))
                kernel_polyhedron_segments(p, &s->packets[i], part, c->index, p->active);
            else if (kernel_is_linear(c->type))
                kernel_tet_segments(p, &s->packets[i], c, s->precise, p->active);
            else
                kernel_curved_segments(t, i, c, map, p->active, (const vf[2]){p->t_near, s->packets[i].t_cut}, 1);
        }
    }
    kernel_blocks_shorten(t, blocks);
}

/* ---- small tets ---- */

/* Adds the segments of those rays that begin or end inside their tet, by packets. places: position of each ray among
 * the tile's packets; lanes: the lane of its tet; rays: mask of lanes. */
static __attribute__((noinline, cold)) void kernel_tet_segments_cut(kernel_tile_trace *t, kernel_tile_segments *s,
                                                                    vi places, vi lanes, unsigned rays)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    int32_t at[SIMD_WIDTH], lane[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    memcpy(lane, &lanes, sizeof lane);
    for (; rays; rays &= rays - 1) {
        const int i = __builtin_ctz(rays), packet = at[i] / SIMD_WIDTH;
        kernel_transformed_tets_cell(&cells->tets, lane[i], &cells->cell);
        kernel_tet_segments(&t->packets[packet], &s->packets[packet], &cells->cell, NULL,
                            vm_from_bits(1u << at[i] % SIMD_WIDTH));
    }
}

/* Adds the segments in those of the transformed tets in the given lanes that have few pixels, one ray-tet pair per
 * lane. Returns the lanes of the other tets. */
static __attribute__((noinline)) unsigned kernel_tet_segments_small(kernel_tile_trace *t, unsigned lanes)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    const unsigned others = kernel_tile_list_small_tets(t, lanes, KERNEL_TET_PIXELS);
    const kernel_pixel_list *rays = &t->thread->tile_cells->rays;
    for (int n = 0; n < rays->count; n += SIMD_WIDTH) {
        kernel_lane_rays r;
        kernel_interval i;
        vf begin, end, near, far;
        kernel_lane_rays_begin(&r, t, rays, n);
        const vi at = r.at;
        vf_gather_pair(s->window, 2 * at, &begin, &end);
        r.active = vm_and(r.active, vf_lt(begin, end));
        kernel_tet_rays_interval(&t->thread->tile_cells->tets, &r, false, &i);
        if (!vm_any(i.mask)) continue;
        vf_gather_pair(s->reach, 2 * at, &near, &far);
        const vm met = vm_and(i.mask, vm_and(vf_le(begin, i.t_out), vf_lt(i.t_in, end)));
        const vm cut = vm_and(met, vm_or(vf_lt(i.t_in, near), vf_lt(far, i.t_out)));
        const vm own = vm_and(vm_andnot(met, cut), vm_and(vf_le(begin, i.t_in), vf_lt(i.t_in, i.t_out)));
        if (vm_any(own)) kernel_local_store_segments(s, at, own, i.t_in, i.t_out, i.v_in, i.v_out);
        if (__builtin_expect(vm_any(cut), 0)) kernel_tet_segments_cut(t, s, at, r.lane, vm_bits(cut));
    }
    kernel_blocks_shorten(t, s->blocks);
    return others;
}

static const kernel_volume_method kernel_volume_by_segments = {
    .is_pencil = false,
    .take = kernel_tile_cell_segments,
    .process_tets = kernel_tet_segments_small,
    .transform = kernel_local_segments_transform,
    .process_pixels = kernel_local_segments_cast,
    .finish = kernel_local_segments_finish,
};

/* ---- windows of depth ---- */

/* Prepares the packet and its lists for segments of all volumes. far: depth behind all cells; hits: the packet's hits
 * on surfaces. */
SIMD_INLINE void kernel_ray_segments_begin(kernel_packet *p, kernel_segments *list, float far, const kernel_hits *hits)
{
    const kernel_frame *f = p->frame;
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    kernel_packet_ray_parameters(p, px, py);
    kernel_packet_set_samples(p, px, py);
    p->is_pencil = false;
    list->active = p->active;
    list->blend = kernel_blend_begin();
    list->t_last = vf_min(p->t_far, vf_set(far));
    list->cut = f->has_transparent && !f->job->separate_samples ? hits : NULL;
    kernel_segments_set_double(p, list, f->is_double && !f->job->separate_samples);
}

/* Prepares the packet and its lists for one volume: sets the error limits and the unit distances, and begins the first
 * window at the rays' begin. */
SIMD_INLINE void kernel_ray_segments_of(kernel_packet *p, kernel_segments *list, int volume)
{
    const kernel_frame *f = p->frame;
    p->active = list->active;
    list->t_begin = p->t_near;
    list->per_t = f->volumes[volume].exponent / p->sample_step * p->clip_length_ratio;
    list->volume = volume;
    list->pieces = &f->pieces[volume];
    list->allowance = f->allowance;
    list->mixing = f->job->separate_samples ? f->mixing : 0;
    list->t_cut = list->mixing > 0 ? p->clip_out : p->t_far;
    list->reach = f->reach[volume];
}

/* Deactivates rays that have ended or are dark (have less light left than KERNEL_DARK). Returns the least depth at
 * which the window of another ray begins; +inf if there are no other rays. */
SIMD_INLINE float kernel_tile_segments_front(kernel_tile_trace *t, kernel_tile_segments *s, const int *packets,
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

/* Chooses the next window's depth (s->depth) from the numbers of segments in this window, so that the longest list will
 * be three quarters full. begin, end: depths at which this window begins and ends. */
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
SIMD_INLINE void kernel_tile_segments_windows(kernel_tile_trace *t, kernel_tile_segments *s, const int *packets,
                                              int count, int volume, const kernel_placement *reach)
{
    for (int n = 0; n < count; n++) kernel_ray_segments_of(&t->packets[packets[n]], &s->packets[packets[n]], volume);
    for (;;) {
        const float front = kernel_tile_segments_front(t, s, packets, count);
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
static void kernel_tile_segments_trace(kernel_tile_trace *t)
{
    kernel_tile_segments *s = t->thread->tile_segments;
    /* Tets are not processed in lanes if ends of segments are computed in double, which is done per packet, nor if
     * transparent surfaces cut segments, because packets are faster at searching for cuts. Whether tets are processed
     * in lanes must not depend on how many cells the rank has, because the segments that are computed in lanes are not
     * bit-identical to those that packets compute. */
    const bool has_cuts = t->frame->has_transparent && !t->frame->job->separate_samples;
    if (!kernel_tile_cells_begin(t, &kernel_volume_by_segments, !t->frame->is_double && !has_cuts, true)) return;
    const kernel_placement reach = kernel_tile_trees_placement(t);
    int packets[KERNEL_TILE_PACKETS];
    const int count = kernel_tile_volume_begin(t, reach.blocks, packets);
    for (int n = 0; n < count; n++)
        kernel_ray_segments_begin(&t->packets[packets[n]], &s->packets[packets[n]], reach.far, &t->hits[packets[n]]);
    for (int volume = 0; volume < t->frame->volume_count; volume++)
        kernel_tile_segments_windows(t, s, packets, count, volume, &reach);
    for (int n = 0; n < count; n++) {
        kernel_segments *list = &s->packets[packets[n]];
        t->packets[packets[n]].active = list->active;
        kernel_segments_close(&t->packets[packets[n]], &list->blend, list->active);
    }
}

#endif
