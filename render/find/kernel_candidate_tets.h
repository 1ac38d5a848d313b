/* Tets, found as many at once as there are lanes (kernel_candidates.h).
 *
 * In float32 from the eye on: positions err by 8 roundings of their distance from it, and so do X, Y and depth; all of
 * it is within the pads of kernel_pixel_range(), which take this of the picture's scale too. */
#ifndef RENDER_KERNEL_CANDIDATE_TETS_H
#define RENDER_KERNEL_CANDIDATE_TETS_H

#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_finder.h"
#include "kernel_interest.h"
#include "kernel_shapes.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_tet_lanes {
    vf f[4], at[3][4]; /* values less the isovalue; from the eye, in the space's scale */
    vm negative[4];
} kernel_tet_lanes;

/* Turns the vertices into the camera's axes. */
SIMD_INLINE void kernel_tet_lanes_turn(const kernel_finder *s, const kernel_tet_lanes *l, vf at[4][3])
{
    for (int i = 0; i < 4; i++) {
        const vf place[3] = {l->at[0][i], l->at[1][i], l->at[2][i]};
        kernel_place_turn(s, place, at[i]);
    }
}

SIMD_INLINE void kernel_tet_lanes_ends(const kernel_finder *s, const kernel_tet_lanes *l, kernel_ends_lanes *e)
{
    vf at[4][3];
    kernel_tet_lanes_turn(s, l, at);
    *e = kernel_no_ends();
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(l->negative[i], l->negative[j]);
        const vf along = vf_max(l->f[i] / (l->f[i] - l->f[j]), vf_set(0)); /* not 0 / 0 */
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = at[i][a] + along * (at[j][a] - at[i][a]);
        kernel_ends_add(s, e, point, crossed);
    }
}

SIMD_INLINE void kernel_tets_add(kernel_finder *s, const kernel_ends_lanes *e, unsigned lanes, const uint32_t *cells,
                                 uint32_t source)
{
    uint32_t sources[SIMD_WIDTH];
    for (int n = 0; n < SIMD_WIDTH; n++) sources[n] = source;
    kernel_add_lanes(s, e, lanes, cells, sources);
}

/* Tets of a packed mesh. v < value is v < the least float not below it. The differences' signs are right but where they
 * vanish in float32, and then along an edge that is as good as a point. */
SIMD_INLINE void kernel_packed_value(kernel_finder *s, const vf v[4], kernel_tet_lanes *l, int value)
{
    const double isovalue = s->surface->layer->values[value];
    const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
    const vf least = vf_set(kernel_not_below(isovalue));
    vf size = vf_set(0);
    vm usual = vm_all_lanes(), negative = vm_none(), positive = vm_none();
    for (int i = 0; i < 4; i++) {
        l->f[i] = (v[i] - middle) - rest;
        l->negative[i] = vf_lt(v[i], least);
        negative = vm_or(negative, l->negative[i]);
        positive = vm_or(positive, vf_le(least, v[i]));
        size = vf_max(vf_abs(l->f[i]), size);
        usual = vm_and(usual, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(l->at[a][i]), vf_set(1e15f)));
    }
    usual = vm_and(usual, vf_lt(vf_set(1e-30f), size));
    const unsigned all = (1u << s->tets.count) - 1, crossed = vm_bits(vm_and(negative, positive)) & all;
    /* Values too large, too small or NaN for lanes are handled one by one. */
    const unsigned good = crossed & vm_bits(usual);
    if (good) {
        kernel_ends_lanes e;
        kernel_tet_lanes_ends(s, l, &e);
        kernel_tets_add(s, &e, good, s->tets.cell, s->source + (uint32_t)value);
    }
    for (unsigned odd = crossed & ~good; odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          s->tets.cell[__builtin_ctz(odd)]);
        kernel_find_alone(s, &s->cell, value);
    }
}

