/* Computes the ends of a ray's segment in a tet in double precision. It is used if the job's max_error is below 2e-4
 * (render_prepare.c) or a transfer function has extremely narrow ramps.
 *
 * In float32 a face's value errs by about 4e-7 of the transfer function's domain: three weights, their sum, and the
 * vertices' positions and values have an error of 6e-8 each. A steep function magnifies that error, near an opacity of
 * 1 by a factor of a hundred. And the length of a short segment is the difference of two depths that are rounded on the
 * scale of the scene. So the decisions which faces a ray crosses, and in which order segments lie along it, are made in
 * float32 as for all other cells (kernel_cell.h), with the same bits. But the segment's length, and its values at both
 * ends, are computed from the caller's coordinates and values and from the ray's position in the picture, in double.
 *
 * An edge function is affine in the ray's u, v (kernel_cell.h). So are the sum D of a face's edge functions, and the
 * sums N of its vertices' depths and values, weighted by the opposite edges: nine coefficients per face, computed once
 * per cell and tile. A ray meets the face's plane at N / D. That point may lie outside the face, by as much as the
 * decision is rounded, about 1e-7 of the edges' terms. If D is less than KERNEL_DOUBLE_EDGE of these terms, the face is
 * seen so nearly edge on that the plane is met far outside the face, and the segment keeps both float32 ends.
 * Everything is computed from the face's vertices in their order and from the ray, so that both cells of a face compute
 * the same point if both use double. */
#ifndef RENDER_KERNEL_DOUBLE_H
#define RENDER_KERNEL_DOUBLE_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* A ray meets a face's plane outside the face by at most 1e-7 / KERNEL_DOUBLE_EDGE of the face's extent. */
#define KERNEL_DOUBLE_EDGE 1e-3

/* Corrections to an interval whose ends are float32: its length in t, rounded only once, and the parts of the values at
 * its ends that float32 rounds off. */
typedef struct kernel_precise_interval {
    vf length, rest_in, rest_out;
} kernel_precise_interval;

/* An affine function of the ray: c[0] + c[1] u + c[2] v. */
typedef struct kernel_affine {
    double c[3];
} kernel_affine;

/* The affine functions of a tet's face: the weighted sums N of depths (depth) and values (value), and the sum of
 * weights D (weight), as defined at the top of this file. */
typedef struct kernel_double_face {
    kernel_affine depth, value, weight;
    double least; /* the face is not seen edge on if the weight is larger than this */
} kernel_double_face;

/* The affine functions of a tet's four faces, in the order of kernel_tet_face. */
typedef struct kernel_double_cell {
    kernel_double_face faces[4];
} kernel_double_cell;

/* The (u, v) of a packet's rays in double, relative to the tile's centre. */
typedef struct kernel_double_rays {
    kernel_f64 u[2], v[2];
} kernel_double_rays;

SIMD_INLINE kernel_precise_interval kernel_precise_interval_of(const kernel_interval *i)
{
    return (kernel_precise_interval){i->t_out - i->t_in, vf_set(0), vf_set(0)};
}

SIMD_INLINE void kernel_double_rays_of(const kernel_packet *p, kernel_double_rays *out)
{
    kernel_lanes lanes;
    kernel_packet_lanes(p, &lanes);
    for (int i = 0; i < SIMD_WIDTH; i++) {
        lanes.px[i] -= p->tile->centre_x;
        lanes.py[i] -= p->tile->centre_y;
    }
    memcpy(out->u, lanes.px, sizeof out->u);
    memcpy(out->v, lanes.py, sizeof out->v);
}

/* ---- a cell ---- */

/* A vertex in tile space before it is rounded to float32. `depth` is the factor of u and v in the vertex's projection;
 * t and value are the depth and the field. */
typedef struct kernel_double_vertex {
    double x, y, depth, t, value;
} kernel_double_vertex;

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

/* Returns the value in the transfer function's domain, clamped to +-1e18. */
static inline double kernel_double_domain(const kernel_transfer *transfer, double value)
{
    return fmax(fmin((value - transfer->low) * transfer->inverse_width, 1e18), -1e18);
}

#endif
