/* Draws lines along those edges of cells that lie in the surface, over the colours of hits. The cells are tets and
 * pyramids, each built on a face of a mesh by the session (outer surfaces). The distance from a hit to an edge is
 * measured in the picture, so that lines have the same width for any orientation of a face. In the following, a ray's
 * plane has the axes x and y of tile space, with the ray at the origin: points are projected to it along the ray
 * (kernel_cell.h). */
#ifndef RENDER_KERNEL_EDGES_H
#define RENDER_KERNEL_EDGES_H

#include <string.h>

#include "grid.h"
#include "kernel_accept.h"
#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Returns, per lane, the squared distance between points a and b, which have been projected along the lane's ray to
 * coordinates x and y with the ray at the origin (kernel_project_vertex_along_ray()). */
SIMD_INLINE vf kernel_squared_distance(const vf a[2], const vf b[2])
{
    const vf x = b[0] - a[0], y = b[1] - a[1];
    return x * x + y * y;
}

/* Returns the squared distance from each ray, which is at the origin, to the edge between vertices a and b, which have
 * been projected along the ray (kernel_project_vertex_along_ray()). */
SIMD_INLINE vf kernel_squared_edge_distance(const vf a[2], const vf b[2])
{
    const vf zero = vf_set(0), one = vf_set(1);
    const vf ex = b[0] - a[0], ey = b[1] - a[1], square = kernel_squared_distance(a, b);
    const vf along = -(a[0] * ex + a[1] * ey) / vf_select(vf_lt(zero, square), square, one);
    const vf s = vf_clamp(along, zero, one);
    const vf x = a[0] + s * ex, y = a[1] + s * ey;
    return x * x + y * y;
}

/* Projects one vertex per ray, given in tile space, along the ray: computes the vertex's x and y minus those of the ray
 * at the vertex's depth. */
SIMD_INLINE void kernel_project_vertex_along_ray(const kernel_packet *p, vf x, vf y, vf z, vf out[2])
{
    out[0] = x - (p->origin_x + p->slope_x * z);
    out[1] = y - (p->origin_y + p->slope_y * z);
}

/* Returns the squared distance from each ray to the nearest edge of a polygon, in the ray's plane. *length is raised to
 * the squared length of the polygon's longest edge. loop: the polygon's entries in render_part.loops: number of
 * vertices around it, number of segments per edge, and the vertices. */
SIMD_INLINE vf kernel_squared_distance_to_polygon(const kernel_packet *p, const grid *g, const int64_t *loop,
                                                  vf *length)
{
    const int64_t count = loop[0], step = loop[1], *corners = loop + 2;
    vf last[2], next[2], begin[2], nearest = vf_set(INFINITY);
    for (int64_t i = 0; i <= count; i++) {
        double world[3];
        float x, y, z;
        grid_read_vertex_position(g, corners[i % count], world);
        kernel_transform_in_tile(p->frame, p->tile, world, &x, &y, &z);
        kernel_project_vertex_along_ray(p, vf_set(x), vf_set(y), vf_set(z), next);
        if (i > 0) nearest = vf_min(nearest, kernel_squared_edge_distance(last, next));
        if (i > 0 && i % step == 0) *length = vf_max(*length, kernel_squared_distance(begin, next));
        memcpy(last, next, sizeof last);
        if (i % step == 0) memcpy(begin, next, sizeof begin);
    }
    return nearest;
}

/* Lists the vertices of each ray's cell that lie in the surface, at most four, in the order of the cell's vertices.
 * places: their positions in the ray's plane. Returns the number of listed vertices for each ray. */
SIMD_INLINE vf kernel_list_vertices_in_surface(const kernel_packet *p, const kernel_surface_hits *h, vf places[4][2])
{
    vf count = vf_set(0);
    for (int k = 0; k < 4; k++) places[k][0] = places[k][1] = vf_set(0);
    for (int i = 0; i < h->vertex_count; i++) {
        vf own[2];
        const vm is_in_surface = vf_eq(kernel_gather_lane(h->vertices[3][i], h->lane), vf_set(0));
        kernel_project_vertex_along_ray(p, kernel_gather_lane(h->vertices[0][i], h->lane),
                                        kernel_gather_lane(h->vertices[1][i], h->lane),
                                        kernel_gather_lane(h->vertices[2][i], h->lane), own);
        for (int k = 0; k < 4; k++) {
            const vm is_next = vm_and(is_in_surface, vf_eq(count, vf_set((float)k)));
            for (int a = 0; a < 2; a++) places[k][a] = vf_select(is_next, own[a], places[k][a]);
        }
        count = vf_select(is_in_surface, count + 1.0f, count);
    }
    return vf_min(count, vf_set(4));
}

