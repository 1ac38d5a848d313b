/* Computes in double, from the mesh's coordinates and values: the ends of a ray's segment in a tet, and the map and the
 * field of other cells at single points, which kernel_map.h computes in float32. Terms:
 *     (u, v)          a ray's parameters in its tile: its slopes or, if the camera is orthographic, its origin
 *     t               depth: z in tile space, in scaled units
 *     domain          values are mapped to the transfer function's domain, in which its range is 0 to 1
 *     segment         a ray's interval in a cell, with its length and the values at its two ends (kernel_segments.h)
 *     rest            rounding error of a float32 number; the sum of both is the value in double
 *     edge on         a face is seen edge on if the ray lies nearly in its plane
 *     half            a vector of SIMD_WIDTH floats has two halves (0 and 1), whose doubles fill one register each
 *
 * Ends of segments are computed in double for jobs that allow no error, or almost none, and for transfer functions with
 * extremely narrow ramps (kernel_frame.is_double).
 *
 * In float32 the value at a crossing of a face has an error of about 4e-7 of the transfer function's domain: three
 * weights, their sum, and the vertices' positions and values have an error of 6e-8 each. A steep function magnifies
 * that error, near an opacity of 1 by a factor of a hundred. Besides, the length of a short segment is the difference
 * of two depths that are rounded relative to the size of the scene. Which faces a ray crosses, and in which order
 * segments lie along it, is decided in float32 as for all other cells (kernel_cell.h), with bit-identical results. But
 * the segment's length, and its values at both ends, are computed in double, from the mesh's coordinates and values and
 * from the ray's position in the picture.
 *
 * An edge function is affine in the ray's u and v (kernel_cell.h). So are three functions of a face: the sum D of its
 * three edge functions; the sum N of its vertices' depths, each times the opposite edge's function; and the same sum of
 * its vertices' values. These three functions have nine coefficients in all, which are computed once per cell and
 * window, one tet per lane; each ray gathers those of the two faces that it crosses. The ray meets the face's plane at
 * the depth N / D. Because the decision that the ray crosses the face is made in float32, that point may lie outside
 * the face: an edge function there may be negative by about 1e-7 of its terms' magnitudes. If D is less than
 * KERNEL_DOUBLE_EDGE times these magnitudes, the face is seen so nearly edge on that the point may be far outside the
 * face, and the segment keeps both float32 ends. Everything is computed from the face's vertices in their order and
 * from the ray, so that both cells of a face compute the same point if both use double. */
#ifndef RENDER_KERNEL_EXACT_H
#define RENDER_KERNEL_EXACT_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_integral.h"
#include "kernel_lanes_cell.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "kernel_transformed_tets.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* Smallest sum of a face's edge functions, relative to the sum of their terms' magnitudes, for which the point where
 * the ray meets the face's plane is used. A ray that crosses the face in float32 then meets the face's plane at most
 * 1e-7 / KERNEL_DOUBLE_EDGE of the face's extent outside the face. */
#define KERNEL_DOUBLE_EDGE 1e-3

/* Numbers of a face of a tet: the coefficients c, cu and cv of three affine functions c + cu u + cv v of the ray, and
 * KERNEL_DOUBLE_LEAST. The functions KERNEL_DOUBLE_DEPTH and KERNEL_DOUBLE_VALUE are sums over the face's vertices of
 * their depths t and values, each times the opposite edge's function; KERNEL_DOUBLE_WEIGHT is the sum of the three edge
 * functions, by which both must be divided. The face is not seen edge on if the magnitude of this sum is larger than
 * KERNEL_DOUBLE_LEAST. */
enum {
    KERNEL_DOUBLE_DEPTH = 0,
    KERNEL_DOUBLE_VALUE = 3,
    KERNEL_DOUBLE_WEIGHT = 6,
    KERNEL_DOUBLE_LEAST = 9,
    KERNEL_DOUBLE_NUMBERS
};

/* The numbers of one face of each lane's tet, indexed by the number (KERNEL_DOUBLE_DEPTH etc.) and the half of the
 * lanes. */
typedef kernel_f64 kernel_double_face[KERNEL_DOUBLE_NUMBERS][2];

/* Computes the (u, v) of a packet's rays in double, relative to the tile's centre. */
SIMD_INLINE void kernel_get_ray_parameters_in_double(const kernel_packet *p, double u[SIMD_WIDTH], double v[SIMD_WIDTH])
{
    kernel_packet_compute_pixel_slopes(p, u, v);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        u[i] -= p->tile->centre_x;
        v[i] -= p->tile->centre_y;
    }
}

