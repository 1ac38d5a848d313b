/* Stores the segments of each ray until everything in front of them is known: one unsorted list of bounded length per
 * ray. kernel_segments.h explains how windows of depth work with this bounded length. Then decides into how many
 * segments a ray's interval in a cell is divided. */
#ifndef RENDER_KERNEL_SEGMENT_LIST_H
#define RENDER_KERNEL_SEGMENT_LIST_H

#include <math.h>
#include <string.h>

#include "fragment.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_exact.h"
#include "kernel_hits.h"
#include "kernel_integral.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_samples.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_WINDOW = 128 };

typedef struct kernel_segment {
    float t_in, t_out, v_in, v_out;
} kernel_segment;

/* Length in unit distances and rounding errors of a segment's values, used if the ends of segments are stored in double
 * (one lane of kernel_unit_segment). It is as large as kernel_segment, so that one index serves both. */
typedef struct kernel_segment_double {
    float length, rest_in, rest_out, unused;
} kernel_segment_double;

/* The segments of a packet's rays in a volume and a window of depth. */
typedef struct kernel_segments {
    int count[SIMD_WIDTH];
    kernel_segment items[SIMD_WIDTH][KERNEL_WINDOW]; /* segments of each ray, unsorted */
    kernel_segment_double precise[SIMD_WIDTH][KERNEL_WINDOW];
    bool is_double; /* set if the ends of segments are stored in double */
    int capacity;   /* capacity of each ray's list; half as large in double, so that a tile's lists stay in the cache */
    kernel_double_rays rays;
    /* Light of the segments that do not fit into a list because too many begin at the same t, as in meshes that overlap
     * many times. Such segments have no order; they are integrated here at once, and blended behind the window. */
    kernel_light unsorted_light;
    vf t_begin, t_end;      /* depth interval of each ray's window */
    bool is_shortened;      /* set if t_end has been lowered since the flag was last cleared */
    vf per_t;               /* number of unit distances (of the transfer function) per unit of t on each ray */
    const kernel_hits *cut; /* the packet's crossings of transparent surfaces, which cut segments; NULL: no cuts */
    int volume;
    const kernel_pieces *pieces;
    /* error allowed per share of the ray's length and of its absorption; 0: subintervals are as long as the sampling
     * step */
    float allowance;
    /* > 0: error allowed by mixing; segments are then emitted at once, to be mixed with other volumes
     * (kernel_cell_interval_subdivisions_mixed()) */
    float mixing;
    float reach; /* upper bound of a ray's length in the cells, in unit distances */
    kernel_blend blend;
    vf t_last; /* depth at which the ray ends: at an opaque surface, or behind all cells */
    /* active rays of the packet, saved here because the packet's own mask is reduced to rays that have not ended */
    vm active;
} kernel_segments;

/* Returns whether segments can be integrated one ray-cell pair per lane. They cannot if transparent surfaces cut them,
 * or if each becomes a fragment of its own. */
SIMD_INLINE bool kernel_segments_use_lanes(const kernel_frame *f)
{
    return !f->has_transparent && !f->job->separate_samples;
}

/* Returns the lane of the packet that holds the pixel, or -1 if the pixel is not in the packet. */
SIMD_INLINE int kernel_packet_lane_of_pixel(const kernel_packet *p, uint32_t pixel)
{
    const int width = p->frame->job->camera.width, left = width - p->x0;
    const int columns = left < KERNEL_PACKET_COLUMNS ? left : KERNEL_PACKET_COLUMNS;
    int64_t column = (int64_t)pixel - p->pixel[0];
    for (int row = 0; row < KERNEL_PACKET_ROWS; row++, column -= width)
        if (column >= 0 && column < columns) return row * KERNEL_PACKET_COLUMNS + (int)column;
    return -1;
}

/* Finds the next depth at which transparent surfaces cut each ray, by a search of all of the tile's fragments. It is
 * used if a ray has more such depths than kernel_hits stores. */
