/* Traces batches of SIMD_WIDTH hexes, wedges or pyramids of one type in a tile (kernel_batch.h defines batch, block and
 * box). A cell of a few pixels would leave most lanes of a block's packet idle, and half of the rays in the cell have
 * no crossing. So rays of several cells are listed one after the other and traced in vectors, each lane with a ray and
 * the index of the lane that holds its cell. After each stage the undecided rays are moved to the front of their list,
 * so that the next stage's vectors are full again. The stages, with their rays, question and method, are:
 *     pixels of boxes       where is the only root in a cuboid?             kernel_cuboids.h
 *     undecided rays        is the only crossing known, or is there none?   kernel_contraction.h
 *     undecided rays        which faces does the ray cross?                 signs of edge functions
 *     rays with two faces   where, and what is the field there?             bilinear patches
 *     rays with one root    where is it, and what is its normal?            Newton's method
 *     other rays            which roots are there?                          kernel_roots.h
 * If the field in a cell is known to be monotone along all of the tile's rays (kernel_roots.h), its signs at the two
 * faces decide whether a ray has a root. Rays in other cells are searched for roots.
 *
 * Rays with an edge function of uncertain sign, and rays that do not cross exactly two faces once each, are traced cell
 * by cell (kernel_surface.h). All operations except those of kernel_cuboids.h are those for a single cell in the same
 * order, so the two methods compute bit-identical hits. Which rays kernel_cuboids.h decides depends only on the ray and
 * its cell. */
#ifndef RENDER_KERNEL_CURVED_BATCH_H
#define RENDER_KERNEL_CURVED_BATCH_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_contraction.h"
#include "kernel_cuboids.h"
#include "kernel_curved_rays.h"
#include "kernel_lane_hits.h"
#include "kernel_lines.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_transformed_curved.h"
#include "kernel_roots.h"
#include "kernel_shapes.h"
#include "kernel_single_cells.h"
#include "kernel_surface.h"
#include "kernel_surface_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_curved_batch {
    const kernel_surface_cells *queued;    /* the cells that are being traced */
    kernel_transformed_curved transformed; /* these cells in tile space */
    /* the colour field's values by vertex and lane, in its transfer function's domain; set only if the layer has a
     * colour field */
    float colours[8][SIMD_WIDTH];
    float lines[8][SIMD_WIDTH]; /* field of the contour lines by vertex and lane; set only if the layer has lines */
    kernel_cuboids cuboids;
    /* set if `bounds` and the data of the cells' faces (kernel_compute_face_data()) have been computed */
    bool has_bounds;
    kernel_bounds bounds;
    unsigned copied_lanes; /* mask of the lanes whose cells have been copied to `cells` */
    kernel_cell cells[SIMD_WIDTH];
    /* rays: undecided rays; met: rays that cross two faces of their cells; found: rays with exactly one root; others:
     * rays whose roots must be searched for */
    kernel_pixel_list rays, met, found, others;
    /* for each ray in `met`, the two faces that it crosses: number of the first plus 8 times that of the second */
    uint8_t faces[KERNEL_LIST_ROOM];
    /* The ends of the intervals of the rays in `found` and in `others`. First index: 0 for the interval's begin, 1 for
     * its end; second index: 0 for t, 1 for the value, 2 to 4 for the reference coordinates; third index: the ray's
     * index in its list. If a ray's root is known by contraction, the root is stored instead of the begin. */
    float found_ends[2][5][KERNEL_LIST_ROOM], other_ends[2][5][KERNEL_LIST_ROOM];
} kernel_curved_batch;

static void kernel_curved_batch_begin(kernel_curved_batch *h)
{
    h->rays.count = 0;
    memset(h->colours, 0, sizeof h->colours);
    memset(h->lines, 0, sizeof h->lines);
}