/* Maps a value of the field to the transfer function's domain, clamped to [-1e18, 1e18]. */
static inline double kernel_map_to_domain_in_double(const kernel_transfer *transfer, double value)
{
    return fmax(fmin((value - transfer->low) * transfer->inverse_width, 1e18), -1e18);
}

/* ---- tets, one per lane ---- */

/* A vertex of each tet in tile space, for one half of the lanes. at: x, y and t; depth: the distance from the eye's
 * plane or, if the camera is orthographic, a constant; value: the field in the transfer function's domain. On the ray
 * (u, v) the vertex is projected to (x - u * depth, y - v * depth). */
typedef struct kernel_double_vertices {
    kernel_f64 at[3], depth, value;
} kernel_double_vertices;

/* Computes the three coefficients of the edge function from a to b (kernel_cell.h). */
SIMD_INLINE void kernel_compute_edge_function_in_double(const kernel_double_vertices *a,
                                                        const kernel_double_vertices *b, kernel_f64 edge[3])
{
    edge[0] = a->at[0] * b->at[1] - b->at[0] * a->at[1];
    edge[1] = b->depth * a->at[1] - a->depth * b->at[1];
    edge[2] = a->depth * b->at[0] - b->depth * a->at[0];
}

/* Computes the numbers of one face, for one half of the lanes, from the tets' vertices and edge functions. face: a row
 * of kernel_tet_face, with three vertices and three edges; radius: upper bound of the rays' |u| and |v|. */
SIMD_INLINE void kernel_double_compute_face_functions(const kernel_double_vertices *spots, const kernel_f64 (*edges)[3],
                                                      const signed char *face, double radius, int half,
                                                      kernel_double_face out)
{
    const kernel_double_vertices *i = &spots[face[0]], *j = &spots[face[1]], *k = &spots[face[2]];
    const kernel_f64 *ij = edges[face[3]], *jk = edges[face[4]], *ik = edges[face[5]];
    kernel_f64 least = {0};
    for (int n = 0; n < 3; n++) {
        out[KERNEL_DOUBLE_DEPTH + n][half] = (jk[n] * i->at[2] - ik[n] * j->at[2]) + ij[n] * k->at[2];
        out[KERNEL_DOUBLE_VALUE + n][half] = (jk[n] * i->value - ik[n] * j->value) + ij[n] * k->value;
        out[KERNEL_DOUBLE_WEIGHT + n][half] = (jk[n] - ik[n]) + ij[n];
        least += KERNEL_DOUBLE_EDGE * (n ? radius : 1) *
                 ((kernel_f64_abs(ij[n]) + kernel_f64_abs(jk[n])) + kernel_f64_abs(ik[n]));
    }
    out[KERNEL_DOUBLE_LEAST][half] = least;
}

/* Computes the numbers (kernel_double_face) of the four faces of each of the transformed tets. */
static __attribute__((noinline)) void
kernel_double_compute_tet_functions(const kernel_frame *f, const kernel_tile *tile, const kernel_transformed_tets *tets,
                                    const kernel_transfer *transfer, kernel_double_face out[4])
{
    for (int half = 0; half < 2; half++) {
        kernel_double_vertices spots[4];
        kernel_f64 edges[KERNEL_TET_EDGES][3];
        for (int i = 0; i < 4; i++) {
            const kernel_f64 value = (tets->values[i][half] - transfer->low) * transfer->inverse_width;
            spots[i].depth = kernel_lanes_transform_half(f, tile, tets->world[i], half, spots[i].at);
            spots[i].value = kernel_f64_clamp(value, 1e18);
        }
        for (int n = 0; n < KERNEL_TET_EDGES; n++)
            kernel_compute_edge_function_in_double(&spots[kernel_tet_edge[n][0]], &spots[kernel_tet_edge[n][1]],
                                                   edges[n]);
        for (int n = 0; n < 4; n++)
            kernel_double_compute_face_functions(spots, (const kernel_f64(*)[3])edges, kernel_tet_face[n],
                                                 (double)tile->radius, half, out[n]);
    }
}

/* ---- segments in tets, one ray-tet pair per lane ---- */

/* A ray's point in the plane of a face: depth t and value, in two halves of the lanes. sound: rays that do not see the
 * face edge on. */
typedef struct kernel_double_points {
    kernel_f64 t[2], value[2];
    vm sound;
} kernel_double_points;

