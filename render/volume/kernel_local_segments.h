/* Computes the segments of rays in hexes, wedges and pyramids, one ray-cell pair per lane: each lane has a ray and the
 * index of the lane that holds its cell. kernel_segments.h defines segment, window and cut; kernel_local_deviation.h
 * defines interval, part and chord. Rays for which lanes cannot be used are processed by packets, cell by cell, and
 * their intervals are divided by the same rule. */
#ifndef RENDER_KERNEL_LOCAL_SEGMENTS_H
#define RENDER_KERNEL_LOCAL_SEGMENTS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_bisection.h"
#include "kernel_cell.h"
#include "kernel_exact.h"
#include "kernel_integral.h"
#include "kernel_local.h"
#include "kernel_local_budget.h"
#include "kernel_local_deviation.h"
#include "kernel_local_crossings.h"
#include "kernel_local_queue.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_preintegral.h"
#include "kernel_samples.h"
#include "kernel_segment_list.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

/* Layout of the 32-bit word that describes a listed ray: its pixel in the tile begins at bit 0, the lane of its cell at
 * bit KERNEL_LOCAL_CELL, and the indices of the two crossed faces, three bits each, at bit KERNEL_LOCAL_FACES. */
enum { KERNEL_LOCAL_CELL = 8, KERNEL_LOCAL_FACES = 16 };

/* Lists of rays. KERNEL_LOCAL_MET: rays that may meet their cells. The other two have the rays that cross two faces of
 * their cells: KERNEL_LOCAL_CROSSED if the face with the smaller index is a quad, KERNEL_LOCAL_CROSSED_TRIANGLE if it
 * is a triangle. */
enum { KERNEL_LOCAL_MET, KERNEL_LOCAL_CROSSED, KERNEL_LOCAL_CROSSED_TRIANGLE, KERNEL_LOCAL_LISTS };

/* The segments of a tile's rays in a window, and the state of the vector of cells that is being processed. */
typedef struct kernel_tile_segments {
    kernel_segments packets[KERNEL_TILE_PACKETS];
    float depth;     /* length of the next window in depth; 0 if it has not been determined yet */
    unsigned blocks; /* mask of the tile's blocks in which segments of the current window may lie */
    int volume;
    float per_t[KERNEL_TILE_PIXELS]; /* unit distances of the transfer function per unit of t, by packet and lane */
    kernel_local_bounds bounds;      /* error bounds of the current vector of cells */
    bool is_double;                  /* set if the ends of segments are stored in double */
    bool has_cuts;                   /* set if transparent surfaces cut segments */
    bool has_overflowed;             /* set if a ray crosses more transparent surfaces than kernel_hits stores */
    int list_count[KERNEL_LOCAL_LISTS];
    float list[KERNEL_LOCAL_LISTS][KERNEL_LIST_ROOM]; /* the words that describe the listed rays */
    /* For each ray, by packet and lane, depths side by side: begin and end of the ray's window (window), and begin and
     * end of the part of the ray in which segments lie (reach). */
    float window[2 * KERNEL_TILE_PIXELS], reach[2 * KERNEL_TILE_PIXELS];
    /* The following members are set only if is_double is: (u, v) of each ray in double, by packet and lane, relative to
     * the tile's centre; and the faces of the current vector of tets. */
    double u[KERNEL_TILE_PIXELS], v[KERNEL_TILE_PIXELS];
    kernel_double_face faces[4];
} kernel_tile_segments;

/* ---- surfaces that cut segments ---- */

/* Returns for each ray in `rays` the depth of the first transparent surface behind the depth `from`; +inf if there is
 * none. The function works ray by ray, and is used only if rays may cross more transparent surfaces than kernel_hits
 * stores. places: position of each ray among the tile's packets. */
static __attribute__((noinline, cold)) vf kernel_local_find_next_cut_ray_by_ray(const kernel_tile_trace *t,
                                                                                const kernel_tile_segments *b,
                                                                                vi places, vm rays, vf from)
{
    int32_t at[SIMD_WIDTH];
    float next[SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    vf_store(next, vf_set(INFINITY));
    for (unsigned bits = vm_bits(rays); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits), packet = at[i] / SIMD_WIDTH;
        next[i] =
            kernel_find_next_cut(&t->packets[packet], &b->packets[packet], vf_set(from[i]), true)[at[i] % SIMD_WIDTH];
    }
    return vf_load(next);
}

/* Returns for each ray in `rays` the depth of the first transparent surface behind the depth `from`; +inf if there is
 * none. places: position of each ray among the tile's packets. */
