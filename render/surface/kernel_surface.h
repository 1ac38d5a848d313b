/* Intersects rays with isosurfaces in cells, and accepts the hits (thesis, sections 4.3.3 to 4.3.5).
 *
 * A ray's interval in a cell lies between two crossings of the ray with the cell's faces. Within a cell, the isovalue
 * is subtracted from the values at the vertices in double before they are rounded, so that their signs are exact, and
 * the differences are scaled by a power of two. The signs of the field minus the isovalue at the two ends of an
 * interval decide whether the ray crosses the surface an odd number of times between them (non-negative counts as
 * inside). The field at an end is interpolated on the face alone. So if the sign changes near a face that two cells
 * share, exactly one of them has the crossing. kernel_roots.h computes all crossings of an interval.
 * kernel_polyhedron_surface.h does the same in polyhedra. kernel_accept.h defines hit, reach and pending hit. */
#ifndef RENDER_KERNEL_SURFACE_H
#define RENDER_KERNEL_SURFACE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_contraction.h"
#include "kernel_crossings.h"
#include "kernel_differences.h"
#include "kernel_edges.h"
#include "kernel_hits.h"
#include "kernel_lines.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_roots.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Computes the normals of hits by central differences from this rank's cells, and returns all hits. But if other ranks
 * may have cells around the hits (job->waiting is set), the hits that need samples (h->reach > 0) are added to the list
 * of pending hits instead, and only the remaining hits are returned. */
SIMD_INLINE vm kernel_sample_or_defer_hits(kernel_packet *p, const kernel_surface *s, vm hit, kernel_surface_hits *h)
{
    if (p->frame->job->waiting) return kernel_defer_hits(p, s, hit, h);
    for (int value = 0; value < s->layer->value_count; value++) {
        const vm mine = vm_and(hit, vf_eq(vf_from_vi(h->value), vf_set((float)value)));
        if (vm_any(mine)) kernel_normals_by_differences(p, s, value, mine, h->t, h->reach, h->normal);
    }
    return hit;
}

/* Computes the normals of hits, unless the layer's normals are the gradients in the hits' cells, which are already set.
 * Returns the hits that have a normal; the others are pending. */
SIMD_INLINE vm kernel_hit_normals(kernel_packet *p, const kernel_surface *s, vm hit, kernel_surface_hits *h)
{
    if (s->layer->normal == RENDER_VERTEX) kernel_vertex_normals(p, s, hit, h->t, h->part, h->cell, h->normal);
    return s->layer->normal == RENDER_DIFFERENCES ? kernel_sample_or_defer_hits(p, s, hit, h) : hit;
}

/* Computes the normals of tied hits (hits with the same depth as their ray's nearest hit), and emits these hits as
 * fragments of their own. */
static __attribute__((noinline, cold)) void kernel_accept_hits_of_equal_depth(kernel_packet *p, const kernel_surface *s,
                                                                              vm tied, const kernel_surface_hits *h)
{
    kernel_surface_hits own = *h;
    const vm ready = kernel_hit_normals(p, s, tied, &own);
    kernel_emit_hits_of_equal_depth(p, s, ready, &own);
}

/* Stores hits of an opaque surface as the nearest ones of their rays. */
SIMD_INLINE void kernel_accept_opaque_hits(kernel_packet *p, const kernel_surface *s, vm hit,
                                           const kernel_surface_hits *h)
{
    kernel_hits *hits = p->hits;
    const vm tied = vm_and(vm_and(hit, hits->found), vf_eq(h->t, p->t_far));
    if (__builtin_expect(vm_any(tied), 0)) {
        kernel_accept_hits_of_equal_depth(p, s, tied, h);
        hit = vm_andnot(hit, tied);
    }
    p->t_far = vf_select(hit, h->t, p->t_far);
    p->is_nearer = true;
    hits->found = vm_or(hits->found, hit);
    for (int a = 0; a < 3; a++) {
        hits->normal[a] = vf_select(hit, h->normal[a], hits->normal[a]);
        hits->colour[a] = vf_select(hit, h->colour[a], hits->colour[a]);
    }
    if (s->layer->normal == RENDER_DIFFERENCES) hits->reach = vf_select(hit, h->reach, hits->reach);
    if (s->layer->normal == RENDER_VERTEX) {
        hits->part = vi_select(hit, h->part, hits->part);
        hits->cell = vi_select(hit, h->cell, hits->cell);
    }
    hits->kind = vf_select(hit, kernel_hit_kinds(s, h), hits->kind);
}