static vf kernel_next_cut_by_search(const kernel_packet *p, vf from, bool beyond)
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
SIMD_INLINE vf kernel_next_cut(const kernel_packet *p, const kernel_segments *list, vf t, bool beyond)
{
    vf next = vf_set(INFINITY);
    if (!list->cut) return next;
    if (vm_any(list->cut->overflowed)) return kernel_next_cut_by_search(p, t, beyond);
    for (int i = 0; i < list->cut->cut_count; i++) {
        const vf cut = list->cut->cut[i];
        next = vf_min(vf_select(beyond ? vf_lt(t, cut) : vf_le(t, cut), cut, next), next);
    }
    return next;
}

/* ---- a ray's segments ---- */

SIMD_INLINE void kernel_segments_set_double(const kernel_packet *p, kernel_segments *list, bool is_double)
{
    list->is_double = is_double;
    list->capacity = is_double ? KERNEL_WINDOW / 2 : KERNEL_WINDOW;
    if (is_double) kernel_double_rays_of(p, &list->rays);
}

static void kernel_items_sort(kernel_segments *list, int lane)
{
    kernel_segment *items = list->items[lane];
    kernel_segment_double *precise = list->precise[lane];
    for (int n = 1; n < list->capacity; n++) {
        const kernel_segment s = items[n];
        const kernel_segment_double its = precise[n];
        int at = n;
        for (; at > 0 && items[at - 1].t_in > s.t_in; at--) {
            items[at] = items[at - 1];
            precise[at] = precise[at - 1];
        }
        items[at] = s;
        precise[at] = its;
    }
}

SIMD_INLINE void kernel_heap_clear(kernel_light *unsorted_light, int lane)
{
    for (int a = 0; a < 3; a++) unsorted_light->colour[a][lane] = 0;
    unsorted_light->depth[lane] = 0;
    unsorted_light->transmittance[lane] = 1;
}

/* Makes space in a full list: the window ends at the begin of one of its farther segments, and all segments from there
 * on are dropped. Returns false if all segments, including the new one, begin at the same depth. */
static __attribute__((noinline, cold)) bool kernel_segments_shorten(kernel_segments *list, int lane,
                                                                    const kernel_segment *s)
{
    kernel_segment *items = list->items[lane];
    kernel_items_sort(list, lane);
    int count = list->capacity * 3 / 4;
    const float first = items[0].t_in, last = items[list->capacity - 1].t_in;
    if (first == last) {
        if (s->t_in == first) return false;
        list->t_end[lane] = simd_max(s->t_in, first);
        if (s->t_in < first) {
            list->count[lane] = 0;
            kernel_heap_clear(&list->unsorted_light, lane);
        }
    } else {
        while (items[count].t_in == first) count++;
        while (items[count - 1].t_in == items[count].t_in) count--;
        list->count[lane] = count;
        list->t_end[lane] = items[count].t_in;
    }
    list->is_shortened = true;
    return true;
}

/* Adds a segment to a ray's list. Returns false if the list is full and all its segments begin at the same t. */
SIMD_INLINE bool kernel_segments_insert(kernel_segments *list, int lane, const kernel_segment *s,
                                        const kernel_segment_double *precise)
{
    if (__builtin_expect(list->count[lane] == list->capacity, 0)) {
        if (!kernel_segments_shorten(list, lane, s)) return false;
        if (!(s->t_in < list->t_end[lane])) return true;
    }
    if (list->is_double) list->precise[lane][list->count[lane]] = *precise;
    list->items[lane][list->count[lane]++] = *s;
    return true;
}

/* Adds a segment from t_in to t_out to the list of each given ray. Segments must begin in the rays' windows. */
static __attribute__((noinline)) void kernel_segments_add(kernel_segments *list, vm rays, vf t_in, vf t_out,
                                                          const kernel_unit_segment *run)
{
    kernel_segment all[SIMD_WIDTH];
    kernel_segment_double doubles[SIMD_WIDTH];
    const vf ends[4] = {t_in, t_out, run->v_in, run->v_out};
    const vf precise[4] = {run->length, run->rest_in, run->rest_out, vf_set(0)};
    unsigned bits = vm_bits(rays), left = 0;
    if (!bits) return;
    vf_store_rows(&all[0].t_in, ends);
    if (list->is_double) vf_store_rows(&doubles[0].length, precise);
    for (; bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits);
        if (!kernel_segments_insert(list, lane, &all[lane], &doubles[lane])) left |= bits & -bits;
    }
    if (__builtin_expect(left != 0, 0)) kernel_integrate(list->pieces, vm_from_bits(left), run, &list->unsorted_light);
}