static __attribute__((noinline)) vf
kernel_local_find_next_cut(const kernel_tile_trace *t, const kernel_tile_segments *b, vi places, vm rays, vf from)
{
    enum { HITS = sizeof(kernel_hits) / sizeof(float) };
    vf next = vf_set(INFINITY);
    if (!b->has_cuts) return next;
    if (b->has_overflowed) return kernel_local_find_next_cut_ray_by_ray(t, b, places, rays, from);
    const vi hits = places / SIMD_WIDTH * HITS, at = hits + (places & (SIMD_WIDTH - 1));
    const vf bits = vf_gather((const float *)(const void *)&t->hits[0].cut_count, hits);
    const vf count = vf_select(rays, vf_from_vi(vi_from_bits(bits)), vf_set(0));
    for (int n = 0; vm_any(vf_lt(vf_set((float)n), count)); n++) {
        const vf cut = vf_gather((const float *)(const void *)&t->hits[0].cut[n], at);
        const vm behind = vm_and(vf_lt(vf_set((float)n), count), vf_lt(from, cut));
        next = vf_select(behind, vf_min(cut, next), next);
    }
    return next;
}

/* The following two functions determine which parts of an interval become segments. last: depth of the opaque surface
 * or of the clip behind which there are none. If pictures must be the same on any partition (render_job.reproducible),
 * a surface on the face at which the interval begins or ends does not cut it, because the surface may belong to another
 * rank, which then has the same interval uncut. Rounding may place such a surface within the interval. Compositing
 * decides by the same error bound whether a segment begins at a surface (begins_at_surface() in comp_merge.c).
 *
 * kernel_local_find_last_begin() returns the depths in front of which segments must begin if they are to be added.
 * kernel_local_find_segment_ends() returns the depths at which segments from `from` on end: at the first transparent
 * surface, at `last`, or at the interval's end (t_out). */
SIMD_INLINE vf kernel_local_find_last_begin(const kernel_tile_trace *t, vf t_out, vf last)
{
    if (!t->frame->job->reproducible) return last;
    const vm ends_behind = vm_and(vf_lt(last, t_out - kernel_face_depth_error(t_out)), vf_lt(last, vf_set(INFINITY)));
    return vf_select(ends_behind, last - kernel_face_depth_error(last), last);
}

static __attribute__((noinline)) vf kernel_local_find_segment_ends(const kernel_tile_trace *t,
                                                                   const kernel_tile_segments *b, vi places, vm rays,
                                                                   vf from, vf t_out, vf last)
{
    if (!t->frame->job->reproducible)
        return vf_min(vf_min(t_out, last), kernel_local_find_next_cut(t, b, places, rays, from));
    const vf cut = vf_min(last, kernel_local_find_next_cut(t, b, places, rays, from + kernel_face_depth_error(from)));
    return vf_select(vf_lt(cut, t_out - kernel_face_depth_error(t_out)), cut, t_out);
}

/* Returns the rays whose interval from t_in to t_out is cut by a surface or a clip, or lies outside the depths reach[0]
 * and reach[1]. places: position of each ray among the tile's packets. */
SIMD_INLINE vm kernel_local_find_cut_intervals(const kernel_tile_trace *t, const kernel_tile_segments *b, vi places,
                                               vm rays, vf t_in, vf t_out, const vf reach[2])
{
    const vm cut = vm_or(vf_lt(t_in, reach[0]), vf_lt(reach[1], t_out));
    if (!b->has_cuts && !vm_any(vm_and(rays, cut))) return cut;
    const vf end = kernel_local_find_segment_ends(t, b, places, rays, t_in, t_out, reach[1]);
    return vm_or(vf_lt(t_in, reach[0]), vm_or(vf_le(reach[1], t_in), vf_lt(end, t_out)));
}

/* Cuts intervals of rays at surfaces, and adds the resulting segments that lie between the depths reach[0] and reach[1]
 * and begin in the rays' windows. i: the intervals of the given rays, on which the field must be linear; whole: the
 * same intervals as segments; places: position of each ray among the tile's packets. */
static __attribute__((noinline)) void kernel_add_linear_segments(const kernel_tile_trace *t, kernel_tile_segments *s,
                                                                 vi places, vm rays, const kernel_interval *i,
                                                                 const vf reach[2], const kernel_unit_segment *whole)
{
    const vf begin = vf_gather(s->window, 2 * places),
             end = vf_min(i->t_out, kernel_local_find_last_begin(t, i->t_out, reach[1]));
    vf from = vf_max(i->t_in, reach[0]);
    for (vm open = vm_and(rays, vf_lt(from, end)); vm_any(open); open = vm_and(open, vf_lt(from, end))) {
        const vf to = kernel_local_find_segment_ends(t, s, places, open, from, i->t_out, reach[1]);
        const kernel_unit_segment part =
            kernel_cut_part_of_unit_segment(whole, kernel_interval_fraction(i, from), kernel_interval_fraction(i, to));
        kernel_segments_add(s->packets, false, s->is_double, places, vm_and(open, vf_le(begin, from)), from, to, &part);
        from = to;
    }
}

