/* Tests exactly whether a cell's opaque surface blocks rays from hits, towards lights or into the hemisphere. Any root
 * of the field minus the isovalue at a depth in [t_near, t_far) blocks the ray, so the result does not depend on the
 * order of cells or on the partition. Roots are found as for primary rays, but no normal and no colour is computed, and
 * the roots need no order. The rays are those of a bundle (kernel_bundle.h), and are traced in its tile space. */
#ifndef RENDER_KERNEL_OCCLUSION_H
#define RENDER_KERNEL_OCCLUSION_H

#include <math.h>

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_bounds.h"
#include "kernel_bundle.h"
#include "kernel_cell.h"
#include "kernel_cell_cache.h"
#include "kernel_cell_values.h"
#include "kernel_crossings.h"
#include "kernel_map.h"
#include "kernel_occluders.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_polyhedron_surface.h"
#include "kernel_roots.h"
#include "kernel_types.h"
#include "render.h"
#include "render_polyhedra.h"
#include "simd.h"

typedef struct kernel_occlusion {
    const kernel_surface *surface;
    const kernel_bundle *bundle;
    int first; /* index in bundle->rays of the packet's first ray */
    /* world coordinates of the vertices of the cell in which the rays are traced */
    double (*world)[3];
    int vertex_count;
} kernel_occlusion;

/* Returns the rays whose crossing of the isovalue at depth t may block them, because its distance from the ray's hit is
 * at least the layer's `contact` times the cell's size. */
static __attribute__((noinline)) vm kernel_occlusion_is_beyond_contact(const kernel_packet *p,
                                                                       const kernel_occlusion *o, vf t)
{
    const double size = kernel_cell_size((const double(*)[3])o->world, o->vertex_count);
    const double reach = (double)o->surface->layer->contact * size * p->frame->job->space.scale;
    const vf length = vf_sqrt((p->slope_x * p->slope_x + p->slope_y * p->slope_y) + 1.0f);
    return vf_le(vf_set((float)reach), (t - p->t_near) * length);
}

/* Returns those of the rays in `hit` whose crossing of the isovalue at depth t all clips of the layer keep. */
static __attribute__((noinline, cold)) vm kernel_occlusion_kept_by_clips(const kernel_packet *p,
                                                                         const kernel_occlusion *o, vm hit, vf t)
{
    float depth[SIMD_WIDTH];
    unsigned kept = 0;
    vf_store(depth, t);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int i = __builtin_ctz(left);
        const bool is_kept = kernel_clips_keep_ray_point(p->frame->job, o->surface->layer->clips,
                                                         &o->bundle->rays[o->first + i], (double)depth[i]);
        kept |= (unsigned)is_kept << i;
    }
    return vm_from_bits(kept);
}

/* Removes the rays that their roots at depth t block from the packet's active rays, and returns them. found: rays that
 * have a root of the field minus the isovalue at t. */
SIMD_INLINE vm kernel_deactivate_blocked_rays(kernel_packet *p, const kernel_occlusion *o, vm found, vf t)
{
    vm hit = vm_and(found, vm_and(vf_le(p->t_near, t), vf_lt(t, p->t_far)));
    if (!vm_any(hit)) return hit;
    if (o->surface->layer->contact > 0) hit = vm_and(hit, kernel_occlusion_is_beyond_contact(p, o, t));
    if (p->frame->job->clip_count) hit = kernel_occlusion_kept_by_clips(p, o, hit, t);
    p->t_far = vf_select(hit, vf_set(-INFINITY), p->t_far);
    p->active = vm_andnot(p->active, hit);
    return hit;
}

/* Finds the points in the rays' interval i at which the field is the isovalue, one after the other, until each ray is
 * blocked or has no more such points. */
SIMD_INLINE void kernel_occlusion_search_roots(kernel_packet *p, const kernel_occlusion *o, const kernel_curved *curved,
                                               const kernel_interval *i, vm wanted)
{
    const kernel_rays rays = kernel_packet_rays(p);
    kernel_search s;
    if (!kernel_search_cells(&s, curved, &rays, vi_set(0), i, wanted, &p->thread->map_failures)) return;
    do {
        kernel_point at;
        if (!vm_any(s.found)) continue;
        kernel_refine_roots(&s, &at);
        kernel_search_close(&s, kernel_deactivate_blocked_rays(p, o, s.found, at.t));
    } while (kernel_search_continue(&s));
}

/* Removes the rays that the surface in a hex, wedge or pyramid blocks from the packet's active rays. */
static __attribute__((noinline)) void kernel_occlusion_test_curved_cell(kernel_packet *p, const kernel_occlusion *o,
                                                                        const kernel_cell *c, vm rays)
{
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    const kernel_beam beam = kernel_bound_rays_of_tile(p->frame, p->tile);
    float at[4][8][SIMD_WIDTH], colours[8][SIMD_WIDTH];
    kernel_bounds bounds;
    kernel_curved curved = {.at = at, .colours = colours, .bounds = &bounds};
    const int count = kernel_curved_intervals(p, c, rays, list);
    bool has_bounds = false;
    for (int n = 0; n < count; n++) {
        const kernel_interval *i = &list[n];
        const vm nonempty = vm_or(vf_lt(i->t_in, i->t_out), kernel_interval_changes_sign(i));
        const vm wanted = vm_and(kernel_interval_overlaps_ray(p, i), nonempty);
        if (!vm_any(wanted)) continue;
        if (!has_bounds) kernel_curved_single_bounds(c, &beam, &curved);
        has_bounds = true;
        kernel_occlusion_search_roots(p, o, &curved, i, wanted);
    }
}