/* Returns the batch's cells as a kernel_curved, the form in which the search for roots reads cells. */
SIMD_INLINE kernel_curved kernel_curved_batch_get_cells(kernel_curved_batch *h)
{
    return (kernel_curved){
        .type = h->queued->type, .at = h->transformed.at, .colours = h->colours, .bounds = &h->bounds};
}

/* ---- tracing one cell of the batch at a time ---- */

/* Copies the cell in lane n to h->cells[n], and computes its edge functions, unless that has been done before. */
SIMD_INLINE void kernel_curved_batch_copy_cell(const kernel_tile_trace *t, kernel_curved_batch *h, int n)
{
    if (h->copied_lanes >> n & 1) return;
    h->copied_lanes |= 1u << n;
    kernel_copy_transformed_curved_cell(&h->transformed, h->queued->type, n, &h->cells[n]);
    kernel_cell_compute_lines(&h->cells[n], t->frame, &t->tile);
    h->cells[n].part = h->queued->part;
    h->cells[n].index = h->queued->cell[n];
    for (int i = 0; i < 8; i++) h->cells[n].g[i] = h->colours[i][n];
    for (int i = 0; i < h->cells[n].count; i++)
        h->cells[n].vertices[i] = kernel_surface_cells_get_mesh_index(h->queued, h->transformed.vertex[i][n]);
}

/* Traces, cell by cell, those rays of the vector that begins at index `first` of the list `rays` whose bits are set in
 * `wanted`. Rays with the same cell and packet are traced together. at_lanes: position of each ray among those of the
 * tile's packets (packet * SIMD_WIDTH + lane). Returns a mask of the blocks that contain a ray whose hit is nearer than
 * its previous one. */
static __attribute__((noinline)) unsigned kernel_curved_batch_trace_singly(kernel_tile_trace *t, kernel_curved_batch *h,
                                                                           const kernel_pixel_list *rays, int first,
                                                                           vi at_lanes, unsigned wanted)
{
    kernel_curved curved = kernel_curved_batch_get_cells(h);
    curved.is_contracted = true;
    unsigned blocks = 0;
    int32_t at[SIMD_WIDTH];
    memcpy(at, &at_lanes, sizeof at);
    for (; wanted; wanted &= wanted - 1) {
        const int i = __builtin_ctz(wanted), n = rays->lane[first + i];
        unsigned same = 0;
        for (unsigned more = wanted; more; more &= more - 1) {
            const int k = __builtin_ctz(more);
            if (rays->lane[first + k] == n && at[k] / SIMD_WIDTH == at[i] / SIMD_WIDTH) {
                same |= 1u << at[k] % SIMD_WIDTH;
                if (k != i) wanted &= ~(1u << k);
            }
        }
        kernel_packet *p = &t->packets[at[i] / SIMD_WIDTH];
        p->is_nearer = false;
        kernel_curved_batch_copy_cell(t, h, n);
        curved.lane = n;
        kernel_curved_trace_isovalue(p, t->surface, &h->cells[n], &curved, h->queued->value[n],
                                     vm_and(p->active, vm_from_bits(same)));
        if (p->is_nearer) blocks |= 1u << at[i] / (KERNEL_BLOCK * KERNEL_BLOCK);
    }
    return blocks;
}

/* ---- stages of tracing the listed rays ---- */

/* Returns the rays that have no root because, between the cell's bounding planes, they stay outside of the slab in
 * which the isosurface lies. The slab is |L| <= thickness, where L is the linear function that approximates the field
 * in the cell (kernel_bounds.h). Outside of it the field has L's sign, at the faces, too. */