/* ---- intervals of rays ---- */

/* Adds one segment per lane to the segments of the lane's ray. rays: the lanes that have a segment; places: position of
 * each ray among the tile's packets; v_in, v_out: values in the transfer function's domain. */
SIMD_INLINE void kernel_local_store_segments(kernel_tile_segments *b, vi places, vm rays, vf t_in, vf t_out, vf v_in,
                                             vf v_out)
{
    vf length = vf_set(0);
    if (b->is_double) length = (t_out - t_in) * vf_gather(b->per_t, places);
    const kernel_unit_segment run = kernel_unit_segment_of(length, v_in, v_out);
    kernel_segments_add(b->packets, false, b->is_double, places, rays, t_in, t_out, &run);
}

/* The following two functions evaluate the polynomial (1/4 - u^2) (f[0] + f[1] u + f[2] u^2) that is fitted to the
 * field's deviation from its chord. It is 0 at the interval's ends, u = -1/2 and 1/2. kernel_local_deviation() returns
 * its value at u, kernel_local_integrate_deviation() its integral from 0 to u. */
SIMD_INLINE vf kernel_local_deviation(const vf f[3], vf u)
{
    return (0.25f - u * u) * vf_muladd(vf_muladd(f[2], u, f[1]), u, f[0]);
}

SIMD_INLINE vf kernel_local_integrate_deviation(const vf f[3], vf u)
{
    const vf square = u * u;
    const vf odd = f[0] * (0.25f - square * (1.0f / 3)) + f[2] * square * (1.0f / 12 - square * 0.2f);
    return u * odd + f[1] * square * (0.125f - 0.25f * square);
}

/* Adds the rays' intervals as one segment each. An offset is added to the segment's values so that its mean is that of
 * the field. */
SIMD_INLINE void kernel_local_add_single_segments(kernel_tile_segments *b, const kernel_local_pairs *p, vm rays)
{
    const vf t0 = p->ends[0].t, t1 = p->ends[1].t, lift = kernel_local_compute_segment_offset(p);
    kernel_local_store_segments(b, p->rays.at, vm_and(rays, vm_and(vf_le(p->begin, t0), vf_lt(t0, t1))), t0, t1,
                                p->ends[0].value + lift, p->ends[1].value + lift);
}

/* Adds the segments of rays that need several (p->count): equal subintervals of the interval, on each of which the
 * segment has the mean of the polynomial through the sampled values. */
static __attribute__((noinline)) void kernel_local_add_equal_segments(kernel_tile_segments *b,
                                                                      const kernel_local_pairs *p, vm rays)
{
    const vf *d = p->field, t0 = p->ends[0].t, t1 = p->ends[1].t, v0 = p->ends[0].value, v1 = p->ends[1].value;
    const vf share = 1.0f / p->count, length = t1 - t0, rise = v1 - v0, middle = 4.0f * d[1];
    const vf f[3] = {middle, (32.0f / 3) * (d[2] - d[0]), 16.0f * ((8.0f / 3) * (d[0] + d[2]) - middle)};
    vf from = t0, u0 = vf_set(-0.5f), off0 = vf_set(0), sum0 = kernel_local_integrate_deviation(f, u0);
    vm open = rays;
    for (int n = 1; vm_any(open); n++) {
        const vf number = vf_set((float)n), along = number * share;
        const vm inner = vm_and(open, vf_lt(number, p->count));
        const vf u1 = vf_select(inner, along - 0.5f, vf_set(0.5f)), sum1 = kernel_local_integrate_deviation(f, u1);
        const vf to = vf_select(inner, t0 + length * along, t1), off1 = kernel_local_deviation(f, u1);
        const vf lift = (sum1 - sum0) * p->count - 0.5f * (off0 + off1);
        const vf in = (v0 + (u0 + 0.5f) * rise) + (off0 + lift), out = (v1 - (0.5f - u1) * rise) + (off1 + lift);
        kernel_local_store_segments(b, p->rays.at, vm_and(open, vm_and(vf_le(p->begin, from), vf_lt(from, to))), from,
                                    to, in, out);
        from = to;
        u0 = u1;
        off0 = off1;
        sum0 = sum1;
        open = inner;
    }
}