/* Computes the lighting of a transparent surface's hits, and emits them as fragments. */
static __attribute__((noinline)) void kernel_emit_transparent(kernel_packet *p, const kernel_surface *s, vm hit,
                                                              kernel_surface_hits *h)
{
    const vf kind = kernel_hit_kinds(s, h);
    hit = kernel_hit_normals(p, s, hit, h);
    kernel_fragments f = {h->t, h->t, {h->colour[0], h->colour[1], h->colour[2]}, 1.0f - h->opacity, kind};
    kernel_compute_fragment_colours(p, s, h->normal, kind, &f);
    for (int a = 0; a < 3; a++) f.colour[a] *= h->opacity;
    kernel_append_fragments(p, hit, 0, &f);
}

/* Draws contour lines over the hits' colours. If only the lines of the surface are drawn (render_lines.is_alone),
 * multiplies the hits' opacities by the share of the pixel that a line covers, and returns the hits on a line.
 * Otherwise returns all hits. In a picture of values (RENDER_VALUES) no colours are drawn. If only the lines are drawn
 * there, and the surface has no colour field, a hit's value (h->colour[0]) becomes that of the lines' field. */
static __attribute__((noinline)) vm kernel_draw_lines_on_hits(const kernel_packet *p, const kernel_surface *s, vm hit,
                                                              kernel_surface_hits *h)
{
    const kernel_rays rays = kernel_packet_rays(p);
    const bool is_alone = s->layer->lines->is_alone, are_numbers = p->frame->job->paint == RENDER_VALUES;
    if (are_numbers && !is_alone) return hit;
    vf colour[3] = {h->colour[0], h->colour[1], h->colour[2]};
    const vf share = kernel_draw_lines(p->frame, p->tile, s, &rays, h->t, h->along, colour);
    for (int a = 0; a < 3 && !are_numbers; a++) h->colour[a] = colour[a];
    if (are_numbers && !s->layer->colour_map)
        h->colour[0] = h->along->value * (float)(1 / s->lines.inverse_width) + (float)s->lines.low;
    if (!is_alone) return hit;
    h->opacity *= share;
    return vm_and(hit, vf_lt(vf_set(0), share));
}

/* Computes the colours of hits before lighting, with edges and contour lines, and their opacities. The caller must have
 * set the other members of *h. Returns the visible hits (kernel_draw_lines_on_hits()). */
SIMD_INLINE vm kernel_colour_hits(const kernel_packet *p, const kernel_surface *s, vm hit, kernel_surface_hits *h)
{
    kernel_unlit_surface_colour(s, h->value, h->w, h->colour);
    if (__builtin_expect(p->frame->job->paint == RENDER_VALUES, 0))
        h->colour[0] = kernel_compute_displayed_value(s, h->value, h->w);
    else if (s->layer->edge_width > 0 && h->vertex_count)
        kernel_draw_edges(p, s->layer, hit, h);
    h->opacity = vf_set(s->layer->opacity);
    return __builtin_expect(h->along != NULL, 0) ? kernel_draw_lines_on_hits(p, s, hit, h) : hit;
}

/* Accepts the hits of a packet of the tile: a hit of an opaque surface is stored as the nearest hit of its ray; hits of
 * a transparent surface are lit and emitted as fragments at once. The caller must have set all members of *h except
 * colour and opacity. */
