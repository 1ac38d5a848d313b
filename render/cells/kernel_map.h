/* Inverts the maps of hexes, wedges and pyramids: computes the reference coordinates of a point, and so the field and
 * its gradient there.
 *
 * The maps of all three types are the same polynomial in the reference coordinates (r, s, q),
 *     c0 + c1 r + c2 s + c3 q + c4 m + c5 r q + c6 s q + c7 m q,
 * with m = r s. The trilinear hex has all terms; in the wedge c4 and c7 are 0. The pyramid is the collapsed hex, whose
 * map is singular at the apex. In the coordinates a = (1-q) r, b = (1-q) s, k = 1-q its map is apex + a c1 + b c2 +
 * k c3 + c4 m with m = a b / k, which is linear except for the last term; that term vanishes if the base is a
 * parallelogram. In these coordinates Newton's method meets no singularity at the apex, because m is bounded by k.
 *
 * A cell is called folded if its map is not one-to-one, so that a point may have several reference coordinates. */
#ifndef RENDER_KERNEL_MAP_H
#define RENDER_KERNEL_MAP_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_wide.h"
#include "simd.h"

enum { KERNEL_MAP_STEPS = 10 };

/* Newton's method ends after a step that is smaller than this in reference coordinates. The remaining error is about
 * the square of this step times the second derivative of the map; except in extremely warped cells, this is below
 * float32's resolution. */
#define KERNEL_MAP_TOLERANCE 5e-5f

/* Computes the polynomial coefficients c of a hex's coordinate or field from its values v at the vertices. c and v are
 * arrays of doubles or of vectors of doubles. */
#define KERNEL_HEX_FIT(c, v)                                                                                           \
    do {                                                                                                               \
        (c)[0] = (v)[0];                                                                                               \
        (c)[1] = (v)[1] - (v)[0];                                                                                      \
        (c)[2] = (v)[3] - (v)[0];                                                                                      \
        (c)[3] = (v)[4] - (v)[0];                                                                                      \
        (c)[4] = (v)[2] - (v)[1] - (v)[3] + (v)[0];                                                                    \
        (c)[5] = (v)[5] - (v)[1] - (v)[4] + (v)[0];                                                                    \
        (c)[6] = (v)[7] - (v)[3] - (v)[4] + (v)[0];                                                                    \
        (c)[7] = ((v)[6] - (v)[5] - (v)[7] + (v)[4]) - (c)[4];                                                         \
    } while (0)

/* Compute the nonzero polynomial coefficients c of a wedge's or a pyramid's coordinate or field from its values v at
 * the vertices. */
#define KERNEL_WEDGE_FIT(c, v)                                                                                         \
    do {                                                                                                               \
        (c)[0] = (v)[0];                                                                                               \
        (c)[1] = (v)[1] - (v)[0];                                                                                      \
        (c)[2] = (v)[2] - (v)[0];                                                                                      \
        (c)[3] = (v)[3] - (v)[0];                                                                                      \
        (c)[5] = (v)[4] - (v)[1] - (v)[3] + (v)[0];                                                                    \
        (c)[6] = (v)[5] - (v)[2] - (v)[3] + (v)[0];                                                                    \
    } while (0)

#define KERNEL_PYRAMID_FIT(c, v)                                                                                       \
    do {                                                                                                               \
        (c)[0] = (v)[4];                                                                                               \
        (c)[1] = (v)[1] - (v)[0];                                                                                      \
        (c)[2] = (v)[3] - (v)[0];                                                                                      \
        (c)[3] = (v)[0] - (v)[4];                                                                                      \
        (c)[4] = (v)[0] - (v)[1] + (v)[2] - (v)[3];                                                                    \
    } while (0)

#define KERNEL_FIT(type, c, v)                                                                                         \
    do {                                                                                                               \
        if (kernel_has_triangles(type)) memset(c, 0, 8 * sizeof *(c));                                                 \
        if (kernel_is_box(type))                                                                                       \
            KERNEL_HEX_FIT(c, v);                                                                                      \
        else if (kernel_is_prism(type))                                                                                \
            KERNEL_WEDGE_FIT(c, v);                                                                                    \
        else                                                                                                           \
            KERNEL_PYRAMID_FIT(c, v);                                                                                  \
    } while (0)