/* Adds the segments of the given rays; p->count has the number of segments of each ray. */
SIMD_INLINE void kernel_local_add_segments(kernel_tile_segments *b, const kernel_local_pairs *p, vm rays)
{
    const vm single = vm_and(rays, vf_le(p->count, vf_set(1))), more = vm_andnot(rays, single);
    kernel_local_add_single_segments(b, p, single);
    if (vm_any(more)) kernel_local_add_equal_segments(b, p, more);
}

/* ---- division of intervals into parts ---- */

static void kernel_local_add_segments_cell_by_cell(kernel_tile_trace *t, vi places, vi lanes, unsigned wanted,
                                                   const vf reach[2], float share);

/* Adds the segments of the rays' intervals. An interval is halved, and its parts again, until the error bounds allow a
 * part to be divided into a few equal segments (kernel_local_choose_segment_counts()). The shortest parts for which the
 * error bounds do not allow this are passed on: from vectors of cells to packets, and from packets to bisection in
 * double. */
SIMD_INLINE void kernel_local_divide_intervals(kernel_tile_trace *t, const kernel_local_bounds *bounds,
                                               const kernel_local_chord *chord, const kernel_local_pairs *whole,
                                               vm rays, int type)
{
    kernel_tile_segments *b = t->thread->tile_segments;
    kernel_local_places stack[KERNEL_LOCAL_LEVELS + 2];
    vm mine[KERNEL_LOCAL_LEVELS + 2] = {rays};
    kernel_local_sample_whole_interval(chord, whole->ends, rays, type, &stack[0]);
    for (int count = 1; count > 0;) {
        const kernel_local_places places = stack[--count];
        kernel_local_pairs part;
        kernel_local_restrict_to_part(whole, &places, mine[count], &part);
        part.active = vm_and(part.active, vf_lt(part.begin, part.ends[1].t));
        const vm fails =
            vm_or(kernel_local_choose_segment_counts(t->frame, b->volume, bounds, &part), part.has_diverged);
        const vm good = vm_andnot(part.active, fails);
        const vm rest = vm_andnot(part.active, good);
        kernel_local_add_segments(b, &part, good);
        if (!vm_any(rest)) continue;
        const vf reach[2] = {part.ends[0].t, part.ends[1].t};
        if (part.share > KERNEL_LOCAL_LEAST_SHARE) {
            for (int half = 1; half >= 0; half--, count++) {
                kernel_local_sample_half_interval(chord, whole->ends, &places, half, rest, type, &stack[count]);
                mine[count] = rest;
            }
        } else if (type == GRID_NO_TYPE) {
            kernel_segments *list = &b->packets[chord->packet - t->packets];
            kernel_interval_bisect(chord->packet, list, chord->cell, chord->interval, rest, reach[0], reach[1]);
        } else {
            kernel_local_add_segments_cell_by_cell(t, part.rays.at, part.rays.lane, vm_bits(rest), reach, part.share);
        }
    }
}

SIMD_INLINE void kernel_local_subdivide_intervals_of_type(kernel_tile_trace *t, const kernel_local_pairs *whole,
                                                          vm rays, int type)
{
    const kernel_local_bounds *bounds = &t->thread->tile_segments->bounds;
    kernel_local_chord chord;
    kernel_local_compute_chords(&t->thread->tile_cells->maps, bounds, whole->rays.lane, whole->ends, type, &chord);
    kernel_local_divide_intervals(t, bounds, &chord, whole, rays, type);
}

/* Adds the segments of the intervals of the given rays in the current vector's cells
 * (kernel_local_divide_intervals()). */
static __attribute__((noinline)) void
kernel_local_subdivide_intervals(kernel_tile_trace *t, const kernel_local_pairs *whole, vm rays, int type)
{
    KERNEL_OF_TYPE(type, kernel_local_subdivide_intervals_of_type, t, whole, rays);
}

/* ---- packets of rays in one cell ---- */

/* For a hex, wedge or pyramid with a constant field: adds the rays' intervals in the cell as segments, cut at surfaces.
 * The value is computed in double if s->is_double is set, because narrow ramps magnify its rounding. reach: first and
 * last depth of the segments to add. */
static __attribute__((noinline)) void kernel_add_constant_segments(const kernel_tile_trace *t, kernel_tile_segments *s,
                                                                   vi places, const kernel_cell *c,
                                                                   const kernel_interval *i, const vf reach[2])
{
    const double exact = kernel_map_to_domain_in_double(&t->frame->volumes[s->volume], c->values[0]);
    const vf value = vf_set((float)exact);
    kernel_unit_segment whole =
        kernel_unit_segment_of((i->t_out - i->t_in) * vf_gather(s->per_t, places), value, value);
    if (s->is_double) whole.rest_in = whole.rest_out = vf_set((float)(exact - (double)(float)exact));
    kernel_add_linear_segments(t, s, places, i->mask, i, reach, &whole);
}

