/* Finds the crossings of rays with the isovalue in cuboids: hexes whose edges are parallel to the axes, as those of
 * uniform and rectilinear grids. Their map is affine, so that along a ray the reference coordinates are linear in the
 * depth, and the field is a cubic polynomial of it:
 *     r = y + w t,        F(r) = k0 + k1 s + k2 s^2 + k3 s^3,
 * where s is 0 and 1 at the ends of the ray's interval in the cell, which lies between the planes of the cell's faces.
 * The number of sign changes of the polynomial's Bernstein coefficients is an upper bound of its number of roots, and
 * exact if it is 0 or 1 (Descartes' rule of signs; Farouki, "The Bernstein polynomial basis", 2012):
 *     none    All coefficients have the same sign: the ray has no root in the cell.
 *     one     They change their sign once: Newton's method finds the root.
 * Rays with two or three sign changes are undecided: kernel_curved_batch.h traces them by the methods for all hexes. So
 * are rays with a root so close to a face that rounding decides in which cell it is. To recognize these, the interval
 * is that of the cell widened by domain_margin (in reference coordinates), a root is accepted only if it is inside the
 * cell by more than domain_margin, and the sign of a coefficient counts only if its magnitude exceeds value_error. The
 * field is that of kernel_bounds.h: minus the isovalue, scaled so that its largest magnitude at a vertex is near 1. */
#ifndef RENDER_KERNEL_CUBOIDS_H
#define RENDER_KERNEL_CUBOIDS_H

#include <math.h>

#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_contraction.h"
#include "kernel_map.h"
#include "kernel_tile_trace.h"
#include "kernel_transformed_curved.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum { KERNEL_CUBOID_STEPS = 8 };

/* Newton's method has converged when a step in s is shorter than this; one last step follows. The error after that step
 * is at most the square of this number, times half the ratio of the polynomial's second derivative to its first. */
#define KERNEL_CUBOID_END 1e-4f

/* Upper bound of the rounding error of a Bernstein coefficient, with u = 6e-8. The field's magnitude at vertices is at
 * most 2. So the magnitudes of the eight coefficients of the field's polynomial are at most 2 (one coefficient), 4
 * (three), 8 (three) and 16 (one). The first is exact, and the others have errors of at most u times 4, 24 and 72 each:
 * 1e-5 together. The sums of the absolute values of all terms of k0 to k3 are at most 54, 108, 72 and 16; each term has
 * up to nine roundings, which amounts to 9 u × 250 = 1.4e-4. */
#define KERNEL_CUBOID_ROUNDING 1.5e-4f

/* Coefficients and error bounds of cuboids, one cuboid per lane. */
typedef struct kernel_cuboids {
    /* inverse of the Jacobian of the map from reference coordinates to tile space, by row, column and lane */
    float normal[3][3][SIMD_WIDTH];
    float field[8][SIMD_WIDTH]; /* coefficients of the field's polynomial (kernel_map.h) */
    /* error bound of the field's Bernstein coefficients along a ray, for a field whose largest magnitude is near 1 */
    float value_error[SIMD_WIDTH];
    /* By how much cells are widened, in reference coordinates, when a ray's interval is computed; a root that is less
     * than this inside the cell is undecided (top of this file). Infinite for cells that are not cuboids. */
    float domain_margin[SIMD_WIDTH];
} kernel_cuboids;

/* Computes the rows of the inverse Jacobians in tile space (out->normal), for the first half of the lanes (half = 0) or
 * the second. The vertices are sorted by coordinates, so that vertices 1, 3 and 4 are the neighbours of vertex 0 along
 * z, y and x. */
SIMD_INLINE void kernel_cuboids_compute_inverse_jacobians(const kernel_transformed_curved *cells, const kernel_frame *f,
                                                          const kernel_tile *tile, int half, kernel_cuboids *out)
{
    static const int neighbour[3] = {1, 3, 4};
    const double scale = f->job->space.scale, shear_x = f->job->camera.is_orthographic ? 0 : tile->centre_x;
    const double shear_y = f->job->camera.is_orthographic ? 0 : tile->centre_y;
    for (int i = 0; i < 3; i++) {
        const int axis = 2 - i;
        const kernel_f64 size = cells->world[neighbour[i]][axis][half] - cells->world[0][axis][half];
        const kernel_f64 inverse = 1 / (size * (scale * scale));
        kernel_f64 row[3];
        for (int a = 0; a < 3; a++) row[a] = f->scaled_axes[a][axis] * inverse;
        row[2] += shear_x * row[0] + shear_y * row[1];
        for (int a = 0; a < 3; a++) kernel_f64_store_half(out->normal[i][a], half, row[a]);
    }
}

