/* Intersects rays with hexes, wedges or pyramids, each ray with a cell of its own: finds the two faces of its cell that
 * each ray crosses, and the crossings. Lanes are rays; each lane gathers its cell's numbers from vectors whose lanes
 * are cells. A ray that may cross more than two faces, one face twice, or an edge cannot be processed in this way; it
 * is added to the mask *alone. Callers trace such rays cell by cell, by kernel_crossings.h. Used by
 * kernel_curved_batch.h, kernel_occlusion_hexes.h and kernel_local_segments.h. */
#ifndef RENDER_KERNEL_CURVED_RAYS_H
#define RENDER_KERNEL_CURVED_RAYS_H

#include <math.h>
#include <string.h>

#include "kernel_crossings.h"
#include "kernel_packet.h"
#include "kernel_transformed_curved.h"
#include "kernel_quad.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

SIMD_INLINE void kernel_pixel_list_copy_ray(kernel_pixel_list *to, const kernel_pixel_list *from, int i)
{
    to->pixel[to->count] = from->pixel[i];
    to->lane[to->count] = from->lane[i];
    to->count++;
}

/* ---- faces that each ray crosses ---- */

/* Returns the edge function of the edge from vertex a to vertex b as an integer vector, of which only the exact sign
 * bits are used. x, y: the projected vertices. If the function's magnitude is smaller than *least, *least is set to
 * it. */
SIMD_INLINE vi kernel_curved_edge_sign(const vf x[8], const vf y[8], int a, int b, vf *least)
{
    const vf e = vf_diff_of_products(x[a], y[b], x[b], y[a]);
    *least = vf_min(vf_abs(e), *least);
    return vi_from_bits(e);
}

/* Returns the rays that cross exactly one of a quad's two triangles. Unlike a test of the signs of the four edge
 * functions, this test is right even if the quad is not convex in the projection along the ray. The result does not
 * depend on the diagonal along which the quad is split. around: edge functions of the quad's edges in cyclic order;
 * diagonal: that from corner 0 to corner 2; of both only the sign bits are used. Rays that may cross the quad's patch
 * twice are added to *alone. */
SIMD_INLINE vm kernel_curved_cross_one_triangle(const vf x[8], const vf y[8], const signed char *loop,
                                                const vi around[4], vi diagonal, vm rays, vm *alone)
{
    vm side[4];
    for (int i = 0; i < 4; i++) side[i] = vm_sign(around[i]);
    *alone = vm_or(*alone, kernel_curved_may_cross_twice(x, y, loop, rays, side));
    return kernel_find_rays_crossing_one_triangle(side, vm_sign(diagonal));
}

/* Finds the rays that cross exactly two faces of their cells, each once (*two), and the indices of these faces in the
 * cell (face). A ray crosses a face if all edge functions of the face have the same sign. *alone: rays that must be
 * traced cell by cell. Rays in neither mask miss their cells. at: x, y and z of the cells' vertices, by vertex and
 * lane. nonconvex: per ray, a mask of its cell's faces with the bits of the quads that may be nonconvex in the
 * projection along the ray; NULL: no quad is. */
SIMD_INLINE void kernel_curved_find_crossed_faces(const float (*at)[8][SIMD_WIDTH], const kernel_lane_rays *r,
                                                  const vi *nonconvex, vm rays, vm *two, vm *alone, vi face[2],
                                                  int type)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    vf x[8], y[8], least = vf_set(INFINITY);
    vi side[KERNEL_MAX_LINES], faces = vi_set(0);
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        const vf z = kernel_gather_lane(at[2][i], r->lane);
        x[i] = (kernel_gather_lane(at[0][i], r->lane) - r->rays.origin_x) - r->rays.slope_x * z;
        y[i] = (kernel_gather_lane(at[1][i], r->lane) - r->rays.origin_y) - r->rays.slope_y * z;
    }
    for (int n = 0; n < shape->edge_count; n++)
        side[n] = kernel_curved_edge_sign(x, y, shape->edges[n][0], shape->edges[n][1], &least);
    for (int n = 0; n < shape->face_count; n++) {
        const signed char *loop = shape->faces[n].vertices;
        if (shape->faces[n].count == 4)
            side[shape->edge_count + n] = kernel_curved_edge_sign(x, y, loop[0], loop[2], &least);
    }
    *alone = vm_not(vf_lt(vf_set(KERNEL_EDGE_LEAST), least));
    for (int n = 0; n < shape->face_count; n++) {
        const vi bit = vi_set(1 << n);
        vi around[4];
        for (int i = 0; i < 4; i++) {
            const signed char *edge = shape->faces[n].sides[i];
            around[i] = edge[1] ? ~side[(int)edge[0]] : side[(int)edge[0]];
        }
        vi crossed = kernel_are_on_same_side_of_edges(around, shape->faces[n].count) >> (31 - n) & bit;
        if (nonconvex && shape->faces[n].count == 4 && vm_any(vm_and(rays, vm_sign(*nonconvex << (31 - n))))) {
            const vm once = kernel_curved_cross_one_triangle(x, y, shape->faces[n].vertices, around,
                                                             side[shape->edge_count + n], rays, alone);
            crossed = vi_select(once, bit, vi_set(0));
        }
        faces |= crossed;
    }
    kernel_curved_find_two_faces(faces, rays, two, alone, face);
}

