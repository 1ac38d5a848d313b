/* Volumes by sample position packets (thesis, section 4.4): the packet's rays with N samples each go down the tree
 * together; a node is left out where no sample is in its box or where its range is transparent. Cells fill the samples
 * that they own (kernel_samples.h). Then the N samples are blended front to back, and the next N follow. */
#ifndef RENDER_KERNEL_VOLUME_H
#define RENDER_KERNEL_VOLUME_H

#include <math.h>

#include "fragment.h"
#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_values.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_poly.h"
#include "kernel_polyhedron_volume.h"
#include "kernel_samples.h"
#include "kernel_tet.h"
#include "kernel_traverse.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* A fragment under way on each ray. */
typedef struct kernel_blend {
    vm open;
    vf t_first, t_last, contact_in, contact_out;
    vf colour[3], transmittance;
    vf depth, lost[3]; /* of segments: -ln(transmittance), and what colour has lost to rounding */
    vf light;          /* what reaches this rank's next sample through all its samples so far */
} kernel_blend;

static void kernel_volume_leaf(kernel_packet *p, void *opaque_state, int part, const uint32_t *cells, int count,
                               vm rays)
{
    kernel_volume_state *state = opaque_state;
    const kernel_transfer *transfer = &p->frame->volumes[state->volume];
    const grid_field *field = &p->frame->job->volumes[state->volume].field.fields[part];
    const grid *g = p->frame->job->parts[part].cells;
    for (int n = 0; n < count; n++) {
        /* Layers of volumes are counted on from those of surfaces. */
        kernel_cell *c = kernel_cell_find(p, p->frame->surface_count + state->volume, part, field, cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_polyhedron_volume(p, state, part, cells[n], rays);
            continue;
        }
        if (!c->is_finite || !kernel_cell_shows(c, transfer)) continue;
        if (!c->is_placed) {
            kernel_cell_place(c, p, g);
            kernel_cell_domain(c, transfer);
        }
        if (c->type == GRID_TET) {
            kernel_interval i;
            kernel_tet_interval(p, c, rays, false, &i);
            if (vm_any(i.mask)) kernel_fill(p, state, NULL, &i);
            continue;
        }
        kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
        kernel_map map;
        const int intervals = kernel_poly_intervals(p, c, rays, false, list);
        if (intervals && !c->is_constant) kernel_map_setup(&map, c);
        for (int k = 0; k < intervals; k++) kernel_fill(p, state, c->is_constant ? NULL : &map, &list[k]);
    }
}

/* End the fragments of the rays in mask. */
SIMD_INLINE void kernel_blend_close(kernel_packet *p, kernel_blend *b, vm mask)
{
    const vm closing = vm_and(b->open, mask);
    if (!vm_any(closing)) return;
    const kernel_fragments ended = {
        b->t_first, b->t_last, {b->colour[0], b->colour[1], b->colour[2]}, b->transmittance, vf_set(0)};
    kernel_emit(p, vm_and(closing, vf_lt(b->transmittance, vf_set(1))), FRAGMENT_VOLUME, &ended);
    b->open = vm_andnot(b->open, closing);
}

/* Rays whose fragment must end before the sample at t: a surface is in between, or may be, on another rank. */
SIMD_INLINE vm kernel_blend_breaks(const kernel_packet *p, const kernel_blend *b, const kernel_samples *s, int n,
                                   const kernel_hits *hits, vf t)
{
    vm broken = hits->crowded;
    for (int i = 0; i < hits->cut_count; i++)
        broken = vm_or(broken, vm_and(vf_lt(b->t_last, hits->cut[i]), vf_le(hits->cut[i], t)));
    if (p->frame->needs_contact) {
        const vm touch = vm_or(vf_eq(s->t_in[n], b->contact_out), vf_eq(s->t_in[n], b->contact_in));
        broken = vm_or(broken, vm_not(touch));
    }
    return broken;
}

/* Colour (premultiplied) and transmittance of the samples of all volumes at one place. */
SIMD_INLINE void kernel_sample_colour(const kernel_packet *p, const kernel_samples *s, int n, vf colour[3], vf *clear)
{
    const kernel_frame *f = p->frame;
    vf sum[3] = {vf_set(0), vf_set(0), vf_set(0)}, weight = vf_set(0), through = vf_set(1), all = vf_set(0);
    for (int v = 0; v < f->volume_count; v++) {
        const vf value = s->value[v][n];
        const vm has = vf_eq(value, value);
        vf absorbed, c[3];
        const vf opacity = vf_select(has, kernel_opacity(&f->volumes[v], value), vf_set(0));
        if (!vm_any(vf_lt(vf_set(0), opacity))) continue;
        const vf left = kernel_transmittance(opacity, f->volumes[v].exponent, &absorbed);
        kernel_table_colour(&f->volumes[v], value, c);
        for (int a = 0; a < 3; a++) sum[a] += absorbed * c[a];
        weight += absorbed;
        all += through * absorbed;
        through *= left;
    }
    /* Several media at one place share what all of them absorb in proportion to what each would. */
    const vf share = f->volume_count == 1 ? vf_set(1) : vf_select(vf_lt(vf_set(0), weight), all / weight, vf_set(0));
    for (int a = 0; a < 3; a++) colour[a] = sum[a] * share;
    *clear = through;
}

