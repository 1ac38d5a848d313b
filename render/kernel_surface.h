/* Isosurfaces: packet traversal to the cells whose values straddle an isovalue, and Neubauer's method in them (thesis,
 * sections 4.3.1 to 4.3.5).
 *
 * Within a cell, values are taken relative to the isovalue in double before they are rounded, so that their signs are
 * exact, and scaled by a power of two. Whether the surface crosses an interval is decided by the signs at its two
 * faces alone (not negative counts as inside); both are the faces' own, so of two cells that share a face exactly one
 * has a crossing next to it. */
#ifndef RENDER_KERNEL_SURFACE_H
#define RENDER_KERNEL_SURFACE_H

#include "kernel_colour.h"
#include "kernel_map.h"
#include "kernel_traverse.h"

/* Nearest opaque hits so far; and the crossings of transparent surfaces, by which volume fragments are cut. */
enum { KERNEL_MAX_CUTS = 32 };

typedef struct kernel_hits {
    vm found;
    vf normal[3]; /* along the gradient, camera axes, any length */
    vf colour[3]; /* unlit */
    vf kind;
    int cut_count; /* more than KERNEL_MAX_CUTS: the list is not whole */
    vm cut_mask[KERNEL_MAX_CUTS];
    vf cut[KERNEL_MAX_CUTS];
} kernel_hits;

typedef struct kernel_surface_state {
    const kernel_surface *surface;
    int layer;
    kernel_hits *hits;
    bool is_opaque;
} kernel_surface_state;

SIMD_INLINE bool kernel_cell_straddles(const kernel_cell *c, double value)
{
    bool below = false, above = false;
    for (int i = 0; i < c->count; i++) {
        below = below || c->values[i] < value;
        above = above || c->values[i] >= value;
    }
    return below && above;
}

/* The power of two that brings largest near 1, read off its bits: its exponent, mirrored. */
SIMD_INLINE double kernel_mirrored_power(double largest)
{
    uint64_t bits;
    memcpy(&bits, &largest, sizeof bits);
    const uint64_t exponent = bits >> 52;
    const uint64_t mirrored = exponent < 23 ? 2023 : exponent > 2023 ? 23 : 2046 - exponent;
    bits = mirrored << 52;
    double scale;
    memcpy(&scale, &bits, sizeof scale);
    return scale;
}

/* f: values minus the isovalue, times a power of two that brings the largest near 1. */
SIMD_INLINE void kernel_cell_relative(kernel_cell *c, double value)
{
    double largest = 0;
    for (int i = 0; i < c->count; i++) {
        const double size = fabs(c->values[i] - value);
        largest = size > largest ? size : largest;
    }
    const double scale = kernel_mirrored_power(largest);
    for (int i = 0; i < c->count; i++) c->f[i] = (float)((c->values[i] - value) * scale);
}

/* g: the colour field in its transfer's domain. Cells keep the field's order of vertices. */
SIMD_INLINE void kernel_cell_colours(kernel_cell *c, const kernel_surface *s, int part)
{
    const grid_field *field = &s->layer->colour_field.fields[part];
    for (int i = 0; i < c->count; i++) {
        const double v = grid_field_value(field, field->is_cell_centred ? c->index : c->vertices[i]);
        c->g[i] = (float)((v - s->colour.low) * s->colour.inverse_width);
    }
}

SIMD_INLINE void kernel_base_colour(const kernel_surface *s, int value, vf w, vf out[3])
{
    if (s->layer->colour_map) {
        kernel_table_colour(&s->colour, w, out);
        return;
    }
    for (int a = 0; a < 3; a++) out[a] = vf_set(s->layer->colours[3 * value + a]);
}

/* Gradients in tile space to camera axes: undo the shear. */
SIMD_INLINE void kernel_unshear(const kernel_packet *p, vf g[3])
{
    g[2] -= g[0] * p->tile->shear_x + g[1] * p->tile->shear_y;
}

