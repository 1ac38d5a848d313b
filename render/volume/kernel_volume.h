/* Volumes by sample position packets (thesis, section 4.4): the packet's rays with N samples each go down the tree
 * together; a node is left out where no sample is in its box or where its range is transparent. Cells fill the samples
 * that they own (kernel_samples.h). Then the N samples are blended front to back, and the next N follow. */
#ifndef RENDER_KERNEL_VOLUME_H
#define RENDER_KERNEL_VOLUME_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_segments.h"
#include "kernel_cell_values.h"
#include "kernel_crossings.h"
#include "kernel_double.h"
#include "kernel_exact.h"
#include "kernel_hits.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_samples.h"
#include "kernel_segment_list.h"
#include "kernel_segments.h"
#include "kernel_traverse.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Returns a cell that packets on their own meet. Layers of volumes are counted on from those of surfaces. */
SIMD_INLINE kernel_cell *kernel_volume_cell(const kernel_packet *p, int volume, int part, uint32_t index)
{
    const grid_field *field = &p->frame->job->volumes[volume].field.fields[part];
    return kernel_cell_find(p, p->frame->surface_count + volume, part, field, index);
}

/* Makes a cell other than a polyhedron ready for rays; false where it does not show. */
SIMD_INLINE bool kernel_volume_ready(kernel_cell *c, const kernel_packet *p, const kernel_transfer *transfer)
{
    if (!c->is_finite || !kernel_cell_shows(c, transfer)) return false;
    if (!c->is_placed) {
        kernel_cell_place(c, p, p->frame->job->parts[c->part].cells);
        kernel_cell_domain(c, transfer);
    }
    return true;
}

static void kernel_volume_leaf(kernel_packet *p, void *opaque_state, int part, const uint32_t *cells, int count,
                               vm rays)
{
    kernel_volume_state *state = opaque_state;
    const kernel_transfer *transfer = &p->frame->volumes[state->volume];
    for (int n = 0; n < count; n++) {
        kernel_cell *c = kernel_volume_cell(p, state->volume, part, cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_polyhedron_volume(p, state, part, cells[n], rays);
            continue;
        }
        if (!kernel_volume_ready(c, p, transfer)) continue;
        if (c->type == GRID_TET) {
            kernel_interval i;
            kernel_tet_interval(p, c, rays, false, &i);
            if (vm_any(i.mask)) kernel_fill(p, state, NULL, &i);
            continue;
        }
        kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
        kernel_map map;
        const int intervals = kernel_curved_intervals(p, c, rays, false, list);
        if (intervals && !c->is_constant) kernel_map_setup(&map, c);
        for (int k = 0; k < intervals; k++) kernel_fill(p, state, c->is_constant ? NULL : &map, &list[k]);
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
    kernel_blend b = {.open = vm_none(), .light = vf_set(1), .transmittance = vf_set(1), .within = vf_set(1)};
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

/* ---- by segments (kernel_segments.h) ---- */

static void kernel_segment_leaf(kernel_packet *p, void *opaque_state, int part, const uint32_t *cells, int count,
                                vm rays)
{
    kernel_segment_state *state = opaque_state;
    const kernel_transfer *transfer = &p->frame->volumes[state->volume];
    for (int n = 0; n < count; n++) {
        kernel_cell *c = kernel_volume_cell(p, state->volume, part, cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_polyhedron_segments(p, state, part, cells[n], rays);
            continue;
        }
        if (!kernel_volume_ready(c, p, transfer)) continue;
        if (c->type == GRID_TET) {
            kernel_double_cell precise;
            if (state->list->is_double) kernel_double_begin(p->frame, p->tile, c, transfer, &precise);
            kernel_tet_segments(p, state, c, &precise, rays);
            continue;
        }
        kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
        kernel_span span = {.cell = c};
        kernel_map map;
        const int intervals = kernel_curved_intervals(p, c, rays, false, list);
        if (intervals && !c->is_constant) {
            kernel_map_setup(&map, c);
            span.map = &map;
        }
        if (intervals && (span.map || state->pieces->has_rests)) kernel_span_bound(state, c->f, c->count, &span);
        for (int k = 0; k < intervals; k++) {
            span.interval = &list[k];
            kernel_span_run(p, state, &span);
        }
    }
}

/* All segments of all volumes, each as a fragment of its own. */
SIMD_INLINE void kernel_trace_apart(kernel_packet *p)
{
    const kernel_frame *f = p->frame;
    kernel_segments list;
    list.t_begin = p->t_near;
    list.t_end = vf_set(INFINITY);
    list.cuts.row_count = 0;
    kernel_segments_set_double(p, &list, false);
    for (int v = 0; v < f->volume_count; v++) {
        kernel_segment_state state = {&list, &f->pieces[v], v, f->allowance, f->mixing, f->reach[v]};
        list.per_t = f->volumes[v].exponent / p->sample_step;
        const kernel_descent descent = {&f->volumes[v].interest, p->t_near, &p->t_far, kernel_segment_leaf, &state};
        kernel_trace_parts(p, &f->job->volumes[v].field, &descent);
    }
}

/* One window from list->t_begin on; t_end is lowered to where it ended. */
SIMD_INLINE void kernel_trace_window(kernel_packet *p, kernel_segment_state *state)
{
    kernel_segments *list = state->list;
    kernel_segments_begin(list, p->t_far);
    const kernel_descent descent = {&p->frame->volumes[0].interest, list->t_begin, &list->t_end, kernel_segment_leaf,
                                    state};
    kernel_trace_parts(p, &p->frame->job->volumes[0].field, &descent);
}

/* first_fragment: where the packet's own fragments, of surfaces so far, begin in the thread's list. */
SIMD_INLINE void kernel_trace_segments(kernel_packet *p, int64_t first_fragment)
{
    const kernel_frame *f = p->frame;
    kernel_segments list;
    kernel_segment_state state = {&list, &f->pieces[0], 0, f->allowance, 0, f->reach[0]};
    kernel_blend b = kernel_blend_begin();
    list.per_t = f->volumes[0].exponent / p->sample_step;
    kernel_segments_set_double(p, &list, f->is_double);
    list.t_begin = p->t_near;
    kernel_cuts_find(p, first_fragment, &list.cuts);
    const vm active = p->active;
    while (vm_any(p->active)) {
        kernel_trace_window(p, &state);
        kernel_blend_segments(p, &b, state.pieces, &list);
        const vm unfinished = vm_and(vf_lt(list.t_end, p->t_far), vf_lt(vf_set(KERNEL_DARK), b.light));
        p->active = vm_and(p->active, unfinished);
        list.t_begin = list.t_end;
    }
    p->active = active;
    kernel_segments_close(p, &b, p->active);
}

#endif
