/* Stores the segments of each ray, in an unsorted list of bounded length per ray, until everything in front of them is
 * known. kernel_segments.h defines the terms, and explains how windows of depth keep the lists within their length.
 * Also emits segments as fragments that compositing mixes with those of other volumes. */
#ifndef RENDER_KERNEL_SEGMENT_LIST_H
#define RENDER_KERNEL_SEGMENT_LIST_H

#include <math.h>
#include <string.h>

#include "fragment.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_integral.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_samples.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_WINDOW = 128 }; /* maximum number of segments of a ray in a window */

/* The segments of a packet's rays in a volume and a window of depth. */
typedef struct kernel_segments {
    int count[SIMD_WIDTH]; /* number of segments of each ray */
    /* per ray and segment, unsorted: t_in and t_out (depths, in scaled units), v_in and v_out (in the transfer
     * function's domain) */
    float items[SIMD_WIDTH][KERNEL_WINDOW][4];
    /* Set if the ends of segments are stored in double. `precise` then holds, per ray and segment, the length in unit
     * distances and the rounding errors of v_in and v_out (kernel_unit_segment). Its rows have four numbers like those
     * of `items`, so that one index serves both. */
    bool is_double;
    float precise[SIMD_WIDTH][KERNEL_WINDOW][4];
    int capacity; /* capacity of each ray's list; half as large in double, so that a tile's lists stay in the cache */
    /* Light of the segments that do not fit into a ray's list because more than its capacity begin at the same depth,
     * as in meshes that overlap many times. Such segments have no order. They are integrated at once, and this sum is
     * blended behind the window's other segments. */
    kernel_light unsorted_light;
    vf t_begin, t_end;           /* depth interval of each ray's window */
    bool is_shortened;           /* set if t_end has been lowered since the flag was last cleared */
    vf per_t;                    /* number of unit distances (of the transfer function) per unit of t on each ray */
    const kernel_hits *cut;      /* the packet's crossings of transparent surfaces, which cut segments; NULL: no cuts */
    int volume;                  /* index of the volume */
    const kernel_pieces *pieces; /* the volume's transfer function */
    /* above 0: segments are emitted as fragments, which compositing mixes with those of other volumes
     * (kernel_emit_segment()), and `mixing` is the error of light that this may cause; 0: segments are integrated
     * here */
    float mixing;
    kernel_blend blend;
    vf t_last; /* depth at which the ray ends: at an opaque surface, or behind all cells */
    /* Depth at which segments are cut: at an opaque surface. Segments that compositing mixes with other volumes are cut
     * only at clips, not at this rank's surfaces, so that they are the same on any partition. */
    vf t_cut;
    /* rays of the packet that were active before the first window; saved here because p->active is reduced to rays that
     * have not ended */
    vm active;
} kernel_segments;

/* Returns the lane of the packet that holds the pixel, or -1 if the pixel is not in the packet. */
SIMD_INLINE int kernel_packet_lane_of_pixel(const kernel_packet *p, uint32_t pixel)
{
    const int width = p->frame->job->camera.width, left = width - p->column[0];
    const int columns = left < KERNEL_PACKET_COLUMNS ? left : KERNEL_PACKET_COLUMNS;
    int64_t column = (int64_t)pixel - p->pixel[0];
    for (int row = 0; row < KERNEL_PACKET_ROWS; row++, column -= width)
        if (column >= 0 && column < columns) return row * KERNEL_PACKET_COLUMNS + (int)column;
    return -1;
}

/* Returns for each ray the depth of the first transparent surface at or behind `from` (only behind if `beyond` is set),
 * by a search of all of the tile's fragments; +inf if there is none. The search is used only if a ray crosses more
 * transparent surfaces than kernel_hits stores. */