/* Returns the squared distance from each ray to the nearest edge of that face of its cell that lies in the surface, in
 * the ray's plane. *length: the squared length of the face's longest edge there. */
SIMD_INLINE vf kernel_squared_face_edge_distance(const kernel_packet *p, const kernel_surface_hits *h, vf *length)
{
    vf places[4][2], nearest = vf_set(INFINITY);
    const vf count = kernel_list_vertices_in_surface(p, h, places);
    *length = vf_set(0);
    for (int i = 0; i < 4; i++) {
        const vm is_edge = vf_lt(vf_set((float)i), count), is_last = vf_eq(vf_set((float)(i + 1)), count);
        vf next[2];
        for (int a = 0; a < 2; a++) next[a] = vf_select(is_last, places[0][a], places[(i + 1) & 3][a]);
        const vf away = vf_min(nearest, kernel_squared_edge_distance(places[i], next));
        const vf longer = vf_max(*length, kernel_squared_distance(places[i], next));
        nearest = vf_select(is_edge, away, nearest);
        *length = vf_select(is_edge, longer, *length);
    }
    return nearest;
}

/* Corrects the results of kernel_squared_face_edge_distance() on the rays in `hit` whose cell lies on one of the faces
 * into which a polygon was divided (render_part.loops). There, *nearest becomes the squared distance to the nearest of
 * the polygon's edges, and *length the squared length of the longest of them. */
static __attribute__((noinline)) void kernel_set_polygon_distances(const kernel_packet *p, const kernel_surface_hits *h,
                                                                   vm hit, vf *nearest, vf *length)
{
    const render_part *part = &p->frame->job->parts[h->part[0]];
    for (unsigned left = vm_bits(hit); left;) {
        const uint32_t cell = (uint32_t)h->cell[__builtin_ctz(left)];
        unsigned same = 0;
        for (unsigned more = left; more; more &= more - 1)
            if ((uint32_t)h->cell[__builtin_ctz(more)] == cell) same |= more & -more;
        left &= ~same;
        if (!part->loops[cell]) continue;
        vf longest = vf_set(0);
        const vf away = kernel_squared_distance_to_polygon(p, part->cells, part->loops + part->loops[cell], &longest);
        *nearest = vf_select(vm_from_bits(same), away, *nearest);
        *length = vf_select(vm_from_bits(same), longest, *length);
    }
}

/* Draws edge lines over the colours, before lighting, of the hits. The weight of the line's colour is the share
 * of the pixel that a strip of the line's width covers. Lines fade out on faces whose longest edge is shorter than six
 * line widths, because otherwise only lines would be visible there. */
static __attribute__((noinline)) void kernel_draw_edges(const kernel_packet *p, const render_surface_layer *layer,
                                                        vm hit, kernel_surface_hits *h)
{
    const kernel_frame *f = p->frame;
    const vf zero = vf_set(0), one = vf_set(1);
    const float pixel = (float)f->slope_dx, width = layer->edge_width;
    const bool flat = f->job->camera.is_orthographic;
    vf depth = h->t + (float)f->depth_shift;
    if (flat) depth = vf_set((float)f->job->space.scale);
    const vf inverse = 1.0f / (depth * pixel);
    vf length, nearest = kernel_squared_face_edge_distance(p, h, &length);
    if (f->job->parts[h->part[0]].loops) kernel_set_polygon_distances(p, h, hit, &nearest, &length);
    const vf distance = vf_sqrt(nearest) * inverse;
    const vf covered = vf_clamp(0.5f * (width + 1) - distance, zero, one);
    const vf fade = vf_clamp(0.25f * (vf_sqrt(length) * inverse / width - 2), zero, one);
    for (int a = 0; a < 3; a++) h->colour[a] = h->colour[a] + covered * fade * (layer->edge_colour[a] - h->colour[a]);
}

#endif