SIMD_INLINE vm kernel_curved_batch_misses_slab(const kernel_curved_batch *h, vi lane, const kernel_contraction *ray)
{
    const vf thick = kernel_gather_lane(h->bounds.thickness, lane);
    vf from = vf_set(-INFINITY), to = vf_set(INFINITY);
    for (int i = 0; i < 3; i++) {
        const vf inverse = 1.0f / ray->w[i];
        const vf low = (kernel_gather_lane(h->bounds.low[i], lane) - ray->y[i]) * inverse;
        const vf high = (kernel_gather_lane(h->bounds.high[i], lane) - ray->y[i]) * inverse;
        from = vf_max(vf_min(low, high), from);
        to = vf_min(vf_max(low, high), to);
    }
    const vf begin = ray->level + ray->rise * from, end = ray->level + ray->rise * to;
    return vm_or(vf_lt(thick, vf_min(begin, end)), vf_lt(vf_max(begin, end), -thick));
}

/* Keeps those of the rays n to n + SIMD_WIDTH - 1 of the list h->rays whose bits are set in `rays`: moves them to the
 * entries of the same list from index `kept` on. Returns the new number of kept rays. */
SIMD_INLINE int kernel_curved_batch_keep_rays(kernel_curved_batch *h, int n, unsigned rays, int kept)
{
    for (; rays; rays &= rays - 1) {
        const int i = n + __builtin_ctz(rays);
        h->rays.pixel[kept] = h->rays.pixel[i];
        h->rays.lane[kept] = h->rays.lane[i];
        kept++;
    }
    return kept;
}

/* Loads a vector of rays of a list, from index n on. Rays whose cells lie behind their nearest hits are inactive. */
SIMD_INLINE void kernel_curved_batch_load(const kernel_tile_trace *t, const kernel_curved_batch *h,
                                          const kernel_pixel_list *rays, int n, kernel_lane_rays *out)
{
    kernel_lane_rays_begin(out, t, rays, n);
    kernel_lane_rays_set_far(out, t);
    out->active = vm_and(out->active, vf_le(kernel_gather_lane(h->queued->near, out->lane), out->far));
}

/* Decides as many rays as possible without intersecting faces: by the slab that contains the isosurface, and by
 * contraction (kernel_contraction.h). Rays with exactly one crossing are moved to `found`, rays without one are
 * dropped, and undecided rays remain in `rays`. */
SIMD_INLINE void kernel_curved_batch_contract_of_type(const kernel_tile_trace *t, kernel_curved_batch *h, int type)
{
    const kernel_curved cells = kernel_curved_batch_get_cells(h);
    int kept = 0;
    h->found.count = 0;
    for (int n = 0; n < h->rays.count; n += SIMD_WIDTH) {
        kernel_lane_rays p;
        kernel_contraction c;
        kernel_point at;
        vm none;
        kernel_curved_batch_load(t, h, &h->rays, n, &p);
        kernel_contraction_set_ray(&cells, &p.rays, p.lane, &c);
        p.active = vm_andnot(p.active, kernel_curved_batch_misses_slab(h, p.lane, &c));
        if (!vm_any(p.active)) continue;
        kernel_contraction_set_cell(&h->bounds, p.lane, type, &c);
        kernel_find_only_root_by_contraction(&c, p.active, &at, &none, type);
        at.t += kernel_gather_lane(h->transformed.at[2][0], p.lane);
        at.value = vf_set(0);
        kernel_append_rays_with_crossings(&h->rays, n, &at, 1, vm_bits(at.mask), &h->found, h->found_ends);
        kept = kernel_curved_batch_keep_rays(h, n, vm_bits(vm_andnot(p.active, vm_or(at.mask, none))), kept);
    }
    h->rays.count = kept;
    kernel_pixel_list_pad(&h->rays);
    kernel_pixel_list_pad(&h->found);
}

static __attribute__((noinline)) void kernel_curved_batch_contract_rays(const kernel_tile_trace *t,
                                                                        kernel_curved_batch *h)
{
    KERNEL_OF_TYPE(h->queued->type, kernel_curved_batch_contract_of_type, t, h);
}

