/* The ends of a tet's segment in double, for segments of which no error is allowed, or hardly any, and for functions
 * with ramps of next to no width.
 *
 * In float32 a face's value errs by some 4e-7 of the transfer's domain: three weights, their sum, the vertices' places
 * and values, 6e-8 each. A steep function magnifies that, of opacity towards 1 a hundredfold; and the length of a short
 * segment is the difference of two depths that are rounded on the scale of the scene. So which faces a ray crosses, and
 * in which order segments lie along it, is decided as for all others (kernel_cell.h), and by the same bits; but how
 * long the segment is, and from which value to which, is taken from the coordinates and values as they were handed
 * over, and from the ray's place in the picture.
 *
 * An edge function is affine in the ray's u, v (kernel_cell.h). So are their sum over a face, D, and the sums of its
 * vertices' depths and values weighed by the opposite edges, N: nine coefficients a face, once a cell and tile. A ray
 * meets the face's plane at N / D. It may be beside the face there, by as much as the decision rounds, which is some
 * 1e-7 of the edges' terms. Where D is not KERNEL_DOUBLE_EDGE of these at least, the face is seen so nearly edge on
 * that the plane is left far beside it, and both float32 ends of the segment stay. All of it comes from the face's
 * vertices in their order and from the ray, so that a face is in one place for both its cells where both take it so. */
#ifndef RENDER_KERNEL_DOUBLE_H
#define RENDER_KERNEL_DOUBLE_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* The plane is left by no more than 1e-7 / KERNEL_DOUBLE_EDGE of the face's extent. */
#define KERNEL_DOUBLE_EDGE 1e-3

/* The parts of an interval that float32 loses: its length in t, and the rests of its values. */
typedef struct kernel_double {
    vf length, rest_in, rest_out;
} kernel_double;

/* c[0] + c[1] u + c[2] v. */
typedef struct kernel_affine {
    double c[3];
} kernel_affine;

typedef struct kernel_double_face {
    kernel_affine depth, value, weight;
    double least; /* the face is not seen edge on where the weight is more */
} kernel_double_face;

/* A tet's, by kernel_tet_face. */
typedef struct kernel_double_cell {
    kernel_double_face faces[4];
} kernel_double_cell;

/* A packet's rays, from the tile's centre. */
typedef struct kernel_double_rays {
    kernel_half u[2], v[2];
} kernel_double_rays;

SIMD_INLINE kernel_double kernel_double_of(const kernel_interval *i)
{
    return (kernel_double){i->t_out - i->t_in, vf_set(0), vf_set(0)};
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

/* A vertex as kernel_place_in() has it before it rounds; depth: what u and v are multiplied by. */
typedef struct kernel_double_spot {
    double x, y, depth, t, value;
} kernel_double_spot;

SIMD_INLINE kernel_double_spot kernel_double_place(const kernel_frame *f, const kernel_tile *tile, const double *world)
{
    double place[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) place[a] += f->scaled_axes[a][b] * (world[b] - f->job->camera.eye[b]);
    const double depth = f->job->camera.is_orthographic ? f->job->space.scale : place[2];
    return (kernel_double_spot){.x = place[0] - tile->centre_x * depth,
                                .y = place[1] - tile->centre_y * depth,
                                .depth = depth,
                                .t = place[2] - tile->depth_shift};
}

/* The value in the transfer's domain. */
static inline double kernel_double_domain(const kernel_transfer *transfer, double value)
{
    return fmax(fmin((value - transfer->low) * transfer->inverse_width, 1e18), -1e18);
}

#endif
