/* Isosurfaces of a packet that goes down the trees on its own (thesis, sections 4.3.1 and 4.3.2), and its hits turned
 * into fragments. */
#ifndef RENDER_KERNEL_PACKET_SURFACE_H
#define RENDER_KERNEL_PACKET_SURFACE_H

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_values.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_packet.h"
#include "kernel_spmd.h"
#include "kernel_surface.h"
#include "kernel_traverse.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Makes the cell ready for the isovalue. */
SIMD_INLINE void kernel_surface_prepare(const kernel_frame *f, const kernel_tile *tile, const kernel_surface *s,
                                        int part, int value, kernel_cell *c, kernel_curved *curved)
{
    const bool is_fresh = !c->is_placed;
    if (is_fresh) {
        kernel_cell_place_in(c, f, tile, f->job->parts[part].cells);
        if (s->layer->colour_map) kernel_cell_colours(c, s, part);
    }
    if (is_fresh || s->layer->value_count > 1) {
        kernel_cell_relative(c, s->layer->values[value]);
        curved->is_set_up = false;
    }
}

static void kernel_surface_leaf(kernel_packet *p, void *opaque_state, int part, const uint32_t *cells, int count,
                                vm rays)
{
    kernel_surface_state *state = opaque_state;
    const render_surface_layer *layer = state->surface->layer;
    for (int n = 0; n < count; n++) {
        kernel_cell *c = kernel_cell_find(p, state->layer, part, &layer->field.fields[part], cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_polyhedron_surfaces(p, state, part, cells[n], rays);
            continue;
        }
        kernel_curved *curved = kernel_curved_find(p, c);
        if (!c->is_finite) continue;
        kernel_cell own_cell;
        kernel_curved own_curved;
        if (layer->normal == RENDER_DIFFERENCES) {
            /* Looking for samples fills the cache with other cells while this one is in use. */
            own_cell = *c;
            own_curved = *curved;
            c = &own_cell;
            curved = &own_curved;
        }
        for (int value = 0; value < layer->value_count; value++) {
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            kernel_surface_prepare(p->frame, p->tile, state->surface, part, value, c, curved);
            kernel_cell_lines(c, p->frame, p->tile);
            kernel_cell_surface(p, state, c, curved, value, rays);
        }
    }
}

/* All surface layers: opaque hits go to p->t_far and hits, transparent ones into fragments. */
SIMD_INLINE void kernel_trace_surfaces(kernel_packet *p, kernel_hits *hits)
{
    const kernel_frame *f = p->frame;
    for (int n = 0; n < f->surface_count; n++) {
        kernel_surface_state state = {
            .surface = &f->surfaces[n], .layer = n, .hits = hits, .is_opaque = n < f->opaque_count};
        const render_field *field = &f->surfaces[n].layer->field;
        const kernel_descent descent = {&f->surfaces[n].interest, p->t_near, &p->t_far, kernel_surface_leaf, &state};
        if (f->job->traversal == RENDER_SPMD)
            kernel_trace_parts_spmd(p, field, &descent);
        else
            kernel_trace_parts(p, field, &descent);
    }
}

/* Normals by differences of the nearest opaque hits of a surface. Returns those that have theirs. */
SIMD_INLINE vm kernel_opaque_differences(kernel_packet *p, const kernel_surface *s, vm rays, kernel_hits *hits)
{
    vm ready = vm_none();
    for (int value = 0; value < s->layer->value_count; value++) {
        const vm mine = vm_and(rays, vf_eq(hits->kind, vf_set((float)((int)s->first_kind + value))));
        if (!vm_any(mine)) continue;
        kernel_look look = kernel_look_of(hits->normal, hits->colour);
        ready = vm_or(ready, kernel_differ(p, s, value, mine, p->t_far, hits->reach, &look));
        for (int a = 0; a < 3; a++) hits->normal[a] = look.normal[a];
    }
    return ready;
}

/* Writes the nearest opaque hits, lit, as fragments. */
SIMD_INLINE void kernel_emit_opaque(kernel_packet *p, kernel_hits *hits)
{
    for (int n = 0; n < p->frame->opaque_count; n++) {
        const kernel_surface *s = &p->frame->surfaces[n];
        const vf first = vf_set((float)s->first_kind);
        const vm mine = vm_and(vf_le(first, hits->kind), vf_lt(hits->kind, first + (float)s->layer->value_count));
        vm write = vm_and(hits->found, mine);
        if (!vm_any(write)) continue;
        if (s->layer->normal == RENDER_DIFFERENCES) write = kernel_opaque_differences(p, s, write, hits);
        if (s->layer->normal == RENDER_VERTEX) kernel_vertex_normals(p, s, write, p->t_far, &hits->cells, hits->normal);
        kernel_fragments lit = {
            p->t_far, p->t_far, {hits->colour[0], hits->colour[1], hits->colour[2]}, vf_set(0), hits->kind};
        kernel_paint(p, s, hits->normal, hits->kind, &lit);
        kernel_emit(p, write, 0, &lit);
    }
}

/* Lights hits that waited, by the samples of all ranks. out: as many fragments. */
static void kernel_light_waiting(const kernel_frame *f, kernel_thread *thread, const render_waiting_list *list,
                                 const render_samples_about *samples, int64_t first, int64_t count, fragment *out)
{
    kernel_waiting_run run;
    kernel_waiting_begin(&run);
    for (int64_t i = first; i < first + count; i += run.count) {
        kernel_samples_about about;
        vf normal[3], colour[3];
        kernel_waiting_take(&run, f, thread, list->items + i, first + count - i);
        for (int a = 0; a < 3; a++) {
            normal[a] = colour[a] = vf_set(0);
            for (int n = 0; n < run.count; n++) {
                normal[a][run.lanes[n]] = list->looks[i + n].normal[a];
                colour[a][run.lanes[n]] = list->looks[i + n].colour[a];
            }
        }
        kernel_load_about(&run, samples + i, &about);
        kernel_differentiate(&run.packet, &about, run.rays, normal);
        const float opacity = run.surface->layer->opacity;
        const vf kind = vf_set((float)((int)run.surface->first_kind + run.value));
        kernel_fragments lit = {
            run.t, run.t, {colour[0], colour[1], colour[2]}, vf_set(opacity < 1 ? 1 - opacity : 0), kind};
        kernel_paint(&run.packet, run.surface, normal, kind, &lit);
        for (int a = 0; a < 3 && opacity < 1; a++) lit.colour[a] *= opacity;
        for (int n = 0; n < run.count; n++) {
            const int lane = run.lanes[n];
            out[i + n] =
                (fragment){list->items[i + n].pixel, lit.t_in[lane],
                           lit.t_out[lane],          {lit.colour[0][lane], lit.colour[1][lane], lit.colour[2][lane]},
                           lit.transmittance[lane],  list->items[i + n].kind};
        }
    }
}

#endif
