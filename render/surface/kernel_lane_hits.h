/* Accepts hits (keeps each ray's nearest hit) of rays that each have a cell of their own, one ray per lane
 * (kernel_batch.h, kernel_curved_batch.h). Several lanes may hold rays of the same pixel. Opaque hits are therefore
 * compared with the nearest hits of their rays one by one. Colours and light are computed with all lanes at once, by
 * the functions that serve the packets of a tile: a packet is made of the rays in the lanes. */
#ifndef RENDER_KERNEL_LANE_HITS_H
#define RENDER_KERNEL_LANE_HITS_H

#include <math.h>
#include <string.h>

#include "kernel_accept.h"
#include "kernel_differences.h"
#include "kernel_hits.h"
#include "kernel_packet.h"
#include "kernel_surface.h"
#include "kernel_surface_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

/* Returns whether hits on the current layer are plain: the surface is opaque, and each hit has the colour of its
 * isovalue, without colour field, edges, lines or numbers in place of colours (RENDER_VALUES). Such hits are accepted
 * without making a packet of their rays (kernel_accept_opaque_hit_of_ray()). */
SIMD_INLINE bool kernel_tile_hits_are_plain(const kernel_tile_trace *t)
{
    const render_surface_layer *l = t->surface->layer;
    return kernel_tile_layer_is_opaque(t) && !l->colour_map && !l->lines && !(l->edge_width > 0) &&
           t->frame->job->paint != RENDER_VALUES;
}

/* Computes own->reach if the layer's normals come from central differences: for each cell, the distance from hits in it
 * to the points at which the field is sampled. world: world coordinates by vertex, axis and half of the lanes; count:
 * number of a cell's vertices. */
SIMD_INLINE void kernel_surface_cells_set_reach(const kernel_tile_trace *t, kernel_surface_cells *own,
                                                const kernel_f64 (*world)[3][2], int count)
{
    const render_surface_layer *layer = t->surface->layer;
    for (int n = 0; layer->normal == RENDER_DIFFERENCES && n < own->count; n++) {
        double corners[8][3];
        for (int i = 0; i < count; i++)
            for (int a = 0; a < 3; a++) corners[i][a] = kernel_halves_lane(world[i][a], n);
        own->reach[n] = kernel_difference_sample_distance(t->frame, layer, (const double(*)[3])corners, count);
    }
}

/* Makes a packet of the rays in the lanes, with the pixels that they have in the tile's packets. Only the members that
 * clips and colours need are set; active, t_near, t_far and hits are not. */
SIMD_INLINE void kernel_packet_of_lane_rays(const kernel_tile_trace *t, const kernel_lane_rays *r, kernel_packet *out)
{
    const kernel_packet *first = &t->packets[0];
    out->frame = t->frame;
    out->tile = &t->tile;
    out->thread = t->thread;
    out->has_view = false;
    out->origin_x = r->rays.origin_x;
    out->origin_y = r->rays.origin_y;
    out->slope_x = r->rays.slope_x;
    out->slope_y = r->rays.slope_y;
    out->column = vi_from_bits(kernel_gather_packet_member(&first->column, r->at));
    out->row = vi_from_bits(kernel_gather_packet_member(&first->row, r->at));
    vi_store((int32_t *)out->pixel, vi_from_bits(kernel_gather_packet_member(first->pixel, r->at)));
}

static __attribute__((noinline, cold)) vm kernel_lane_hits_kept_by_clips(const kernel_tile_trace *t,
                                                                         const kernel_lane_rays *r, vm hit, vf depth)
{
    kernel_packet rays;
    kernel_packet_of_lane_rays(t, r, &rays);
    return kernel_hits_kept_by_clips(&rays, t->surface->own_clips, hit, depth);
}

/* Returns those of the hits that are in front of the eye and not behind the rays' nearest hits, and that the surface's
 * own clips keep. */
SIMD_INLINE vm kernel_visible_lane_hits(const kernel_tile_trace *t, const kernel_lane_rays *r, vm hit, vf depth)
{
    const vm visible = vm_and(hit, vm_and(vf_le(kernel_lane_rays_get_begin_depths(t, r), depth), vf_le(depth, r->far)));
    if (__builtin_expect(t->surface->own_clips == 0, 1)) return visible;
    /* a copy to be passed on, because taking the address of *r would keep the original in memory instead of
     * registers */
    const kernel_lane_rays copy = *r;
    return kernel_lane_hits_kept_by_clips(t, &copy, visible, depth);
}

/* Emits a ray's hit in the cell in lane n of `cells` as a fragment of its own. Callers do this if the hit has the same
 * depth as the ray's nearest hit. ray: lane of the packet p. */
static __attribute__((noinline, cold)) void kernel_emit_ray_hit_of_equal_depth(kernel_packet *p,
                                                                               const kernel_surface *s, int ray,
                                                                               const kernel_surface_cells *cells, int n,
                                                                               float depth, const float normal[3],
                                                                               const float colour[3])
{
    kernel_surface_hits h = {.value = vi_set(cells->value[n]),
                             .t = vf_set(depth),
                             .reach = vf_set(s->layer->normal == RENDER_DIFFERENCES ? cells->reach[n] : 0),
                             .part = vi_set(cells->part),
                             .cell = vi_set((int32_t)cells->cell[n])};
    for (int a = 0; a < 3; a++) {
        h.normal[a] = vf_set(normal[a]);
        h.colour[a] = vf_set(colour[a]);
    }
    kernel_accept_hits_of_equal_depth(p, s, vm_from_bits(1u << ray), &h);
}

/* Accepts a hit of an opaque surface in the cell in lane n of `cells`: keeps it if it is the nearest hit of its ray, as
 * kernel_accept() does for the rays of a packet. at: position of the ray among those of the tile's packets (packet *
 * SIMD_WIDTH + lane); normal: as in kernel_hits; colour: before lighting. Returns the bit of the ray's block if the hit
 * is nearer than the ray's previous one, and otherwise 0. */