SIMD_INLINE void kernel_polynomial_fit(double out[8], int type, const double v[GRID_MAX_CELL_VERTICES])
{
    KERNEL_FIT(type, out, v);
}

/* Computes the polynomial coefficients of SIMD_WIDTH / 2 cells from the values v at their vertices. */
SIMD_INLINE void kernel_f64_fit(int type, kernel_f64 c[8], const kernel_f64 v[8])
{
    KERNEL_FIT(type, c, v);
}

/* The product m = r s, or a b / k in a pyramid, in the map's polynomial (see the top of this file), and its derivatives
 * along the three reference coordinates. */
typedef struct kernel_product {
    vf m, dr, ds, dq;
} kernel_product;

SIMD_INLINE kernel_product kernel_compute_coordinate_product(bool is_pyramid, const vf r[3])
{
    kernel_product out = {r[0] * r[1], r[1], r[0], vf_set(0)};
    if (is_pyramid) {
        /* Within the cell a / k and b / k are in [0, 1]; the clamp limits them for points beyond the apex, which
         * Newton's method may try. */
        const vf inverse = 1.0f / vf_max(r[2], vf_set(1e-6f));
        out.ds = vf_clamp(r[0] * inverse, vf_set(-1), vf_set(2));
        out.dr = vf_clamp(r[1] * inverse, vf_set(-1), vf_set(2));
        out.m = out.ds * r[1];
        out.dq = -(out.ds * out.dr);
    }
    return out;
}

/* Returns the polynomial's value at the reference coordinates r. Each lane has its own coefficients. */
SIMD_INLINE vf kernel_polynomial_value(const vf c[8], bool is_pyramid, const kernel_product *m, const vf r[3])
{
    vf v = ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m->m * c[4];
    if (!is_pyramid) v += r[2] * ((r[0] * c[5] + r[1] * c[6]) + m->m * c[7]);
    return v;
}

SIMD_INLINE void kernel_polynomial_gradient(const vf c[8], bool is_pyramid, const kernel_product *m, const vf r[3],
                                            vf out[3])
{
    out[0] = c[1] + m->dr * c[4];
    out[1] = c[2] + m->ds * c[4];
    out[2] = c[3] + m->dq * c[4];
    if (is_pyramid) return;
    out[0] += r[2] * (c[5] + m->dr * c[7]);
    out[1] += r[2] * (c[6] + m->ds * c[7]);
    out[2] += (r[0] * c[5] + r[1] * c[6]) + m->m * c[7];
}

