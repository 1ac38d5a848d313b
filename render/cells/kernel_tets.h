/* Computes the interval of each ray inside its tet. A ray crosses two or none of a tet's four faces (kernel_cell.h).
 * The same source is compiled for rays that each have a tet of their own and for rays that share one tet:
 * kernel_tets.is_uniform is a compile-time constant wherever these functions are inlined. */
#ifndef RENDER_KERNEL_TETS_H
#define RENDER_KERNEL_TETS_H

#include <math.h>

#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_packet.h"
#include "kernel_transformed_tets.h"
#include "kernel_shapes.h"
#include "kernel_tile_trace.h"
#include "simd.h"

/* Rays and their tets. The tet of each ray is in the lane lane_rays->lane of `transformed`. If is_uniform is set, all
 * rays have the tet in the lane `lane` instead. */
typedef struct kernel_tets {
    const kernel_lane_rays *lane_rays;
    const kernel_transformed_tets *transformed;
    bool is_uniform;
    int lane;
} kernel_tets;

/* Expands to a vector with one number of each ray's tet: the given member of kernel_transformed_tets. */
#define KERNEL_TET_NUMBER(t, member)                                                                                   \
    ((t)->is_uniform ? vf_set((t)->transformed->member[(t)->lane])                                                     \
                     : vf_permute((t)->transformed->member, (t)->lane_rays->lane))

/* Returns a copy of *t, to be passed to a function that is not inlined, so that the original stays in registers. rays:
 * memory for a copy of *t->lane_rays. */
SIMD_INLINE kernel_tets kernel_tets_copy(const kernel_tets *t, kernel_lane_rays *rays)
{
    kernel_tets out = *t;
    *rays = *t->lane_rays;
    out.lane_rays = rays;
    out.is_uniform = false;
    return out;
}

SIMD_INLINE void kernel_tets_project(const kernel_tets *t, vf x[4], vf y[4])
{
    const kernel_rays rays = t->lane_rays->rays;
    for (int i = 0; i < 4; i++) {
        const vf z = KERNEL_TET_NUMBER(t, at[2][i]);
        x[i] = (KERNEL_TET_NUMBER(t, at[0][i]) - rays.origin_x) - rays.slope_x * z;
        y[i] = (KERNEL_TET_NUMBER(t, at[1][i]) - rays.origin_y) - rays.slope_y * z;
    }
}

SIMD_INLINE void kernel_tets_compute_exact_edge_functions(const kernel_tets *t, vf e[KERNEL_TET_EDGES])
{
    vf x[4], y[4];
    kernel_tets_project(t, x, y);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        e[n] = kernel_compute_exact_edge_function(x[i], y[i], x[j], y[j]);
    }
}

/* Replaces the edge functions whose sign is uncertain by those of the projected vertices, whose signs are exact. */
static __attribute__((noinline)) void kernel_tets_recompute_uncertain_edges(const kernel_tets *t,
                                                                            vf e[KERNEL_TET_EDGES])
{
    vf exact[KERNEL_TET_EDGES];
    kernel_tets_compute_exact_edge_functions(t, exact);
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const vm sure = vf_lt(KERNEL_TET_NUMBER(t, bound[n]), vf_abs(e[n]));
        e[n] = vf_select(sure, e[n], exact[n]);
    }
}

/* Computes the edge functions e of the tets' six edges on the rays. is_pencil: set if e is computed from the edges'
 * lines (kernel_cell.h), which are valid for camera rays through the tile's pixels; otherwise e is computed from
 * projected vertices. */
SIMD_INLINE void kernel_tets_compute_edge_functions(const kernel_tets *t, vm rays, bool is_pencil,
                                                    vf e[KERNEL_TET_EDGES])
{
    const vf u = t->lane_rays->u, v = t->lane_rays->v;
    vf least = vf_set(INFINITY);
    if (!is_pencil) {
        kernel_tets_compute_exact_edge_functions(t, e);
        return;
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const vf c = KERNEL_TET_NUMBER(t, c[n]);
        const vf cu = KERNEL_TET_NUMBER(t, cu[n]);
        const vf cv = KERNEL_TET_NUMBER(t, cv[n]);
        e[n] = vf_muladd(cv, v, vf_muladd(cu, u, c));
        least = vf_min(vf_abs(e[n]), least);
    }
    if (__builtin_expect(vm_any(vm_andnot(rays, vf_lt(KERNEL_TET_NUMBER(t, doubt), least))), 0)) {
        kernel_lane_rays lane_rays;
        const kernel_tets copy = kernel_tets_copy(t, &lane_rays);
        kernel_tets_recompute_uncertain_edges(&copy, e);
    }
}

/* Sets hit[n] to those of the rays that cross face n of their tets (kernel_tet_face). */
SIMD_INLINE void kernel_tets_find_crossed_faces(vm rays, const vf e[KERNEL_TET_EDGES], vm hit[4])
{
    for (int n = 0; n < 4; n++) {
        const signed char *face = kernel_tet_face[n];
        hit[n] = kernel_rays_inside_triangle(rays, e[(int)face[3]], e[(int)face[4]], e[(int)face[5]]);
    }
}