SIMD_INLINE void kernel_accept(kernel_packet *p, const kernel_surface *s, vm hit, kernel_surface_hits *h)
{
    hit = kernel_colour_hits(p, s, hit, h);
    if (kernel_is_opaque(p, s)) {
        kernel_accept_opaque_hits(p, s, hit, h);
        return;
    }
    for (unsigned left = p->frame->volume_count ? vm_bits(hit) : 0; left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        kernel_hits_add_crossing(p->hits, ray, h->t[ray]);
    }
    if (vm_any(hit)) kernel_emit_transparent(p, s, hit, h);
}

/* Returns the value of a field at the reference coordinates r, in each ray's own cell. values: the field by vertex and
 * lane; lane: the lane that holds each ray's cell. kernel_maps_evaluate_field() computes the same, but is inlined
 * separately for each cell type. */
static __attribute__((noinline)) vf kernel_interpolate_value_in_cells(const float (*values)[SIMD_WIDTH], vi lane,
                                                                      const vf r[3], int type)
{
    return KERNEL_OF_TYPE(type, kernel_maps_evaluate_field, values, lane, r);
}

/* Accepts those of the found crossings of the isovalue in a hex, wedge or pyramid that are visible, and returns them.
 * at: the crossings. */
SIMD_INLINE vm kernel_curved_accept_visible_roots(kernel_packet *p, const kernel_surface *s, const kernel_cell *c,
                                                  const kernel_curved *curved, int value, const kernel_map *map,
                                                  vm found, const kernel_point *at)
{
    const vm hit = kernel_visible_hits(p, s, found, at->t);
    if (!vm_any(hit)) return hit;
    kernel_surface_hits h = {
        .value = vi_set(value),
        .t = at->t,
        .reach = vf_set(kernel_difference_sample_distance(p->frame, s->layer, (const double(*)[3])c->world, c->count)),
        .part = vi_set(c->part),
        .cell = vi_set((int32_t)c->index),
        .vertex_count = c->count,
        .lane = vi_set(curved->lane)};
    for (int a = 0; a < 4; a++) h.vertices[a] = (const float(*)[SIMD_WIDTH])curved->at[a];
    if (s->layer->normal == RENDER_VERTEX) {
        memcpy(h.normal, at->r, sizeof h.normal);
    } else {
        kernel_compute_gradient_direction(map, at->r, h.normal);
        kernel_gradient_to_camera_axes(p->tile, h.normal);
    }
    if (s->layer->colour_map)
        h.w = kernel_interpolate_value_in_cells((const float(*)[SIMD_WIDTH])curved->colours, vi_set(curved->lane),
                                                at->r, curved->type);
    kernel_line_field along;
    if (s->layer->lines) {
        kernel_curved_line_field(p, s, c, map, at->r, &along);
        h.along = &along;
    }
    kernel_accept(p, s, hit, &h);
    return hit;
}

/* Finds the crossings in the rays' interval i one after the other, by kernel_roots.h, and accepts them. A ray ends at
 * the first visible crossing of an opaque surface. */
SIMD_INLINE void kernel_accept_searched_roots(kernel_packet *p, const kernel_surface *s, const kernel_cell *c,
                                              const kernel_curved *curved, int value, const kernel_interval *i,
                                              vm wanted)
{
    const kernel_rays rays = kernel_packet_rays(p);
    kernel_search search;
    if (!kernel_search_cells(&search, curved, &rays, vi_set(curved->lane), i, wanted, &p->thread->map_failures)) return;
    do {
        kernel_point at;
        if (!vm_any(search.found)) continue;
        kernel_refine_roots(&search, &at);
        const vm hit = kernel_curved_accept_visible_roots(p, s, c, curved, value, &search.map, search.found, &at);
        if (kernel_is_opaque(p, s)) kernel_search_close(&search, hit);
    } while (kernel_search_continue(&search));
}