SIMD_INLINE void kernel_cross(const vf a[3], const vf b[3], vf out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

SIMD_INLINE vf kernel_dot(const vf a[3], const vf b[3])
{
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

/* Computes the map's Jacobian at r, whose row i is the gradient of the position's component i, and from it cross[i] =
 * row i+1 × row i+2, with indices modulo 3. Returns the Jacobian's determinant. Divided by it, the cross products are
 * the columns of the inverse Jacobian. */
SIMD_INLINE vf kernel_jacobian(const vf position[3][8], bool is_pyramid, const kernel_product *m, const vf r[3],
                               vf cross[3][3])
{
    vf row[3][3];
    for (int a = 0; a < 3; a++) kernel_polynomial_gradient(position[a], is_pyramid, m, r, row[a]);
    for (int i = 0; i < 3; i++) kernel_cross(row[(i + 1) % 3], row[(i + 2) % 3], cross[i]);
    return kernel_dot(row[0], cross[0]);
}

/* The maps of cells of one type, one per lane: polynomial coefficients of the positions and of the field. Positions are
 * in tile space and relative to vertex 0, so that their rounding errors are relative to the cell's size. */
typedef struct kernel_map {
    bool is_pyramid;
    float tolerance; /* Newton's method ends after a step smaller than this, in reference coordinates */
    vf origin[3];    /* vertex 0 in tile space */
    vf position[3][8], field[8];
    kernel_f64 exact[2][4][8]; /* the coefficients of positions and field in double, by halves of the lanes */
} kernel_map;

/* Computes the map of each ray's own cell. at[n][vertex][lane]: x, y, z (n = 0, 1, 2) and field (n = 3) of the cell in
 * this lane; lane: the lane of each ray's cell in these arrays. */
SIMD_INLINE void kernel_compute_maps_of_type(const float (*at)[8][SIMD_WIDTH], vi lane, kernel_map *out, int type)
{
    const int count = grid_type_vertex_count(type);
    out->is_pyramid = kernel_has_apex(type);
    out->tolerance = KERNEL_MAP_TOLERANCE;
    for (int n = 0; n < 4; n++) {
        vf v[8], *const c = n < 3 ? out->position[n] : out->field;
        for (int i = 0; i < count; i++) v[i] = kernel_gather_lane(at[n][i], lane);
        if (n < 3) out->origin[n] = v[0];
        for (int half = 0; half < 2; half++) {
            kernel_f64 d[8], *const e = out->exact[half][n];
            for (int i = 0; i < count; i++) d[i] = kernel_f64_widen_half(&v[i], half);
            if (n < 3)
                for (int i = count - 1; i >= 0; i--) d[i] -= d[0];
            kernel_f64_fit(type, e, d);
            for (int i = 0; i < 8; i++) kernel_f64_store_half_of_vector(&c[i], half, e[i]);
        }
    }
}

static __attribute__((noinline)) void kernel_compute_maps(const float (*at)[8][SIMD_WIDTH], vi lane, int type,
                                                          kernel_map *out)
{
    KERNEL_OF_TYPE(type, kernel_compute_maps_of_type, at, lane, out);
}

/* Copies `count` numbers, one for each vertex of a cell, to all lanes of `out`. If the cell has fewer than eight
 * vertices, the remaining entries become 0. */
SIMD_INLINE void kernel_broadcast_vertex_numbers(const float *numbers, int count, float out[8][SIMD_WIDTH])
{
    for (int i = 0; i < 8; i++) vf_store(out[i], vf_set(i < count ? numbers[i] : 0));
}

/* Computes the map of one cell, the same in all lanes. */
SIMD_INLINE void kernel_map_setup(kernel_map *m, const kernel_cell *c)
{
    const float *const numbers[4] = {c->x, c->y, c->z, c->f};
    float at[4][8][SIMD_WIDTH];
    for (int n = 0; n < 4; n++) kernel_broadcast_vertex_numbers(numbers[n], c->count, at[n]);
    kernel_compute_maps((const float(*)[8][SIMD_WIDTH])at, vi_set(0), c->type, m);
}

/* Computes the polynomial coefficients c of a field in each ray's own cell. values: the field by vertex, in arrays
 * whose lanes are cells; lane: the lane of each ray's cell. */
SIMD_INLINE void kernel_maps_polynomial(const float (*values)[SIMD_WIDTH], vi lane, vf c[8], int type)
{
    const int count = grid_type_vertex_count(type);
    vf v[8];
    for (int i = 0; i < count; i++) v[i] = kernel_gather_lane(values[i], lane);
    for (int half = 0; half < 2; half++) {
        kernel_f64 d[8], e[8];
        for (int i = 0; i < count; i++) d[i] = kernel_f64_widen_half(&v[i], half);
        kernel_f64_fit(type, e, d);
        for (int i = 0; i < 8; i++) kernel_f64_store_half_of_vector(&c[i], half, e[i]);
    }
}

/* Returns a field at the reference coordinates r in each ray's own cell. values: the field by vertex, in arrays whose
 * lanes are cells; lane: the lane of each ray's cell in these arrays. */
SIMD_INLINE vf kernel_maps_evaluate_field(const float (*values)[SIMD_WIDTH], vi lane, const vf r[3], int type)
{
    const kernel_product m = kernel_compute_coordinate_product(kernel_has_apex(type), r);
    vf c[8];
    kernel_maps_polynomial(values, lane, c, type);
    return kernel_polynomial_value(c, kernel_has_apex(type), &m, r);
}

/* Computes the rays' points at depth t, relative to the map's origin. */
SIMD_INLINE void kernel_rays_at(const kernel_rays *rays, const kernel_map *map, vf t, vf out[3])
{
    out[0] = (rays->origin_x + rays->slope_x * t) - map->origin[0];
    out[1] = (rays->origin_y + rays->slope_y * t) - map->origin[1];
    out[2] = t - map->origin[2];
}

/* Computes the reference coordinates of the point at depth t on each ray in `wanted` by Newton's method, from the guess
 * in r. Returns the rays that did not converge. A ray that has converged is not changed any more, so its result does
 * not depend on the other rays of the packet. */
SIMD_INLINE vm kernel_map_newton(const kernel_rays *rays, const kernel_map *map, vm wanted, vf t, vf r[3])
{
    vf target[3];
    vm open = wanted;
    kernel_rays_at(rays, map, t, target);
    for (int step = 0; step < KERNEL_MAP_STEPS && vm_any(open); step++) {
        const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, r);
        vf cross[3][3];
        const vf det = kernel_jacobian(map->position, map->is_pyramid, &m, r, cross);
        const vf inverse = vf_select(vf_eq(det, vf_set(0)), vf_set(0), 1.0f / det);
        vf residual[3], largest = vf_set(0);
        for (int a = 0; a < 3; a++)
            residual[a] = target[a] - kernel_polynomial_value(map->position[a], map->is_pyramid, &m, r);
        for (int a = 0; a < 3; a++) {
            const vf sum = (cross[0][a] * residual[0] + cross[1][a] * residual[1]) + cross[2][a] * residual[2];
            const vf move = vf_clamp(sum * inverse, vf_set(-1), vf_set(1));
            largest = vf_max(largest, vf_abs(move));
            r[a] = vf_select(open, vf_clamp(r[a] + move, vf_set(-1), vf_set(2)), r[a]);
        }
        const vm solid = vm_not(vf_eq(det, vf_set(0)));
        open = vm_andnot(open, vm_and(solid, vf_le(largest, vf_set(map->tolerance))));
    }
    return open;
}

/* Returns the largest amount by which one of the coordinates of r is below 0 or above 1; 0 if r is in [0, 1]^3. */
SIMD_INLINE vf kernel_map_distance_outside(const vf r[3])
{
    vf most = vf_set(0);
    for (int a = 0; a < 3; a++) most = vf_max(most, vf_max(-r[a], r[a] - 1.0f));
    return most;
}

/* Points whose reference coordinates are outside of [0, 1] by no more than this are accepted as points of the cell. A
 * ray's point in the cell may have such coordinates if it lies between the two triangles of a warped face and the
 * face's bilinear patch, or if the cell is so flat that rounding errors matter. */
#define KERNEL_MAP_BEYOND 0.25f

/* Computes the reference coordinates r of the points at depth t, for the rays in `wanted`, from a guess in r. From a
 * poor guess, or in a folded cell, Newton's method may diverge or find another solution outside the cell; it is then
 * repeated from the middle of the cell. Returns the rays without a solution in or near the cell, whose r must not be
 * used. */
SIMD_INLINE vm kernel_map_invert(const kernel_rays *rays, const kernel_map *map, vm wanted, vf t, vf r[3])
{
    const vf most = vf_set(KERNEL_MAP_BEYOND);
    const vm failed = kernel_map_newton(rays, map, wanted, t, r);
    const vm again = vm_or(failed, vm_and(wanted, vf_lt(most, kernel_map_distance_outside(r))));
    if (__builtin_expect(!vm_any(again), 1)) return failed;
    vf middle[3] = {vf_set(0.4f), vf_set(0.4f), vf_set(0.5f)};
    const vm worse = kernel_map_newton(rays, map, again, t, middle);
    const vm better = vm_andnot(vm_andnot(again, worse), vf_lt(most, kernel_map_distance_outside(middle)));
    for (int a = 0; a < 3; a++) r[a] = vf_select(better, middle[a], r[a]);
    return vm_andnot(again, better);
}

/* Computes a vector parallel to the field's gradient at the reference coordinates r, in tile space, of any length and
 * of either sign. */
SIMD_INLINE void kernel_compute_gradient_direction(const kernel_map *map, const vf r[3], vf out[3])
{
    const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, r);
    vf cross[3][3], g[3];
    kernel_jacobian(map->position, map->is_pyramid, &m, r, cross);
    kernel_polynomial_gradient(map->field, map->is_pyramid, &m, r, g);
    /* the gradient is J^-T g, where the columns of J^-1 are cross / det; the sign of det is ignored, because callers
     * orient the normal themselves */
    for (int a = 0; a < 3; a++) out[a] = kernel_dot(cross[a], g);
}

