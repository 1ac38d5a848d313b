/* A ray's span in a cell: how its field is known, and how finely a stretch of it is cut into segments with a
 * linear field each (kernel_segments.h): into equal subintervals, or, where these do not suffice, by bisection
 * (kernel_bisection.h). */
#ifndef RENDER_KERNEL_SPAN_H
#define RENDER_KERNEL_SPAN_H

#include "fragment.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_field.h"
#include "kernel_double.h"
#include "kernel_integral.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_pieces.h"
#include "kernel_segment_list.h"
#include "kernel_types.h"
#include "simd.h"

/* Of equal subintervals. */
enum { KERNEL_MAX_SUBDIVISIONS = 256 };
/* exp(-it) is KERNEL_BLACK, or a little more. */
#define KERNEL_DARK_DEPTH 18.4f

typedef struct kernel_segment_state {
    kernel_segments *list;
    const kernel_pieces *pieces;
    int volume;
    float allowance; /* the error a unit distance, and a unit of optical depth, may make; 0: subintervals by step */
    float mixing;    /* > 0: segments go out as they are met, to be mixed with others: see kernel_span_mixed() */
    float reach;     /* no ray is longer in the cells, unit distances */
} kernel_segment_state;

/* A cell under way: how its field is known, and how finely it must be. */
typedef struct kernel_span {
    const kernel_map *map;   /* NULL: linear */
    const kernel_cell *cell; /* NULL: a tet or a polyhedron; without a map it is of one value */
    const kernel_interval *interval;
    const kernel_double *precise; /* of a tet's interval in double; NULL: none */
    float cost;                 /* what light changes by a unit distance for a field off by one; 0 where nobody asks */
    int first_step, step_count; /* the steps of the opacity among the cell's values */
    bool is_steep, is_narrow;   /* steep ramps are, narrow ones */
} kernel_span;

/* With extinction s and colour c, a field that is off by d changes the light by at most T (contrast |s'| + s |c'|) d a
 * unit distance (docs/error_budget.md): the most of that over the cell's values, between steps. */
SIMD_INLINE void kernel_span_bound(const kernel_segment_state *state, const float *values, int count, kernel_span *out)
{
    const kernel_pieces *t = state->pieces;
    float low = values[0], high = low;
    if (!(state->allowance > 0) && !(state->mixing > 0)) return;
    for (int i = 1; i < count; i++) {
        low = simd_min(values[i], low);
        high = simd_max(values[i], high);
    }
    const float last = KERNEL_BOUND_BINS - 1;
    const int from = (int)simd_min(simd_max((low - t->bin_low) * t->bound_inverse, 0), last);
    const int to = (int)simd_min(simd_max((high - t->bin_low) * t->bound_inverse, 0), last);
    kernel_bound b = t->bounds[from];
    for (int i = from + 1; i <= to; i++) {
        b.extinction_high = simd_max(t->bounds[i].extinction_high, b.extinction_high);
        b.extinction_slope = simd_max(t->bounds[i].extinction_slope, b.extinction_slope);
        b.colour_slope = simd_max(t->bounds[i].colour_slope, b.colour_slope);
    }
    out->cost = simd_min(t->contrast * b.extinction_slope + b.extinction_high * b.colour_slope, 1e30f);
    while (out->first_step < t->step_count && t->steps[out->first_step].cut < low) out->first_step++;
    while (out->first_step + out->step_count < t->step_count && t->steps[out->first_step + out->step_count].cut <= high)
        out->step_count++;
    for (int i = 0; i < t->steep_count; i++) {
        const bool is_met = low <= t->steep[i].high && t->steep[i].low <= high;
        out->is_steep = out->is_steep || is_met;
        out->is_narrow = out->is_narrow || (is_met && t->steep[i].is_narrow);
    }
}

SIMD_INLINE vf kernel_span_value(kernel_packet *p, const kernel_span *span, vm rays, vf t)
{
    const kernel_interval *i = span->interval;
    return span->map ? kernel_value_at(p, span->map, i, rays, t) : kernel_line_value(i, t);
}

/* Rays whose values, from low to high, have a steep ramp among them, or a narrow one. */
SIMD_INLINE vm kernel_span_is_steep(const kernel_segment_state *state, vf low, vf high, bool is_narrow)
{
    vm any = vm_none();
    for (int i = 0; i < state->pieces->steep_count; i++) {
        const kernel_steep *steep = &state->pieces->steep[i];
        if (is_narrow && !steep->is_narrow) continue;
        any = vm_or(any, vm_and(vf_le(low, vf_set(steep->high)), vf_le(vf_set(steep->low), high)));
    }
    return any;
}