/* A hit in the place of the nearest, as folded cells may have them: compositing decides, by bits that do not know which
 * cell came first. */
static __attribute__((noinline, cold)) void kernel_emit_tied(kernel_packet *p, const kernel_surface *s, int value,
                                                             vm tied, vf t, const vf normal[3], const vf colour[3])
{
    vf lit[3] = {colour[0], colour[1], colour[2]};
    kernel_shade(p, &s->layer->material, normal, lit);
    kernel_emit(p, tied, s->first_kind + (uint32_t)value, vf_set(0), t, t, lit, vf_set(0));
}

/* Hits at depth t: kept where the nearest, or written at once where the surface is transparent. */
SIMD_INLINE void kernel_accept(kernel_packet *p, kernel_surface_state *state, int value, vm hit, vf t,
                               const vf normal[3], vf w)
{
    const kernel_surface *s = state->surface;
    kernel_hits *hits = state->hits;
    vf colour[3];
    kernel_base_colour(s, value, w, colour);
    if (state->is_opaque) {
        const vm tied = vm_and(vm_and(hit, hits->found), vf_eq(t, p->t_far));
        if (__builtin_expect(vm_any(tied), 0)) {
            kernel_emit_tied(p, s, value, tied, t, normal, colour);
            hit = vm_andnot(hit, tied);
        }
        p->t_far = vf_select(hit, t, p->t_far);
        hits->found = vm_or(hits->found, hit);
        for (int a = 0; a < 3; a++) {
            hits->normal[a] = vf_select(hit, normal[a], hits->normal[a]);
            hits->colour[a] = vf_select(hit, colour[a], hits->colour[a]);
        }
        hits->kind = vf_select(hit, vf_set((float)((int)s->first_kind + value)), hits->kind);
        return;
    }
    kernel_shade(p, &s->layer->material, normal, colour);
    for (int a = 0; a < 3; a++) colour[a] *= s->layer->opacity;
    kernel_emit(p, hit, s->first_kind + (uint32_t)value, vf_set(0), t, t, colour, vf_set(1 - s->layer->opacity));
    if (hits->cut_count < KERNEL_MAX_CUTS) {
        hits->cut_mask[hits->cut_count] = hit;
        hits->cut[hits->cut_count] = t;
    }
    hits->cut_count++;
}

/* Rays on which the sign changes between the interval's faces, in front of the eye and of what is known. */
SIMD_INLINE vm kernel_changes_sign(const kernel_packet *p, const kernel_interval *i)
{
    const vf zero = vf_set(0);
    const vm change = vm_xor(vf_lt(i->v_in, zero), vf_lt(i->v_out, zero));
    return vm_and(vm_and(i->mask, change), vm_and(vf_le(i->t_in, p->t_far), vf_le(p->t_near, i->t_out)));
}

/* Where the line through the ends is zero. */
SIMD_INLINE vf kernel_secant(vf t0, vf v0, vf t1, vf v1)
{
    return vf_clamp(t0 - v0 * ((t1 - t0) / (v1 - v0)), t0, t1);
}

SIMD_INLINE vm kernel_visible(const kernel_packet *p, vm hit, vf t)
{
    return vm_and(hit, vm_and(vf_le(p->t_near, t), vf_le(t, p->t_far)));
}

/* The gradient of a tet's field, by Cramer's rule in double; its length and sign do not matter. */
SIMD_INLINE void kernel_tet_normal(const kernel_packet *p, const kernel_cell *c, vf out[3])
{
    double d[3][3], df[3], g[3];
    for (int i = 0; i < 3; i++) {
        df[i] = (double)c->f[i + 1] - (double)c->f[0];
        for (int a = 0; a < 3; a++) d[i][a] = (c->world[i + 1][a] - c->world[0][a]) * p->frame->job->space.scale;
    }
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, e = (a + 2) % 3;
        g[a] = df[0] * (d[1][b] * d[2][e] - d[1][e] * d[2][b]) + df[1] * (d[2][b] * d[0][e] - d[2][e] * d[0][b]) +
               df[2] * (d[0][b] * d[1][e] - d[0][e] * d[1][b]);
    }
    double largest = 0;
    for (int a = 0; a < 3; a++) largest = fabs(g[a]) > largest ? fabs(g[a]) : largest;
    const double scale = largest > 0 ? 1 / (largest * p->frame->job->space.scale) : 0;
    for (int a = 0; a < 3; a++) {
        const double *axis = p->frame->scaled_axes[a];
        out[a] = vf_set((float)((axis[0] * g[0] + axis[1] * g[1] + axis[2] * g[2]) * scale));
    }
}