/* Returns the value on the ray (u, v) of one of the affine functions of the face that each ray crosses, for one half of
 * the lanes. function: KERNEL_DOUBLE_DEPTH, KERNEL_DOUBLE_VALUE or KERNEL_DOUBLE_WEIGHT; index: index, in floats, of
 * the face's first number in `faces`. */
SIMD_INLINE kernel_f64 kernel_double_evaluate_face_function(const kernel_double_face *faces, int function, vi index,
                                                            int half, kernel_f64 u, kernel_f64 v)
{
    kernel_f64 c[3];
    for (int n = 0; n < 3; n++) c[n] = vd_gather((const float *)(const void *)faces[0][function + n], index, half);
    return (c[0] + c[1] * u) + c[2] * v;
}

/* Computes the points at which rays meet the planes of faces of their tets. face: index of each ray's face in its tet;
 * lane: lane of each ray's tet. */
SIMD_INLINE void kernel_double_intersect_face_planes(const kernel_double_face *faces, vi face, vi lane,
                                                     const kernel_f64 u[2], const kernel_f64 v[2],
                                                     kernel_double_points *out)
{
    const vi index = face * (2 * SIMD_WIDTH * KERNEL_DOUBLE_NUMBERS) + 2 * lane;
    kernel_f64 weight[2], least[2];
    for (int half = 0; half < 2; half++) {
        const kernel_f64 w =
            kernel_double_evaluate_face_function(faces, KERNEL_DOUBLE_WEIGHT, index, half, u[half], v[half]);
        const kernel_f64 inverse = 1.0 / w;
        out->t[half] =
            kernel_double_evaluate_face_function(faces, KERNEL_DOUBLE_DEPTH, index, half, u[half], v[half]) * inverse;
        out->value[half] =
            kernel_double_evaluate_face_function(faces, KERNEL_DOUBLE_VALUE, index, half, u[half], v[half]) * inverse;
        weight[half] = w * w;
        least[half] = vd_gather((const float *)(const void *)faces[0][KERNEL_DOUBLE_LEAST], index, half);
        least[half] *= least[half];
    }
    out->sound = vd_lt(least, weight);
}

/* Rounds doubles to float32 (*v), and computes the rounding errors (*rest). */
SIMD_INLINE void kernel_round_doubles(const kernel_f64 value[2], vf *v, vf *rest)
{
    kernel_f64 lost[2];
    *v = kernel_halves_narrow(value);
    for (int half = 0; half < 2; half++) lost[half] = value[half] - kernel_f64_widen_half(v, half);
    *rest = kernel_halves_narrow(lost);
}

/* Replaces the length and the values of *run, the rays' segments in tets in float32, by those computed in double. Rays
 * that see one of the two crossed faces edge on keep those in float32. The length is in units of t. lane: lane of each
 * ray's tet; first, second: indices of the crossed faces in the tet; u, v: parameters of the rays. */
SIMD_INLINE void kernel_refine_segments_in_double(const kernel_double_face *faces, vi lane, vi first, vi second,
                                                  const kernel_f64 u[2], const kernel_f64 v[2],
                                                  kernel_unit_segment *run)
{
    kernel_double_points a, b;
    kernel_f64 ends[2][2], length[2];
    vf rounded[2], rest[2];
    kernel_double_intersect_face_planes(faces, first, lane, u, v, &a);
    kernel_double_intersect_face_planes(faces, second, lane, u, v, &b);
    const vm sound = vm_and(a.sound, b.sound), swap = vd_lt(b.t, a.t);
    vd_select(swap, b.value, a.value, ends[0]);
    vd_select(swap, a.value, b.value, ends[1]);
    for (int half = 0; half < 2; half++) length[half] = kernel_f64_abs(b.t[half] - a.t[half]);
    for (int end = 0; end < 2; end++) kernel_round_doubles(ends[end], &rounded[end], &rest[end]);
    run->length = vf_select(sound, kernel_halves_narrow(length), run->length);
    run->v_in = vf_select(sound, rounded[0], run->v_in);
    run->v_out = vf_select(sound, rounded[1], run->v_out);
    run->rest_in = vf_select(sound, rest[0], run->rest_in);
    run->rest_out = vf_select(sound, rest[1], run->rest_out);
}

enum { KERNEL_EXACT_STEPS = 24 };

/* ---- map and field of a hex, wedge or pyramid at one point ---- */

