/* Crossed cells of a mesh of float32 put side by side, for pictures to come (render_active_cells.h). Sizes are such
 * that each picture of the same scale finds a tet's numbers usual (kernel_candidate_surfaces.h): a mesh that has others
 * among them is not kept. */
#ifndef RENDER_KERNEL_ACTIVE_CELLS_H
#define RENDER_KERNEL_ACTIVE_CELLS_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Returns the lanes that some isovalue crosses. unusual: one of these has a difference that float32 cannot hold with
 * full precision. */
SIMD_INLINE unsigned kernel_activate_crossed(const kernel_finder *s, const kernel_cells *c, const vf *v, bool *unusual)
{
    const render_surface_layer *layer = s->surface->layer;
    vf low = vf_set(INFINITY), high = vf_set(-INFINITY), most = vf_set(0);
    vm finite = vm_all_lanes(), any = vm_none(), odd = vm_none();
    for (int i = 0; i < c->vertices; i++) {
        low = vf_min(v[i], low);
        high = vf_max(v[i], high);
        most = vf_max(vf_abs(v[i]), most);
        finite = vm_and(finite, vf_lt(vf_abs(v[i]), vf_set(INFINITY)));
    }
    for (int value = 0; value < layer->value_count; value++) {
        const double isovalue = layer->values[value];
        const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
        const vf least = vf_set(kernel_not_below(isovalue));
        const vm crossed = vm_and(finite, vm_and(vf_lt(low, least), vf_le(least, high)));
        vf largest = vf_set(0);
        for (int i = 0; i < c->vertices; i++) largest = vf_max(vf_abs((v[i] - middle) - rest), largest);
        odd = vm_or(odd, vm_and(crossed, vm_not(vf_lt(vf_set(1e-30f), largest))));
        any = vm_or(any, crossed);
    }
    odd = vm_or(odd, vm_and(any, vm_not(vf_lt(most, vf_set(KERNEL_ACTIVE_VALUE)))));
    const unsigned lanes = (1u << c->count) - 1;
    *unusual = vm_bits(odd) & lanes;
    return vm_bits(any) & lanes;
}

/* Writes the cell's record. Returns false where a coordinate is too large. */
SIMD_INLINE bool kernel_activate_cell(kernel_finder *s, const kernel_cells *c, int lane)
{
    const kernel_arrays *p = &s->arrays;
    const float most = KERNEL_ACTIVE_PLACE / (float)s->frame->job->space.scale;
    float *at = s->writer->at;
    bool is_usual = true;
    for (int i = 0; i < c->vertices; i++, at += KERNEL_ACTIVE_FLOATS) {
        const int64_t vertex = c->vertex[i][lane];
        for (int a = 0; a < 3; a++) {
            at[a] = p->coordinates[a].data[vertex * p->coordinates[a].stride];
            is_usual = is_usual && fabsf(at[a]) < most;
        }
        at[3] = p->values.data[vertex * p->values.stride];
    }
    s->writer->at = at;
    return is_usual;
}

/* Makes records of the pending cells, whose vertices have come. */
static void kernel_activate_pending(kernel_finder *s, const kernel_cells *c)
{
    kernel_active_writer *k = s->writer;
    vf v[8];
    bool unusual;
    for (int i = 0; i < c->vertices; i++)
        v[i] = vf_gather(s->arrays.values.data, kernel_cells_vertex(c, i) * s->arrays.values.stride);
    unsigned lanes = kernel_activate_crossed(s, c, v, &unusual);
    k->is_refused = k->is_refused || unusual;
    for (; lanes && !k->is_refused; lanes &= lanes - 1) {
        if (k->at == k->end && !s->keep(k)) break;
        if (!kernel_activate_cell(s, c, __builtin_ctz(lanes))) k->is_refused = true;
    }
}

#endif
