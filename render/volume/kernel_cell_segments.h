/* What a cell adds to the segments of rays (kernel_segments.h): its span in subintervals, between surfaces. */
#ifndef RENDER_KERNEL_CELL_SEGMENTS_H
#define RENDER_KERNEL_CELL_SEGMENTS_H

#include "kernel_cell.h"
#include "kernel_span.h"
#include "kernel_field.h"
#include "kernel_double.h"
#include "kernel_bisection.h"
#include "kernel_integral.h"
#include "kernel_packet.h"
#include "kernel_segment_list.h"
#include "kernel_tet.h"
#include "simd.h"

/* ---- a cell's segments ---- */

/* A stretch in equal subintervals: the field at three of their ends in turn. */
typedef struct kernel_parts {
    vf t0, t1, span, count;
    vf last;                 /* the value at t1 */
    vf from, to;             /* the current part, */
    vf before, after, ahead; /* the field at its ends and at the end of the next, */
    vf bend, next_bend;      /* second differences at its ends */
} kernel_parts;

/* The n-th end, and the field there. */
SIMD_INLINE vf kernel_parts_end(kernel_packet *p, const kernel_span *span, const kernel_parts *s, vm rays, int n,
                                vf *value)
{
    const vm inner = vm_and(rays, vf_lt(vf_set((float)n), s->count));
    const vf t = vf_select(inner, s->t0 + s->span * (float)n, s->t1);
    *value = s->last;
    if (vm_any(inner)) *value = vf_select(inner, kernel_span_value(p, span, inner, t), s->last);
    return t;
}

/* By how much to raise a subinterval's chord so that the mean along it is the field's: where the field is a parabola,
 * by a twelfth of its second difference, which the subintervals beside it tell; a single subinterval tells none. */
SIMD_INLINE vf kernel_parts_lift(const kernel_parts *s, vm is_first, vm is_last)
{
    const vf zero = vf_set(0), both = 0.5f * (s->bend + s->next_bend);
    const vf bend = vf_select(is_first, vf_select(is_last, zero, s->next_bend), vf_select(is_last, s->bend, both));
    return bend * (-1.0f / 12);
}

/* The stretch from t0 to t1 of an interval in double, as one segment where it begins in the window. */
SIMD_INLINE void kernel_span_double(kernel_segment_state *state, const kernel_span *span, vm rays, vf t0, vf t1)
{
    const kernel_interval *i = span->interval;
    const kernel_double *precise = span->precise;
    const kernel_run whole = {precise->length, i->v_in, i->v_out, precise->rest_in, precise->rest_out};
    const kernel_run run = kernel_run_within(&whole, kernel_share(i, t0), kernel_share(i, t1));
    const kernel_interval sub = {.t_in = t0, .t_out = t1, .v_in = run.v_in, .v_out = run.v_out};
    const kernel_double own = {run.length, run.rest_in, run.rest_out};
    const vm mine = vm_and(vf_le(state->list->t_begin, t0), vf_lt(t0, state->list->t_end));
    kernel_segments_add(state->pieces, state->list, vm_and(rays, mine), &sub, &own);
}

/* The stretch from t0 to t1 as segments; those that begin in the window are kept. */
SIMD_INLINE void kernel_span_segments(kernel_packet *p, kernel_segment_state *state, const kernel_span *span, vm rays,
                                      vf t0, vf t1)
{
    kernel_segments *list = state->list;
    kernel_parts s = {.t0 = t0, .t1 = t1, .from = t0};
    if (span->precise) {
        kernel_span_double(state, span, rays, t0, t1);
        return;
    }
    s.before = kernel_span_value(p, span, rays, t0);
    s.last = kernel_span_value(p, span, rays, t1);
    vm halved;
    const kernel_interval stretch = {.t_in = t0, .t_out = t1, .v_in = s.before, .v_out = s.last};
    s.count = kernel_span_subdivisions(p, state, span, rays, &stretch, &halved);
    if (__builtin_expect(vm_any(halved), 0)) {
        kernel_span_bisect(p, state, span, halved, t0, t1);
        rays = vm_andnot(rays, halved);
        if (!vm_any(rays)) return;
    }
    s.span = (t1 - t0) / s.count;
    s.to = kernel_parts_end(p, span, &s, rays, 1, &s.after);
    s.bend = vf_set(0);
    vm open = rays;
    for (int n = 1; vm_any(open); n++) {
        const vm inner = vm_and(open, vf_lt(vf_set((float)n), s.count));
        const vf next = kernel_parts_end(p, span, &s, inner, n + 1, &s.ahead);
        s.next_bend = (s.before - s.after) + (s.ahead - s.after);
        const vf lift = kernel_parts_lift(&s, n == 1 ? rays : vm_none(), vm_not(inner));
        const vm mine = vm_and(vf_le(list->t_begin, s.from), vf_lt(s.from, list->t_end));
        if (!(state->mixing > 0)) {
            const kernel_interval sub = {
                .t_in = s.from, .t_out = s.to, .v_in = s.before + lift, .v_out = s.after + lift};
            const kernel_double precise = kernel_double_of(&sub);
            kernel_segments_add(state->pieces, list, vm_and(open, mine), &sub, list->is_double ? &precise : NULL);
        } else if (vm_any(vm_and(open, mine))) {
            const kernel_run run = kernel_run_of((s.to - s.from) * list->per_t, s.before + lift, s.after + lift);
            kernel_emit_segment(p, state, vm_and(open, mine), s.from, s.to, &run);
        }
        s.from = s.to;
        s.to = next;
        s.before = s.after;
        s.after = s.ahead;
        s.bend = s.next_bend;
        open = vm_and(inner, vf_lt(s.from, list->t_end));
    }
}