SIMD_INLINE void kernel_curved_find_faces_of_active_rays(const kernel_transformed_curved *h, const kernel_lane_rays *p,
                                                         int type, vm *two, vm *alone, vi face[2])
{
    const vi all = vi_set((1 << KERNEL_CURVED_FACES) - 1);
    kernel_curved_find_crossed_faces((const float(*)[8][SIMD_WIDTH])h->at, p, &all, p->active, two, alone, face, type);
}

/* ---- crossing points ---- */

/* The corners of one face of each ray's cell, in the order of kernel_transformed_curved.corners. vertex[i]: index of
 * corner i in the cell; at[i]: x, y, depth and field of corner i, where x and y are relative to the ray after
 * kernel_curved_corners_project(). A triangle has only three corners; its fourth entry is meaningless. */
typedef struct kernel_curved_corners {
    vi vertex[4];
    vf at[4][4];
} kernel_curved_corners;

/* Replaces the corners' x and y in tile space by those relative to the ray at the corner's depth. */
SIMD_INLINE void kernel_curved_corners_project(const kernel_rays *rays, kernel_curved_corners *c)
{
    for (int i = 0; i < 4; i++) {
        vf *at = c->at[i];
        at[0] = (at[0] - rays->origin_x) - rays->slope_x * at[2];
        at[1] = (at[1] - rays->origin_y) - rays->slope_y * at[2];
    }
}

SIMD_INLINE void kernel_curved_corners_gather(const kernel_transformed_curved *h, const kernel_lane_rays *p, int type,
                                              vi face, kernel_curved_corners *out)
{
    const vi word = vi_from_bits(vf_gather((const float *)(const void *)h->corners, face * SIMD_WIDTH + p->lane));
    for (int i = 0; i < 4; i++) {
        out->vertex[i] = word >> (4 * i) & 7;
        for (int n = 0; n < 4; n++)
            out->at[i][n] =
                kernel_curved_gather_vertex(h->at[n], grid_type_vertex_count(type), p->lane, out->vertex[i]);
    }
    kernel_curved_corners_project(&p->rays, out);
}

SIMD_INLINE void kernel_set_crossing_from_patch_point(int type, const kernel_curved_corners *c,
                                                      const kernel_point *place, kernel_point *out)
{
    const vf f[4] = {c->at[0][3], c->at[1][3], c->at[2][3], c->at[3][3]};
    out->t = place->t;
    out->value = kernel_bilinear(f, place->r[0], place->r[1]);
    for (int a = 0; a < 3; a++) {
        vf at[4];
        for (int i = 0; i < 4; i++)
            at[i] =
                kernel_curved_vertex_coordinate(kernel_cell_shape(type), grid_type_vertex_count(type), a, c->vertex[i]);
        out->r[a] = (at[0] + place->r[0] * (at[1] - at[0])) + place->r[1] * (at[3] - at[0]);
    }
}

/* Computes the edge functions ij, jk and ik of triangles from their projected corners. */
SIMD_INLINE void kernel_compute_corner_edge_functions(const kernel_curved_corners *c, vf e[3])
{
    const vf *i = c->at[0], *j = c->at[1], *k = c->at[2];
    e[0] = vf_diff_of_products(i[0], j[1], j[0], i[1]);
    e[1] = vf_diff_of_products(j[0], k[1], k[0], j[1]);
    e[2] = vf_diff_of_products(i[0], k[1], k[0], i[1]);
}