/* Adds the rays that cross exactly two faces of their cells once each to the list `met`, and the indices of these faces
 * to `faces`. Rays for which that is not certain are traced at once, cell by cell, and their hits are accepted. Returns
 * a mask of the tile's blocks in which one of these hits is nearer than the ray's previous one. */
SIMD_INLINE unsigned kernel_curved_batch_find_faces_of_type(kernel_tile_trace *t, kernel_curved_batch *h, int type)
{
    unsigned nearer = 0;
    h->met.count = 0;
    for (int n = 0; n < h->rays.count; n += SIMD_WIDTH) {
        kernel_lane_rays p;
        vm two, alone;
        vi face[2];
        uint8_t faces[SIMD_WIDTH];
        kernel_curved_batch_load(t, h, &h->rays, n, &p);
        if (!vm_any(p.active)) continue;
        kernel_curved_find_faces_of_active_rays(&h->transformed, &p, type, &two, &alone, face);
        const vi both = face[0] | face[1] << 3;
        for (int i = 0; i < SIMD_WIDTH; i++) faces[i] = (uint8_t)both[i];
        for (unsigned bits = vm_bits(two); bits; bits &= bits - 1) {
            const int i = __builtin_ctz(bits);
            h->faces[h->met.count] = faces[i];
            kernel_pixel_list_copy_ray(&h->met, &h->rays, n + i);
        }
        if (__builtin_expect(vm_any(alone), 0))
            nearer |= kernel_curved_batch_trace_singly(t, h, &h->rays, n, p.at, vm_bits(alone));
    }
    kernel_pixel_list_pad(&h->met);
    memset(h->faces + h->met.count, 0, SIMD_WIDTH);
    return nearer;
}

static __attribute__((noinline)) unsigned kernel_curved_batch_find_faces(kernel_tile_trace *t, kernel_curved_batch *h)
{
    return KERNEL_OF_TYPE(h->queued->type, kernel_curved_batch_find_faces_of_type, t, h);
}

/* Computes the points at which the rays in `met` enter and leave their cells, and the field there. Rays with exactly
 * one root according to these values are added to `found`. Rays whose roots must be searched for are added to `others`.
 */
SIMD_INLINE void kernel_curved_batch_intersect_of_type(const kernel_tile_trace *t, kernel_curved_batch *h, int type)
{
    const kernel_curved cells = kernel_curved_batch_get_cells(h);
    h->found.count = h->others.count = 0;
    for (int n = 0; n < h->met.count; n += SIMD_WIDTH) {
        kernel_lane_rays p;
        kernel_point ends[2];
        vm found;
        const vf zero = vf_set(0), endless = vf_set(INFINITY);
        const vi faces = kernel_load_bytes(h->faces + n);
        kernel_lane_rays_begin(&p, t, &h->met, n);
        kernel_lane_rays_set_far(&p, t);
        kernel_curved_compute_crossings(&h->transformed, &p, type, faces, ends);
        ends[1].value = kernel_move_end_value_into_cell(ends[0].value, ends[1].value, t->surface->layer->is_of_faces);
        vm near = vm_and(vf_le(ends[0].t, p.far), vf_le(kernel_lane_rays_get_begin_depths(t, &p), ends[1].t));
        near = vm_and(vm_and(p.active, near), vm_and(vf_lt(ends[0].t, endless), vf_lt(ends[1].t, endless)));
        const vm change = vm_xor(vf_lt(ends[0].value, zero), vf_lt(ends[1].value, zero));
        const vm nonempty = vm_and(near, vm_or(change, vf_lt(ends[0].t, ends[1].t)));
        const vm left = kernel_decide_by_ends(&cells, &p.rays, p.lane, nonempty, &ends[0], &ends[1], &found);
        kernel_append_rays_with_crossings(&h->met, n, ends, 2, vm_bits(found), &h->found, h->found_ends);
        kernel_append_rays_with_crossings(&h->met, n, ends, 2, vm_bits(left), &h->others, h->other_ends);
    }
}