SIMD_INLINE void kernel_blend_window(kernel_packet *p, kernel_blend *b, const kernel_samples *s,
                                     const kernel_hits *hits)
{
    const bool is_alone = p->frame->job->is_alone;
    for (int n = 0; n < s->count; n++) {
        const vf t = kernel_sample_t(p, s->first + n);
        vm has = vm_none();
        for (int v = 0; v < p->frame->volume_count; v++) has = vm_or(has, vf_eq(s->value[v][n], s->value[v][n]));
        has = vm_and(has, vm_and(vf_lt(t, p->t_far), vf_lt(vf_set(KERNEL_DARK), b->light)));
        has = vm_and(has, vf_le(p->clip_in, t));
        if (!is_alone) kernel_blend_close(p, b, vm_not(has));
        if (!vm_any(has)) continue;
        kernel_blend_close(p, b, vm_and(has, kernel_blend_breaks(p, b, s, n, hits, t)));
        const vm fresh = vm_andnot(has, b->open);
        vf colour[3], clear;
        kernel_sample_colour(p, s, n, colour, &clear);
        b->t_first = vf_select(fresh, t, b->t_first);
        b->transmittance = vf_select(fresh, vf_set(1), b->transmittance);
        for (int a = 0; a < 3; a++) {
            b->colour[a] = vf_select(fresh, vf_set(0), b->colour[a]);
            b->colour[a] = vf_select(has, b->colour[a] + b->transmittance * colour[a], b->colour[a]);
        }
        b->transmittance = vf_select(has, b->transmittance * clear, b->transmittance);
        b->light = vf_select(has, b->light * clear, b->light);
        b->t_last = vf_select(has, t, b->t_last);
        b->open = vm_or(b->open, has);
        if (p->frame->needs_contact) {
            b->contact_in = vf_select(has, s->t_in[n], b->contact_in);
            b->contact_out = vf_select(has, s->t_out[n], b->contact_out);
        }
    }
}

/* The part of the rays that is in any tree: sample numbers first..last. */
SIMD_INLINE bool kernel_sample_range(const kernel_packet *p, int *first, int *last)
{
    const render_job *job = p->frame->job;
    vf from = vf_set(INFINITY), to = vf_set(-INFINITY);
    for (int i = 0; i < job->part_count; i++) {
        vf t_in = p->t_near, t_out = p->t_far;
        if (!job->parts[i].tree->node_count) continue;
        const vm met = vm_and(p->active, kernel_box(p, job->parts[i].tree, 0, &t_in, &t_out));
        from = vf_select(met, vf_min(from, t_in), from);
        to = vf_select(met, vf_max(to, t_out), to);
    }
    const vm any = vf_lt(from, vf_set(INFINITY));
    if (!vm_any(any)) return false;
    const vf low = vf_select(any, (from - p->sample_base) / p->sample_step, vf_set(INFINITY));
    const vf high = vf_select(any, (to - p->sample_base) / p->sample_step, vf_set(-INFINITY));
    const int lowest = (int)floorf(vf_reduce_min(low)) - 1;
    *first = lowest < p->sample_first ? p->sample_first : lowest;
    *last = (int)floorf(vf_reduce_max(high)) + 1;
    return *first <= *last;
}

SIMD_INLINE void kernel_trace_volumes(kernel_packet *p, const kernel_hits *hits)
{
    const kernel_frame *f = p->frame;
    kernel_samples s;
    kernel_blend b = {.open = vm_none(), .light = vf_set(1), .transmittance = vf_set(1)};
    int first, last;
    if (!kernel_sample_range(p, &first, &last)) return;
    /* Where samples are separate, all places count as taken, and what is there is not looked at. */
    const vf nothing = vf_set(f->job->separate_samples ? 0 : NAN);
    s.marked = vf_set(INFINITY);
    b.contact_in = b.contact_out = b.t_first = b.t_last = b.colour[0] = b.colour[1] = b.colour[2] = vf_set(0);
    for (; first <= last; first += f->job->sample_group) {
        const int left = last - first + 1;
        kernel_samples_window(p, &s, first, left < f->job->sample_group ? left : f->job->sample_group);
        const vf t_first = kernel_sample_t(p, first), t_last = kernel_sample_t(p, first + s.count - 1);
        const vf t_end = vf_min(t_last, p->t_far);
        const vm lit = vm_and(p->active, vm_and(vf_lt(vf_set(KERNEL_DARK), b.light), vf_le(t_first, t_end)));
        if (!vm_any(lit)) break;
        const vm active = p->active;
        p->active = lit;
        for (int v = 0; v < f->volume_count; v++) {
            for (int n = 0; n < s.count; n++) s.value[v][n] = nothing;
            kernel_volume_state state = {v, &s};
            const kernel_descent descent = {&f->volumes[v].interest, t_first, &t_end, kernel_volume_leaf, &state};
            kernel_trace_parts(p, &f->job->volumes[v].field, &descent);
        }
        p->active = active;
        if (!f->job->separate_samples) kernel_blend_window(p, &b, &s, hits);
    }
    kernel_blend_close(p, &b, p->active);
}

#endif
