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
 * An edge function is affine in the ray's u, v (kernel_line.h). So are their sum over a face, D, and the sums of its
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
#include "kernel_tet.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* The plane is left by no more than 1e-7 / KERNEL_DOUBLE_EDGE of the face's extent. */
#define KERNEL_DOUBLE_EDGE 1e-3

/* What an interval has beside float32: its length in t, and what its values lost to their rounding. */
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

SIMD_INLINE kernel_affine kernel_double_edge(const kernel_double_spot *a, const kernel_double_spot *b)
{
    return (kernel_affine){
        {a->x * b->y - b->x * a->y, b->depth * a->y - a->depth * b->y, a->depth * b->x - b->depth * a->x}};
}

/* The sums of a face of kernel_tet_face, from the tet's vertices and edges. No ray's |u| and |v| exceed radius. */
SIMD_INLINE void kernel_double_sums(const kernel_double_spot *spots, const kernel_affine *edges,
                                    const signed char *face, double radius, kernel_double_face *out)
{
    const kernel_double_spot *i = &spots[face[0]], *j = &spots[face[1]], *k = &spots[face[2]];
    const kernel_affine *ij = &edges[face[3]], *jk = &edges[face[4]], *ik = &edges[face[5]];
    for (int n = 0; n < 3; n++) {
        out->depth.c[n] = (jk->c[n] * i->t - ik->c[n] * j->t) + ij->c[n] * k->t;
        out->value.c[n] = (jk->c[n] * i->value - ik->c[n] * j->value) + ij->c[n] * k->value;
        out->weight.c[n] = (jk->c[n] - ik->c[n]) + ij->c[n];
    }
    out->least = 0;
    for (int n = 0; n < 3; n++)
        out->least += KERNEL_DOUBLE_EDGE * (n ? radius : 1) * ((fabs(ij->c[n]) + fabs(jk->c[n])) + fabs(ik->c[n]));
}

/* The value in the transfer's domain. */
static inline double kernel_double_domain(const kernel_transfer *transfer, double value)
{
    return fmax(fmin((value - transfer->low) * transfer->inverse_width, 1e18), -1e18);
}

/* c: a tet that is placed. */
static __attribute__((noinline)) void kernel_double_begin(const kernel_frame *f, const kernel_tile *tile,
                                                          const kernel_cell *c, const kernel_transfer *transfer,
                                                          kernel_double_cell *out)
{
    kernel_double_spot spots[4];
    kernel_affine edges[KERNEL_TET_EDGES];
    for (int i = 0; i < 4; i++) {
        spots[i] = kernel_double_place(f, tile, c->world[i]);
        spots[i].value = kernel_double_domain(transfer, c->values[i]);
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++)
        edges[n] = kernel_double_edge(&spots[kernel_tet_edge[n][0]], &spots[kernel_tet_edge[n][1]]);
    for (int n = 0; n < 4; n++)
        kernel_double_sums(spots, edges, kernel_tet_face[n], (double)tile->radius, &out->faces[n]);
}

/* ---- rays in it ---- */

/* Where rays meet a face; is_sound: it is not seen edge on. */
typedef struct kernel_double_end {
    kernel_half t, v;
    kernel_half_mask is_sound;
} kernel_double_end;

SIMD_INLINE kernel_half kernel_affine_at(const kernel_affine *a, kernel_half u, kernel_half v)
{
    return (a->c[0] + a->c[1] * u) + a->c[2] * v;
}

SIMD_INLINE kernel_double_end kernel_double_meet(const kernel_double_face *face, kernel_half u, kernel_half v)
{
    const kernel_half weight = kernel_affine_at(&face->weight, u, v), inverse = 1.0 / weight;
    return (kernel_double_end){kernel_affine_at(&face->depth, u, v) * inverse,
                               kernel_affine_at(&face->value, u, v) * inverse,
                               (kernel_half_mask)(weight * weight > face->least * face->least)};
}

SIMD_INLINE void kernel_double_take(kernel_half_mask m, const kernel_double_end *from, kernel_double_end *to)
{
    to->t = kernel_half_select(m, from->t, to->t);
    to->v = kernel_half_select(m, from->v, to->v);
    to->is_sound = (from->is_sound & m) | (to->is_sound & ~m);
}

/* A packet's, half by half. */
typedef struct kernel_double_lanes {
    float is_sound[SIMD_WIDTH], length[SIMD_WIDTH], v_in[SIMD_WIDTH], rest_in[SIMD_WIDTH], v_out[SIMD_WIDTH],
        rest_out[SIMD_WIDTH];
} kernel_double_lanes;

SIMD_INLINE void kernel_double_value(kernel_half value, float *v, float *rest)
{
    const kernel_half_floats rounded = kernel_half_narrow(value);
    const kernel_half_floats lost = kernel_half_narrow(value - kernel_half_widen(rounded));
    memcpy(v, &rounded, sizeof rounded);
    memcpy(rest, &lost, sizeof lost);
}

SIMD_INLINE void kernel_double_half(const kernel_double_cell *cell, const kernel_double_rays *rays, const vm hit[4],
                                    int half, kernel_double_lanes *out)
{
    kernel_double_end first = {0}, last = {0};
    kernel_half_mask met = {0};
    const int lane = half * KERNEL_HALF;
    for (int n = 0; n < 4; n++) {
        const kernel_half_mask m = kernel_half_of_mask(hit[n], half);
        const kernel_double_end end = kernel_double_meet(&cell->faces[n], rays->u[half], rays->v[half]);
        kernel_double_take(m & ~met, &end, &first);
        kernel_double_take(m & met, &end, &last);
        met |= m;
    }
    const kernel_half_mask swap = (kernel_half_mask)(last.t < first.t);
    const kernel_double_end nearer = first;
    kernel_double_take(swap, &last, &first);
    kernel_double_take(swap, &nearer, &last);
    const kernel_half_floats length = kernel_half_narrow(last.t - first.t);
    const kernel_half_floats sound = __builtin_convertvector(first.is_sound & last.is_sound, kernel_half_floats);
    memcpy(out->length + lane, &length, sizeof length);
    memcpy(out->is_sound + lane, &sound, sizeof sound);
    kernel_double_value(first.v, out->v_in + lane, out->rest_in + lane);
    kernel_double_value(last.v, out->v_out + lane, out->rest_out + lane);
}

/* Of the tet's interval i as kernel_tet_interval() has it: its values become the nearest to those in double. */
static __attribute__((noinline)) kernel_double kernel_tet_double(const kernel_packet *p, const kernel_cell *c,
                                                                 const kernel_double_cell *cell,
                                                                 const kernel_double_rays *rays, kernel_interval *i)
{
    kernel_double_lanes lanes;
    kernel_double out = kernel_double_of(i);
    vm hit[4];
    kernel_tet_faces(p, c, i->mask, hit);
    for (int half = 0; half < 2; half++) kernel_double_half(cell, rays, hit, half, &lanes);
    const vm sound = vm_and(i->mask, vf_lt(vf_load(lanes.is_sound), vf_set(0)));
    out.length = vf_select(sound, vf_load(lanes.length), out.length);
    out.rest_in = vf_select(sound, vf_load(lanes.rest_in), vf_set(0));
    out.rest_out = vf_select(sound, vf_load(lanes.rest_out), vf_set(0));
    i->v_in = vf_select(sound, vf_load(lanes.v_in), i->v_in);
    i->v_out = vf_select(sound, vf_load(lanes.v_out), i->v_out);
    return out;
}

#endif