/* At the crossings of a face: the sums of the depths, values and colour values of the face's three vertices, each
 * multiplied by the vertex's weight (kernel_cell.h), and the sum of the weights. A sum divided by the sum of the
 * weights is the number at the crossing. */
typedef struct kernel_sums {
    vf depth, value, colour, weight;
} kernel_sums;

#define KERNEL_TET_WEIGH(t, face, ij, jk, ik, member)                                                                  \
    vf_muladd(ij, KERNEL_TET_NUMBER(t, member[(int)(face)[2]]),                                                        \
              vf_muladd(-(ik), KERNEL_TET_NUMBER(t, member[(int)(face)[1]]),                                           \
                        (jk)*KERNEL_TET_NUMBER(t, member[(int)(face)[0]])))

/* Returns the weighted sums of a face (kernel_sums). face: its entry of kernel_tet_face; ij, jk, ik: its edge
 * functions; has_colour: set if the colour field is included. */
SIMD_INLINE kernel_sums kernel_tets_weighted_sums(const kernel_tets *t, const signed char *face, vf ij, vf jk, vf ik,
                                                  bool has_colour)
{
    return (kernel_sums){.depth = KERNEL_TET_WEIGH(t, face, ij, jk, ik, at[2]),
                         .value = KERNEL_TET_WEIGH(t, face, ij, jk, ik, f),
                         .colour = has_colour ? KERNEL_TET_WEIGH(t, face, ij, jk, ik, colours) : vf_set(0),
                         .weight = kernel_sum_weights(ij, jk, ik)};
}

SIMD_INLINE kernel_sums kernel_sums_select(vm m, const kernel_sums *a, const kernel_sums *b)
{
    return (kernel_sums){vf_select(m, a->depth, b->depth), vf_select(m, a->value, b->value),
                         vf_select(m, a->colour, b->colour), vf_select(m, a->weight, b->weight)};
}

/* Selects, for each ray, the weighted sums (kernel_sums) of the two faces that the ray crosses. ends[0] gets those of
 * the face with the smaller index, ends[1] those of the other face. Either face may be the nearer one. */
SIMD_INLINE void kernel_tets_select_crossed_faces(const vm hit[4], const kernel_sums sums[4], kernel_sums ends[2])
{
    const kernel_sums a = kernel_sums_select(hit[1], &sums[1], &sums[2]);
    const kernel_sums b = kernel_sums_select(hit[2], &sums[2], &sums[1]);
    ends[0] = kernel_sums_select(hit[0], &sums[0], &a);
    ends[1] = kernel_sums_select(hit[3], &sums[3], &b);
}

/* Returns, for each ray, the index of the face whose weighted sums kernel_tets_select_crossed_faces() selects for
 * ends[0]. */
SIMD_INLINE vi kernel_tets_first_face(const vm hit[4])
{
    return vi_select(hit[0], vi_set(0), vi_select(hit[1], vi_set(1), vi_set(2)));
}

/* Returns, for each ray, the index of the face whose weighted sums kernel_tets_select_crossed_faces() selects for
 * ends[1]. */
SIMD_INLINE vi kernel_tets_second_face(const vm hit[4])
{
    return vi_select(hit[3], vi_set(3), vi_select(hit[2], vi_set(2), vi_set(1)));
}

/* Computes depth and values of both crossings by dividing the weighted sums by the sum of the weights. The nearer
 * crossing becomes the begin of the interval (members _in), the other its end (members _out). */
SIMD_INLINE void kernel_tets_set_interval(const kernel_sums ends[2], bool has_colour, kernel_interval *out)
{
    const vf scale_a = 1.0f / ends[0].weight, scale_b = 1.0f / ends[1].weight;
    const vf t_a = ends[0].depth * scale_a, t_b = ends[1].depth * scale_b;
    const vf v_a = ends[0].value * scale_a, v_b = ends[1].value * scale_b;
    const vm swap = vf_lt(t_b, t_a);
    out->t_in = vf_select(swap, t_b, t_a);
    out->t_out = vf_select(swap, t_a, t_b);
    out->v_in = vf_select(swap, v_b, v_a);
    out->v_out = vf_select(swap, v_a, v_b);
    if (!has_colour) return;
    const vf w_a = ends[0].colour * scale_a, w_b = ends[1].colour * scale_b;
    out->w_in = vf_select(swap, w_b, w_a);
    out->w_out = vf_select(swap, w_a, w_b);
}

/* Returns those of the rays that cross face n (hit) whose sum of weights is too small for an accurate crossing. */
SIMD_INLINE vm kernel_tets_find_inaccurate_crossings(const kernel_tets *t, int n, vm hit, vf weight)
{
    return vm_and(hit, vf_lt(vf_abs(weight), KERNEL_TET_NUMBER(t, least[n])));
}

/* Selects the weighted sums of the two crossed faces as kernel_tets_select_crossed_faces() does. But for rays on which
 * a face's weights are not accurate enough, the sums are first computed anew, from edge functions of projected
 * vertices. This function is not inlined, because few rays have inaccurate weights. */
