/* Isosurfaces in cells: which crossings a ray has, and what becomes of a hit (thesis, sections 4.3.3 to 4.3.5).
 *
 * Within a cell, values are taken relative to the isovalue in double before they are rounded, so that their signs are
 * exact, and scaled by a power of two. Whether the surface crosses an interval an odd number of times is decided by the
 * signs at its two faces alone (not negative counts as inside); both are the faces' own, so of two cells that share a
 * face exactly one has a crossing next to it. Neubauer's method takes one crossing where there is an odd number and
 * none where there is an even one; the robust finder (kernel_roots.h) finds all. */
#ifndef RENDER_KERNEL_SURFACE_H
#define RENDER_KERNEL_SURFACE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_edges.h"
#include "kernel_field.h"
#include "kernel_hits.h"
#include "kernel_map.h"
#include "kernel_neubauer.h"
#include "kernel_normals.h"
#include "kernel_packet.h"
#include "kernel_poly.h"
#include "kernel_roots.h"
#include "kernel_tet.h"
#include "kernel_types.h"
#include "kernel_vertex_normals.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_surface_state {
    const kernel_surface *surface;
    int layer;
    kernel_hits *hits;
    bool is_opaque;
} kernel_surface_state;

/* Of bands, and with colours of their own for what is outside of the range. */
static __attribute__((noinline)) void kernel_marked_colour(const kernel_transfer *t, vf w, vf out[3])
{
    const vf place = kernel_colour_place(t, w), one = vf_set(1), zero = vf_set(0);
    if (t->is_banded) {
        const vf band = vf_floor(vf_clamp(place, zero, one) * (float)t->colour_count);
        const vi index = vi_from_vf(vf_min(band, vf_set((float)(t->colour_count - 1)))) * 3;
        vf_gather_pair(t->colours, index, &out[0], &out[1]);
        out[2] = vf_gather(t->colours + 2, index);
    } else {
        kernel_table_colour(t, w, out);
    }
    const vm below = vf_lt(place, vf_set(-RENDER_END)), above = vf_lt(vf_set(1 + RENDER_END), place), is = vf_eq(w, w);
    for (int a = 0; a < 3; a++) {
        if (t->outside) out[a] = vf_select(below, vf_set(t->outside[a]), out[a]);
        if (t->outside) out[a] = vf_select(above, vf_set(t->outside[3 + a]), out[a]);
        out[a] = vf_select(is, out[a], vf_set(t->outside ? t->outside[6 + a] : RENDER_NO_COLOUR));
    }
}

SIMD_INLINE void kernel_base_colour(const kernel_surface *s, int value, vf w, vf out[3])
{
    if (s->layer->colour_map && (s->colour.is_banded || s->colour.outside)) {
        kernel_marked_colour(&s->colour, w, out);
        return;
    }
    if (s->layer->colour_map) {
        kernel_table_colour(&s->colour, w, out);
        for (int a = 0; a < 3; a++) out[a] = vf_select(vf_eq(w, w), out[a], vf_set(RENDER_NO_COLOUR));
        return;
    }
    for (int a = 0; a < 3; a++) out[a] = vf_set(s->layer->colours[3 * value + a]);
}

/* Gradients in tile space to camera axes: undo the shear. */
SIMD_INLINE void kernel_unshear(const kernel_packet *p, vf g[3])
{
    g[2] -= g[0] * p->tile->shear_x + g[1] * p->tile->shear_y;
}

/* RENDER_NORMALS, as kernel_shade() finds it; and of RENDER_VALUES the isovalue's number. */
static __attribute__((noinline, cold)) void kernel_paint_numbers(const kernel_packet *p, const vf normal[3], vf kind,
                                                                 vf colour[3])
{
    const render_camera *c = &p->frame->job->camera;
    vm flat;
    vf unit[3], inverse = kernel_inverse_length(normal, &flat), facing = vf_set(0);
    if (p->frame->job->paint == RENDER_VALUES) {
        colour[1] = kind - (float)FRAGMENT_SURFACE;
        colour[2] = vf_set(0);
        return;
    }
    for (int a = 0; a < 3; a++) {
        unit[a] = vf_select(flat, p->view[a], normal[a] * inverse);
        facing += unit[a] * p->view[a];
    }
    const vf turn = vf_select(vf_lt(facing, vf_set(0)), vf_set(-1), vf_set(1));
    for (int a = 0; a < 3; a++)
        colour[a] =
            turn * ((unit[0] * (float)c->right[a] + unit[1] * (float)c->up[a]) + unit[2] * (float)c->forward[a]);
}