/* The same for a step. */
SIMD_INLINE vm kernel_span_steps(const kernel_segment_state *state, const kernel_span *span, vf low, vf high)
{
    vm any = vm_none();
    for (int i = 0; i < span->step_count; i++) {
        const vf cut = vf_set(state->pieces->steps[span->first_step + i].cut);
        any = vm_or(any, vm_and(vf_le(low, cut), vf_le(cut, high)));
    }
    return any;
}

/* Of a stretch's values, the rounding of those in float32, up to 1 or of their size (docs/error_budget.md: 4e-7 at
 * most).
 */
#define KERNEL_VALUE_ROUNDING 1e-6f

/* Into how many subintervals, as a real number, to cut the stretch, and how far its field is off the line between the
 * values at its ends. By error: the deviation from the line at a quarter, the half and three
 * quarters, half as much again (the three see 7/8 of a cubic's), goes as the square of a subinterval, and its mean is
 * two thirds of it. Allowed is the stretch's share of the ray's length and of its absorption, 1 - exp(-depth) >= depth
 * / (1 + depth), with the opacity as the least of the extinction. Where a step of the opacity is among the values no
 * number is enough, nor where a steep ramp is among them and asks for too many, nor where a narrow one is in which the
 * values' rounding alone would take an eighth of what is allowed. */
SIMD_INLINE vf kernel_span_curved(kernel_packet *p, const kernel_segment_state *state, const kernel_span *span, vm rays,
                                  const kernel_interval *stretch, vf *deviation)
{
    const vf t0 = stretch->t_in, length = stretch->t_out - t0, v0 = stretch->v_in, v1 = stretch->v_out;
    const kernel_transfer *transfer = &p->frame->volumes[state->volume];
    vf off = vf_set(0), opacity = 0.5f * (kernel_opacity(transfer, v0) + kernel_opacity(transfer, v1));
    for (int quarter = 1; quarter < 4; quarter++) {
        const float share = 0.25f * (float)quarter;
        const vf v = kernel_value_at(p, span->map, span->interval, rays, t0 + length * share);
        off = vf_max(off, vf_abs((v0 + (v1 - v0) * share) - v));
        opacity += kernel_opacity(transfer, v);
    }
    const vf distance = length * state->list->per_t, depth = distance * opacity * 0.25f;
    const vf allowed = state->allowance * (distance / state->reach + depth / (1.0f + depth));
    const vf made = off * span->cost * distance; /* 3/2 of 2/3 */
    *deviation = off;
    const vf wanted = vf_sqrt(vf_min(made / vf_max(allowed, vf_set(1e-30f)), vf_set(1e6f)));
    const vf subdivisions = vf_min(wanted, vf_set(KERNEL_MAX_SUBDIVISIONS));
    if (!span->step_count && !span->is_steep) return subdivisions;
    const vf largest = vf_max(vf_max(vf_abs(v0), vf_abs(v1)), vf_set(1));
    const vf wide = 1.5f * off + KERNEL_VALUE_ROUNDING * largest, low = vf_min(v0, v1) - wide,
             high = vf_max(v0, v1) + wide;
    vm too_few = kernel_span_steps(state, span, low, high);
    if (span->is_steep) {
        const vm many = vf_lt(vf_set(KERNEL_MAX_SUBDIVISIONS), wanted);
        too_few = vm_or(too_few, vm_and(many, kernel_span_is_steep(state, low, high, false)));
    }
    if (span->is_narrow) {
        const vf rounded = (8 * KERNEL_VALUE_ROUNDING) * largest * span->cost * distance;
        const vm shows = vf_lt(allowed, rounded);
        too_few = vm_or(too_few, vm_and(shows, kernel_span_is_steep(state, low, high, true)));
    }
    return vf_select(too_few, vf_set(2 * KERNEL_MAX_SUBDIVISIONS), subdivisions);
}

/* The same for a stretch that others are mixed with, who take it for a medium that is the same throughout (comp.h). Of
 * a stretch of depth d whose extinction and colour vary by the share v, no more than d v / 4 is elsewhere than it is
 * said to be, and what that does to light is attenuated by the others' depth in it. That depth, times the light that
 * gets there, sums to 1 over a ray; so d v / 4 may be the whole error allowed. */
SIMD_INLINE vf kernel_span_mixed(const kernel_segment_state *state, const kernel_span *span, vf length, vf change)
{
    const vf moved = change * span->cost * (length * state->list->per_t) * 0.25f;
    return vf_sqrt(vf_min(moved / state->mixing, vf_set(1e6f)));
}