/* The packet's segments sorted by t_in: row n holds the n-th segment of each ray. */
typedef struct kernel_sorted {
    int row_count;
    vf t_in[KERNEL_WINDOW]; /* +inf if a ray has fewer segments */
    vi item[KERNEL_WINDOW]; /* position of the segment, in floats from list->items on */
} kernel_sorted;

SIMD_INLINE vf kernel_items_gather(const kernel_segments *list, int member, vi item)
{
    return vf_gather(&list->items[0][0].t_in + member, item);
}

/* Returns the rays on which the two segments begin at the same t and `item` ends before `earlier`: it has length 0 in
 * float32 and must come first. */
static __attribute__((noinline, cold)) vm kernel_segments_begin_equal(const kernel_segments *list, vm same, vi item,
                                                                      vi earlier)
{
    return vm_and(same, vf_lt(kernel_items_gather(list, 1, item), kernel_items_gather(list, 1, earlier)));
}

/* Sorts the segments of all rays by insertion. They are nearly sorted already, because the traversal is front to
 * back. */
static void kernel_segments_sort(const kernel_segments *list, kernel_sorted *out)
{
    enum { FLOATS = sizeof(kernel_segment) / sizeof(float) };
    int32_t first[SIMD_WIDTH];
    vi firsts, counts;
    out->row_count = 0;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        first[lane] = lane * KERNEL_WINDOW * FLOATS;
        out->row_count = list->count[lane] > out->row_count ? list->count[lane] : out->row_count;
    }
    memcpy(&firsts, first, sizeof firsts);
    memcpy(&counts, list->count, sizeof counts);
    const vf count = vf_from_vi(counts);
    for (int n = 0; n < out->row_count; n++) {
        const vm has = vf_lt(vf_set((float)n), count);
        vi item = (vi)vf_select(has, (vf)(firsts + n * FLOATS), (vf)firsts);
        vf t_in = vf_select(has, kernel_items_gather(list, 0, item), vf_set(INFINITY));
        int at = n;
        for (; at > 0; at--) {
            const vf before = out->t_in[at - 1];
            const vi earlier = out->item[at - 1];
            vm moves = vf_lt(t_in, before);
            if (list->is_double) {
                const vm same = vm_and(vf_eq(t_in, before), vf_lt(t_in, vf_set(INFINITY)));
                if (__builtin_expect(vm_any(same), 0))
                    moves = vm_or(moves, kernel_segments_begin_equal(list, same, item, earlier));
            }
            if (!vm_any(moves)) break;
            out->t_in[at] = vf_select(moves, before, t_in);
            out->item[at] = (vi)vf_select(moves, (vf)earlier, (vf)item);
            t_in = vf_select(moves, t_in, before);
            item = (vi)vf_select(moves, (vf)item, (vf)earlier);
        }
        out->t_in[at] = t_in;
        out->item[at] = item;
    }
}

/* The following part decides how a ray's interval in a cell is divided into segments, each with a linear field
 * (kernel_segments.h): into equal subintervals or, if these are not accurate enough, by bisection
 * (kernel_cell_segments.h). */

/* Maximum number of equal subintervals of an interval. */
enum { KERNEL_MAX_SUBDIVISIONS = 256 };
/* Optical depth at which the transmittance exp(-depth) is KERNEL_BLACK or slightly more. */
#define KERNEL_DARK_DEPTH 18.4f

/* The interval of a ray in the current cell, how the field is computed along it, and the accuracy that is required. */
typedef struct kernel_cell_interval {
    const kernel_map *map; /* inverse map of the cell; NULL if the field is linear */
    /* the cell; NULL for a tet or a polyhedron; if `map` is NULL, the cell's field is constant */
    const kernel_cell *cell;
    const kernel_interval *interval;
    const kernel_unit_segment *precise; /* a tet's whole interval as a segment, computed in double; or NULL */
    float cost; /* change of light per unit distance for a field error of 1; 0 if neither error nor mixing is limited */
    /* first of the opacity's steps that lie within the range of the cell's values, and their number */
    int first_step, step_count;
    /* set if a steep ramp, or a narrow ramp, lies within the range of the cell's values */
    bool is_steep, is_narrow;
} kernel_cell_interval;