/* Returns an upper bound of the magnitude of the field's derivative along reference axis i, by the differences along
 * the cell's four edges in that direction. */
SIMD_INLINE vf kernel_cuboids_bound_field_derivative(const float values[8][SIMD_WIDTH], int i)
{
    static const signed char edges[3][4][2] = {
        {{0, 1}, {3, 2}, {4, 5}, {7, 6}}, {{0, 3}, {1, 2}, {4, 7}, {5, 6}}, {{0, 4}, {1, 5}, {2, 6}, {3, 7}}};
    vf most = vf_set(0);
    for (int n = 0; n < 4; n++)
        most = vf_max(vf_abs(vf_load(values[edges[i][n][0]]) - vf_load(values[edges[i][n][1]])), most);
    return most;
}

/* Computes value_error and domain_margin of the lanes in `cuboid`. In the code, reach is the largest magnitude of the
 * vertices' coordinates, gap an upper bound of the distance between a face's computed crossing and the ray, and own an
 * error bound of a ray's reference coordinates; gap and own are in reference coordinates. The comments on
 * kernel_f64_compute_bounds() and kernel_bounds_store_iteration_errors() derive gap and own; both are doubled here as
 * they are there. */
SIMD_INLINE void kernel_cuboids_compute_error_bounds(const kernel_transformed_curved *cells, const kernel_beam *beam,
                                                     vm cuboid, kernel_cuboids *out)
{
    vf reach[3], extent[3], margin = vf_set(4e-6f), error = vf_set(KERNEL_CUBOID_ROUNDING);
    for (int a = 0; a < 3; a++) {
        const vf origin = vf_load(cells->at[a][0]);
        reach[a] = vf_abs(origin);
        extent[a] = vf_set(0);
        for (int n = 1; n < 8; n++) {
            const vf at = vf_load(cells->at[a][n]);
            reach[a] = vf_max(vf_abs(at), reach[a]);
            extent[a] = vf_max(vf_abs(at - origin), extent[a]);
        }
    }
    const vf across = 2e-6f * ((reach[0] + reach[1]) + (beam->offset + beam->spread * reach[2]));
    for (int i = 0; i < 3; i++) {
        vf size[3];
        for (int a = 0; a < 3; a++) size[a] = vf_abs(vf_load(out->normal[i][a]));
        const vf gap = across * (size[0] + size[1]) + 1e-6f * (reach[2] * size[2]);
        vf own = 0.125f * (across * (size[0] + size[1]));
        for (int a = 0; a < 3; a++) own += 3e-7f * (size[a] * extent[a]);
        margin += 2 * (gap + own);
        error += 2 * ((gap + own) * kernel_cuboids_bound_field_derivative(cells->at[3], i));
    }
    cuboid = vm_and(cuboid, vf_lt(margin, vf_set(0.015625f)));
    vf_store(out->domain_margin, vf_select(cuboid, margin, vf_set(INFINITY)));
    vf_store(out->value_error, error);
}

/* Computes the coefficients and error bounds of the lanes' cells. */
static __attribute__((noinline)) void kernel_cuboids_compute_coefficients(const kernel_transformed_curved *cells,
                                                                          const kernel_frame *f,
                                                                          const kernel_tile *tile, kernel_cuboids *out)
{
    const kernel_beam beam = kernel_bound_rays_of_tile(f, tile);
    vf v[8], c[8];
    for (int i = 0; i < 8; i++) v[i] = vf_load(cells->at[3][i]);
    KERNEL_HEX_FIT(c, v);
    for (int i = 0; i < 8; i++) vf_store(out->field[i], c[i]);
    for (int half = 0; half < 2; half++) kernel_cuboids_compute_inverse_jacobians(cells, f, tile, half, out);
    kernel_cuboids_compute_error_bounds(cells, &beam, vm_from_bits(cells->cuboids), out);
}

/* A ray's interval in its cell widened by domain_margin, and the field along it, one ray per lane. */
typedef struct kernel_cuboid_ray {
    /* members of kernel_cuboids, gathered from each ray's cell */
    vf normal[3][3], field[8], value_error, domain_margin;
    vf origin[3];     /* vertex 0 in tile space */
    vf begin, length; /* depth of the interval's begin relative to vertex 0, and the interval's length in depth */
    vf r[3], d[3];    /* reference coordinates at the interval's begin, and their change from there to its end */
    vf k[4];          /* coefficients k0 to k3 of the field's polynomial in s */
} kernel_cuboid_ray;