/* Returns the rays on which the sum of the triangle's weights is too small for an accurate crossing. number: index of
 * each ray's triangle among its cell's triangles; e: edge functions ij, jk, ik. */
SIMD_INLINE vm kernel_find_inaccurate_triangle_rays(const kernel_transformed_curved *h, vi lane, vm rays, vi number,
                                                    const vf e[3])
{
    return vm_and(
        rays, vf_lt(vf_abs(kernel_sum_weights(e[0], e[1], e[2])), vf_gather(h->least[0], number * SIMD_WIDTH + lane)));
}

/* Replaces edge functions by more accurate ones, which are computed from the projected corners. This is done for each
 * edge function whose sign is uncertain (doubt), and for all three of a triangle whose weights are not accurate
 * enough. */
static __attribute__((noinline, cold)) void
kernel_replace_inaccurate_edge_functions(const kernel_transformed_curved *h, vi lane, vm rays, vi number,
                                         const vm doubt[3], const kernel_curved_corners *c, vf e[3])
{
    vf exact[3];
    kernel_compute_corner_edge_functions(c, exact);
    for (int i = 0; i < 3; i++) e[i] = vf_select(doubt[i], exact[i], e[i]);
    const vm weak = kernel_find_inaccurate_triangle_rays(h, lane, rays, number, e);
    for (int i = 0; i < 3; i++) e[i] = vf_select(weak, exact[i], e[i]);
}

/* Computes the edge functions ij, jk and ik of a triangular face of each ray's cell, for the given rays, from the lines
 * that h holds (kernel_transformed_curved.triangles). face: index of the face in the cell. Lanes of other rays get
 * meaningless numbers. */
SIMD_INLINE void kernel_evaluate_triangle_lines(const kernel_transformed_curved *h, const kernel_lane_rays *p, int type,
                                                vm rays, vi face, const kernel_curved_corners *c, vf e[3])
{
    const int size = (int)(sizeof h->triangles[0] / sizeof(float));
    const vi number = vi_select(rays, face - kernel_first_triangle(type), vi_set(0)), at = number * size + p->lane;
    vm doubt[3], any = vm_none();
    for (int i = 0; i < 3; i++) {
        const float(*const lines)[3][SIMD_WIDTH] = h->triangles[0];
        e[i] = vf_muladd(vf_gather(lines[2][i], at), p->v,
                         vf_muladd(vf_gather(lines[1][i], at), p->u, vf_gather(lines[0][i], at)));
        doubt[i] = vm_andnot(rays, vf_lt(vf_gather(lines[3][i], at), vf_abs(e[i])));
        any = vm_or(any, doubt[i]);
    }
    any = vm_or(any, kernel_find_inaccurate_triangle_rays(h, p->lane, rays, number, e));
    if (__builtin_expect(vm_any(any), 0))
        kernel_replace_inaccurate_edge_functions(h, p->lane, rays, number, doubt, c, e);
}

/* Computes the crossings of triangles. Depth, field and reference coordinates of a crossing are means of those at the
 * corners, with weights from the edge functions e (ij, jk, ik). */
SIMD_INLINE void kernel_curved_triangle_point(int type, const kernel_curved_corners *c, const vf e[3],
                                              kernel_point *out)
{
    const vf inverse = 1.0f / kernel_sum_weights(e[0], e[1], e[2]);
    vf v[5][3];
    for (int i = 0; i < 3; i++) {
        v[0][i] = c->at[i][2];
        v[1][i] = c->at[i][3];
        for (int a = 0; a < 3; a++)
            v[2 + a][i] =
                kernel_curved_vertex_coordinate(kernel_cell_shape(type), grid_type_vertex_count(type), a, c->vertex[i]);
    }
    for (int n = 0; n < 5; n++) v[n][0] = vf_muladd(e[0], v[n][2], vf_muladd(-e[2], v[n][1], e[1] * v[n][0])) * inverse;
    *out = (kernel_point){.t = v[0][0], .value = v[1][0], .r = {v[2][0], v[3][0], v[4][0]}};
}

/* Computes the two crossings of each active ray, the nearer one first. face: indices of the two crossed faces in the
 * cell; corners: their projected corners. h: the cells, from whose lines the edge functions of triangles are computed;
 * if it is NULL, they are computed from the corners. */
