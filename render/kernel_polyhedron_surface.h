/* Isosurfaces in polyhedra: the first place on the profile where the sign is no longer that of the entry. It is exact:
 * a linear piece has one root at most. */
#ifndef RENDER_KERNEL_POLYHEDRON_SURFACE_H
#define RENDER_KERNEL_POLYHEDRON_SURFACE_H

#include "kernel_polyhedron.h"
#include "kernel_surface.h"

SIMD_INLINE bool kernel_polyhedron_straddles(const polyhedron *c, double value)
{
    bool below = false, above = false;
    for (int i = 0; i < c->vertex_count; i++) {
        below = below || c->values[i] < value;
        above = above || c->values[i] >= value;
    }
    return below && above;
}

SIMD_INLINE void kernel_polyhedron_relative(polyhedron *c, double value)
{
    double largest = 0;
    for (int i = 0; i < c->vertex_count; i++) {
        const double size = fabs(c->values[i] - value);
        largest = size > largest ? size : largest;
    }
    const double scale = kernel_mirrored_power(largest);
    for (int i = 0; i <= c->vertex_count; i++) c->f[i] = (float)((c->values[i] - value) * scale);
}

static void kernel_polyhedron_colours(polyhedron *c, const kernel_surface *s, int part)
{
    const grid_field *field = &s->layer->colour_field.fields[part];
    double sum = 0;
    for (int i = 0; i < c->vertex_count; i++) {
        const double v = grid_field_value(field, field->is_cell_centred ? c->index : c->vertices[i]);
        const double place = (v - s->colour.low) * s->colour.inverse_width;
        c->g[i] = (float)place;
        sum += place / c->vertex_count;
    }
    c->g[c->vertex_count] = (float)sum;
}