/* Hits as the job paints them; kind: that of the fragments. */
SIMD_INLINE void kernel_paint(kernel_packet *p, const kernel_surface *s, const vf normal[3], vf kind, vf colour[3])
{
    kernel_packet_view(p);
    if (__builtin_expect(p->frame->job->paint == RENDER_LIGHT, 1))
        kernel_shade(p, &s->layer->material, normal, colour);
    else
        kernel_paint_numbers(p, normal, kind, colour);
}

/* A hit in the place of the nearest, as folded cells may have them: compositing decides, by bits that do not know which
 * cell came first. */
static __attribute__((noinline, cold)) void kernel_emit_tied(kernel_packet *p, const kernel_surface *s, int value,
                                                             vm tied, vf t, const vf normal[3], const vf colour[3])
{
    kernel_fragments lit = {t, t, {colour[0], colour[1], colour[2]}, vf_set(0), vf_set(0)};
    kernel_paint(p, s, normal, vf_set((float)((int)s->first_kind + value)), lit.colour);
    kernel_emit(p, tied, s->first_kind + (uint32_t)value, &lit);
}

/* Where rays hit: the depth, a vector along the normal (or what kernel_vertex_normals() makes one of), and the value
 * that the surface is coloured by. */
typedef struct kernel_hit_places {
    vf t, normal[3], w;
} kernel_hit_places;

/* What colours the surface, or its isovalue. w: the first's place along the colour map's range. */
SIMD_INLINE vf kernel_surface_value(const kernel_surface *s, int value, vf w)
{
    if (!s->layer->colour_map) return vf_set((float)s->layer->values[value]);
    return w * (float)(1 / s->colour.inverse_width) + (float)s->colour.low;
}

/* Takes hits: the nearest are kept; those of a transparent surface are written at once. */
SIMD_INLINE void kernel_accept(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c, int value, vm hit,
                               kernel_hit_places *at)
{
    const kernel_surface *s = state->surface;
    kernel_hits *hits = state->hits;
    const vf t = at->t;
    vf *normal = at->normal, colour[3];
    const bool by_differences = s->layer->normal == RENDER_DIFFERENCES, by_vertices = s->layer->normal == RENDER_VERTEX;
    const kernel_hit_cells cells = {vi_set(c ? c->part : -1), vi_set(c ? (int32_t)c->index : -1)};
    /* Polyhedra (no cell given) have their own gradient always, or come with what their vertices make. */
    const vf reach = vf_set(by_differences && c ? kernel_difference_reach(p, s->layer, c) : 0);
    kernel_base_colour(s, value, at->w, colour);
    if (__builtin_expect(p->frame->job->paint == RENDER_VALUES, 0))
        colour[0] = kernel_surface_value(s, value, at->w);
    else if (s->layer->edge_width > 0 && c)
        kernel_draw_edges(p, s->layer, c, t, colour);
    if (state->is_opaque) {
        const vm tied = vm_and(vm_and(hit, hits->found), vf_eq(t, p->t_far));
        if (__builtin_expect(vm_any(tied), 0)) {
            vf own[3] = {normal[0], normal[1], normal[2]};
            if (by_differences) kernel_differences(p, s, value, tied, t, reach, own);
            if (by_vertices) kernel_vertex_normals(p, s, tied, t, &cells, own);
            kernel_emit_tied(p, s, value, tied, t, own, colour);
            hit = vm_andnot(hit, tied);
        }
        p->t_far = vf_select(hit, t, p->t_far);
        p->is_nearer = true;
        hits->found = vm_or(hits->found, hit);
        for (int a = 0; a < 3; a++) {
            hits->normal[a] = vf_select(hit, normal[a], hits->normal[a]);
            hits->colour[a] = vf_select(hit, colour[a], hits->colour[a]);
        }
        if (by_differences) hits->reach = vf_select(hit, reach, hits->reach);
        if (by_vertices) {
            hits->cells.part = vi_select(hit, cells.part, hits->cells.part);
            hits->cells.index = vi_select(hit, cells.index, hits->cells.index);
        }
        hits->kind = vf_select(hit, vf_set((float)((int)s->first_kind + value)), hits->kind);
        return;
    }
    if (by_differences) kernel_differences(p, s, value, hit, t, reach, normal);
    if (by_vertices) kernel_vertex_normals(p, s, hit, t, &cells, normal);
    kernel_paint(p, s, normal, vf_set((float)((int)s->first_kind + value)), colour);
    const float opacity = s->layer->opacity;
    const kernel_fragments f = {
        t, t, {colour[0] * opacity, colour[1] * opacity, colour[2] * opacity}, vf_set(1 - opacity), vf_set(0)};
    kernel_emit(p, hit, s->first_kind + (uint32_t)value, &f);
    kernel_hits_cut(hits, hit, t);
}