/* Returns bounds of the transfer function over the values from low to high. Steps of the opacity are not included. */
SIMD_INLINE kernel_bound kernel_bound_between(const kernel_pieces *t, float low, float high)
{
    const float last = KERNEL_BOUND_BINS - 1;
    const int from = (int)simd_min(simd_max((low - t->bin_low) * t->bound_inverse, 0), last);
    const int to = (int)simd_min(simd_max((high - t->bin_low) * t->bound_inverse, 0), last);
    kernel_bound b = t->bounds[from];
    for (int i = from + 1; i <= to; i++) {
        b.extinction_low = simd_min(t->bounds[i].extinction_low, b.extinction_low);
        b.extinction_high = simd_max(t->bounds[i].extinction_high, b.extinction_high);
        b.extinction_slope = simd_max(t->bounds[i].extinction_slope, b.extinction_slope);
        b.colour_slope = simd_max(t->bounds[i].colour_slope, b.colour_slope);
    }
    return b;
}

/* Returns an upper bound of the change of light per unit distance for a field error of 1. With extinction s and colour
 * c, a field error d changes the light by at most T (contrast |s'| + s |c'|) d per unit distance
 * (docs/development/error_budget.md). */
SIMD_INLINE float kernel_bound_cost(const kernel_pieces *t, const kernel_bound *b)
{
    return simd_min(t->contrast * b->extinction_slope + b->extinction_high * b->colour_slope, 1e30f);
}

/* Computes the maximum of this change of light over the cell's values, and finds the steps and ramps within these
 * values. */
SIMD_INLINE void kernel_cell_interval_bound(const kernel_segments *list, const float *values, int count,
                                            kernel_cell_interval *out)
{
    const kernel_pieces *t = list->pieces;
    float low = values[0], high = low;
    if (!(list->allowance > 0) && !(list->mixing > 0)) return;
    for (int i = 1; i < count; i++) {
        low = simd_min(values[i], low);
        high = simd_max(values[i], high);
    }
    const kernel_bound b = kernel_bound_between(t, low, high);
    out->cost = kernel_bound_cost(t, &b);
    while (out->first_step < t->step_count && t->steps[out->first_step].cut < low) out->first_step++;
    while (out->first_step + out->step_count < t->step_count && t->steps[out->first_step + out->step_count].cut <= high)
        out->step_count++;
    for (int i = 0; i < t->steep_count; i++) {
        const bool is_met = low <= t->steep[i].high && t->steep[i].low <= high;
        out->is_steep = out->is_steep || is_met;
        out->is_narrow = out->is_narrow || (is_met && t->steep[i].is_narrow);
    }
}

SIMD_INLINE vf kernel_cell_interval_value(kernel_packet *p, const kernel_cell_interval *cell_interval, vm rays, vf t)
{
    const kernel_interval *i = cell_interval->interval;
    return cell_interval->map ? kernel_value_at(p, cell_interval->map, i, rays, t) : kernel_line_value(i, t);
}

/* Returns the rays whose values from low to high meet a steep ramp, or, if is_narrow is set, a narrow one. */
SIMD_INLINE vm kernel_values_are_steep(const kernel_pieces *t, vf low, vf high, bool is_narrow)
{
    vm any = vm_none();
    for (int i = 0; i < t->steep_count; i++) {
        const kernel_steep *steep = &t->steep[i];
        if (is_narrow && !steep->is_narrow) continue;
        any = vm_or(any, vm_and(vf_le(low, vf_set(steep->high)), vf_le(vf_set(steep->low), high)));
    }
    return any;
}

/* Returns the rays whose values from low to high contain one of the opacity's steps first .. first + count - 1. */
SIMD_INLINE vm kernel_values_have_step(const kernel_pieces *t, int first, int count, vf low, vf high)
{
    vm any = vm_none();
    for (int i = first; i < first + count; i++) {
        const vf cut = vf_set(t->steps[i].cut);
        any = vm_or(any, vm_and(vf_le(low, cut), vf_le(cut, high)));
    }
    return any;
}