/* Computes the interval of each ray in its widened cell, and stores it in *out. at: x, y and z of the cells' vertices,
 * by vertex and lane. Returns the rays that have an interval. */
SIMD_INLINE vm kernel_cuboid_interval(const kernel_cuboids *cells, const float (*at)[8][SIMD_WIDTH],
                                      const kernel_lane_rays *p, kernel_cuboid_ray *out)
{
    const vi lane = p->lane;
    const kernel_rays *rays = &p->rays;
    vf begin = vf_set(-INFINITY), end = vf_set(INFINITY), w[3], y[3];
    for (int a = 0; a < 3; a++) out->origin[a] = kernel_gather_lane(at[a][0], lane);
    out->domain_margin = kernel_gather_lane(cells->domain_margin, lane);
    const vf x_apart = (rays->origin_x + rays->slope_x * out->origin[2]) - out->origin[0];
    const vf y_apart = (rays->origin_y + rays->slope_y * out->origin[2]) - out->origin[1];
    for (int i = 0; i < 3; i++) {
        vf *const normal = out->normal[i];
        for (int a = 0; a < 3; a++) normal[a] = kernel_gather_lane(cells->normal[i][a], lane);
        y[i] = normal[0] * x_apart + normal[1] * y_apart;
        w[i] = (normal[0] * rays->slope_x + normal[1] * rays->slope_y) + normal[2];
        const vf inverse = 1.0f / w[i];
        const vf low = (-out->domain_margin - y[i]) * inverse, high = ((1 + out->domain_margin) - y[i]) * inverse;
        begin = vf_max(vf_min(low, high), begin);
        end = vf_min(vf_max(low, high), end);
    }
    out->begin = begin;
    out->length = end - begin;
    for (int i = 0; i < 3; i++) {
        out->r[i] = y[i] + w[i] * begin;
        out->d[i] = w[i] * out->length;
    }
    return vf_le(begin, end);
}

/* Computes the coefficients k0 to k3 of the cubic polynomial in s that is the field along each ray's interval. lane:
 * the lane that holds each ray's cell. */
SIMD_INLINE void kernel_cuboid_compute_polynomial(const kernel_cuboids *cells, vi lane, kernel_cuboid_ray *ray)
{
    const vf *c = ray->field, *r = ray->r, *d = ray->d;
    vf g[3];
    for (int i = 0; i < 8; i++) ray->field[i] = kernel_gather_lane(cells->field[i], lane);
    ray->value_error = kernel_gather_lane(cells->value_error, lane);
    const kernel_product m = kernel_compute_coordinate_product(false, r);
    kernel_polynomial_gradient(c, false, &m, r, g);
    ray->k[0] = kernel_polynomial_value(c, false, &m, r);
    ray->k[1] = kernel_dot(g, d);
    ray->k[2] =
        (d[0] * d[1]) * (c[4] + c[7] * r[2]) + d[2] * (d[0] * (c[5] + c[7] * r[1]) + d[1] * (c[6] + c[7] * r[0]));
    ray->k[3] = c[7] * (d[0] * (d[1] * d[2]));
}

/* Finds the rays without a root in their interval (*none) and those with exactly one (*one), by the signs of the
 * Bernstein coefficients. For rays with one root, *s becomes the zero of the line through the field's values at the
 * interval's ends. */
SIMD_INLINE void kernel_cuboid_count_roots(const kernel_cuboid_ray *ray, vm *none, vm *one, vf *s)
{
    const vf *k = ray->k, error = ray->value_error, zero = vf_set(0), third = vf_set(1.0f / 3);
    const vf b[4] = {k[0], k[0] + third * k[1], k[0] + third * (2 * k[1] + k[2]), (k[0] + k[1]) + (k[2] + k[3])};
    const vf low = vf_min(vf_min(b[0], b[1]), vf_min(b[2], b[3]));
    const vf high = vf_max(vf_max(b[0], b[1]), vf_max(b[2], b[3]));
    const vm falls = vf_lt(b[3], b[0]);
    const vf first = vf_select(falls, b[0], -b[0]), second = vf_select(falls, b[1], -b[1]);
    const vf third_one = vf_select(falls, b[2], -b[2]), last = vf_select(falls, b[3], -b[3]);
    const vm ends = vm_and(vf_lt(error, first), vf_lt(last, -error));
    *none = vm_or(vf_lt(error, low), vf_lt(high, -error));
    *one = vm_andnot(ends, vm_and(vf_lt(second, error), vf_lt(-error, third_one)));
    *s = vf_select(ends, b[0] / (b[0] - b[3]), zero);
}