/* Rays on which the sign changes between the interval's faces. */
SIMD_INLINE vm kernel_changes_sign(const kernel_interval *i)
{
    return vm_xor(vf_lt(i->v_in, vf_set(0)), vf_lt(i->v_out, vf_set(0)));
}

/* Rays whose interval is in front of the eye and of what is known. */
SIMD_INLINE vm kernel_is_near(const kernel_packet *p, const kernel_interval *i)
{
    return vm_and(i->mask, vm_and(vf_le(i->t_in, p->t_far), vf_le(p->t_near, i->t_out)));
}

/* The hits that clips leave. */
static __attribute__((noinline, cold)) vm kernel_clip_hits(const kernel_packet *p, uint32_t clips, vm hit, vf t)
{
    kernel_lanes l;
    unsigned kept = 0;
    kernel_packet_lanes(p, &l);
    vf_store(l.value, t);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        kernel_clip_ray ray;
        kernel_tree_ray(p->frame, l.px[i], l.py[i], ray.base, ray.direction);
        kept |= (unsigned)kernel_clip_keeps(p->frame->job, clips, &ray, (double)l.value[i]) << i;
    }
    return vm_from_bits(kept);
}

/* Hits in front of the eye that the surface's clips leave. */
SIMD_INLINE vm kernel_kept(const kernel_packet *p, const kernel_surface *s, vm hit, vf t)
{
    const vm in_front = vm_and(hit, vf_le(p->t_near, t));
    if (__builtin_expect(s->own_clips == 0, 1)) return in_front;
    return kernel_clip_hits(p, s->own_clips, in_front, t);
}

SIMD_INLINE vm kernel_visible(const kernel_packet *p, const kernel_surface *s, vm hit, vf t)
{
    return kernel_kept(p, s, vm_and(hit, vf_le(t, p->t_far)), t);
}

/* The gradient of a tet's field, by Cramer's rule in double; its length and sign do not matter. */
SIMD_INLINE void kernel_tet_normal(const kernel_packet *p, const kernel_cell *c, vf out[3])
{
    double d[3][3], df[3], g[3];
    if (c->has_normal) {
        for (int a = 0; a < 3; a++) out[a] = vf_set(c->normal[a]);
        return;
    }
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
    const vm change = vm_and(kernel_is_near(p, &i), kernel_changes_sign(&i));
    if (!vm_any(change)) return;
    const vf t = kernel_secant(i.t_in, i.v_in, i.t_out, i.v_out);
    const vm hit = kernel_visible(p, state->surface, change, t);
    if (!vm_any(hit)) return;
    kernel_hit_places at = {.t = t, .w = vf_set(0)};
    kernel_tet_normal(p, c, at.normal);
    if (has_colour) {
        const vf length = i.t_out - i.t_in;
        const vf along = vf_select(vf_lt(vf_set(0), length), (t - i.t_in) / length, vf_set(0));
        at.w = i.w_in + along * (i.w_out - i.w_in);
    }
    kernel_accept(p, state, c, value, hit, &at);
}

/* What is set up once for a cell and isovalue, for all packets of a tile: beside each place of the cache. */
typedef struct kernel_poly {
    bool is_set_up;
    int value;
    kernel_map map;
    kernel_bounds bounds; /* robust roots alone */
} kernel_poly;