SIMD_INLINE void kernel_tet_surface(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c, int value,
                                    vm rays)
{
    const bool has_colour = state->surface->layer->colour_map != NULL;
    kernel_interval i;
    kernel_tet_interval(p, c, rays, has_colour, &i);
    const vm change = kernel_changes_sign(p, &i);
    if (!vm_any(change)) return;
    const vf t = kernel_secant(i.t_in, i.v_in, i.t_out, i.v_out);
    const vm hit = kernel_visible(p, change, t);
    if (!vm_any(hit)) return;
    vf normal[3], w = vf_set(0);
    kernel_tet_normal(p, c, normal);
    if (has_colour) {
        const vf length = i.t_out - i.t_in;
        const vf along = vf_select(vf_lt(vf_set(0), length), (t - i.t_in) / length, vf_set(0));
        w = i.w_in + along * (i.w_out - i.w_in);
    }
    kernel_accept(p, state, value, hit, t, normal, w);
}

/* A guess for the coordinates at t: on the line between those at the faces. */
SIMD_INLINE void kernel_guess(const kernel_interval *i, vf t, vf r[3])
{
    const vf length = i->t_out - i->t_in;
    const vf along = vf_select(vf_lt(vf_set(0), length), (t - i->t_in) / length, vf_set(0));
    for (int a = 0; a < 3; a++) r[a] = i->r_in[a] + along * (i->r_out[a] - i->r_in[a]);
}

/* Field at t, by the inverse map; on rays where that fails, the line between the faces' values, counted. */
SIMD_INLINE vf kernel_value_at(kernel_packet *p, const kernel_map *map, const kernel_interval *i, vm rays, vf t)
{
    vf r[3];
    kernel_guess(i, t, r);
    const vm failed = kernel_map_invert(p, map, rays, t, r);
    const vf value = kernel_map_value(map, &map->field, r);
    if (!vm_any(failed)) return value;
    p->thread->map_failures += __builtin_popcount(vm_bits(failed));
    const vf length = i->t_out - i->t_in;
    const vf along = vf_select(vf_lt(vf_set(0), length), (t - i->t_in) / length, vf_set(0));
    return vf_select(failed, i->v_in + along * (i->v_out - i->v_in), value);
}

/* Neubauer's method (thesis, algorithm 4.2): steps of regula falsi on the field along the ray. */
SIMD_INLINE vf kernel_neubauer(kernel_packet *p, const kernel_map *map, const kernel_interval *i, vm rays, int steps)
{
    vf t0 = i->t_in, t1 = i->t_out, v0 = i->v_in, v1 = i->v_out;
    for (int n = 0; n < steps; n++) {
        const vf t = kernel_secant(t0, v0, t1, v1);
        const vf v = kernel_value_at(p, map, i, rays, t);
        const vm same = vm_not(vm_xor(vf_lt(v, vf_set(0)), vf_lt(v0, vf_set(0))));
        t0 = vf_select(same, t, t0);
        v0 = vf_select(same, v, v0);
        t1 = vf_select(same, t1, t);
        v1 = vf_select(same, v1, v);
    }
    return kernel_secant(t0, v0, t1, v1);
}