/* Returns the derivative of the field's polynomial at s. */
SIMD_INLINE vf kernel_cuboid_derivative(const vf k[4], vf s)
{
    return k[1] + s * (2 * k[2] + s * (3 * k[3]));
}

/* Refines the root *s of the given rays by Newton's method; a step that leaves the bracket of the root is replaced by a
 * bisection. Returns the rays whose roots have not converged. A root that has converged is not changed any more, so
 * that it does not depend on the other rays. */
SIMD_INLINE vm kernel_cuboid_refine_root(const kernel_cuboid_ray *ray, vm rays, vf *s)
{
    vf low = vf_set(0), high = vf_set(1);
    const vm falls = vf_lt(vf_set(0), ray->k[0]);
    vm open = rays;
    for (int step = 0; step < KERNEL_CUBOID_STEPS && vm_any(open); step++) {
        const vf *k = ray->k, value = k[0] + *s * (k[1] + *s * (k[2] + *s * k[3]));
        const vm before = vm_not(vm_xor(falls, vf_lt(vf_set(0), value)));
        low = vf_select(before, *s, low);
        high = vf_select(before, high, *s);
        vf next = *s - value / kernel_cuboid_derivative(ray->k, *s);
        next = vf_select(vm_and(vf_le(low, next), vf_le(next, high)), next, 0.5f * (low + high));
        const vf move = vf_abs(next - *s);
        *s = vf_select(open, next, *s);
        open = vm_andnot(open, vf_lt(move, vf_set(KERNEL_CUBOID_END)));
    }
    return open;
}

/* Returns the field at the reference coordinates r in each ray's cell, interpolated between the values at the vertices.
 * Its error is four roundings of the largest value, which is less than the error of the field's polynomial. */
SIMD_INLINE vf kernel_cuboid_interpolate_field(const float values[8][SIMD_WIDTH], vi lane, const vf r[3])
{
    vf v[8];
    for (int i = 0; i < 8; i++) v[i] = kernel_gather_lane(values[i], lane);
    for (int i = 0; i < 8; i += 4) {
        const vf low = v[i] + r[0] * (v[i + 1] - v[i]), high = v[i + 3] + r[0] * (v[i + 2] - v[i + 3]);
        v[i] = low + r[1] * (high - low);
    }
    return v[0] + r[2] * (v[4] - v[0]);
}

/* Finds the roots of the given rays, whose cells must be cuboids. at: x, y, z and the field of the cells' vertices, by
 * vertex and lane. out->mask: rays with exactly one root; *none: rays without a root; other rays are undecided.
 * gradient: the field's gradient at the roots, in tile space. */
SIMD_INLINE void kernel_cuboid_find_roots(const kernel_cuboids *cells, const float (*at)[8][SIMD_WIDTH],
                                          const kernel_lane_rays *p, vm rays, kernel_point *out, vm *none,
                                          vf gradient[3])
{
    kernel_cuboid_ray ray;
    vf s, g[3];
    const vm within = kernel_cuboid_interval(cells, at, p, &ray);
    out->mask = vm_none();
    *none = vm_andnot(rays, within);
    rays = vm_and(rays, within);
    if (!vm_any(rays)) return;
    kernel_cuboid_compute_polynomial(cells, p->lane, &ray);
    vm no_root;
    kernel_cuboid_count_roots(&ray, &no_root, &out->mask, &s);
    *none = vm_or(*none, vm_and(rays, no_root));
    out->mask = vm_and(rays, out->mask);
    if (!vm_any(out->mask)) return;
    out->mask = vm_andnot(out->mask, kernel_cuboid_refine_root(&ray, out->mask, &s));
    for (int i = 0; i < 3; i++) out->r[i] = ray.r[i] + s * ray.d[i];
    s -= kernel_cuboid_interpolate_field(at[3], p->lane, out->r) / kernel_cuboid_derivative(ray.k, s);
    for (int i = 0; i < 3; i++) {
        out->r[i] = ray.r[i] + s * ray.d[i];
        const vm inside = vm_and(vf_lt(ray.domain_margin, out->r[i]), vf_lt(out->r[i], 1 - ray.domain_margin));
        out->mask = vm_and(out->mask, inside);
    }
    out->t = ray.origin[2] + (ray.begin + s * ray.length);
    const kernel_product m = kernel_compute_coordinate_product(false, out->r);
    kernel_polynomial_gradient(ray.field, false, &m, out->r, g);
    for (int a = 0; a < 3; a++)
        gradient[a] = (g[0] * ray.normal[0][a] + g[1] * ray.normal[1][a]) + g[2] * ray.normal[2][a];
}

#endif