static vf kernel_find_next_cut_in_fragments(const kernel_packet *p, vf from, bool beyond)
{
    float start[SIMD_WIDTH], next[SIMD_WIDTH];
    vf_store(start, from);
    vf_store(next, vf_set(INFINITY));
    for (int64_t i = 0; i < p->thread->out.count; i++) {
        const fragment *hit = &p->thread->out.items[i];
        if (hit->kind < FRAGMENT_SURFACE) continue;
        const int lane = kernel_packet_lane_of_pixel(p, hit->pixel);
        if (lane < 0) continue;
        if ((beyond ? hit->t_in > start[lane] : hit->t_in >= start[lane]) && hit->t_in < next[lane])
            next[lane] = hit->t_in;
    }
    return vf_load(next);
}

/* Returns the depth of the first transparent surface on each ray at or behind t, or only behind t if `beyond` is set;
 * +inf if there is none. */
SIMD_INLINE vf kernel_find_next_cut(const kernel_packet *p, const kernel_segments *list, vf t, bool beyond)
{
    vf next = vf_set(INFINITY);
    if (!list->cut) return next;
    if (vm_any(list->cut->overflowed)) return kernel_find_next_cut_in_fragments(p, t, beyond);
    for (int i = 0; i < list->cut->cut_count; i++) {
        const vf cut = list->cut->cut[i];
        next = vf_min(vf_select(beyond ? vf_lt(t, cut) : vf_le(t, cut), cut, next), next);
    }
    return next;
}

/* ---- a ray's segments ---- */

/* Sorts the full list of the ray in `lane` by t_in. */
static void kernel_sort_segments_of_lane(kernel_segments *list, int lane)
{
    float(*items)[4] = list->items[lane], (*precise)[4] = list->precise[lane];
    for (int n = 1; n < list->capacity; n++) {
        float own[2][4];
        memcpy(own[0], items[n], sizeof own[0]);
        memcpy(own[1], precise[n], sizeof own[1]);
        int at = n;
        for (; at > 0 && items[at - 1][0] > own[0][0]; at--) {
            memcpy(items[at], items[at - 1], sizeof *items);
            memcpy(precise[at], precise[at - 1], sizeof *precise);
        }
        memcpy(items[at], own[0], sizeof own[0]);
        memcpy(precise[at], own[1], sizeof own[1]);
    }
}

/* Resets the accumulated light of unsorted segments (kernel_segments.unsorted_light) on the ray in `lane`. */
SIMD_INLINE void kernel_unsorted_light_clear(kernel_light *unsorted_light, int lane)
{
    for (int a = 0; a < 3; a++) unsorted_light->colour[a][lane] = 0;
    unsorted_light->depth[lane] = 0;
    unsorted_light->transmittance[lane] = 1;
}

/* Makes space in the full list of a ray (lane) for a segment that begins at t_in: the window is shortened so that it
 * ends where one of the list's farther segments begins, and all segments from there on are dropped; the ray's next
 * window contains them. Returns false if all segments, including the new one, begin at the same depth. */
static __attribute__((noinline, cold)) bool kernel_segments_shorten(kernel_segments *list, int lane, float t_in)
{
    const float(*items)[4] = (const float(*)[4])list->items[lane];
    kernel_sort_segments_of_lane(list, lane);
    int count = list->capacity * 3 / 4;
    const float first = items[0][0], last = items[list->capacity - 1][0];
    if (first == last) {
        if (t_in == first) return false;
        list->t_end[lane] = simd_max(t_in, first);
        if (t_in < first) {
            list->count[lane] = 0;
            kernel_unsorted_light_clear(&list->unsorted_light, lane);
        }
    } else {
        while (items[count][0] == first) count++;
        while (items[count - 1][0] == items[count][0]) count--;
        list->count[lane] = count;
        list->t_end[lane] = items[count][0];
    }
    list->is_shortened = true;
    return true;
}

/* Adds a segment, given as rows of list->items and list->precise, to the list of the ray in `lane`. A segment that does
 * not begin in front of the end of a shortened window is dropped. Returns false if the list is full and all its
 * segments begin at the same depth as this one. */