/* The following functions evaluate the field along a ray through a cell: by linear interpolation between its two
 * crossings of faces, or exactly, by the inverse map. */

/* Returns the depth at which the line through the points (t0, v0) and (t1, v1) is zero, clamped to [t0, t1]. */
SIMD_INLINE vf kernel_secant(vf t0, vf v0, vf t1, vf v1)
{
    return vf_clamp(t0 - v0 * ((t1 - t0) / (v1 - v0)), t0, t1);
}

/* Returns the fraction of the interval that lies before t, in [0, 1]. */
SIMD_INLINE vf kernel_interval_fraction(const kernel_interval *i, vf t)
{
    const vf length = i->t_out - i->t_in;
    return vf_select(vf_lt(vf_set(0), length), (t - i->t_in) / length, vf_set(0));
}

/* Returns the field at depth t, interpolated linearly between its values at the interval's ends. */
SIMD_INLINE vf kernel_line_value(const kernel_interval *i, vf t)
{
    return i->v_in + kernel_interval_fraction(i, t) * (i->v_out - i->v_in);
}

/* Interpolates the reference coordinates at depth t linearly between those at the interval's ends. Inside a warped cell
 * the result is only a guess. */
SIMD_INLINE void kernel_reference_on_chord(const kernel_interval *i, vf t, vf r[3])
{
    const vf along = kernel_interval_fraction(i, t);
    for (int a = 0; a < 3; a++) r[a] = i->r_in[a] + along * (i->r_out[a] - i->r_in[a]);
}