/* The tile's rays. */
SIMD_INLINE kernel_beam kernel_tile_beam(const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const float shift = fabsf((float)f->depth_shift), radius = tile->radius;
    return (kernel_beam){.spread = flat ? 0 : radius, .offset = flat ? radius : radius * shift};
}

SIMD_INLINE void kernel_poly_setup(const kernel_frame *f, const kernel_tile *tile, kernel_poly *poly,
                                   const render_surface_layer *layer, const kernel_cell *c, int value)
{
    if (poly->is_set_up) return;
    poly->is_set_up = true;
    poly->value = value;
    kernel_map_setup(&poly->map, c);
    if (layer->colour_map) kernel_map_colour(&poly->map, c);
    const kernel_beam beam = kernel_tile_beam(f, tile);
    if (layer->root == RENDER_ROBUST) kernel_bounds_setup(&poly->bounds, &poly->map, c->type, &beam);
}

SIMD_INLINE kernel_poly *kernel_poly_find(const kernel_packet *p, const kernel_cell *c)
{
    return &p->thread->polys[c - p->thread->cells->cells];
}

/* The crossings at the places that are visible; returns these. */
SIMD_INLINE vm kernel_poly_accept(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c,
                                  const kernel_poly *poly, vm found, const kernel_point *at)
{
    const vm hit = kernel_visible(p, state->surface, found, at->t);
    if (!vm_any(hit)) return hit;
    kernel_hit_places places = {.t = at->t, .w = vf_set(0)};
    if (state->surface->layer->normal == RENDER_VERTEX) {
        memcpy(places.normal, at->r, sizeof places.normal);
    } else {
        kernel_map_normal(&poly->map, at->r, places.normal);
        kernel_unshear(p, places.normal);
    }
    if (state->surface->layer->colour_map) places.w = kernel_map_value(&poly->map, &poly->map.colour, at->r);
    kernel_accept(p, state, c, poly->value, hit, &places);
    return hit;
}

/* Every crossing of the interval in turn; an opaque surface's first visible one is a ray's last. */
SIMD_INLINE void kernel_poly_robust(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c,
                                    const kernel_poly *poly, const kernel_interval *i, vm rays)
{
    kernel_search_cell cell;
    kernel_search s;
    if (!kernel_search_in(&s, &cell, p, &poly->map, &poly->bounds, i, rays)) return;
    do {
        kernel_point at;
        if (!vm_any(s.found)) continue;
        kernel_polish(&s, &at);
        const vm hit = kernel_poly_accept(p, state, c, poly, s.found, &at);
        if (state->is_opaque) kernel_search_close(&s, hit);
    } while (kernel_search_on(&s));
}

SIMD_INLINE void kernel_poly_surface(kernel_packet *p, kernel_surface_state *state, const kernel_cell *c,
                                     kernel_poly *poly, int value, vm rays)
{
    const render_surface_layer *layer = state->surface->layer;
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const int count = kernel_poly_intervals(p, c, rays, false, list);
    for (int n = 0; n < count; n++) {
        const kernel_interval *i = &list[n];
        const vm near = kernel_is_near(p, i);
        /* Where a ray crosses both halves of a quad, but not its patch, in and out are one place, beside the ray. */
        const vm room = vm_or(vf_lt(i->t_in, i->t_out), kernel_changes_sign(i));
        const vm wanted = vm_and(near, layer->root == RENDER_ROBUST ? room : kernel_changes_sign(i));
        if (!vm_any(wanted)) continue;
        kernel_poly_setup(p->frame, p->tile, poly, layer, c, value);
        if (layer->root == RENDER_ROBUST) {
            kernel_poly_robust(p, state, c, poly, i, wanted);
            continue;
        }
        kernel_point at;
        kernel_neubauer(p, &poly->map, i, wanted, layer->root_steps, &at);
        kernel_poly_accept(p, state, c, poly, wanted, &at);
    }
}

/* In a cell that is neither a polyhedron nor without finite values: its surface of an isovalue. The cell is in the
 * frame's coordinates. */
static __attribute__((noinline)) void kernel_cell_surface(kernel_packet *p, kernel_surface_state *state,
                                                          const kernel_cell *c, kernel_poly *poly, int value, vm rays)
{
    if (c->type == GRID_TET)
        kernel_tet_surface(p, state, c, value, rays);
    else
        kernel_poly_surface(p, state, c, poly, value, rays);
}

#endif