/* Adds the segments of a packet's rays in the tile's current cell (kernel_tile_cells.cell), between the depths reach[0]
 * and reach[1]. share: length between these depths, as a share of the rays' intervals in the cell; lane: the lane of
 * the cell in the current vector, whose error bounds are then used; -1: the cell is not in it. */
static __attribute__((noinline)) void kernel_add_segments_in_current_cell(kernel_tile_trace *t, int packet, vm rays,
                                                                          const vf reach[2], float share, int lane)
{
    const kernel_cell *c = &t->thread->tile_cells->cell;
    const kernel_map *map = t->thread->tile_cells->cell_map;
    kernel_tile_segments *b = t->thread->tile_segments;
    kernel_packet *p = &t->packets[packet];
    kernel_segments *list = &b->packets[packet];
    kernel_interval intervals[KERNEL_MAX_CELL_INTERVALS];
    kernel_local_bounds own_bounds;
    const kernel_local_bounds *bounds = lane < 0 ? &own_bounds : &b->bounds;
    kernel_local_chord chord = {.packet = p, .map = map, .cell = c};
    kernel_local_pairs whole = {
        .begin = list->t_begin,
        .per_t = list->per_t,
        .share = share,
        .rays = {.at = kernel_list_positions_in_packet(packet), .lane = vi_set(lane < 0 ? 0 : lane)}};
    const int count = kernel_curved_intervals(p, c, rays, intervals);
    if (count && map && lane < 0) kernel_local_set_bounds_of_single_cell(t->frame, b->volume, c, &own_bounds);
    for (int k = 0; k < count; k++) {
        const vf end = vf_min(intervals[k].t_out, kernel_local_find_last_begin(t, intervals[k].t_out, reach[1]));
        vf from = vf_max(intervals[k].t_in, reach[0]);
        vm open = vm_and(intervals[k].mask, vf_lt(from, end));
        chord.interval = &intervals[k];
        if (!map) {
            kernel_add_constant_segments(t, b, whole.rays.at, c, &intervals[k], reach);
            continue;
        }
        for (; vm_any(open); open = vm_and(open, vf_lt(from, end))) {
            const vf to = kernel_local_find_segment_ends(t, b, whole.rays.at, open, from, intervals[k].t_out, reach[1]);
            const vm mine = vm_and(open, vm_and(vf_lt(list->t_begin, to), vf_lt(from, list->t_end)));
            whole.ends[0].t = from;
            whole.ends[1].t = from = to;
            for (int n = 0; n < 2; n++)
                whole.ends[n].value = kernel_evaluate_field_in_one_cell(p, map, &intervals[k], mine, whole.ends[n].t);
            if (vm_any(mine)) kernel_local_divide_intervals(t, bounds, &chord, &whole, mine, GRID_NO_TYPE);
        }
    }
}

/* ---- rays ---- */

/* Adds the segments of the rays in `wanted` (a mask of lanes) between the depths reach[0] and reach[1], by packets,
 * cell by cell; rays with the same cell and packet are processed together. places: position of each ray among the
 * tile's packets; lanes: the lane of each ray's cell; share: as in kernel_add_segments_in_current_cell(). */
static __attribute__((noinline)) void kernel_local_add_segments_cell_by_cell(kernel_tile_trace *t, vi places, vi lanes,
                                                                             unsigned wanted, const vf reach[2],
                                                                             float share)
{
    int32_t at[SIMD_WIDTH], lane[SIMD_WIDTH];
    float depths[2][SIMD_WIDTH];
    memcpy(at, &places, sizeof at);
    memcpy(lane, &lanes, sizeof lane);
    for (int end = 0; end < 2; end++) vf_store(depths[end], reach[end]);
    while (wanted) {
        const int first = __builtin_ctz(wanted), packet = at[first] / SIMD_WIDTH;
        vf own[2] = {vf_set(0), vf_set(0)};
        unsigned same = 0;
        for (unsigned more = wanted; more; more &= more - 1) {
            const int i = __builtin_ctz(more);
            if (lane[i] != lane[first] || at[i] / SIMD_WIDTH != packet) continue;
            for (int end = 0; end < 2; end++) own[end][at[i] % SIMD_WIDTH] = depths[end][i];
            same |= 1u << at[i] % SIMD_WIDTH;
            wanted &= ~(1u << i);
        }
        if (!kernel_tile_set_current_cell(t, lane[first])) continue;
        kernel_add_segments_in_current_cell(t, packet, vm_and(t->packets[packet].active, vm_from_bits(same)), own,
                                            share, lane[first]);
    }
}

/* Adds the segments, between the depths reach[0] and reach[1], of rays whose intervals are cut by surfaces or begin or
 * end outside these depths. */