/* The gradient of the field in a tet, in camera axes, by Cramer's rule in double. */
static void kernel_polyhedron_gradient(const kernel_packet *p, const polyhedron *c, int facet, double out[3])
{
    const int *vertex = c->facets[facet].vertex, centre = c->vertex_count;
    const double scale = p->frame->job->space.scale;
    double d[3][3], df[3], g[3], n[3][3];
    for (int i = 0; i < 3; i++) {
        df[i] = (double)c->f[vertex[i]] - (double)c->f[centre];
        for (int a = 0; a < 3; a++) d[i][a] = (c->world[vertex[i]][a] - c->world[centre][a]) * scale;
    }
    for (int i = 0; i < 3; i++) {
        const double *u = d[(i + 1) % 3], *v = d[(i + 2) % 3];
        for (int a = 0; a < 3; a++) n[i][a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
    }
    const double volume = d[0][0] * n[0][0] + d[0][1] * n[0][1] + d[0][2] * n[0][2];
    for (int a = 0; a < 3; a++) g[a] = (df[0] * n[0][a] + df[1] * n[1][a] + df[2] * n[2][a]) / volume;
    for (int a = 0; a < 3; a++) {
        const double *axis = p->frame->scaled_axes[a];
        const double along = (axis[0] * g[0] + axis[1] * g[1] + axis[2] * g[2]) / scale;
        out[a] = along > 1e18 ? 1e18 : along >= -1e18 ? along : -1e18;
    }
}

/* Where tets overlap: the signed sum of their gradients. Returns the rays that have one. */
static vm kernel_polyhedron_sum_normals(const kernel_packet *p, const polyhedron *c, const kernel_passage *r, vm hit,
                                        vf t, vf out[3])
{
    vf cover = vf_set(0);
    for (int n = 0; n < r->segment_count; n++) {
        const kernel_tet_span *s = &r->segments[n];
        const vm in = vm_and(hit, kernel_tet_span_holds(s, t, false));
        if (!vm_any(in)) continue;
        double g[3];
        kernel_polyhedron_gradient(p, c, s->facet, g);
        cover = vf_select(in, cover + s->sign, cover);
        for (int a = 0; a < 3; a++) out[a] = vf_select(in, out[a] + s->sign * (float)g[a], out[a]);
    }
    return vm_and(hit, vf_eq(cover, vf_set(1)));
}

/* The gradient at the hits: of the positive tet that holds them, or is nearest to that. */
static void kernel_polyhedron_normal(const kernel_packet *p, const polyhedron *c, const kernel_passage *r, vm hit, vf t,
                                     vf out[3])
{
    for (int a = 0; a < 3; a++) out[a] = vf_set(0);
    if (!c->is_star) hit = vm_andnot(hit, kernel_polyhedron_sum_normals(p, c, r, hit, t, out));
    vf nearest = vf_set(INFINITY);
    for (int n = 0; n < r->segment_count; n++) {
        const kernel_tet_span *s = &r->segments[n];
        const vf away = vf_max(vf_max(s->t0 - t, t - s->t1), vf_set(0));
        const vm nearer = vm_and(vm_and(hit, s->mask), vf_lt(away, nearest));
        if (!vm_any(nearer) || s->sign < 0) continue;
        double g[3];
        kernel_polyhedron_gradient(p, c, s->facet, g);
        nearest = vf_select(nearer, away, nearest);
        for (int a = 0; a < 3; a++) out[a] = vf_select(nearer, vf_set((float)g[a]), out[a]);
    }
}

/* The inside's value at an end, or the face's where the two do not agree on the side. */
SIMD_INLINE vf kernel_polyhedron_end(vf inside, vf face)
{
    const vm differ = vm_xor(vf_lt(inside, vf_set(0)), vf_lt(face, vf_set(0)));
    return vf_select(differ, face, inside);
}

/* The root on each ray of change, and the colour field there. */
static vf kernel_polyhedron_root(const kernel_passage *r, const kernel_stay *stay, vm change, vf *w)
{
    const kernel_interval *i = &stay->interval;
    const vf v_in = kernel_polyhedron_end(stay->u_in, i->v_in), v_out = kernel_polyhedron_end(stay->u_out, i->v_out);
    const vm below = vf_lt(v_in, vf_set(0));
    kernel_profile_piece piece = kernel_profile_begin(stay, v_in);
    vf root = i->t_out;
    vm open = change;
    while (vm_any(open)) {
        const vm last = vm_not(kernel_profile_open(stay, &piece, open));
        kernel_profile_next(r, stay, v_out, &piece);
        const vm cross = vm_and(open, vm_xor(vf_lt(piece.v1, vf_set(0)), below));
        const vf t = kernel_secant(piece.t0, piece.v0, piece.t1, piece.v1), length = piece.t1 - piece.t0;
        const vf along = vf_select(vf_lt(vf_set(0), length), (t - piece.t0) / length, vf_set(0));
        root = vf_select(cross, t, root);
        *w = vf_select(cross, piece.w0 + along * (piece.w1 - piece.w0), *w);
        open = vm_andnot(vm_andnot(open, cross), last);
    }
    return root;
}

static void kernel_polyhedron_surface(kernel_packet *p, kernel_surface_state *state, const polyhedron *c, int value,
                                      vm rays)
{
    const bool has_colour = state->surface->layer->colour_map != NULL;
    kernel_passage r;
    kernel_stay stay;
    if (!kernel_passage_open(p, c, &r) || !kernel_passage_cross(p, c, rays, has_colour, &r)) return;
    while (kernel_passage_next(&r, &stay)) {
        const vm change = vm_and(kernel_changes_sign(&stay.interval), kernel_is_near(p, &stay.interval));
        if (!vm_any(change)) continue;
        vf normal[3], w = vf_set(0);
        kernel_passage_profile(p, c, rays, has_colour, &r, &stay);
        const vf t = kernel_polyhedron_root(&r, &stay, change, &w);
        const vm hit = kernel_visible(p, change, t);
        if (!vm_any(hit)) continue;
        kernel_passage_segments(c, rays, &r);
        kernel_polyhedron_normal(p, c, &r, hit, t, normal);
        kernel_accept(p, state, NULL, value, hit, t, normal, w);
    }
}

static void kernel_polyhedron_surfaces(kernel_packet *p, kernel_surface_state *state, int part, uint32_t index, vm rays)
{
    const render_surface_layer *layer = state->surface->layer;
    polyhedron *c = p->thread->find_polyhedron(p->thread->polyhedra, p->frame->job->parts[part].cells,
                                               &layer->field.fields[part], part, state->layer, index);
    if (!c) p->thread->out_of_memory = true;
    if (!c || !c->is_finite) return;
    for (int value = 0; value < layer->value_count; value++) {
        if (!kernel_polyhedron_straddles(c, layer->values[value])) continue;
        const bool is_fresh = !c->is_placed;
        if (is_fresh) {
            kernel_polyhedron_place(c, p);
            if (layer->colour_map) kernel_polyhedron_colours(c, state->surface, part);
        }
        if (is_fresh || layer->value_count > 1) kernel_polyhedron_relative(c, layer->values[value]);
        kernel_polyhedron_surface(p, state, c, value, rays);
    }
}

#endif
