/* Computes in double, from the caller's coordinates and values: the ends of a ray's segment in a tet, and the map and
 * the field of other cells at single points, which kernel_map.h computes in float32. Terms:
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
 * the segment's length, and its values at both ends, are computed in double, from the caller's coordinates and values
 * and from the ray's position in the picture.
 *
 * An edge function is affine in the ray's u and v (kernel_cell.h). So are the sum D of a face's three edge functions,
 * and the sum N of its vertices' depths, each times the opposite edge's function, and the same sum of their values:
 * nine coefficients per face, computed once per cell and tile. The ray meets the face's plane at the depth N / D.
 * Because the decision that the ray crosses the face is made in float32, that point may lie outside the face: an edge
 * function there may be negative by about 1e-7 of its terms' magnitudes. If D is less than KERNEL_DOUBLE_EDGE times
 * these magnitudes, the face is seen so nearly edge on that the point may be far outside the face, and the segment
 * keeps both float32 ends. Everything is computed from the face's vertices in their order and from the ray, so that
 * both cells of a face compute the same point if both use double. */
#ifndef RENDER_KERNEL_EXACT_H
#define RENDER_KERNEL_EXACT_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_integral.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "kernel_tets.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* Smallest sum of a face's edge functions, relative to the sum of their terms' magnitudes, for which the face's point
 * is used. A ray that crosses the face in float32 then meets the face's plane at most 1e-7 / KERNEL_DOUBLE_EDGE of the
 * face's extent outside the face. */
#define KERNEL_DOUBLE_EDGE 1e-3

/* A face of a tet, as affine functions c[0] + c[1] u + c[2] v of the ray. depth, value: sums over the face's vertices
 * of their depths t and values, each times the opposite edge's function; weight: sum of the three edge functions, by
 * which both must be divided. A tet has four faces, in the order of kernel_tet_face. */
typedef struct kernel_double_face {
    double depth[3], value[3], weight[3];
    double least; /* the face is not seen edge on if the magnitude of the weight is larger than this */
} kernel_double_face;

/* Computes the (u, v) of a packet's rays in double, relative to the tile's centre, in two halves of the lanes. */
SIMD_INLINE void kernel_double_rays_of(const kernel_packet *p, kernel_f64 u[2], kernel_f64 v[2])
{
    double px[SIMD_WIDTH], py[SIMD_WIDTH];
    kernel_packet_ray_parameters(p, px, py);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        px[i] -= p->tile->centre_x;
        py[i] -= p->tile->centre_y;
    }
    memcpy(u, px, sizeof px);
    memcpy(v, py, sizeof py);
}

/* ---- a cell ---- */

/* A vertex in tile space in double. On the ray (u, v) it is projected to (x - u * depth, y - v * depth). t: z in tile
 * space; value: the field in the transfer function's domain. */
typedef struct kernel_double_vertex {
    double x, y, depth, t, value;
} kernel_double_vertex;

/* Transforms a vertex from world coordinates to tile space, without its value. */
SIMD_INLINE kernel_double_vertex kernel_double_transform(const kernel_frame *f, const kernel_tile *tile,
                                                         const double *world)
{
    double place[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) place[a] += f->scaled_axes[a][b] * (world[b] - f->job->camera.eye[b]);
    const double depth = f->job->camera.is_orthographic ? f->job->space.scale : place[2];
    return (kernel_double_vertex){.x = place[0] - tile->centre_x * depth,
                                  .y = place[1] - tile->centre_y * depth,
                                  .depth = depth,
                                  .t = place[2] - tile->depth_shift};
}

/* Maps a value of the field to the transfer function's domain, clamped to [-1e18, 1e18]. */
static inline double kernel_double_domain(const kernel_transfer *transfer, double value)
{
    return fmax(fmin((value - transfer->low) * transfer->inverse_width, 1e18), -1e18);
}

/* Computes the three coefficients of the edge function from a to b (kernel_cell.h). */
SIMD_INLINE void kernel_double_edge(const kernel_double_vertex *a, const kernel_double_vertex *b, double edge[3])
{
    edge[0] = a->x * b->y - b->x * a->y;
    edge[1] = b->depth * a->y - a->depth * b->y;
    edge[2] = a->depth * b->x - b->depth * a->x;
}