static __attribute__((noinline)) void kernel_curved_batch_intersect_faces(const kernel_tile_trace *t,
                                                                          kernel_curved_batch *h)
{
    KERNEL_OF_TYPE(h->queued->type, kernel_curved_batch_intersect_of_type, t, h);
}

/* Computes the contour lines' field, its gradient and the surface's normal at the reference coordinates r in each ray's
 * own cell. */
SIMD_INLINE void kernel_curved_batch_compute_line_field(const kernel_tile_trace *t, const kernel_curved_batch *h,
                                                        vi lane, const vf r[3], kernel_line_field *out, int type)
{
    kernel_map map;
    vf c[8];
    kernel_compute_maps_of_type((const float(*)[8][SIMD_WIDTH])h->transformed.at, lane, &map, type);
    kernel_maps_polynomial((const float(*)[SIMD_WIDTH])h->lines, lane, c, type);
    kernel_map_line_field(&t->tile, &map, c, r, out);
}

/* Reads the field of the contour lines at the vertices of the lanes' cells. */
static __attribute__((noinline)) void kernel_curved_batch_read_line_values(const kernel_tile_trace *t,
                                                                           kernel_curved_batch *h)
{
    const grid_field *field = &t->surface->layer->lines->field.fields[h->queued->part];
    for (int n = 0; n < h->queued->count; n++)
        for (int i = 0; i < grid_type_vertex_count(h->queued->type); i++) {
            const int64_t vertex = kernel_surface_cells_get_mesh_index(h->queued, h->transformed.vertex[i][n]);
            h->lines[i][n] = (float)kernel_lines_read_vertex_value(t->surface, field, vertex);
        }
}

/* Accepts the hits of one vector of rays. points: the hits; normal: as in kernel_hits, a vector along the normal or
 * reference coordinates. Returns a mask of the blocks that contain a ray whose hit is nearer than its previous one. */
static __attribute__((noinline)) unsigned
kernel_curved_batch_accept_hits(kernel_tile_trace *t, const kernel_curved_batch *h, const kernel_lane_rays *p, vm hit,
                                const kernel_point *points, const vf normal[3])
{
    const render_surface_layer *layer = t->surface->layer;
    const int type = h->queued->type;
    if (kernel_tile_hits_are_plain(t))
        return kernel_lane_hits_accept_opaque(t, h->queued, p, hit, points->t, normal, NULL);
    kernel_line_field along;
    kernel_surface_hits hits = {.t = points->t, .vertex_count = grid_type_vertex_count(type)};
    memcpy(hits.normal, normal, sizeof hits.normal);
    for (int a = 0; a < 4; a++) hits.vertices[a] = (const float(*)[SIMD_WIDTH])h->transformed.at[a];
    if (layer->colour_map)
        hits.w = kernel_interpolate_value_in_cells((const float(*)[SIMD_WIDTH])h->colours, p->lane, points->r, type);
    if (layer->lines) {
        KERNEL_OF_TYPE(type, kernel_curved_batch_compute_line_field, t, h, p->lane, points->r, &along);
        hits.along = &along;
    }
    return kernel_lane_hits_accept(t, h->queued, p, hit, &hits);
}

/* Sets `normal` to what hits store in place of their normals: the field's gradients, transformed from tile space into
 * camera axes. If the layer has normals from vertices (RENDER_VERTEX), it is set to the reference coordinates r
 * instead, from which kernel_vertex_normals() computes the normals later. */
SIMD_INLINE void kernel_curved_batch_store_normal(const kernel_tile_trace *t, const vf gradient[3], const vf r[3],
                                                  vf normal[3])
{
    const bool is_later = t->surface->layer->normal == RENDER_VERTEX;
    for (int a = 0; a < 3; a++) normal[a] = is_later ? r[a] : gradient[a];
    if (!is_later) kernel_gradient_to_camera_axes(&t->tile, normal);
}