SIMD_INLINE void kernel_poly_surface(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c, int value,
                                     vm rays)
{
    const render_surface_layer *layer = state->surface->layer;
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const int count = kernel_poly_intervals(p, c, rays, false, list);
    kernel_map map;
    bool is_set_up = false;
    for (int n = 0; n < count; n++) {
        const kernel_interval *i = &list[n];
        const vm change = kernel_changes_sign(p, i);
        if (!vm_any(change)) continue;
        if (!is_set_up) {
            kernel_map_setup(&map, c);
            if (layer->colour_map) kernel_map_colour(&map, c);
            is_set_up = true;
        }
        const vf t = kernel_neubauer(p, &map, i, change, layer->root_steps);
        const vm hit = kernel_visible(p, change, t);
        if (!vm_any(hit)) continue;
        vf r[3], normal[3], w = vf_set(0);
        kernel_guess(i, t, r);
        kernel_map_invert(p, &map, hit, t, r);
        kernel_map_normal(&map, r, normal);
        kernel_unshear(p, normal);
        if (layer->colour_map) w = kernel_map_value(&map, &map.colour, r);
        kernel_accept(p, state, value, hit, t, normal, w);
    }
}

/* kernel_polyhedron_surface.h */
static void kernel_polyhedron_surfaces(kernel_packet *p, kernel_surface_state *state, int part, uint32_t index,
                                       vm rays);

static void kernel_surface_leaf(kernel_packet *p, void *opaque_state, int part, const uint32_t *cells, int count,
                                vm rays)
{
    kernel_surface_state *state = opaque_state;
    const render_surface_layer *layer = state->surface->layer;
    const grid *g = p->frame->job->parts[part].cells;
    for (int n = 0; n < count; n++) {
        kernel_cell *c = kernel_cell_find(p, state->layer, part, &layer->field.fields[part], cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_polyhedron_surfaces(p, state, part, cells[n], rays);
            continue;
        }
        if (!c->is_finite) continue;
        for (int value = 0; value < layer->value_count; value++) {
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            const bool is_fresh = !c->is_placed;
            if (is_fresh) {
                kernel_cell_place(c, p, g);
                if (layer->colour_map) kernel_cell_colours(c, state->surface, part);
            }
            if (is_fresh || layer->value_count > 1) kernel_cell_relative(c, layer->values[value]);
            if (c->type == GRID_TET)
                kernel_tet_surface(p, state, c, value, rays);
            else
                kernel_poly_surface(p, state, c, value, rays);
        }
    }
}

/* All surface layers: opaque hits go to p->t_far and hits, transparent ones into fragments. */
SIMD_INLINE void kernel_trace_parts(kernel_packet *p, const render_field *field, const kernel_interest *interest,
                                    vf t_low, const vf *t_high, kernel_leaf *leaf, void *state);

SIMD_INLINE void kernel_trace_surfaces(kernel_packet *p, kernel_hits *hits)
{
    const kernel_frame *f = p->frame;
    for (int n = 0; n < f->surface_count; n++) {
        kernel_surface_state state = {
            .surface = &f->surfaces[n], .layer = n, .hits = hits, .is_opaque = n < f->opaque_count};
        kernel_trace_parts(p, &f->surfaces[n].layer->field, &f->surfaces[n].interest, p->t_near, &p->t_far,
                           kernel_surface_leaf, &state);
    }
}

/* The nearest opaque hits, lit. */
SIMD_INLINE void kernel_emit_opaque(kernel_packet *p, kernel_hits *hits)
{
    for (int n = 0; n < p->frame->opaque_count; n++) {
        const kernel_surface *s = &p->frame->surfaces[n];
        const vf first = vf_set((float)s->first_kind);
        const vm mine = vm_and(vf_le(first, hits->kind), vf_lt(hits->kind, first + (float)s->layer->value_count));
        const vm write = vm_and(hits->found, mine);
        if (!vm_any(write)) continue;
        vf colour[3] = {hits->colour[0], hits->colour[1], hits->colour[2]};
        kernel_shade(p, &s->layer->material, hits->normal, colour);
        kernel_emit(p, write, 0, hits->kind, p->t_far, p->t_far, colour, vf_set(0));
    }
}

#endif