/* Computes the affine functions of one face from the tet's vertices (spots) and edge functions. face: a row of
 * kernel_tet_face, with three vertices and three edges; radius: upper bound of the rays' |u| and |v|. */
SIMD_INLINE void kernel_double_compute_face(const kernel_double_vertex *spots, double (*const edges)[3],
                                            const signed char *face, double radius, kernel_double_face *out)
{
    const kernel_double_vertex *i = &spots[face[0]], *j = &spots[face[1]], *k = &spots[face[2]];
    const double *ij = edges[face[3]], *jk = edges[face[4]], *ik = edges[face[5]];
    out->least = 0;
    for (int n = 0; n < 3; n++) {
        out->depth[n] = (jk[n] * i->t - ik[n] * j->t) + ij[n] * k->t;
        out->value[n] = (jk[n] * i->value - ik[n] * j->value) + ij[n] * k->value;
        out->weight[n] = (jk[n] - ik[n]) + ij[n];
        out->least += KERNEL_DOUBLE_EDGE * (n ? radius : 1) * ((fabs(ij[n]) + fabs(jk[n])) + fabs(ik[n]));
    }
}

/* Computes the affine functions of a tet's four faces. The tet's vertices must have been sorted by coordinates. */
static __attribute__((noinline)) void kernel_double_compute_faces(const kernel_frame *f, const kernel_tile *tile,
                                                                  const kernel_cell *c, const kernel_transfer *transfer,
                                                                  kernel_double_face faces[4])
{
    kernel_double_vertex spots[4];
    double edges[KERNEL_TET_EDGES][3];
    for (int i = 0; i < 4; i++) {
        spots[i] = kernel_double_transform(f, tile, c->world[i]);
        spots[i].value = kernel_double_domain(transfer, c->values[i]);
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++)
        kernel_double_edge(&spots[kernel_tet_edge[n][0]], &spots[kernel_tet_edge[n][1]], edges[n]);
    for (int n = 0; n < 4; n++)
        kernel_double_compute_face(spots, edges, kernel_tet_face[n], (double)tile->radius, &faces[n]);
}

/* ---- rays in a tet ---- */

/* Returns the affine function with the coefficients c on the rays (u, v). */
SIMD_INLINE kernel_f64 kernel_affine_at(const double c[3], kernel_f64 u, kernel_f64 v)
{
    return (c[0] + c[1] * u) + c[2] * v;
}

/* Rounds doubles to float32, and stores them in one half of the lanes of *v, and the rounding errors in the same half
 * of *rest. */
SIMD_INLINE void kernel_store_rounded_doubles(kernel_f64 value, int half, vf *v, vf *rest)
{
    kernel_f64_store_half_of_vector(v, half, value);
    kernel_f64_store_half_of_vector(rest, half, value - kernel_f64_widen_half(v, half));
}

/* Computes a tet's segment in double on the rays (u, v), and stores it in one half of the lanes of *out; the length is
 * in units of t. hit: for each face, the rays that cross it, decided in float32. Returns the rays for which the segment
 * is valid: those that cross two faces, none of which is seen edge on. */
SIMD_INLINE kernel_f64_mask kernel_double_segment_half(const kernel_double_face faces[4], kernel_f64 u, kernel_f64 v,
                                                       const vm hit[4], int half, kernel_unit_segment *out)
{
    kernel_f64 t[2] = {{0}, {0}}, value[2] = {{0}, {0}};
    kernel_f64_mask met[2] = {{0}, {0}}, sound = ~(kernel_f64_mask){0};
    for (int n = 0; n < 4; n++) {
        const kernel_double_face *face = &faces[n];
        const kernel_f64_mask hits = kernel_f64_mask_of_half(hit[n], half);
        const kernel_f64 weight = kernel_affine_at(face->weight, u, v), inverse = 1.0 / weight;
        const kernel_f64 depth = kernel_affine_at(face->depth, u, v) * inverse;
        const kernel_f64 own = kernel_affine_at(face->value, u, v) * inverse;
        /* the point is not valid if the face is seen edge on */
        sound &= ~hits | (kernel_f64_mask)(weight * weight > face->least * face->least);
        for (int end = 1; end >= 0; end--) {
            const kernel_f64_mask m = end ? hits & met[0] : hits & ~met[0];
            t[end] = kernel_f64_select(m, depth, t[end]);
            value[end] = kernel_f64_select(m, own, value[end]);
            met[end] |= m;
        }
    }
    const kernel_f64_mask swap = (kernel_f64_mask)(t[1] < t[0]);
    kernel_f64_store_half_of_vector(&out->length, half,
                                    kernel_f64_select(swap, t[0], t[1]) - kernel_f64_select(swap, t[1], t[0]));
    kernel_store_rounded_doubles(kernel_f64_select(swap, value[1], value[0]), half, &out->v_in, &out->rest_in);
    kernel_store_rounded_doubles(kernel_f64_select(swap, value[0], value[1]), half, &out->v_out, &out->rest_out);
    return sound & met[0] & met[1];
}