SIMD_INLINE void kernel_find_contracted_roots_of_type(const kernel_curved *c, const kernel_rays *rays, vi lane,
                                                      vm wanted, kernel_point *out, vm *none, int type)
{
    kernel_contraction contraction;
    kernel_contraction_set_ray(c, rays, lane, &contraction);
    kernel_contraction_set_cell(c->bounds, lane, type, &contraction);
    kernel_find_only_root_by_contraction(&contraction, wanted, out, none, type);
    out->t += kernel_gather_lane(c->at[2][0], lane);
}

/* Computes the only crossing of each ray of a packet in one cell by contraction
 * (kernel_find_only_root_by_contraction()), without intersecting the cell's faces. */
static __attribute__((noinline)) void kernel_find_contracted_roots(const kernel_curved *c, const kernel_rays *rays,
                                                                   vi lane, vm wanted, kernel_point *out, vm *none)
{
    KERNEL_OF_TYPE(c->type, kernel_find_contracted_roots_of_type, c, rays, lane, wanted, out, none);
}

/* Finds crossings of the isovalue by contraction (a fixed-point iteration, kernel_contraction.h), and accepts them.
 * Returns the rays that contraction has decided: those with exactly one crossing, and those without one. */
static __attribute__((noinline)) vm kernel_curved_accept_contracted_roots(kernel_packet *p, const kernel_surface *s,
                                                                          const kernel_cell *c,
                                                                          const kernel_curved *curved, int value,
                                                                          vm wanted)
{
    const kernel_rays rays = kernel_packet_rays(p);
    const vi lane = vi_set(curved->lane);
    kernel_point at;
    vm none;
    kernel_find_contracted_roots(curved, &rays, lane, wanted, &at, &none);
    if (vm_any(at.mask)) {
        kernel_map map;
        kernel_compute_maps((const float(*)[8][SIMD_WIDTH])curved->at, lane, curved->type, &map);
        kernel_refine_accurate_roots(&rays, &map, at.mask, &at);
        kernel_curved_accept_visible_roots(p, s, c, curved, value, &map, at.mask, &at);
    }
    return vm_or(at.mask, none);
}

/* Traces one isovalue's surface in a hex, wedge or pyramid with finite values, which must have been transformed into
 * tile space. value: index of the isovalue in the layer. */
static __attribute__((noinline)) void kernel_curved_trace_isovalue(kernel_packet *p, const kernel_surface *s,
                                                                   const kernel_cell *c, const kernel_curved *curved,
                                                                   int value, vm rays)
{
    const render_surface_layer *layer = s->layer;
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const int count = kernel_curved_intervals(p, c, rays, list);
    vm reached[KERNEL_MAX_CELL_INTERVALS], any = vm_none(), known = vm_none();
    for (int n = 0; n < count; n++) {
        kernel_interval *i = &list[n];
        i->v_out = kernel_move_end_value_into_cell(i->v_in, i->v_out, layer->is_of_faces);
        /* If a ray crosses both triangles of a quad but not its bilinear patch, both ends of the interval are the same
         * point beside the ray; such an interval is skipped. */
        const vm nonempty = vm_or(vf_lt(i->t_in, i->t_out), kernel_interval_changes_sign(i));
        reached[n] = vm_and(kernel_interval_overlaps_ray(p, i), nonempty);
        any = vm_or(any, reached[n]);
    }
    if (!vm_any(any)) return;
    if (!curved->is_contracted) known = kernel_curved_accept_contracted_roots(p, s, c, curved, value, any);
    for (int n = 0; n < count; n++) {
        kernel_interval *i = &list[n];
        const vm wanted = vm_andnot(vm_and(reached[n], kernel_interval_overlaps_ray(p, i)), known);
        if (vm_any(wanted)) kernel_accept_searched_roots(p, s, c, curved, value, i, wanted);
    }
}

#endif