/* Computes the polynomial coefficients (kernel_map.h) of the map of a hex, wedge or pyramid to tile space (3 rows), and
 * of the field in the transfer function's domain (last row). */
static void kernel_exact_fit_cell_polynomials(double map[4][8], const kernel_packet *p, const kernel_cell *c,
                                              const kernel_transfer *transfer)
{
    double d[4][GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < c->count; i++) {
        double place[3];
        kernel_transform_in_double(p->frame, p->tile, c->world[i], place);
        for (int a = 0; a < 3; a++) d[a][i] = place[a];
        d[3][i] = kernel_map_to_domain_in_double(transfer, c->values[i]);
    }
    for (int n = 0; n < 4; n++) kernel_polynomial_fit(map[n], c->type, d[n]);
}

/* Returns the product term m of a cell's map (kernel_map.h) at the reference coordinates r: r[0] r[1] or, in a pyramid,
 * r[0] r[1] / r[2]. Also computes the derivatives of m by r (slopes). */
static inline double kernel_exact_compute_product_term(bool is_pyramid, const double r[3], double slopes[3])
{
    slopes[0] = r[1];
    slopes[1] = r[0];
    slopes[2] = 0;
    if (!is_pyramid) return r[0] * r[1];
    const double inverse = 1 / fmax(r[2], 1e-9);
    slopes[0] = fmax(fmin(r[1] * inverse, 2), -1);
    slopes[1] = fmax(fmin(r[0] * inverse, 2), -1);
    slopes[2] = -slopes[0] * slopes[1];
    return slopes[1] * r[1];
}

/* Returns the polynomial with the coefficients c at the reference coordinates r; m: its product term. */
static inline double kernel_exact_evaluate_polynomial(const double c[8], const double r[3], double m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* Computes the derivatives, by the reference coordinates r, of the polynomial with the coefficients c. m, slopes:
 * results of kernel_exact_compute_product_term(). */
static inline void kernel_exact_compute_gradient(const double c[8], const double r[3], double m, const double slopes[3],
                                                 double out[3])
{
    const double of_m = c[4] + r[2] * c[7];
    out[0] = c[1] + r[2] * c[5] + slopes[0] * of_m;
    out[1] = c[2] + r[2] * c[6] + slopes[1] * of_m;
    out[2] = c[3] + (r[0] * c[5] + r[1] * c[6]) + m * c[7] + slopes[2] * of_m;
}

/* Finds the reference coordinates r of the point `target` in tile space by Newton's method in double, from an initial
 * guess in r. A step below 1e-8 is the last one; the error is then below rounding. Returns false if the method does not
 * converge. */
static bool kernel_exact_invert_map(const double (*map)[8], bool is_pyramid, const double target[3], double r[3])
{
    for (int n = 0; n < KERNEL_EXACT_STEPS; n++) {
        double slopes[3], row[3][3], off[3], cross[3][3], largest = 0;
        const double m = kernel_exact_compute_product_term(is_pyramid, r, slopes);
        for (int a = 0; a < 3; a++) {
            off[a] = target[a] - kernel_exact_evaluate_polynomial(map[a], r, m);
            kernel_exact_compute_gradient(map[a], r, m, slopes, row[a]);
        }
        for (int a = 0; a < 3; a++) {
            const double *x = row[(a + 1) % 3], *y = row[(a + 2) % 3];
            for (int b = 0; b < 3; b++) cross[a][b] = x[(b + 1) % 3] * y[(b + 2) % 3] - x[(b + 2) % 3] * y[(b + 1) % 3];
        }
        const double det = row[0][0] * cross[0][0] + row[0][1] * cross[0][1] + row[0][2] * cross[0][2];
        if (det == 0) return false;
        for (int b = 0; b < 3; b++) {
            const double move = (cross[0][b] * off[0] + cross[1][b] * off[1] + cross[2][b] * off[2]) / det;
            largest = fmax(largest, fabs(move));
            r[b] = fmax(fmin(r[b] + fmax(fmin(move, 1), -1), 2), -1);
        }
        if (largest <= 1e-8) return true;
    }
    return false;
}

/* Returns whether r is in the reference domain [0, 1], or outside by at most KERNEL_MAP_BEYOND. */
static inline bool kernel_exact_is_in_or_near_cell(const double r[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && -r[a] <= (double)KERNEL_MAP_BEYOND && r[a] - 1 <= (double)KERNEL_MAP_BEYOND;
    return near;
}

#endif