/* Replaces the length and the values of *run, a tet's segment in float32, by those computed in double, on the given
 * rays for which these are valid. The length is in units of t. */
static __attribute__((noinline)) void kernel_tet_segment_in_double(const kernel_packet *p, const kernel_cell *c,
                                                                   const kernel_double_face faces[4],
                                                                   const kernel_f64 u[2], const kernel_f64 v[2],
                                                                   vm active, kernel_unit_segment *run)
{
    kernel_unit_segment exact = *run;
    vf sound = vf_set(0);
    vm hit[4];
    kernel_tet_faces(p, c, active, hit);
    for (int half = 0; half < 2; half++) {
        const kernel_f64_mask is_sound = kernel_double_segment_half(faces, u[half], v[half], hit, half, &exact);
        kernel_f64_store_half_of_vector(&sound, half,
                                        kernel_f64_select(is_sound, (kernel_f64){0} + 1, (kernel_f64){0}));
    }
    const vm better = vm_and(active, vf_lt(vf_set(0), sound));
    run->length = vf_select(better, exact.length, run->length);
    run->v_in = vf_select(better, exact.v_in, run->v_in);
    run->v_out = vf_select(better, exact.v_out, run->v_out);
    run->rest_in = vf_select(better, exact.rest_in, run->rest_in);
    run->rest_out = vf_select(better, exact.rest_out, run->rest_out);
}

enum { KERNEL_EXACT_STEPS = 24 };

/* ---- the map and the field ---- */

/* Computes the polynomial coefficients (kernel_map.h) of the map of a hex, wedge or pyramid to tile space (3 rows), and
 * of the field in the transfer function's domain (last row). */
static void kernel_exact_setup(double map[4][8], const kernel_packet *p, const kernel_cell *c,
                               const kernel_transfer *transfer)
{
    double d[4][GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < c->count; i++) {
        const kernel_double_vertex spot = kernel_double_transform(p->frame, p->tile, c->world[i]);
        d[0][i] = spot.x;
        d[1][i] = spot.y;
        d[2][i] = spot.t;
        d[3][i] = kernel_double_domain(transfer, c->values[i]);
    }
    for (int n = 0; n < 4; n++) kernel_polynomial_fit(map[n], c->type, d[n]);
}

/* Returns the product term m of the cell's map (kernel_map.h) at the reference coordinates r, and its derivatives along
 * r. */
static inline double kernel_exact_product(bool is_pyramid, const double r[3], double slopes[3])
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
static inline double kernel_exact_value(const double c[8], const double r[3], double m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* Computes the polynomial's derivatives along r. m, slopes: results of kernel_exact_product(). */
static inline void kernel_exact_gradient(const double c[8], const double r[3], double m, const double slopes[3],
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
static bool kernel_exact_newton(const double (*map)[8], bool is_pyramid, const double target[3], double r[3])
{
    for (int n = 0; n < KERNEL_EXACT_STEPS; n++) {
        double slopes[3], row[3][3], off[3], cross[3][3], largest = 0;
        const double m = kernel_exact_product(is_pyramid, r, slopes);
        for (int a = 0; a < 3; a++) {
            off[a] = target[a] - kernel_exact_value(map[a], r, m);
            kernel_exact_gradient(map[a], r, m, slopes, row[a]);
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
static inline bool kernel_exact_is_near(const double r[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && -r[a] <= (double)KERNEL_MAP_BEYOND && r[a] - 1 <= (double)KERNEL_MAP_BEYOND;
    return near;
}

#endif
