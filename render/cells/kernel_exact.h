/* Computes cells in double, from the caller's coordinates and values: crossings of rays with a tet's faces, for the
 * reasons in kernel_double.h; and the map and field of other cells at single points, which kernel_map.h computes in
 * float32. */
#ifndef RENDER_KERNEL_EXACT_H
#define RENDER_KERNEL_EXACT_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_crossings.h"
#include "kernel_double.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "kernel_tets.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

SIMD_INLINE kernel_affine kernel_double_edge(const kernel_double_vertex *a, const kernel_double_vertex *b)
{
    return (kernel_affine){
        {a->x * b->y - b->x * a->y, b->depth * a->y - a->depth * b->y, a->depth * b->x - b->depth * a->x}};
}

/* Computes the affine sums of one face (a row of kernel_tet_face) from the tet's vertices and edge functions. radius:
 * upper bound of the rays' |u| and |v|. */
SIMD_INLINE void kernel_double_sums(const kernel_double_vertex *spots, const kernel_affine *edges,
                                    const signed char *face, double radius, kernel_double_face *out)
{
    const kernel_double_vertex *i = &spots[face[0]], *j = &spots[face[1]], *k = &spots[face[2]];
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

/* Computes the affine functions of a tet's faces. The tet must have been transformed and sorted. */
static __attribute__((noinline)) void kernel_double_begin(const kernel_frame *f, const kernel_tile *tile,
                                                          const kernel_cell *c, const kernel_transfer *transfer,
                                                          kernel_double_cell *out)
{
    kernel_double_vertex spots[4];
    kernel_affine edges[KERNEL_TET_EDGES];
    for (int i = 0; i < 4; i++) {
        spots[i] = kernel_double_transform(f, tile, c->world[i]);
        spots[i].value = kernel_double_domain(transfer, c->values[i]);
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++)
        edges[n] = kernel_double_edge(&spots[kernel_tet_edge[n][0]], &spots[kernel_tet_edge[n][1]]);
    for (int n = 0; n < 4; n++)
        kernel_double_sums(spots, edges, kernel_tet_face[n], (double)tile->radius, &out->faces[n]);
}

/* ---- rays in a tet ---- */

/* Points at which rays meet the plane of a face. is_sound: rays for which the face is not seen edge on, so that the
 * point is valid. */
typedef struct kernel_double_end {
    kernel_f64 t, v;
    kernel_f64_mask is_sound;
} kernel_double_end;

SIMD_INLINE kernel_f64 kernel_affine_at(const kernel_affine *a, kernel_f64 u, kernel_f64 v)
{
    return (a->c[0] + a->c[1] * u) + a->c[2] * v;
}

SIMD_INLINE kernel_double_end kernel_double_intersect(const kernel_double_face *face, kernel_f64 u, kernel_f64 v)
{
    const kernel_f64 weight = kernel_affine_at(&face->weight, u, v), inverse = 1.0 / weight;
    return (kernel_double_end){kernel_affine_at(&face->depth, u, v) * inverse,
                               kernel_affine_at(&face->value, u, v) * inverse,
                               (kernel_f64_mask)(weight * weight > face->least * face->least)};
}

SIMD_INLINE void kernel_double_select(kernel_f64_mask m, const kernel_double_end *from, kernel_double_end *to)
{
    to->t = kernel_f64_select(m, from->t, to->t);
    to->v = kernel_f64_select(m, from->v, to->v);
    to->is_sound = (from->is_sound & m) | (to->is_sound & ~m);
}

/* Exact intervals of a packet's rays in a tet, stored in two halves of the lanes because they are in double. */
typedef struct kernel_double_lanes {
    float is_sound[SIMD_WIDTH], length[SIMD_WIDTH], v_in[SIMD_WIDTH], rest_in[SIMD_WIDTH], v_out[SIMD_WIDTH],
        rest_out[SIMD_WIDTH];
} kernel_double_lanes;

SIMD_INLINE void kernel_double_value(kernel_f64 value, float *v, float *rest)
{
    const kernel_f64_floats rounded = kernel_f64_narrow(value);
    const kernel_f64_floats lost = kernel_f64_narrow(value - kernel_f64_widen(rounded));
    memcpy(v, &rounded, sizeof rounded);
    memcpy(rest, &lost, sizeof lost);
}

SIMD_INLINE void kernel_double_half(const kernel_double_cell *cell, const kernel_double_rays *rays, const vm hit[4],
                                    int half, kernel_double_lanes *out)
{
    kernel_double_end first = {0}, last = {0};
    kernel_f64_mask met = {0};
    const int lane = half * KERNEL_HALF;
    for (int n = 0; n < 4; n++) {
        const kernel_f64_mask m = kernel_f64_of_mask(hit[n], half);
        const kernel_double_end end = kernel_double_intersect(&cell->faces[n], rays->u[half], rays->v[half]);
        kernel_double_select(m & ~met, &end, &first);
        kernel_double_select(m & met, &end, &last);
        met |= m;
    }
    const kernel_f64_mask swap = (kernel_f64_mask)(last.t < first.t);
    const kernel_double_end nearer = first;
    kernel_double_select(swap, &last, &first);
    kernel_double_select(swap, &nearer, &last);
    const kernel_f64_floats length = kernel_f64_narrow(last.t - first.t);
    const kernel_f64_floats sound = __builtin_convertvector(first.is_sound & last.is_sound, kernel_f64_floats);
    memcpy(out->length + lane, &length, sizeof length);
    memcpy(out->is_sound + lane, &sound, sizeof sound);
    kernel_double_value(first.v, out->v_in + lane, out->rest_in + lane);
    kernel_double_value(last.v, out->v_out + lane, out->rest_out + lane);
}

/* Computes the exact length and the rounding errors of interval *i, which kernel_tet_interval() has computed. The
 * interval's values are replaced by the doubles rounded to float32. */
static __attribute__((noinline)) kernel_precise_interval kernel_tet_double(const kernel_packet *p, const kernel_cell *c,
                                                                           const kernel_double_cell *cell,
                                                                           const kernel_double_rays *rays,
                                                                           kernel_interval *i)
{
    kernel_double_lanes lanes;
    kernel_precise_interval out = kernel_precise_interval_of(i);
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

enum { KERNEL_EXACT_STEPS = 24 };

/* ---- the map and the field ---- */

typedef struct kernel_exact_map {
    bool is_pyramid;
    double position[3][8], field[8];
} kernel_exact_map;

static void kernel_exact_setup(kernel_exact_map *m, const kernel_packet *p, const kernel_cell *c,
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
    m->is_pyramid = kernel_has_apex(c->type);
    for (int a = 0; a < 3; a++) kernel_polynomial_fit(m->position[a], c->type, d[a]);
    kernel_polynomial_fit(m->field, c->type, d[3]);
}

/* Returns the bilinear product m, a term of the cell's map (kernel_map.h), at the reference coordinates r, and its
 * derivatives. */
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

static inline double kernel_exact_value(const double c[8], const double r[3], double m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

static inline void kernel_exact_gradient(const double c[8], const double r[3], double m, const double slopes[3],
                                         double out[3])
{
    const double of_m = c[4] + r[2] * c[7];
    out[0] = c[1] + r[2] * c[5] + slopes[0] * of_m;
    out[1] = c[2] + r[2] * c[6] + slopes[1] * of_m;
    out[2] = c[3] + (r[0] * c[5] + r[1] * c[6]) + m * c[7] + slopes[2] * of_m;
}

/* Inverts the map by Newton's method in double, until a step is below 1e-8, after which the error is below rounding.
 * Returns false if the method does not converge. */
static bool kernel_exact_newton(const kernel_exact_map *map, const double target[3], double r[3])
{
    for (int n = 0; n < KERNEL_EXACT_STEPS; n++) {
        double slopes[3], row[3][3], off[3], cross[3][3], largest = 0;
        const double m = kernel_exact_product(map->is_pyramid, r, slopes);
        for (int a = 0; a < 3; a++) {
            off[a] = target[a] - kernel_exact_value(map->position[a], r, m);
            kernel_exact_gradient(map->position[a], r, m, slopes, row[a]);
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

static inline bool kernel_exact_is_near(const double r[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && -r[a] <= (double)KERNEL_MAP_BEYOND && r[a] - 1 <= (double)KERNEL_MAP_BEYOND;
    return near;
}

#endif