static __attribute__((noinline, cold)) void
kernel_tets_recompute(const kernel_tets *t, vm rays, const vf e[KERNEL_TET_EDGES], bool has_colour, kernel_sums ends[2])
{
    vf exact[KERNEL_TET_EDGES];
    kernel_sums sums[4];
    vm hit[4];
    kernel_tets_compute_exact_edge_functions(t, exact);
    kernel_tets_find_crossed_faces(rays, e, hit);
    for (int n = 0; n < 4; n++) {
        const signed char *face = kernel_tet_face[n];
        const int ij = face[3], jk = face[4], ik = face[5];
        const vm weak = kernel_tets_find_inaccurate_crossings(t, n, hit[n], kernel_sum_weights(e[ij], e[jk], e[ik]));
        sums[n] =
            kernel_tets_weighted_sums(t, face, vf_select(weak, exact[ij], e[ij]), vf_select(weak, exact[jk], e[jk]),
                                      vf_select(weak, exact[ik], e[ik]), has_colour);
    }
    kernel_tets_select_crossed_faces(hit, sums, ends);
}

/* Computes the depths at which the rays enter and leave their tets, the values there, and the rays that cross each face
 * (hit). The weighted sums (kernel_sums) of all four faces are computed without branches; then those of the two faces
 * that each ray crosses are selected. */
SIMD_INLINE void kernel_tets_interval(const kernel_tets *t, vm rays, bool is_pencil, bool has_colour, vm hit[4],
                                      kernel_interval *out)
{
    vf e[KERNEL_TET_EDGES];
    vm weak[4];
    kernel_sums sums[4], ends[2];
    kernel_tets_compute_edge_functions(t, rays, is_pencil, e);
    kernel_tets_find_crossed_faces(rays, e, hit);
    out->mask = vm_or(vm_or(hit[0], hit[1]), vm_or(hit[2], hit[3]));
    out->t_in = out->t_out = out->v_in = out->v_out = out->w_in = out->w_out = vf_set(0);
    if (!vm_any(out->mask)) return;
    for (int n = 0; n < 4; n++) {
        const signed char *face = kernel_tet_face[n];
        sums[n] = kernel_tets_weighted_sums(t, face, e[(int)face[3]], e[(int)face[4]], e[(int)face[5]], has_colour);
    }
    kernel_tets_select_crossed_faces(hit, sums, ends);
    if (is_pencil) {
        for (int n = 0; n < 4; n++) weak[n] = kernel_tets_find_inaccurate_crossings(t, n, hit[n], sums[n].weight);
        if (__builtin_expect(vm_any(vm_or(vm_or(weak[0], weak[1]), vm_or(weak[2], weak[3]))), 0)) {
            kernel_lane_rays lane_rays;
            const kernel_tets copy = kernel_tets_copy(t, &lane_rays);
            /* a separate variable, because passing the address of `ends` would keep `ends` in memory instead of
             * registers */
            kernel_sums exact[2];
            kernel_tets_recompute(&copy, rays, e, has_colour, exact);
            ends[0] = exact[0];
            ends[1] = exact[1];
        }
    }
    kernel_tets_set_interval(ends, has_colour, out);
}

/* Computes the rays' intervals in their tets, and the rays that cross each face (hit). is_uniform: set if all rays have
 * the tet in the given lane; otherwise each ray has that of its own lane (r->lane). is_pencil: set if edge functions
 * are computed from the edges' lines (kernel_tets_compute_edge_functions()); has_colour: set if w_in and w_out are
 * computed, too. */
SIMD_INLINE void kernel_tet_rays_find_intervals_and_faces(const kernel_transformed_tets *transformed,
                                                          const kernel_lane_rays *r, bool is_uniform, int lane,
                                                          bool is_pencil, bool has_colour, vm hit[4],
                                                          kernel_interval *out)
{
    const kernel_tets tets = {.lane_rays = r, .transformed = transformed, .is_uniform = is_uniform, .lane = lane};
    kernel_tets_interval(&tets, r->active, is_pencil, has_colour, hit, out);
}

/* Computes the rays' intervals in their tets, with edge functions from the edges' lines
 * (kernel_tets_compute_edge_functions()). has_colour: set if w_in and w_out are computed, too. */
SIMD_INLINE void kernel_tet_rays_interval(const kernel_transformed_tets *transformed, const kernel_lane_rays *r,
                                          bool has_colour, kernel_interval *out)
{
    vm hit[4];
    kernel_tet_rays_find_intervals_and_faces(transformed, r, false, 0, true, has_colour, hit, out);
}

/* Computes the intervals of rays that all have the tet in the given lane. is_pencil: set if edge functions are computed
 * from the edges' lines (kernel_tets_compute_edge_functions()); has_colour: set if w_in and w_out are computed, too. */
SIMD_INLINE void kernel_tet_rays_interval_in_one(const kernel_transformed_tets *transformed, const kernel_lane_rays *r,
                                                 int lane, bool is_pencil, bool has_colour, kernel_interval *out)
{
    vm hit[4];
    kernel_tet_rays_find_intervals_and_faces(transformed, r, true, lane, is_pencil, has_colour, hit, out);
}

#endif