SIMD_INLINE bool kernel_segments_insert(kernel_segments *list, int lane, const float item[4], const float precise[4])
{
    if (__builtin_expect(list->count[lane] == list->capacity, 0)) {
        if (!kernel_segments_shorten(list, lane, item[0])) return false;
        if (!(item[0] < list->t_end[lane])) return true;
    }
    const int n = list->count[lane]++;
    if (list->is_double) memcpy(list->precise[lane][n], precise, sizeof list->precise[lane][n]);
    memcpy(list->items[lane][n], item, sizeof list->items[lane][n]);
    return true;
}

/* Adds one segment per lane, from t_in to t_out, to the list of the lane's ray, unless the ray's window ends in front
 * of t_in. Segments must not begin in front of the rays' windows. If is_uniform is set, the rays are those of one
 * packet, whose lists are *packets, and `places` is not used. Otherwise `places` has the position of each ray among the
 * tile's packets (packet * SIMD_WIDTH + lane), whose lists begin at `packets`. rays: mask of the lanes that have a
 * segment; run: values at the segments' ends. run->length is used only if the lists are in double. */
SIMD_INLINE void kernel_segments_add(kernel_segments *packets, bool is_uniform, bool is_double, vi places, vm rays,
                                     vf t_in, vf t_out, const kernel_unit_segment *run)
{
    int32_t at[SIMD_WIDTH];
    float all[SIMD_WIDTH][4], doubles[SIMD_WIDTH][4];
    if (!is_uniform) vi_store(at, places);
    const vf ends[4] = {t_in, t_out, run->v_in, run->v_out};
    const vf precise[4] = {run->length, run->rest_in, run->rest_out, vf_set(0)};
    vf_store_rows(all[0], ends);
    if (is_double) vf_store_rows(doubles[0], precise);
    for (unsigned bits = vm_bits(rays); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits), lane = is_uniform ? i : at[i] % SIMD_WIDTH;
        kernel_segments *list = is_uniform ? packets : &packets[at[i] / SIMD_WIDTH];
        if (!(all[i][0] < list->t_end[lane])) continue;
        if (__builtin_expect(kernel_segments_insert(list, lane, all[i], doubles[i]), 1)) continue;
        const float length = is_double ? run->length[i] : (t_out[i] - t_in[i]) * list->per_t[lane];
        const kernel_unit_segment own = {vf_set(length), vf_set(run->v_in[i]), vf_set(run->v_out[i]),
                                         vf_set(run->rest_in[i]), vf_set(run->rest_out[i])};
        kernel_integrate_segments(list->pieces, vm_from_bits(1u << lane), &own, &list->unsorted_light);
    }
}

/* Gathers one of the four floats of a segment, for one segment per ray. member: 0 for t_in, 1 for t_out, 2 for v_in, 3
 * for v_out. item: index of the segment's first float in list->items, counted in floats. */
SIMD_INLINE vf kernel_gather_segment_member(const kernel_segments *list, int member, vi item)
{
    return vf_gather(list->items[0][0] + member, item);
}

/* Returns those of the rays in `same` on which the segment `item` must come before the segment `earlier`. On the rays
 * in `same` both begin at the same depth. `item` must come first if it ends in front of the end of `earlier`, because
 * its length is then 0 in float32. */
static __attribute__((noinline, cold)) vm kernel_segments_compare_equal_begins(const kernel_segments *list, vm same,
                                                                               vi item, vi earlier)
{
    return vm_and(same,
                  vf_lt(kernel_gather_segment_member(list, 1, item), kernel_gather_segment_member(list, 1, earlier)));
}

/* Sorts the segments of all rays by t_in. Element n of the results belongs to the n-th segment of each ray: the depth
 * at which it begins (begins[n]; +inf if the ray has fewer segments), and the index of its first float in list->items
 * (items[n]). Returns the largest number of segments of a ray. The method is insertion sort, because the segments are
 * nearly sorted already: the tree is traversed front to back. */