SIMD_INLINE void kernel_curved_cross_corners(const kernel_transformed_curved *h, const kernel_lane_rays *p, vm active,
                                             int type, const vi face[2], const kernel_curved_corners corners[2],
                                             kernel_point out[2])
{
    const int quads = kernel_has_apex(type) ? 1 : 2;
    vm on_quad[2];
    for (int n = 0; n < 2; n++) on_quad[n] = vm_and(active, kernel_is_crossed_face_a_quad(type, n, face[n]));
    if (kernel_has_triangles(type)) memset(out, 0, 2 * sizeof *out);
    if (kernel_is_box(type) || vm_any(vm_or(on_quad[0], on_quad[1]))) {
        kernel_quad quad[2];
        kernel_point places[2];
        for (int n = 0; n < quads; n++)
            for (int i = 0; i < 4; i++) {
                quad[n].x[i] = corners[n].at[i][0];
                quad[n].y[i] = corners[n].at[i][1];
                quad[n].z[i] = corners[n].at[i][2];
            }
        /* none of the active rays meets an edge, because kernel_curved_find_crossed_faces() adds rays that may meet one
         * to its mask `alone` */
        kernel_quads_cross(quad, quads, on_quad, true, places);
        for (int n = 0; n < quads; n++) kernel_set_crossing_from_patch_point(type, &corners[n], &places[n], &out[n]);
    }
    for (int n = 0; n < 2 && kernel_has_triangles(type); n++) {
        const vm on_triangle = vm_andnot(active, on_quad[n]);
        kernel_point place;
        vf e[3];
        if (!vm_any(on_triangle)) continue;
        if (h)
            kernel_evaluate_triangle_lines(h, p, type, on_triangle, face[n], &corners[n], e);
        else
            kernel_compute_corner_edge_functions(&corners[n], e);
        kernel_curved_triangle_point(type, &corners[n], e, &place);
        kernel_point_copy_lanes(on_triangle, &place, &out[n]);
    }
    kernel_points_sort_by_depth(out);
}

/* Computes the crossings at which the active rays enter and leave their cells. faces: index of the first face that a
 * ray crosses, plus 8 times the index of the second one. */
SIMD_INLINE void kernel_curved_compute_crossings(const kernel_transformed_curved *h, const kernel_lane_rays *p,
                                                 int type, vi faces, kernel_point out[2])
{
    const vi face[2] = {faces & 7, faces >> 3 & 7};
    kernel_curved_corners corners[2];
    for (int n = 0; n < 2; n++) kernel_curved_corners_gather(h, p, type, face[n], &corners[n]);
    kernel_curved_cross_corners(h, p, p->active, type, face, corners, out);
}

/* Appends rays of the list `met` to the list `rays`: those of its entries n to n + SIMD_WIDTH - 1 whose bit is set in
 * `bits`. ends[e]: crossing e of these SIMD_WIDTH rays with their cells, one ray per lane, for e < end_count. Depth,
 * value and reference coordinates of an appended ray's crossing e are stored in out[e][0] to out[e][4], at the ray's
 * index in `rays`. */
SIMD_INLINE void kernel_append_rays_with_crossings(const kernel_pixel_list *met, int n, const kernel_point *ends,
                                                   int end_count, unsigned bits, kernel_pixel_list *rays,
                                                   float (*out)[5][KERNEL_LIST_ROOM])
{
    if (!bits) return;
    float lanes[2][5][SIMD_WIDTH];
    for (int e = 0; e < end_count; e++) {
        vf_store(lanes[e][0], ends[e].t);
        vf_store(lanes[e][1], ends[e].value);
        for (int a = 0; a < 3; a++) vf_store(lanes[e][2 + a], ends[e].r[a]);
    }
    for (; bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits), to = rays->count;
        for (int e = 0; e < end_count; e++)
            for (int k = 0; k < 5; k++) out[e][k][to] = lanes[e][k][i];
        kernel_pixel_list_copy_ray(rays, met, n + i);
    }
}

/* Loads the crossings, stored by kernel_append_rays_with_crossings(), of the SIMD_WIDTH rays from index n on in the
 * list. */
SIMD_INLINE void kernel_curved_ends_load(float (*const ends)[5][KERNEL_LIST_ROOM], int n, int end_count,
                                         kernel_point *out)
{
    for (int e = 0; e < end_count; e++) {
        out[e].t = vf_load(ends[e][0] + n);
        out[e].value = vf_load(ends[e][1] + n);
        for (int a = 0; a < 3; a++) out[e].r[a] = vf_load(ends[e][2 + a] + n);
    }
}

#endif