SIMD_INLINE unsigned kernel_accept_opaque_hit_of_ray(kernel_tile_trace *t, int at, const kernel_surface_cells *cells,
                                                     int n, float depth, const float normal[3], const float colour[3])
{
    const kernel_surface *s = t->surface;
    const int ray = at % SIMD_WIDTH;
    kernel_packet *p = &t->packets[at / SIMD_WIDTH];
    kernel_hits *hits = p->hits;
    const float far = p->t_far[ray];
    if (!(depth <= far) || !(vm_bits(p->active) >> ray & 1)) return 0;
    if (depth == far && vm_bits(hits->found) >> ray & 1) {
        kernel_emit_ray_hit_of_equal_depth(p, s, ray, cells, n, depth, normal, colour);
        return 0;
    }
    p->t_far[ray] = depth;
    vm_set_lane(&hits->found, ray);
    for (int a = 0; a < 3; a++) {
        hits->normal[a][ray] = normal[a];
        hits->colour[a][ray] = colour[a];
    }
    if (s->layer->normal == RENDER_DIFFERENCES) hits->reach[ray] = cells->reach[n];
    if (s->layer->normal == RENDER_VERTEX) {
        hits->part[ray] = cells->part;
        hits->cell[ray] = (int32_t)cells->cell[n];
    }
    hits->kind[ray] = (float)((int)s->first_kind + cells->value[n]);
    return 1u << at / (KERNEL_BLOCK * KERNEL_BLOCK);
}

/* Accepts hits of an opaque surface ray by ray (kernel_accept_opaque_hit_of_ray()). normal: per ray, as in kernel_hits;
 * colour: per ray, before lighting, or NULL for the colours of the isovalues. Returns a mask of the blocks that contain
 * a ray whose hit is nearer than its previous one. */
SIMD_INLINE unsigned kernel_lane_hits_accept_opaque(kernel_tile_trace *t, const kernel_surface_cells *cells,
                                                    const kernel_lane_rays *r, vm hit, vf depth, const vf normal[3],
                                                    const vf *colour)
{
    unsigned blocks = 0;
    int32_t at[SIMD_WIDTH], lanes[SIMD_WIDTH];
    vi_store(at, r->at);
    vi_store(lanes, r->lane);
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int i = __builtin_ctz(left), n = lanes[i];
        const float ray_normal[3] = {normal[0][i], normal[1][i], normal[2][i]};
        float ray_colour[3];
        for (int a = 0; colour && a < 3; a++) ray_colour[a] = colour[a][i];
        blocks |=
            kernel_accept_opaque_hit_of_ray(t, at[i], cells, n, depth[i], ray_normal,
                                            colour ? ray_colour : t->surface->layer->colours + 3 * cells->value[n]);
    }
    return blocks;
}

/* Returns those of the hits whose rays are active in their packets. If the frame has volumes, adds the depths of these
 * hits to the rays' lists of crossings of transparent surfaces. */
SIMD_INLINE vm kernel_lane_hits_add_crossings(kernel_tile_trace *t, const kernel_lane_rays *r, vm hit, vf depth)
{
    unsigned kept = 0;
    for (unsigned left = vm_bits(hit); left; left &= left - 1) {
        const int i = __builtin_ctz(left), at = r->at[i], ray = at % SIMD_WIDTH;
        const kernel_packet *p = &t->packets[at / SIMD_WIDTH];
        if (!(vm_bits(p->active) >> ray & 1)) continue;
        if (t->frame->volume_count) kernel_hits_add_crossing(p->hits, ray, depth[i]);
        kept |= 1u << i;
    }
    return vm_from_bits(kept);
}

/* Sets the members of *h that describe the cells that are hit. lane: the lane of `cells` that holds each ray's cell. */
SIMD_INLINE void kernel_lane_hits_set_cells(const kernel_tile_trace *t, const kernel_surface_cells *cells, vi lane,
                                            kernel_surface_hits *h)
{
    h->lane = lane;
    h->value = vi_from_bits(kernel_gather_lane((const float *)(const void *)cells->value, lane));
    h->part = vi_set(cells->part);
    h->cell = vi_from_bits(kernel_gather_lane((const float *)(const void *)cells->cell, lane));
    h->reach = vf_set(0);
    if (t->surface->layer->normal == RENDER_DIFFERENCES) h->reach = kernel_gather_lane(cells->reach, lane);
}

/* Accepts the hits of rays in lanes on a layer of any kind, as kernel_accept() does for the rays of a packet. hit: mask
 * of the rays that hit; *h: its members t, normal, w, along, vertex_count and vertices must be set. Returns a mask of
 * the blocks that contain a ray whose hit is nearer than its previous one. */
static __attribute__((noinline)) unsigned kernel_lane_hits_accept(kernel_tile_trace *t,
                                                                  const kernel_surface_cells *cells,
                                                                  const kernel_lane_rays *r, vm hit,
                                                                  kernel_surface_hits *h)
{
    const kernel_surface *s = t->surface;
    kernel_packet rays;
    kernel_packet_of_lane_rays(t, r, &rays);
    kernel_lane_hits_set_cells(t, cells, r->lane, h);
    hit = kernel_colour_hits(&rays, s, hit, h);
    if (kernel_tile_layer_is_opaque(t))
        return kernel_lane_hits_accept_opaque(t, cells, r, hit, h->t, h->normal, h->colour);
    hit = kernel_lane_hits_add_crossings(t, r, hit, h->t);
    if (vm_any(hit)) kernel_emit_transparent(&rays, s, hit, h);
    return 0;
}

#endif
