/* Crossed cells of a packed mesh put side by side, for pictures to come (render_active_cells.h). Sizes are such that
 * each picture of the same scale finds a tet's numbers usual (kernel_candidate_tets.h): a mesh that has others among
 * them is not kept. */
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
SIMD_INLINE unsigned kernel_activate_crossed(const kernel_finder *s, const vf *v, int vertices, bool *unusual)
{
    const render_surface_layer *layer = s->surface->layer;
    vf low = vf_set(INFINITY), high = vf_set(-INFINITY), most = vf_set(0);
    vm finite = vm_all_lanes(), any = vm_none(), odd = vm_none();
    for (int i = 0; i < vertices; i++) {
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
        for (int i = 0; i < vertices; i++) largest = vf_max(vf_abs((v[i] - middle) - rest), largest);
        odd = vm_or(odd, vm_and(crossed, vm_not(vf_lt(vf_set(1e-30f), largest))));
        any = vm_or(any, crossed);
    }
    odd = vm_or(odd, vm_and(any, vm_not(vf_lt(most, vf_set(KERNEL_ACTIVE_VALUE)))));
    const unsigned lanes = (1u << s->tets.count) - 1;
    *unusual = vm_bits(odd) & lanes;
    return vm_bits(any) & lanes;
}

/* Writes the cell's record. Returns false where a coordinate is too large. */
SIMD_INLINE bool kernel_activate_cell(kernel_finder *s, int lane, int vertices)
{
    const kernel_packed *p = &s->packed;
    const float most = KERNEL_ACTIVE_PLACE / p->scale;
    float *at = s->writer->at;
    bool is_usual = true;
    for (int i = 0; i < vertices; i++, at += KERNEL_ACTIVE_FLOATS) {
        const int64_t vertex = s->tets.packed[i][lane];
        for (int a = 0; a < 3; a++) {
            at[a] = p->coordinates[a][vertex * p->stride];
            is_usual = is_usual && fabsf(at[a]) < most;
        }
        at[3] = p->values[vertex * p->value_stride];
    }
    s->writer->at = at;
    return is_usual;
}

/* Makes records of the pending cells, whose vertices have come. */
static void kernel_activate_pending(kernel_finder *s)
{
    const int vertices = s->writer->vertices;
    kernel_active_writer *k = s->writer;
    vf v[8];
    bool unusual;
    if (!s->tets.count) return;
    kernel_tets_fill(&s->tets, vertices);
    for (int i = 0; i < vertices; i++) {
        vi vertex;
        memcpy(&vertex, s->tets.packed[i], sizeof vertex);
        v[i] = vf_gather(s->packed.values, vertex * s->packed.value_stride);
    }
    unsigned lanes = kernel_activate_crossed(s, v, vertices, &unusual);
    k->is_refused = k->is_refused || unusual;
    for (; lanes && !k->is_refused; lanes &= lanes - 1) {
        if (k->at == k->end && !s->keep(k)) break;
        if (!kernel_activate_cell(s, __builtin_ctz(lanes), vertices)) k->is_refused = true;
    }
    s->tets.count = 0;
}

#endif