/* Rounding of an interval's values in float32, relative to max(1, |value|). docs/development/error_budget.md derives at
 * most 4e-7. */
#define KERNEL_VALUE_ROUNDING 1e-6f

enum { KERNEL_DEVIATION_SAMPLES = 8 };

/* Deviation of the field from the chord between its values at the interval's ends, sampled at each eighth of the
 * interval. */
typedef struct kernel_cell_interval_deviation {
    vf most;
    /* deviation at the middle of a parabola whose second derivative is the mean absolute one of the field */
    vf bend;
    vf opacity; /* mean opacity along the interval, from samples at its quarters */
} kernel_cell_interval_deviation;

/* Returns the mean size of the field's second derivative, as a deviation (kernel_cell_interval_deviation.bend).
 * Subintervals of length h deviate from their chords by h^2 / 12 of the second derivative on average, and the error of
 * light is the integral of that. Second differences over an eighth give the mean size; towards the ends they are
 * extrapolated. */
SIMD_INLINE vf kernel_cell_interval_curvature(const vf off[KERNEL_DEVIATION_SAMPLES + 1])
{
    vf second[KERNEL_DEVIATION_SAMPLES], sum = vf_set(0);
    for (int i = 1; i < KERNEL_DEVIATION_SAMPLES; i++) {
        second[i] = (off[i + 1] - off[i]) - (off[i] - off[i - 1]);
        sum += vf_abs(second[i]);
    }
    const vf begin = 2.0f * second[1] - second[2];
    const vf end = 2.0f * second[KERNEL_DEVIATION_SAMPLES - 1] - second[KERNEL_DEVIATION_SAMPLES - 2];
    return sum + 0.5f * (vf_abs(begin) + vf_abs(end));
}

SIMD_INLINE void kernel_cell_interval_deviate(kernel_packet *p, const kernel_segments *list,
                                              const kernel_cell_interval *cell_interval, vm rays,
                                              const kernel_interval *stretch, kernel_cell_interval_deviation *out)
{
    const vf t0 = stretch->t_in, length = stretch->t_out - t0, v0 = stretch->v_in, v1 = stretch->v_out;
    const kernel_transfer *transfer = &p->frame->volumes[list->volume];
    vf off[KERNEL_DEVIATION_SAMPLES + 1];
    off[0] = off[KERNEL_DEVIATION_SAMPLES] = out->most = vf_set(0);
    out->opacity = 0.125f * (kernel_opacity(transfer, v0) + kernel_opacity(transfer, v1));
    for (int i = 1; i < KERNEL_DEVIATION_SAMPLES; i++) {
        const float share = (1.0f / KERNEL_DEVIATION_SAMPLES) * (float)i;
        const vf v = kernel_value_at(p, cell_interval->map, cell_interval->interval, rays, t0 + length * share);
        off[i] = v - (v0 + (v1 - v0) * share);
        out->most = vf_max(out->most, vf_abs(off[i]));
        if (i % 2 == 0) out->opacity += 0.25f * kernel_opacity(transfer, v);
    }
    out->bend = kernel_cell_interval_curvature(off);
}

/* Returns the number of subintervals, as a real number, into which the interval must be divided, and stores the largest
 * deviation of its field from the chord.
 *
 * With n subintervals, each deviates from its chord by 1 / n^2 of the bend, two thirds of that on average; the bound
 * uses 1.5 times as much. Second differences accumulate the values' rounding, which is subtracted, but the bend is
 * never less than the largest deviation. The error allowed is the interval's share of the ray's length and of its
 * absorption, 1 - exp(-depth) >= depth / (1 + depth), with the opacity as a lower bound of the extinction.
 *
 * No number is enough in three cases: if a step of the opacity lies among the values; if a steep ramp does and too many
 * subintervals would be needed; or if a narrow ramp does in which the values' rounding alone would use an eighth of the
 * allowed error. */