/* Returns the field at depth t on the rays in `wanted`, and replaces the guess in r by the reference coordinates there.
 * For rays for which the map cannot be inverted, field and reference coordinates are interpolated linearly between the
 * interval's ends, and *failures is increased by the number of these rays. */
SIMD_INLINE vf kernel_evaluate_field_on_rays(const kernel_rays *rays, const kernel_map *map, const kernel_interval *i,
                                             vm wanted, vf t, vf r[3], int64_t *failures)
{
    const vm failed = kernel_map_invert(rays, map, wanted, t, r);
    const bool has_failed = vm_any(failed);
    if (has_failed) {
        vf line[3];
        kernel_reference_on_chord(i, t, line);
        for (int a = 0; a < 3; a++) r[a] = vf_select(failed, line[a], r[a]);
        *failures += __builtin_popcount(vm_bits(failed));
    }
    const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, r);
    const vf value = kernel_polynomial_value(map->field, map->is_pyramid, &m, r);
    return has_failed ? vf_select(failed, kernel_line_value(i, t), value) : value;
}

/* Returns the field at depth t on a packet's rays, in the single cell of `map` and the interval i. */
static __attribute__((noinline, unused)) vf kernel_evaluate_field_in_one_cell(kernel_packet *p, const kernel_map *map,
                                                                              const kernel_interval *i, vm rays, vf t)
{
    const kernel_rays own = kernel_packet_rays(p);
    vf r[3];
    kernel_reference_on_chord(i, t, r);
    return kernel_evaluate_field_on_rays(&own, map, i, rays, t, r, &p->thread->map_failures);
}

SIMD_INLINE void kernel_get_points_at_interval_ends(const kernel_interval *i, kernel_point *in, kernel_point *out)
{
    in->t = i->t_in;
    in->value = i->v_in;
    out->t = i->t_out;
    out->value = i->v_out;
    memcpy(in->r, i->r_in, sizeof in->r);
    memcpy(out->r, i->r_out, sizeof out->r);
}

/* Interpolates the reference coordinates at depth t linearly between those of two points of each ray. */
SIMD_INLINE void kernel_reference_between(const kernel_point *low, const kernel_point *high, vf t, vf r[3])
{
    const vf length = high->t - low->t;
    const vf along = vf_select(vf_lt(vf_set(0), length), (t - low->t) / length, vf_set(0));
    for (int a = 0; a < 3; a++) r[a] = low->r[a] + along * (high->r[a] - low->r[a]);
}

/* Upper bound of the difference, caused by rounding, between the value computed on a face and the field of the cell at
 * the same point, if the largest magnitude of a vertex value is near 1. */
#define KERNEL_FACE_BAND 1e-6f

/* Upper bounds for a set of rays in tile space. spread: of |x| and |y|, where (x, y, 1) is a ray's direction. */
typedef struct kernel_beam {
    float spread;
    float offset; /* largest |origin_x| and |origin_y| of the rays */
} kernel_beam;

#endif