static int kernel_segments_sort(const kernel_segments *list, vf begins[KERNEL_WINDOW], vi items[KERNEL_WINDOW])
{
    enum { FLOATS = sizeof list->items[0][0] / sizeof(float) };
    int32_t first[SIMD_WIDTH];
    vi firsts, counts;
    int row_count = 0;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        first[lane] = lane * KERNEL_WINDOW * FLOATS;
        row_count = list->count[lane] > row_count ? list->count[lane] : row_count;
    }
    memcpy(&firsts, first, sizeof firsts);
    memcpy(&counts, list->count, sizeof counts);
    const vf count = vf_from_vi(counts);
    for (int n = 0; n < row_count; n++) {
        const vm has = vf_lt(vf_set((float)n), count);
        vi item = (vi)vf_select(has, (vf)(firsts + n * FLOATS), (vf)firsts);
        vf t_in = vf_select(has, kernel_gather_segment_member(list, 0, item), vf_set(INFINITY));
        int at = n;
        for (; at > 0; at--) {
            const vf before = begins[at - 1];
            const vi earlier = items[at - 1];
            vm moves = vf_lt(t_in, before);
            if (list->is_double) {
                const vm same = vm_and(vf_eq(t_in, before), vf_lt(t_in, vf_set(INFINITY)));
                if (__builtin_expect(vm_any(same), 0))
                    moves = vm_or(moves, kernel_segments_compare_equal_begins(list, same, item, earlier));
            }
            if (!vm_any(moves)) break;
            begins[at] = vf_select(moves, before, t_in);
            items[at] = (vi)vf_select(moves, (vf)earlier, (vf)item);
            t_in = vf_select(moves, t_in, before);
            item = (vi)vf_select(moves, (vf)item, (vf)earlier);
        }
        begins[at] = t_in;
        items[at] = item;
    }
    return row_count;
}

/* ---- division of segments for compositing ---- */

/* Maximum number of equal parts into which a segment is divided for mixing. */
enum { KERNEL_MAX_SUBDIVISIONS = 256 };
/* Optical depth at which the transmittance exp(-depth) is KERNEL_BLACK or slightly more. */
#define KERNEL_DARK_DEPTH 18.4f

/* Returns the rounded sum a + b; *lost becomes the rounding error, computed exactly (Knuth). */
SIMD_INLINE vf kernel_add_with_rounding_error(vf a, vf b, vf *lost)
{
    const vf sum = a + b, other = sum - a;
    *lost = (a - (sum - other)) + (b - other);
    return sum;
}

/* Returns the part of each ray's segment between the positions `from` and `to`, which are shares of the segment's
 * length. */
SIMD_INLINE kernel_unit_segment kernel_cut_part_of_unit_segment(const kernel_unit_segment *whole, vf from, vf to)
{
    const vf rise = (whole->v_out - whole->v_in) + (whole->rest_out - whole->rest_in);
    const vm begins = vf_eq(from, vf_set(0)), ends = vf_eq(to, vf_set(1));
    kernel_unit_segment out = {.length = whole->length * (to - from)};
    out.v_in = vf_select(begins, whole->v_in,
                         kernel_add_with_rounding_error(whole->v_in, rise * from + whole->rest_in, &out.rest_in));
    out.v_out = vf_select(ends, whole->v_out,
                          kernel_add_with_rounding_error(whole->v_in, rise * to + whole->rest_in, &out.rest_out));
    out.rest_in = vf_select(begins, whole->rest_in, out.rest_in);
    out.rest_out = vf_select(ends, whole->rest_out, out.rest_out);
    return out;
}

/* Returns the end of a part of a segment, for segments that are divided into parts so that compositing can mix them.
 * The part begins at `from`; both ends are shares of the segment's length. share: length of a part
 * (kernel_choose_share_of_mixed_part()). A part also ends where the opacity has a step. */
SIMD_INLINE vf kernel_find_end_of_mixed_part(const kernel_pieces *t, const kernel_unit_segment *whole, vf share,
                                             vf from)
{
    const vf one = vf_set(1), inverse = one / (whole->v_out - whole->v_in);
    vf to = vf_select(vf_lt(from + 1.5f * share, one), from + share, one);
    for (int i = 0; i < t->step_count; i++) {
        const vf cut = (kernel_round_opacity_step(t->steps[i]) - whole->v_in) * inverse;
        to = vf_select(vf_lt(from, cut), vf_min(cut, to), to);
    }
    return to;
}