SIMD_INLINE void kernel_local_add_cut_segments_of_type(kernel_tile_trace *t, kernel_tile_segments *b,
                                                       const kernel_local_pairs *whole, vm rays, const vf reach[2],
                                                       int type)
{
    const kernel_local_cells *cells = &t->thread->tile_cells->maps;
    const vf end = vf_min(whole->ends[1].t, kernel_local_find_last_begin(t, whole->ends[1].t, reach[1]));
    kernel_local_pairs part = *whole;
    kernel_local_chord chord;
    kernel_local_compute_chords(cells, &b->bounds, whole->rays.lane, whole->ends, type, &chord);
    vf from = vf_max(whole->ends[0].t, reach[0]);
    for (vm open = vm_and(rays, vf_lt(from, end)); vm_any(open); open = vm_and(open, vf_lt(from, end))) {
        const vf between[2] = {
            from, kernel_local_find_segment_ends(t, b, whole->rays.at, open, from, whole->ends[1].t, reach[1])};
        vm alone = vm_none();
        for (int n = 0; n < 2; n++)
            alone = vm_or(alone,
                          kernel_local_find_point_at_depth(&chord, whole->ends, open, between[n], type, &part.ends[n]));
        kernel_local_subdivide_intervals(t, &part, vm_andnot(open, alone), type);
        if (__builtin_expect(vm_any(alone), 0))
            kernel_local_add_segments_cell_by_cell(t, whole->rays.at, whole->rays.lane, vm_bits(alone), between, 1);
        from = between[1];
    }
}

static __attribute__((noinline)) void kernel_local_add_cut_segments(kernel_tile_trace *t, kernel_tile_segments *b,
                                                                    const kernel_local_pairs *whole, vm rays,
                                                                    const vf reach[2], int type)
{
    KERNEL_OF_TYPE(type, kernel_local_add_cut_segments_of_type, t, b, whole, rays, reach);
}

/* Appends rays to a list of rays. words: per lane, the word that describes a ray; rays: the lanes that are appended. */
SIMD_INLINE void kernel_local_list_add(kernel_tile_segments *b, int list, vm rays, vi words)
{
    b->list_count[list] += vf_compress(b->list[list] + b->list_count[list], rays, vf_from_bits(words));
}

/* Loads up to SIMD_WIDTH rays from index n on of a list: the words that describe the rays, and the rays themselves.
 * Returns the lanes that contain a ray. */
SIMD_INLINE vm kernel_local_list_load(const kernel_tile_segments *b, int list, const kernel_tile *tile, int n,
                                      vi *words, kernel_lane_rays *rays)
{
    const int left = b->list_count[list] - n;
    const vm all = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    *words = vi_select(all, vi_from_bits(vf_load(b->list[list] + n)), vi_set(0));
    kernel_lane_rays_through_pixels(rays, tile, *words, *words >> KERNEL_LOCAL_CELL);
    return all;
}

/* Finds the crossed faces of up to SIMD_WIDTH rays, from index n on of the list KERNEL_LOCAL_MET. Rays that certainly
 * cross exactly two faces once each are added to KERNEL_LOCAL_CROSSED or KERNEL_LOCAL_CROSSED_TRIANGLE. Rays for which
 * that is uncertain are processed cell by cell. */
SIMD_INLINE void kernel_local_list_crossing_rays(kernel_tile_trace *t, kernel_tile_segments *b, int type, int n)
{
    kernel_lane_rays rays;
    vm two, alone;
    vi words, face[2];
    const vm all = kernel_local_list_load(b, KERNEL_LOCAL_MET, &t->tile, n, &words, &rays);
    kernel_local_find_crossed_faces(&t->thread->tile_cells->curved, &rays, all, type, &two, &alone, face);
    const vm on_quad = kernel_is_crossed_face_a_quad(type, 0, face[0]);
    words = words | face[0] << KERNEL_LOCAL_FACES | face[1] << (KERNEL_LOCAL_FACES + 3);
    kernel_local_list_add(b, KERNEL_LOCAL_CROSSED, vm_and(two, on_quad), words);
    if (kernel_has_triangles(type))
        kernel_local_list_add(b, KERNEL_LOCAL_CROSSED_TRIANGLE, vm_andnot(two, on_quad), words);
    if (__builtin_expect(vm_any(alone), 0)) {
        vf reach[2];
        vf_gather_pair(b->reach, 2 * rays.at, &reach[0], &reach[1]);
        kernel_local_add_segments_cell_by_cell(t, rays.at, rays.lane, vm_bits(alone), reach, 1);
    }
}