SIMD_INLINE vf kernel_cell_interval_subdivisions_curved(kernel_packet *p, const kernel_segments *list,
                                                        const kernel_cell_interval *cell_interval, vm rays,
                                                        const kernel_interval *stretch, vf *deviation)
{
    const vf length = stretch->t_out - stretch->t_in, v0 = stretch->v_in, v1 = stretch->v_out;
    kernel_cell_interval_deviation off;
    kernel_cell_interval_deviate(p, list, cell_interval, rays, stretch, &off);
    const vf largest = vf_max(vf_max(vf_abs(v0), vf_abs(v1)), vf_set(1));
    const vf bend = vf_max(off.most, off.bend - 0.5f * KERNEL_VALUE_ROUNDING * largest);
    const vf distance = length * list->per_t, depth = distance * off.opacity;
    const vf allowed = list->allowance * (distance / list->reach + depth / (1.0f + depth));
    const vf made = bend * cell_interval->cost * distance; /* a factor 3/2 and a factor 2/3 cancel each other */
    *deviation = off.most;
    const vf wanted = vf_sqrt(vf_min(made / vf_max(allowed, vf_set(1e-30f)), vf_set(1e6f)));
    const vf subdivisions = vf_min(wanted, vf_set(KERNEL_MAX_SUBDIVISIONS));
    if (!cell_interval->step_count && !cell_interval->is_steep) return subdivisions;
    const vf wide = 1.5f * off.most + KERNEL_VALUE_ROUNDING * largest, low = vf_min(v0, v1) - wide,
             high = vf_max(v0, v1) + wide;
    vm too_few = kernel_values_have_step(list->pieces, cell_interval->first_step, cell_interval->step_count, low, high);
    if (cell_interval->is_steep) {
        const vm many = vf_lt(vf_set(KERNEL_MAX_SUBDIVISIONS), wanted);
        too_few = vm_or(too_few, vm_and(many, kernel_values_are_steep(list->pieces, low, high, false)));
    }
    if (cell_interval->is_narrow) {
        const vf rounded = (8 * KERNEL_VALUE_ROUNDING) * largest * cell_interval->cost * distance;
        const vm shows = vf_lt(allowed, rounded);
        too_few = vm_or(too_few, vm_and(shows, kernel_values_are_steep(list->pieces, low, high, true)));
    }
    return vf_select(too_few, vf_set(2 * KERNEL_MAX_SUBDIVISIONS), subdivisions);
}

/* Returns the number of subintervals if compositing mixes the interval with other volumes, which it treats as a uniform
 * medium (comp.h). In an interval of depth d whose extinction and colour vary by a share v, at most d v / 4 is
 * displaced from its assumed position, and the effect on light is attenuated by the other volumes' depth in the
 * interval. That depth, times the light that arrives there, sums to 1 over a ray; so d v / 4 may be the whole error
 * allowed. */
SIMD_INLINE vf kernel_cell_interval_subdivisions_mixed(const kernel_segments *list,
                                                       const kernel_cell_interval *cell_interval, vf length, vf change)
{
    const vf moved = change * cell_interval->cost * (length * list->per_t) * 0.25f;
    return vf_sqrt(vf_min(moved / list->mixing, vf_set(1e6f)));
}

/* Returns the number of equal subintervals into which each ray's interval is divided. *halved receives the rays for
 * which no number is accurate enough, so that their intervals must be divided by bisection. */
SIMD_INLINE vf kernel_cell_interval_subdivisions(kernel_packet *p, const kernel_segments *list,
                                                 const kernel_cell_interval *cell_interval, vm rays,
                                                 const kernel_interval *stretch, vm *halved)
{
    const vf length = stretch->t_out - stretch->t_in, most = vf_set(KERNEL_MAX_SUBDIVISIONS);
    const vf v0 = stretch->v_in, v1 = stretch->v_out;
    vf subdivisions = vf_set(1), off = vf_set(0);
    *halved = vm_none();
    if (cell_interval->map && list->allowance > 0) {
        subdivisions = kernel_cell_interval_subdivisions_curved(p, list, cell_interval, rays, stretch, &off);
        *halved = vm_and(rays, vf_lt(most, subdivisions));
    } else if (cell_interval->map) {
        subdivisions = length / p->sample_step;
        if (cell_interval->step_count && list->mixing > 0) {
            const vf wanted = kernel_cell_interval_subdivisions_curved(p, list, cell_interval, rays, stretch, &off);
            *halved = vm_and(rays, vf_lt(most, wanted));
        }
    } else if (cell_interval->step_count && list->mixing > 0) {
        *halved = vm_and(rays, kernel_values_have_step(list->pieces, cell_interval->first_step,
                                                       cell_interval->step_count, vf_min(v0, v1), vf_max(v0, v1)));
    } else if (cell_interval->is_narrow && cell_interval->cell) {
        *halved = rays;
    }
    if (list->mixing > 0)
        subdivisions = vf_max(subdivisions, kernel_cell_interval_subdivisions_mixed(list, cell_interval, length,
                                                                                    vf_abs(v1 - v0) + 2.0f * off));
    return vf_clamp(-vf_floor(-subdivisions), vf_set(1), most);
}