/* Returns the share of a segment's length that one fragment may have if compositing mixes it with fragments of other
 * volumes. Compositing treats a fragment as a uniform medium (comp.h). Let d be the optical depth of the fragment, and
 * v the relative variation of its extinction and colour. Then at most d v / 4 of its light is displaced, and the effect
 * is proportional to the other volumes' optical depth in the same interval. That depth, times the light that arrives
 * there, sums to at most 1 over a ray; so d v / 4 may be the whole error that mixing is allowed. Let s be the
 * extinction, c the colour, b the light from behind, R the contrast, and s' and c' the derivatives by the value. Then d
 * v is at most (R |s'| + s |c'|) times the change of the value times the length, and s |c'| is at most the cost
 * (kernel_look_up_light_error_bounds()), which bounds |s c' + s' (c - b)| for all b, among them b = c. */
SIMD_INLINE vf kernel_choose_share_of_mixed_part(const kernel_segments *list, const kernel_unit_segment *run)
{
    const kernel_pieces *t = list->pieces;
    const vf low = vf_min(run->v_in, run->v_out), high = vf_max(run->v_in, run->v_out);
    vf bounds[KERNEL_LIGHT_ENTRIES];
    kernel_look_up_light_error_bounds(t, low, high, bounds);
    const vf most = bounds[KERNEL_LIGHT_STEEPNESS] + bounds[KERNEL_LIGHT_COST];
    const vf moved = (high - low) * most * run->length * 0.25f;
    const vf count = vf_min(-vf_floor(-vf_sqrt(moved / list->mixing)), vf_set(KERNEL_MAX_SUBDIVISIONS));
    return 1.0f / vf_max(count, vf_set(1));
}

/* Emits one segment per ray as fragments, which compositing mixes with those of other volumes by their optical depths.
 * kernel_integrate_segments() stops once all light but KERNEL_BLACK is absorbed, so that the depth of a very dense
 * fragment would be too small. Therefore such a fragment is bisected until its parts are less dense. Emission ends when
 * no light is left. */
static __attribute__((noinline)) void kernel_emit_segment(kernel_packet *p, const kernel_segments *list, vm rays,
                                                          vf t_in, vf t_out, const kernel_unit_segment *whole)
{
    const vf one = vf_set(1), black = vf_set(KERNEL_BLACK), share = kernel_choose_share_of_mixed_part(list, whole);
    vf from = vf_set(0), to = kernel_find_end_of_mixed_part(list->pieces, whole, share, from), depth = vf_set(0);
    for (vm open = rays; vm_any(open);) {
        kernel_light light = kernel_light_none();
        const kernel_unit_segment run = kernel_cut_part_of_unit_segment(whole, from, to);
        const vf begin = t_in + (t_out - t_in) * from;
        const vf end = vf_select(vf_eq(to, one), t_out, t_in + (t_out - t_in) * to), middle = 0.5f * (from + to);
        kernel_integrate_segments(list->pieces, open, &run, &light);
        const vm cut = vm_and(open, vm_and(vf_le(light.transmittance, black),
                                           vm_and(vf_lt(begin, t_in + (t_out - t_in) * middle), vf_lt(middle, to))));
        const vm put = vm_andnot(open, cut);
        const kernel_fragments segment = {
            begin, end, {light.colour[0], light.colour[1], light.colour[2]}, light.transmittance, vf_set(0)};
        kernel_append_fragments(p, vm_and(put, kernel_fragment_is_visible(light.colour, light.transmittance)),
                                FRAGMENT_VOLUME, &segment);
        depth += vf_select(put, light.depth, vf_set(0));
        open = vm_andnot(open, vm_and(put, vm_or(vf_eq(to, one), vf_lt(vf_set(KERNEL_DARK_DEPTH), depth))));
        from = vf_select(put, to, from);
        to =
            vf_select(cut, middle, vf_select(put, kernel_find_end_of_mixed_part(list->pieces, whole, share, from), to));
    }
}

#endif