/* The interval's stretches between surfaces that begin in the window. */
SIMD_INLINE void kernel_span_run(kernel_packet *p, kernel_segment_state *state, const kernel_span *span)
{
    const kernel_interval *i = span->interval;
    const kernel_segments *list = state->list;
    vf from = vf_max(i->t_in, p->t_near);
    /* To be mixed, segments are whole, whatever surfaces this rank knows of: the same on any partition. */
    const vf end = vf_min(i->t_out, state->mixing > 0 ? p->clip_out : p->t_far);
    vm open = vm_and(i->mask, vm_and(p->active, vm_and(vf_lt(from, end), vf_lt(from, p->t_far))));
    while (vm_any(open)) {
        vf to = end;
        if (list->cuts.row_count) to = vf_min(end, kernel_next_cut(p, &list->cuts, from, true));
        const vm mine = vm_and(open, vm_and(vf_lt(list->t_begin, to), vf_lt(from, list->t_end)));
        if (vm_any(mine)) kernel_span_segments(p, state, span, mine, from, to);
        from = to;
        open = vm_and(open, vf_lt(from, end));
    }
}

/* The rays of a tet's interval that surfaces cut, or on which it is to be mixed with others. */
static __attribute__((noinline)) void kernel_tet_course(kernel_packet *p, kernel_segment_state *state,
                                                        const kernel_cell *c, const kernel_double_cell *double_cell,
                                                        kernel_interval i)
{
    kernel_span span = {.interval = &i};
    kernel_double precise;
    if (state->mixing > 0) {
        kernel_span_bound(state, c->f, c->count, &span);
    } else if (state->list->is_double) {
        precise = kernel_tet_double(p, c, double_cell, &state->list->rays, &i);
        span.precise = &precise;
    }
    kernel_span_run(p, state, &span);
}

/* A tet is one segment, cut by surfaces alone. double_cell is looked at where the list is in double. */
static __attribute__((noinline)) void kernel_tet_segments(kernel_packet *p, kernel_segment_state *state,
                                                          const kernel_cell *c, const kernel_double_cell *double_cell,
                                                          vm rays)
{
    kernel_segments *list = state->list;
    kernel_interval i;
    kernel_tet_interval(p, c, rays, false, &i);
    if (!vm_any(i.mask)) return;
    const vm hit = i.mask;
    vm cut = vm_or(vf_lt(i.t_in, p->t_near), vf_lt(p->t_far, i.t_out));
    if (list->cuts.row_count) cut = vm_or(cut, vf_lt(kernel_next_cut(p, &list->cuts, i.t_in, true), i.t_out));
    cut = state->mixing > 0 ? hit : vm_and(hit, cut);
    if (__builtin_expect(vm_any(cut), 0)) {
        i.mask = cut;
        kernel_tet_course(p, state, c, double_cell, i);
        i.mask = vm_andnot(hit, cut);
    }
    const vm window = vm_and(vf_le(list->t_begin, i.t_in), vf_lt(i.t_in, list->t_end));
    vm mine = vm_and(i.mask, window);
    if (!list->is_double) mine = vm_and(mine, vf_lt(i.t_in, i.t_out));
    if (!vm_any(mine)) return;
    kernel_double precise;
    if (list->is_double) {
        /* Of segments whose ends float32 does not tell apart, many may lie on one ray. */
        precise = kernel_tet_double(p, c, double_cell, &list->rays, &i);
        mine = vm_and(mine, vf_lt(vf_set(0), precise.length));
    }
    kernel_segments_add(state->pieces, list, mine, &i, list->is_double ? &precise : NULL);
}

#endif