/* As kernel_packed_value(), for all that a volume shows of tets or hexes of a packed mesh, of so many vertices. */
static __attribute__((noinline)) void kernel_find_packed_volume(kernel_finder *s, int vertices)
{
    const kernel_packed *p = &s->packed;
    kernel_tets *t = &s->tets;
    kernel_ends_lanes e = kernel_no_ends();
    vm usual = vm_all_lanes();
    vf v[8];
    if (!t->count) return;
    kernel_tets_fill(t, vertices);
    for (int i = 0; i < vertices; i++) {
        vi vertex;
        vf place[3], at[3];
        memcpy(&vertex, t->packed[i], sizeof vertex);
        v[i] = vf_gather(p->values, vertex * p->value_stride);
        usual = vm_and(usual, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        kernel_packed_place(p, vertex, place);
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(place[a]), vf_set(1e15f)));
        kernel_place_turn(s, place, at);
        kernel_ends_add(s, &e, at, vm_all_lanes());
    }
    const vm shows = kernel_interest_meets_values(s->interest, v, vertices);
    const unsigned all = (1u << t->count) - 1, good = all & vm_bits(vm_and(usual, shows));
    if (good) kernel_tets_add(s, &e, good, t->cell, s->source);
    for (unsigned odd = all & ~vm_bits(usual); odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          t->cell[__builtin_ctz(odd)]);
        kernel_find_volume(s);
    }
    t->count = 0;
}

static void kernel_find_packed_tets(kernel_finder *s)
{
    const kernel_packed *p = &s->packed;
    kernel_tets *t = &s->tets;
    kernel_tet_lanes l;
    vf v[4];
    if (!t->count) return;
    kernel_tets_fill(t, 4);
    for (int i = 0; i < 4; i++) {
        vi vertex;
        vf place[3];
        memcpy(&vertex, t->packed[i], sizeof vertex);
        v[i] = vf_gather(p->values, vertex * p->value_stride);
        kernel_packed_place(p, vertex, place);
        for (int a = 0; a < 3; a++) l.at[a][i] = place[a];
    }
    for (int value = 0; value < s->surface->layer->value_count; value++)
        kernel_packed_value(s, v, &l, value);
    t->count = 0;
}

/* Looks for tets of any other mesh, which are fetched one by one into lanes. */
static void kernel_find_any_tets(kernel_finder *s)
{
    if (!s->tets.count) return;
    const render_surface_layer *layer = s->surface->layer;
    const grid_field *field = &layer->field.fields[s->part];
    const grid *g = s->frame->job->parts[s->part].cells;
    const double *eye = s->frame->job->camera.eye, scale = s->frame->job->space.scale;
    kernel_cell *c = &s->cell;
    for (int value = 0; value < layer->value_count; value++) {
        float f[4][SIMD_WIDTH] = {{0}}, at[3][4][SIMD_WIDTH] = {{{0}}};
        uint32_t cells[SIMD_WIDTH];
        int count = 0;
        for (int n = 0; n < s->tets.count; n++) {
            c->count = 4;
            if (!grid_cell_values(field, s->tets.cell[n], s->tets.vertices[n], 4, c->values)) continue;
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            kernel_cell_relative(c, layer->values[value]);
            for (int i = 0; i < 4; i++) {
                double world[3];
                grid_vertex(g, s->tets.vertices[n][i], world);
                for (int a = 0; a < 3; a++) at[a][i][count] = (float)((world[a] - eye[a]) * scale);
                f[i][count] = c->f[i];
            }
            cells[count++] = s->tets.cell[n];
        }
        if (!count) continue;
        kernel_tet_lanes l;
        kernel_ends_lanes e;
        for (int i = 0; i < 4; i++) {
            l.f[i] = vf_load(f[i]);
            l.negative[i] = vf_lt(l.f[i], vf_set(0));
            for (int a = 0; a < 3; a++) l.at[a][i] = vf_load(at[a][i]);
        }
        kernel_tet_lanes_ends(s, &l, &e);
        kernel_tets_add(s, &e, (1u << count) - 1, cells, s->source + (uint32_t)value);
    }
    s->tets.count = 0;
}

#endif