/* How many equal subintervals; halved: the rays for which no number is enough. */
SIMD_INLINE vf kernel_span_subdivisions(kernel_packet *p, const kernel_segment_state *state, const kernel_span *span,
                                        vm rays, const kernel_interval *stretch, vm *halved)
{
    const vf length = stretch->t_out - stretch->t_in, most = vf_set(KERNEL_MAX_SUBDIVISIONS);
    const vf v0 = stretch->v_in, v1 = stretch->v_out;
    vf subdivisions = vf_set(1), off = vf_set(0);
    *halved = vm_none();
    if (span->map && state->allowance > 0) {
        subdivisions = kernel_span_curved(p, state, span, rays, stretch, &off);
        *halved = vm_and(rays, vf_lt(most, subdivisions));
    } else if (span->map) {
        subdivisions = length / p->sample_step;
        if (span->step_count && state->mixing > 0) {
            const vf wanted = kernel_span_curved(p, state, span, rays, stretch, &off);
            *halved = vm_and(rays, vf_lt(most, wanted));
        }
    } else if (span->step_count && state->mixing > 0) {
        *halved = vm_and(rays, kernel_span_steps(state, span, vf_min(v0, v1), vf_max(v0, v1)));
    } else if (span->is_narrow && span->cell) {
        *halved = rays;
    }
    if (state->mixing > 0)
        subdivisions = vf_max(subdivisions, kernel_span_mixed(state, span, length, vf_abs(v1 - v0) + 2.0f * off));
    return vf_clamp(-vf_floor(-subdivisions), vf_set(1), most);
}

/* a + b, and what that loses to rounding (Knuth). */
SIMD_INLINE vf kernel_exact_sum(vf a, vf b, vf *lost)
{
    const vf sum = a + b, other = sum - a;
    *lost = (a - (sum - other)) + (b - other);
    return sum;
}

/* The share of a segment from `from` to `to`. */
SIMD_INLINE kernel_run kernel_run_within(const kernel_run *whole, vf from, vf to)
{
    const vf rise = (whole->v_out - whole->v_in) + (whole->rest_out - whole->rest_in);
    const vm begins = vf_eq(from, vf_set(0)), ends = vf_eq(to, vf_set(1));
    kernel_run out = {.length = whole->length * (to - from)};
    out.v_in =
        vf_select(begins, whole->v_in, kernel_exact_sum(whole->v_in, rise * from + whole->rest_in, &out.rest_in));
    out.v_out = vf_select(ends, whole->v_out, kernel_exact_sum(whole->v_in, rise * to + whole->rest_in, &out.rest_out));
    out.rest_in = vf_select(begins, whole->rest_in, out.rest_in);
    out.rest_out = vf_select(ends, whole->rest_out, out.rest_out);
    return out;
}

/* A segment as a fragment of its own. The integral ends where all but KERNEL_BLACK of the light is gone, and says no
 * more of the depth; but what is mixed with others goes by its depth. So a segment as dense as that is cut until its
 * fragments are not, and ends where light does. */
static void kernel_emit_segment(kernel_packet *p, const kernel_segment_state *state, vm rays, vf t_in, vf t_out,
                                const kernel_run *whole)
{
    const vf one = vf_set(1), black = vf_set(KERNEL_BLACK);
    vf from = vf_set(0), to = one, depth = vf_set(0);
    for (vm open = rays; vm_any(open);) {
        kernel_light light = kernel_clear();
        const kernel_run run = kernel_run_within(whole, from, to);
        const vf begin = t_in + (t_out - t_in) * from;
        const vf end = vf_select(vf_eq(to, one), t_out, t_in + (t_out - t_in) * to), middle = 0.5f * (from + to);
        kernel_integrate(state->pieces, open, &run, &light);
        const vm cut = vm_and(open, vm_and(vf_le(light.transmittance, black),
                                           vm_and(vf_lt(begin, t_in + (t_out - t_in) * middle), vf_lt(middle, to))));
        const vm put = vm_andnot(open, cut);
        const kernel_fragments segment = {
            begin, end, {light.colour[0], light.colour[1], light.colour[2]}, light.transmittance, vf_set(0)};
        kernel_emit(p, vm_and(put, vf_lt(light.transmittance, one)), FRAGMENT_VOLUME, &segment);
        depth += vf_select(put, light.depth, vf_set(0));
        open = vm_andnot(open, vm_and(put, vm_or(vf_eq(to, one), vf_lt(vf_set(KERNEL_DARK_DEPTH), depth))));
        from = vf_select(put, to, from);
        to = vf_select(cut, middle, vf_select(put, one, to));
    }
}

#endif
