/* Volumes in polyhedra: samples on the profile. */
#ifndef RENDER_KERNEL_POLYHEDRON_VOLUME_H
#define RENDER_KERNEL_POLYHEDRON_VOLUME_H

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_segments.h"
#include "kernel_cell_values.h"
#include "kernel_span.h"
#include "kernel_interest.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_samples.h"
#include "kernel_types.h"
#include "render_polyhedra.h"
#include "simd.h"

SIMD_INLINE bool kernel_polyhedron_shows(const polyhedron *c, const kernel_transfer *t)
{
    double low = c->values[0], high = low;
    for (int i = 1; i < c->vertex_count; i++) {
        low = c->values[i] < low ? c->values[i] : low;
        high = c->values[i] > high ? c->values[i] : high;
    }
    return kernel_interest_meets(&t->interest, kernel_hold(low, 3e38), kernel_hold(high, 3e38));
}

SIMD_INLINE void kernel_polyhedron_domain(polyhedron *c, const kernel_transfer *t)
{
    for (int i = 0; i <= c->vertex_count; i++) c->f[i] = kernel_hold((c->values[i] - t->low) * t->inverse_width, 1e18);
}

/* The samples of the window, from begin on to end, that the stay owns and that are in the piece. One that another cell
 * owns too stays the other's, as in kernel_fill(). */
static void kernel_polyhedron_fill(kernel_packet *p, kernel_volume_state *state, const kernel_stay *stay,
                                   const kernel_profile_piece *piece, int begin, int end)
{
    kernel_samples *s = state->samples;
    const vf length = piece->t1 - piece->t0;
    const vf slope = vf_select(vf_lt(vf_set(0), length), (piece->v1 - piece->v0) / length, vf_set(0));
    for (int n = begin; n < end; n++) {
        const vf t = kernel_sample_t(p, s->first + n);
        vm own = vm_and(stay->interval.mask, vm_andnot(vf_lt(t, piece->t1), vf_lt(t, piece->t0)));
        if (!vm_any(own)) continue;
        const vf value = piece->v0 + slope * (t - piece->t0), active = s->value[state->volume][n];
        const vm apart = vm_and(own, vf_eq(active, active));
        if (__builtin_expect(vm_any(apart), 0)) {
            kernel_emit_sample(p, state, &stay->interval, apart, t, value);
            own = vm_andnot(own, apart);
        }
        s->value[state->volume][n] = vf_select(own, value, active);
        if (p->frame->needs_contact) {
            s->t_in[n] = vf_select(own, stay->interval.t_in, s->t_in[n]);
            s->t_out[n] = vf_select(own, stay->interval.t_out, s->t_out[n]);
        }
    }
}

static void kernel_polyhedron_stay(kernel_packet *p, kernel_volume_state *state, const polyhedron *c, vm rays,
                                   kernel_passage *r, kernel_stay *stay)
{
    const kernel_interval *i = &stay->interval;
    int begin, end;
    kernel_sample_span(p, state->samples, i, &begin, &end);
    if (begin >= end) return;
    if (!c->is_constant) kernel_passage_profile(p, c, rays, false, r, stay);
    kernel_profile_piece piece = kernel_profile_begin(stay, stay->u_in);
    while (vm_any(kernel_profile_open(stay, &piece, i->mask))) {
        kernel_profile_next(r, stay, stay->u_out, &piece);
        kernel_polyhedron_fill(p, state, stay, &piece, begin, end);
    }
}

/* The cell in the layer's domain, placed; NULL where it does not show. */
static polyhedron *kernel_polyhedron_ready(kernel_packet *p, int volume, int part, uint32_t index)
{
    const kernel_transfer *transfer = &p->frame->volumes[volume];
    const grid_field *field = &p->frame->job->volumes[volume].field.fields[part];
    polyhedron *c = p->thread->find_polyhedron(p->thread->polyhedra, p->frame->job->parts[part].cells, field, part,
                                               p->frame->surface_count + volume, index);
    if (!c) p->thread->out_of_memory = true;
    if (!c || !c->is_finite || !kernel_polyhedron_shows(c, transfer)) return NULL;
    if (!c->is_placed) {
        kernel_polyhedron_place(c, p);
        kernel_polyhedron_domain(c, transfer);
    }
    return c;
}

static void kernel_polyhedron_volume(kernel_packet *p, kernel_volume_state *state, int part, uint32_t index, vm rays)
{
    const polyhedron *c = kernel_polyhedron_ready(p, state->volume, part, index);
    kernel_passage r;
    kernel_stay stay;
    if (!c || !kernel_passage_open(p, c, &r) || !kernel_passage_cross(p, c, rays, false, &r)) return;
    while (kernel_passage_next(&r, &stay)) kernel_polyhedron_stay(p, state, c, rays, &r, &stay);
}

/* Segments are the profile's pieces, on which the field is linear: exact. */
static void kernel_polyhedron_segments(kernel_packet *p, kernel_segment_state *state, int part, uint32_t index, vm rays)
{
    const polyhedron *c = kernel_polyhedron_ready(p, state->volume, part, index);
    kernel_passage r;
    kernel_stay stay;
    if (!c || !kernel_passage_open(p, c, &r) || !kernel_passage_cross(p, c, rays, false, &r)) return;
    kernel_span span = {.map = NULL};
    if (state->mixing > 0) kernel_span_bound(state, c->f, c->vertex_count, &span);
    while (kernel_passage_next(&r, &stay)) {
        if (!c->is_constant) kernel_passage_profile(p, c, rays, false, &r, &stay);
        kernel_profile_piece piece = kernel_profile_begin(&stay, stay.u_in);
        vm open = kernel_profile_open(&stay, &piece, stay.interval.mask);
        while (vm_any(open)) {
            kernel_profile_next(&r, &stay, stay.u_out, &piece);
            const kernel_interval i = {
                .mask = open, .t_in = piece.t0, .t_out = piece.t1, .v_in = piece.v0, .v_out = piece.v1};
            span.interval = &i;
            kernel_span_run(p, state, &span);
            open = kernel_profile_open(&stay, &piece, open);
        }
    }
}

#endif