/* Removes the rays that are blocked in their current interval (r->interval) in a polyhedron from the packet's active
 * rays. Crossings of the isovalue are found along each ray's profile, the piecewise linear field on the ray
 * (kernel_polyhedron_surface.h). */
static void kernel_occlusion_test_interval(kernel_packet *p, const kernel_occlusion *o, vm wanted,
                                           kernel_poly_crossings *r)
{
    kernel_profile_walk walk;
    kernel_poly_prepare_piecewise_field(r);
    kernel_profile_walk_begin(r, wanted, &walk);
    do {
        const vm found = kernel_profile_walk_find_crossing(r, &walk);
        walk.open = vm_andnot(walk.open, kernel_deactivate_blocked_rays(p, o, found, walk.t));
    } while (vm_any(walk.open));
}

static void kernel_occlusion_trace_polyhedron(kernel_packet *p, const kernel_occlusion *o, polyhedron *c, vm rays)
{
    kernel_poly_crossings r;
    if (!kernel_poly_allocate(p, c, &r) || !kernel_poly_cross(&r, rays, false)) return;
    while (kernel_poly_find_next_interval(&r)) {
        const vm changes = kernel_interval_changes_sign(&r.interval);
        const vm wanted =
            vm_and(kernel_interval_overlaps_ray(p, &r.interval), vm_or(changes, kernel_polyhedron_may_cross(p, c, &r)));
        if (vm_any(wanted)) kernel_occlusion_test_interval(p, o, wanted, &r);
    }
}

/* Removes the rays that the surface in a polyhedron blocks from the packet's active rays. The thread keeps the
 * polyhedron's decomposition into tets for later bundles, but for each bundle the vertices are transformed into its own
 * tile space. */
static void kernel_occlusion_test_polyhedron(kernel_packet *p, kernel_occlusion *o, const kernel_occluder *occluder)
{
    const int part = occluder->part;
    const double value = o->surface->layer->values[occluder->value];
    polyhedron *c =
        kernel_polyhedron_find(p, &o->surface->layer->field.fields[part], part, occluder->surface, occluder->cell);
    if (!c) return;
    c->has_slopes = c->is_transformed = false;
    o->world = c->world;
    o->vertex_count = c->vertex_count;
    if (!kernel_values_straddle(c->values, c->vertex_count, value)) return;
    kernel_polyhedron_transform(c, p);
    c->scale = kernel_values_subtract_isovalue(c->values, c->vertex_count + 1, value, c->f);
    kernel_occlusion_trace_polyhedron(p, o, c, p->active);
}

/* Transforms the cell into the bundle's tile space. If it has been transformed before, its world coordinates are
 * already known. */
SIMD_INLINE void kernel_occlusion_transform(const kernel_packet *p, kernel_cell *c, int part)
{
    if (!c->is_transformed) {
        kernel_cell_transform_in_tile(c, p->frame, p->tile, p->frame->job->parts[part].cells);
        return;
    }
    for (int i = 0; i < c->count; i++) kernel_transform(p, c->world[i], &c->x[i], &c->y[i], &c->z[i]);
    c->has_lines = false;
}

/* Removes the rays that the cell's surface blocks from the packet's active rays. The cell is not a tet, because rays
 * are never undecided in tets (kernel_occluders.h). */
static void kernel_occlusion_test_cell(kernel_packet *p, kernel_occlusion *o, const kernel_occluder *occluder)
{
    const render_surface_layer *layer = o->surface->layer;
    kernel_cell *c = kernel_cell_cache_find(p, occluder->surface, occluder->part, &layer->field.fields[occluder->part],
                                            occluder->cell);
    if (kernel_has_own_faces(c->type)) {
        kernel_occlusion_test_polyhedron(p, o, occluder);
        return;
    }
    if (!c->is_finite) return;
    o->world = c->world;
    o->vertex_count = c->count;
    kernel_occlusion_transform(p, c, occluder->part);
    kernel_cell_subtract_isovalue(c, layer->values[occluder->value]);
    kernel_occlusion_test_curved_cell(p, o, c, p->active);
}

/* Clears the `open` bits of the bundle's rays that the surface in the occluder's cell blocks. */
static void kernel_occlude_by_cell(const kernel_frame *f, kernel_thread *thread, kernel_bundle *b,
                                   const kernel_occluder *occluder)
{
    for (int first = 0; first < b->count; first += SIMD_WIDTH) {
        kernel_packet p;
        kernel_occlusion o = {&f->surfaces[occluder->surface], b, first, NULL, 0};
        if (!(b->open >> first & (((uint64_t)1 << SIMD_WIDTH) - 1))) continue;
        kernel_packet_set_up_from_bundle(&p, f, thread, b, first);
        const unsigned before = vm_bits(p.active);
        kernel_occlusion_test_cell(&p, &o, occluder);
        b->open &= ~((uint64_t)(before & ~vm_bits(p.active)) << first);
    }
}

#endif