SIMD_INLINE void kernel_curved_batch_normal(const kernel_tile_trace *t, const kernel_map *map, const vf r[3],
                                            vf normal[3])
{
    vf gradient[3] = {vf_set(0), vf_set(0), vf_set(0)};
    if (t->surface->layer->normal != RENDER_VERTEX) kernel_compute_gradient_direction(map, r, gradient);
    kernel_curved_batch_store_normal(t, gradient, r, normal);
}

/* Accepts the visible hits of the rays in `rays` that certainly have exactly one root in a cuboid, and drops rays that
 * certainly have none. Undecided rays, and rays in cells that are not cuboids, remain in `rays`. Returns a mask of the
 * blocks that contain a ray whose hit is nearer than its previous one. */
static __attribute__((noinline)) unsigned kernel_curved_batch_accept_cuboid_roots(kernel_tile_trace *t,
                                                                                  kernel_curved_batch *h)
{
    const float(*const at)[8][SIMD_WIDTH] = (const float(*)[8][SIMD_WIDTH])h->transformed.at;
    unsigned nearer = 0;
    int kept = 0;
    for (int n = 0; n < h->rays.count; n += SIMD_WIDTH) {
        kernel_lane_rays p;
        kernel_point root;
        vm none;
        vf gradient[3], normal[3];
        kernel_curved_batch_load(t, h, &h->rays, n, &p);
        const vm cuboid = vf_lt(kernel_gather_lane(h->cuboids.domain_margin, p.lane), vf_set(INFINITY));
        const vm rays = vm_and(p.active, cuboid);
        kernel_cuboid_find_roots(&h->cuboids, at, &p, rays, &root, &none, gradient);
        const vm hit = kernel_visible_lane_hits(t, &p, root.mask, root.t);
        if (vm_any(hit)) {
            kernel_curved_batch_store_normal(t, gradient, root.r, normal);
            nearer |= kernel_curved_batch_accept_hits(t, h, &p, hit, &root, normal);
        }
        kept = kernel_curved_batch_keep_rays(h, n, vm_bits(vm_andnot(p.active, vm_or(root.mask, none))), kept);
    }
    h->rays.count = kept;
    kernel_pixel_list_pad(&h->rays);
    return nearer;
}

/* Refines the roots of the rays in `found`, and accepts those that are visible. is_contracted: the roots come from
 * kernel_curved_batch_contract_rays(), and are so accurate that they need no bracket. Returns a mask of the blocks that
 * contain a ray whose hit is nearer than its previous one. */
SIMD_INLINE unsigned kernel_curved_batch_accept_found_of(kernel_tile_trace *t, kernel_curved_batch *h,
                                                         bool is_contracted, int type)
{
    unsigned nearer = 0;
    for (int n = 0; n < h->found.count; n += SIMD_WIDTH) {
        kernel_lane_rays p;
        kernel_map map;
        kernel_point ends[2], at;
        vm open = vm_none();
        kernel_lane_rays_begin(&p, t, &h->found, n);
        kernel_lane_rays_set_far(&p, t);
        kernel_curved_ends_load(h->found_ends, n, is_contracted ? 1 : 2, ends);
        kernel_compute_maps_of_type((const float(*)[8][SIMD_WIDTH])h->transformed.at, p.lane, &map, type);
        if (is_contracted) {
            at = ends[0];
            kernel_refine_accurate_roots(&p.rays, &map, p.active, &at);
        } else {
            open = kernel_refine_roots_by_newton(&p.rays, &map, p.active, &ends[0], &ends[1], &at);
        }
        const vm hit = kernel_visible_lane_hits(t, &p, vm_andnot(p.active, open), at.t);
        if (__builtin_expect(vm_any(open), 0))
            nearer |= kernel_curved_batch_trace_singly(t, h, &h->found, n, p.at, vm_bits(open));
        if (!vm_any(hit)) continue;
        vf normal[3];
        kernel_curved_batch_normal(t, &map, at.r, normal);
        nearer |= kernel_curved_batch_accept_hits(t, h, &p, hit, &at, normal);
    }
    return nearer;
}