/* Adds the segments of up to SIMD_WIDTH rays, from index n on of a list of rays with two crossed faces
 * (KERNEL_LOCAL_CROSSED or KERNEL_LOCAL_CROSSED_TRIANGLE). */
SIMD_INLINE void kernel_local_add_segments_of_listed_rays(kernel_tile_trace *t, kernel_tile_segments *b, int list,
                                                          int type, int n)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_local_pairs p;
    vi words;
    vf end, reach[2];
    p.share = 1;
    p.active = kernel_local_list_load(b, list, &t->tile, n, &words, &p.rays);
    const vi face[2] = {words >> KERNEL_LOCAL_FACES & 7, words >> (KERNEL_LOCAL_FACES + 3) & 7};
    kernel_local_compute_crossing_points(&cells->curved, &p.rays, p.active, type, face, p.ends);
    p.per_t = vf_gather(b->per_t, p.rays.at);
    vf_gather_pair(b->window, 2 * p.rays.at, &p.begin, &end);
    vf_gather_pair(b->reach, 2 * p.rays.at, &reach[0], &reach[1]);
    p.active = vm_and(p.active, vm_and(vf_lt(p.begin, p.ends[1].t), vf_lt(p.ends[0].t, end)));
    const vm cut =
        vm_and(p.active, kernel_local_find_cut_intervals(t, b, p.rays.at, p.active, p.ends[0].t, p.ends[1].t, reach));
    if (__builtin_expect(vm_any(cut), 0)) kernel_local_add_cut_segments(t, b, &p, cut, reach, type);
    p.active = vm_andnot(p.active, cut);
    kernel_local_compute_deviations(&cells->maps, &b->bounds, &p, type);
    const vm alone = vm_and(p.active, p.has_diverged);
    p.active = vm_andnot(p.active, alone);
    const vm coarse = vm_and(p.active, kernel_local_choose_segment_counts(t->frame, b->volume, &b->bounds, &p));
    kernel_local_add_segments(b, &p, vm_andnot(p.active, coarse));
    if (__builtin_expect(vm_any(coarse), 0)) kernel_local_subdivide_intervals(t, &p, coarse, type);
    if (__builtin_expect(vm_any(alone), 0))
        kernel_local_add_segments_cell_by_cell(t, p.rays.at, p.rays.lane, vm_bits(alone), reach, 1);
}

/* Adds rays to the list KERNEL_LOCAL_MET: of the vector of rays that begins at index n of the list of pixels, those
 * that may meet their cells within the window. */
SIMD_INLINE void kernel_local_list_rays_meeting_cells(const kernel_tile_trace *t, const kernel_tile_cells *cells,
                                                      kernel_tile_segments *b, int n)
{
    const vi pixel = kernel_load_bytes(cells->rays.pixel + n);
    kernel_lane_rays rays;
    vf near, far, begin, end;
    kernel_lane_rays_begin(&rays, t, &cells->rays, n);
    const vf depth = kernel_gather_lane(cells->maps.origin[2], rays.lane);
    kernel_local_intersect_slabs(&cells->maps, &rays, depth, &near, &far);
    vf_gather_pair(b->window, 2 * rays.at, &begin, &end);
    const vm meets = vm_and(vf_le(near, far), vm_and(vf_le(begin, depth + far), vf_le(depth + near, end)));
    kernel_local_list_add(b, KERNEL_LOCAL_MET, vm_and(rays.active, meets), pixel | rays.lane << KERNEL_LOCAL_CELL);
}

/* Processes the rays in the list KERNEL_LOCAL_MET: finds the crossed faces, then adds the segments. */
SIMD_INLINE void kernel_local_process_rays_meeting_cells(kernel_tile_trace *t, kernel_tile_segments *b, int type)
{
    const int met = b->list_count[KERNEL_LOCAL_MET];
    b->list_count[KERNEL_LOCAL_CROSSED] = b->list_count[KERNEL_LOCAL_CROSSED_TRIANGLE] = 0;
    for (int n = 0; n < met; n += SIMD_WIDTH) kernel_local_list_crossing_rays(t, b, type, n);
    for (int list = KERNEL_LOCAL_CROSSED; list <= KERNEL_LOCAL_CROSSED_TRIANGLE; list++)
        for (int n = 0; n < b->list_count[list]; n += SIMD_WIDTH)
            kernel_local_add_segments_of_listed_rays(t, b, list, type, n);
}

/* Adds the segments of all rays in the list of pixels, and empties the list. */
static __attribute__((noinline)) void kernel_local_segments_process_pixels(kernel_tile_trace *t, int type)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_tile_segments *b = t->thread->tile_segments;
    kernel_pixel_list_pad(&cells->rays);
    b->list_count[KERNEL_LOCAL_MET] = 0;
    for (int n = 0; n < cells->rays.count; n += SIMD_WIDTH) kernel_local_list_rays_meeting_cells(t, cells, b, n);
    KERNEL_OF_TYPE(type, kernel_local_process_rays_meeting_cells, t, b);
    cells->rays.count = 0;
}