/* Returns the rounded sum a + b; *lost becomes the rounding error, computed exactly (Knuth). */
SIMD_INLINE vf kernel_exact_sum(vf a, vf b, vf *lost)
{
    const vf sum = a + b, other = sum - a;
    *lost = (a - (sum - other)) + (b - other);
    return sum;
}

/* Returns the part of a segment between two positions, which are given as shares of the segment's length. */
SIMD_INLINE kernel_unit_segment kernel_unit_segment_part(const kernel_unit_segment *whole, vf from, vf to)
{
    const vf rise = (whole->v_out - whole->v_in) + (whole->rest_out - whole->rest_in);
    const vm begins = vf_eq(from, vf_set(0)), ends = vf_eq(to, vf_set(1));
    kernel_unit_segment out = {.length = whole->length * (to - from)};
    out.v_in =
        vf_select(begins, whole->v_in, kernel_exact_sum(whole->v_in, rise * from + whole->rest_in, &out.rest_in));
    out.v_out = vf_select(ends, whole->v_out, kernel_exact_sum(whole->v_in, rise * to + whole->rest_in, &out.rest_out));
    out.rest_in = vf_select(begins, whole->rest_in, out.rest_in);
    out.rest_out = vf_select(ends, whole->rest_out, out.rest_out);
    return out;
}

/* Emits a segment as a fragment of its own. kernel_integrate() stops once all but KERNEL_BLACK of the light is
 * absorbed, so that its depth is then too small; but compositing mixes fragments by their depth. So a segment that is
 * so dense is bisected until its parts are not, and emission ends when no light is left. */
static void kernel_emit_segment(kernel_packet *p, const kernel_segments *list, vm rays, vf t_in, vf t_out,
                                const kernel_unit_segment *whole)
{
    const vf one = vf_set(1), black = vf_set(KERNEL_BLACK);
    vf from = vf_set(0), to = one, depth = vf_set(0);
    for (vm open = rays; vm_any(open);) {
        kernel_light light = kernel_light_none();
        const kernel_unit_segment run = kernel_unit_segment_part(whole, from, to);
        const vf begin = t_in + (t_out - t_in) * from;
        const vf end = vf_select(vf_eq(to, one), t_out, t_in + (t_out - t_in) * to), middle = 0.5f * (from + to);
        kernel_integrate(list->pieces, open, &run, &light);
        const vm cut = vm_and(open, vm_and(vf_le(light.transmittance, black),
                                           vm_and(vf_lt(begin, t_in + (t_out - t_in) * middle), vf_lt(middle, to))));
        const vm put = vm_andnot(open, cut);
        const kernel_fragments segment = {
            begin, end, {light.colour[0], light.colour[1], light.colour[2]}, light.transmittance, vf_set(0)};
        kernel_emit(p, vm_and(put, kernel_fragment_is_visible(light.colour, light.transmittance)), FRAGMENT_VOLUME,
                    &segment);
        depth += vf_select(put, light.depth, vf_set(0));
        open = vm_andnot(open, vm_and(put, vm_or(vf_eq(to, one), vf_lt(vf_set(KERNEL_DARK_DEPTH), depth))));
        from = vf_select(put, to, from);
        to = vf_select(cut, middle, vf_select(put, one, to));
    }
}

#endif