static __attribute__((noinline)) unsigned kernel_curved_batch_accept_found(kernel_tile_trace *t, kernel_curved_batch *h,
                                                                           bool is_contracted)
{
    return is_contracted ? KERNEL_OF_TYPE(h->queued->type, kernel_curved_batch_accept_found_of, t, h, true)
                         : KERNEL_OF_TYPE(h->queued->type, kernel_curved_batch_accept_found_of, t, h, false);
}

/* Searches for the roots of each ray in the vector that begins at index n of `others`, and accepts those that are
 * visible. A ray ends at the first visible root of an opaque surface. Returns a mask of the blocks that contain a ray
 * whose hit is nearer than its previous one. */
static __attribute__((noinline)) unsigned kernel_curved_batch_search(kernel_tile_trace *t, kernel_curved_batch *h,
                                                                     int n)
{
    kernel_lane_rays p;
    kernel_point ends[2];
    kernel_interval i = {.w_in = vf_set(0), .w_out = vf_set(0)};
    kernel_search s;
    unsigned nearer = 0;
    kernel_lane_rays_begin(&p, t, &h->others, n);
    kernel_lane_rays_set_far(&p, t);
    kernel_curved_ends_load(h->other_ends, n, 2, ends);
    kernel_interval_from_points(p.active, &ends[0], &ends[1], &i);
    const kernel_curved cells = kernel_curved_batch_get_cells(h);
    if (!kernel_search_cells(&s, &cells, &p.rays, p.lane, &i, p.active, &t->thread->map_failures)) return 0;
    do {
        kernel_point at;
        vf normal[3];
        if (!vm_any(s.found)) continue;
        kernel_refine_roots(&s, &at);
        const vm hit = kernel_visible_lane_hits(t, &p, s.found, at.t);
        if (!vm_any(hit)) continue;
        kernel_curved_batch_normal(t, &s.map, at.r, normal);
        nearer |= kernel_curved_batch_accept_hits(t, h, &p, hit, &at, normal);
        if (kernel_tile_layer_is_opaque(t)) kernel_search_close(&s, hit);
    } while (kernel_search_continue(&s));
    return nearer;
}

/* ---- processing a whole batch ---- */

/* Computes the data of the faces (kernel_compute_face_data()) and the bounds (kernel_bounds) of the batch's cells,
 * unless that has been done. */
static void kernel_curved_batch_set_bounds(const kernel_tile_trace *t, kernel_curved_batch *h)
{
    const kernel_beam beam = kernel_bound_rays_of_tile(t->frame, &t->tile);
    if (h->has_bounds) return;
    kernel_compute_face_data(&h->transformed, t->frame, &t->tile, h->queued->type);
    kernel_compute_bounds_of_cells(h->queued->type, (const float(*)[8][SIMD_WIDTH])h->transformed.at, &beam,
                                   &h->bounds);
    h->has_bounds = true;
}

/* Traces the rays in the list `rays` that kernel_cuboids.h has not decided, stage by stage. Returns a mask of the
 * blocks that contain a ray whose hit is nearer than its previous one. */
static unsigned kernel_curved_batch_trace_others(kernel_tile_trace *t, kernel_curved_batch *h)
{
    if (!h->rays.count) return 0;
    kernel_curved_batch_set_bounds(t, h);
    kernel_curved_batch_contract_rays(t, h);
    unsigned nearer = kernel_curved_batch_accept_found(t, h, true);
    nearer |= kernel_curved_batch_find_faces(t, h);
    kernel_curved_batch_intersect_faces(t, h);
    kernel_pixel_list_pad(&h->found);
    kernel_pixel_list_pad(&h->others);
    nearer |= kernel_curved_batch_accept_found(t, h, false);
    for (int n = 0; n < h->others.count; n += SIMD_WIDTH) nearer |= kernel_curved_batch_search(t, h, n);
    return nearer;
}