/* ---- cells ---- */

/* Computes the faces and the error bounds of the current vector of cells, which the functions for segments use. */
SIMD_INLINE void kernel_local_prepare_faces_and_bounds(const kernel_tile_trace *t, kernel_tile_cells *cells,
                                                       kernel_tile_segments *s, int type)
{
    kernel_local_prepare_cell_faces(&t->tile, &cells->curved, cells->pixel_ends, type);
    kernel_local_set_nonlinear_bounds(&cells->maps, type, &s->bounds);
    kernel_local_set_light_error_bounds(t->frame, s->volume, (const float(*)[SIMD_WIDTH])cells->curved.at[3], type,
                                        &s->bounds);
}

/* Transforms the current vector of cells into tile space. Returns a mask of the visible cells; *lanes: mask of those
 * that can be processed in lanes. */
static __attribute__((noinline)) unsigned kernel_local_segments_transform(kernel_tile_trace *t, int type,
                                                                          unsigned *lanes)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_tile_segments *s = t->thread->tile_segments;
    const unsigned showing = kernel_local_transform_cells(t, cells, KERNEL_LOCAL_BENT_MOST, lanes, type);
    KERNEL_OF_TYPE(type, kernel_local_prepare_faces_and_bounds, t, cells, s);
    return showing;
}

/* Stores in t->far the farthest depth at which the window of one of the block's active rays ends. */
SIMD_INLINE void kernel_block_set_window_end(kernel_tile_trace *t, const kernel_segments *packets, int block)
{
    vf end = vf_set(-INFINITY);
    for (int i = block * KERNEL_BLOCK_PACKETS; i < (block + 1) * KERNEL_BLOCK_PACKETS; i++)
        end = vf_max(end, vf_select(t->packets[i].active, packets[i].t_end, vf_set(-INFINITY)));
    t->far[block / SIMD_WIDTH][block % SIMD_WIDTH] = vf_reduce_max(end);
}

/* Lowers the depth in t->far of those of the given blocks in which the window of a ray has been shortened, because its
 * list was full. */
SIMD_INLINE void kernel_update_shortened_windows(kernel_tile_trace *t, unsigned blocks)
{
    kernel_segments *packets = t->thread->tile_segments->packets;
    for (; blocks; blocks &= blocks - 1) {
        const int block = __builtin_ctz(blocks);
        bool is_shortened = false;
        for (int i = block * KERNEL_BLOCK_PACKETS; i < (block + 1) * KERNEL_BLOCK_PACKETS; i++) {
            is_shortened = is_shortened || packets[i].is_shortened;
            packets[i].is_shortened = false;
        }
        if (is_shortened) kernel_block_set_window_end(t, packets, block);
    }
}

static void kernel_local_segments_finish(kernel_tile_trace *t, int unused)
{
    (void)unused;
    kernel_update_shortened_windows(t, t->thread->tile_segments->blocks);
}

/* Prepares segments of a volume in a window. Copies, from the packets of the given blocks, each ray's window and the
 * part of the ray in which segments lie into the arrays by packet and lane that functions for segments in lanes
 * read. */
static void kernel_local_segments_begin(const kernel_tile_trace *t, kernel_tile_segments *b, unsigned blocks,
                                        int volume)
{
    const kernel_frame *f = t->frame;
    b->volume = volume;
    b->is_double = f->is_double && !f->job->separate_samples;
    b->has_cuts = f->has_transparent && !f->job->separate_samples;
    b->blocks = blocks;
    for (int i = 0; i < KERNEL_TILE_PIXELS; i++) b->window[2 * i] = INFINITY, b->window[2 * i + 1] = -INFINITY;
    for (; blocks; blocks &= blocks - 1) {
        const int begin = __builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS;
        for (int i = begin; i < begin + KERNEL_BLOCK_PACKETS; i++) {
            const kernel_packet *p = &t->packets[i];
            const kernel_segments *list = &b->packets[i];
            const vf from = vf_select(p->active, list->t_begin, vf_set(INFINITY));
            vf_store(b->per_t + i * SIMD_WIDTH, list->per_t);
            for (int n = 0; n < SIMD_WIDTH; n++) {
                const int at = 2 * (i * SIMD_WIDTH + n);
                b->window[at] = from[n];
                b->window[at + 1] = list->t_end[n];
                b->reach[at] = p->t_near[n];
                b->reach[at + 1] = list->t_cut[n];
            }
        }
    }
}

#endif
