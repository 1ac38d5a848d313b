/* Lights a packet's nearest opaque hits and emits them as fragments. Also lights pending hits: hits whose normals need
 * samples of other ranks' cells, after the samples of all ranks have been merged (render_differences.h). */
#ifndef RENDER_KERNEL_PACKET_SURFACE_H
#define RENDER_KERNEL_PACKET_SURFACE_H

#include <string.h>

#include "kernel_accept.h"
#include "kernel_colour.h"
#include "kernel_hits.h"
#include "kernel_packet.h"
#include "kernel_surface.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Computes normals by central differences for the given rays' hits on the opaque surface s. Returns the hits whose
 * normals are known. The other hits need samples of other ranks' cells, and are added to the list of pending hits. */
SIMD_INLINE vm kernel_compute_opaque_hit_normals(kernel_packet *p, const kernel_surface *s, vm rays, kernel_hits *hits)
{
    kernel_surface_hits h = {.value = vi_from_vf(hits->kind) - (int)s->first_kind, .t = p->t_far, .reach = hits->reach};
    memcpy(h.normal, hits->normal, sizeof h.normal);
    memcpy(h.colour, hits->colour, sizeof h.colour);
    const vm ready = kernel_sample_or_defer_hits(p, s, rays, &h);
    memcpy(hits->normal, h.normal, sizeof h.normal);
    return ready;
}

/* Lights the nearest opaque hits and emits them as fragments. */
SIMD_INLINE void kernel_emit_opaque_hits(kernel_packet *p, kernel_hits *hits)
{
    for (int n = 0; n < p->frame->opaque_count; n++) {
        const kernel_surface *s = &p->frame->surfaces[n];
        const vf first = vf_set((float)s->first_kind);
        const vm mine = vm_and(vf_le(first, hits->kind), vf_lt(hits->kind, first + (float)s->layer->value_count));
        vm write = vm_and(hits->found, mine);
        if (!vm_any(write)) continue;
        if (s->layer->normal == RENDER_DIFFERENCES) write = kernel_compute_opaque_hit_normals(p, s, write, hits);
        if (s->layer->normal == RENDER_VERTEX)
            kernel_vertex_normals(p, s, write, p->t_far, hits->part, hits->cell, hits->normal);
        kernel_fragments lit = {
            p->t_far, p->t_far, {hits->colour[0], hits->colour[1], hits->colour[2]}, vf_set(0), hits->kind};
        kernel_compute_fragment_colours(p, s, hits->normal, hits->kind, &lit);
        kernel_append_fragments(p, write, 0, &lit);
    }
}

/* Computes the normals of pending hits from the samples that have been merged over all ranks, and lights the hits.
 * shadings: per hit, the gradient in its own cell, in camera axes, and its colour before lighting. out[i] becomes the
 * fragment of hit i. */
static void kernel_light_pending(const kernel_frame *f, kernel_thread *thread, const render_pending_hit *hits,
                                 float (*shadings)[2][3], const render_difference_samples *samples, fragment *out,
                                 int64_t count)
{
    kernel_pending_group run;
    kernel_pending_group_reset(&run);
    for (int64_t i = 0; i < count; i += run.count) {
        vm found[RENDER_DIFFERENCE_SAMPLES];
        vf values[RENDER_DIFFERENCE_SAMPLES], normal[3], colour[3];
        kernel_pending_group_begin(&run, f, thread, hits + i, count - i);
        for (int a = 0; a < 3; a++) {
            normal[a] = colour[a] = vf_set(0);
            for (int n = 0; n < run.count; n++) {
                normal[a][run.lanes[n]] = shadings[i + n][0][a];
                colour[a][run.lanes[n]] = shadings[i + n][1][a];
            }
        }
        kernel_load_difference_samples(&run, samples + i, found, values);
        kernel_normals_from_samples(&run.packet, found, values, run.rays, normal);
        const float opacity = run.surface->layer->opacity;
        const vf kind = vf_set((float)((int)run.surface->first_kind + run.value));
        kernel_fragments lit = {
            run.t, run.t, {colour[0], colour[1], colour[2]}, vf_set(opacity < 1 ? 1 - opacity : 0), kind};
        kernel_compute_fragment_colours(&run.packet, run.surface, normal, kind, &lit);
        for (int a = 0; a < 3 && opacity < 1; a++) lit.colour[a] *= opacity;
        for (int n = 0; n < run.count; n++) {
            const int lane = run.lanes[n];
            out[i + n] =
                (fragment){hits[i + n].pixel,       lit.t_in[lane],
                           lit.t_out[lane],         {lit.colour[0][lane], lit.colour[1][lane], lit.colour[2][lane]},
                           lit.transmittance[lane], hits[i + n].kind};
        }
    }
}

#endif