/* Traces all rays in the list `rays`. */
static __attribute__((noinline)) void kernel_curved_batch_trace(kernel_tile_trace *t, kernel_curved_batch *h)
{
    kernel_pixel_list_pad(&h->rays);
    unsigned nearer = h->transformed.cuboids ? kernel_curved_batch_accept_cuboid_roots(t, h) : 0;
    nearer |= kernel_curved_batch_trace_others(t, h);
    for (; nearer; nearer &= nearer - 1) kernel_block_update_far(t, __builtin_ctz(nearer));
    h->rays.count = 0;
}

/* Appends the rays of a cell's box of pixels to the list h->rays, and sets up the packets of the given blocks, in which
 * the cell may be visible. Traces the list if it is full. */
SIMD_INLINE void kernel_curved_batch_list_rays(kernel_tile_trace *t, kernel_curved_batch *h, int lane, unsigned box,
                                               unsigned blocks)
{
    kernel_pixel_list_add_box(&h->rays, box, lane);
    for (blocks &= ~t->begun; blocks; blocks &= blocks - 1) kernel_block_set_up_packets(t, __builtin_ctz(blocks));
    if (h->rays.count >= KERNEL_LIST_PIXELS) kernel_curved_batch_trace(t, h);
}

/* Transforms the queued cells into tile space, and lists the rays of their boxes of pixels. A cell that has an edge of
 * length zero is not listed, but traced block by block at once. */
static __attribute__((noinline)) void kernel_curved_batch_transform(kernel_tile_trace *t, kernel_curved_batch *h,
                                                                    kernel_surface_cells *queued)
{
    kernel_surface_cells_fill_lanes(t, queued);
    h->queued = queued;
    const vm collapsed = kernel_transform_curved(&h->transformed, &queued->arrays, t->frame, &t->tile, queued->vertex,
                                                 queued->isovalue, queued->type);
    h->has_bounds = false;
    kernel_surface_cells_set_reach(t, queued, (const kernel_f64(*)[3][2])h->transformed.world,
                                   grid_type_vertex_count(queued->type));
    if (h->transformed.cuboids) kernel_cuboids_compute_coefficients(&h->transformed, t->frame, &t->tile, &h->cuboids);
    if (t->surface->layer->colour_map)
        kernel_surface_cells_read_colours(t->surface, queued, (const int32_t(*)[SIMD_WIDTH])h->transformed.vertex,
                                          h->colours);
    if (t->surface->layer->lines) kernel_curved_batch_read_line_values(t, h);
    h->copied_lanes = 0;
    kernel_curved cells = kernel_curved_batch_get_cells(h);
    for (int n = 0; n < queued->count; n++) {
        const unsigned blocks = kernel_surface_cells_visible_blocks(t, queued, n);
        if (!blocks) continue;
        if (!(vm_bits(collapsed) >> n & 1)) {
            kernel_curved_batch_list_rays(t, h, n, queued->box[n], queued->blocks[n]);
            continue;
        }
        kernel_curved_batch_set_bounds(t, h);
        kernel_curved_batch_copy_cell(t, h, n);
        cells.lane = n;
        kernel_trace_cell_in_blocks(t, blocks, queued->part, queued->cell[n], &h->cells[n], &cells, queued->value[n]);
    }
}

/* Traces the queue's cells, which become the current batch, and empties the queue. */
static __attribute__((noinline)) void
kernel_curved_batch_trace_queued_cells(kernel_tile_trace *t, kernel_curved_batch *h, kernel_surface_cells *queued)
{
    kernel_curved_batch_transform(t, h, queued);
    if (h->rays.count) kernel_curved_batch_trace(t, h);
    queued->count = 0;
}

#endif
