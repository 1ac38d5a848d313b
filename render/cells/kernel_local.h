/* Computes the reference coordinates of points in cells, one point per lane, each in its own cell.
 *
 * A cell's map takes its reference coordinates r to the position X(r). In coordinates that are counted from the cell's
 * middle, the map is linear except for a few nonlinear terms:
 *     X(r) = X0 + M r + (nonlinear terms)      and so with A = 1 / M      y = A (X - X0) = r + n(r)
 * n, the map's nonlinear part, is small if the cell is not far from a parallelepiped. y, an affine function of the
 * position, approximates r. From y, r is computed by Newton's method, usually in two steps with the same derivatives.
 * Hexes have the nonlinear terms ρσ, ρκ, σκ and ρσκ, wedges ρκ and σκ, and a pyramid αβ / k:
 *              r                              inside
 *     hex      (ρ, σ, κ) from the middle      |ρ|, |σ|, |κ| <= 1/2
 *     wedge    ρ, σ from the triangle's       ρ, σ >= -1/3, ρ + σ <= 1/3, |κ| <= 1/2
 *              centroid, κ from the middle
 *     pyramid  α, β from the axis; k is 0     |α|, |β| <= k / 2, k <= 1
 *              at the apex
 * The Frobenius norm of n's derivative must be less than 0.78 or 0.89 (KERNEL_LOCAL_BENT, KERNEL_LOCAL_BENT_MOST) at
 * every corner; other cells are not processed in lanes. The norm is convex along each coordinate, so it is nowhere
 * larger in the cell, and so r -> r + n(r) maps no two points of the cell to the same point. Reference coordinates are
 * counted from the middle here and from a corner in kernel_map.h; both describe the same points. */
#ifndef RENDER_KERNEL_LOCAL_H
#define RENDER_KERNEL_LOCAL_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum { KERNEL_NONLINEAR_TERMS = 4, KERNEL_LOCAL_STEPS = 4 };

/* Limits of the squared Frobenius norm of the derivative of n, the nonlinear part of a cell's map: 0.78 squared and
 * 0.89 squared. The second limit is for callers that compute their own bound of the error of reference coordinates. */
#define KERNEL_LOCAL_BENT 0.6f
#define KERNEL_LOCAL_BENT_MOST 0.8f

/* The maps of one cell per lane. field: the field at the middle, its derivatives along the three reference coordinates
 * there, and the coefficients of its nonlinear terms. */
typedef struct kernel_local_cells {
    /* affine approximation y of the reference coordinates of a position X: y = inverse (X - origin) + offset */
    float origin[3][SIMD_WIDTH], inverse[3][3][SIMD_WIDTH], offset[3][SIMD_WIDTH];
    float nonlinear_part[KERNEL_NONLINEAR_TERMS][3][SIMD_WIDTH];
    float field[4 + KERNEL_NONLINEAR_TERMS][SIMD_WIDTH];
    /* bounds of y, the affine approximation of the reference coordinates, over all points inside the cell */
    float low[3][SIMD_WIDTH], high[3][SIMD_WIDTH];
    /* upper bound of the squared Frobenius norm of the derivative of n, the map's nonlinear part */
    float bend[SIMD_WIDTH];
    /* upper bound of the error of computed reference coordinates r; if r is closer than this to the border of the
     * reference domain, the point may be inside or outside the cell */
    float error_bound[SIMD_WIDTH];
} kernel_local_cells;

SIMD_INLINE int kernel_nonlinear_count(int type)
{
    return KERNEL_BY_SHAPE(type, 4, 2, 1);
}

/* Computes the polynomial coefficients of the field, or of one coordinate, from its values v at a hex's vertices. out:
 * the value at the middle, then the coefficients of the three linear terms, then those of the nonlinear terms. The
 * functions below do the same for other types. */
SIMD_INLINE void kernel_fit_hex_polynomial(const vf v[8], vf out[8])
{
    const vf p0 = v[0] + v[1], p1 = v[3] + v[2], p2 = v[4] + v[5], p3 = v[7] + v[6];
    const vf m0 = v[1] - v[0], m1 = v[2] - v[3], m2 = v[5] - v[4], m3 = v[6] - v[7];
    const vf pp0 = p0 + p1, pp1 = p2 + p3, pm0 = p1 - p0, pm1 = p3 - p2;
    const vf mp0 = m0 + m1, mp1 = m2 + m3, mm0 = m1 - m0, mm1 = m3 - m2;
    out[0] = 0.125f * (pp0 + pp1);
    out[1] = 0.25f * (mp0 + mp1);
    out[2] = 0.25f * (pm0 + pm1);
    out[3] = 0.25f * (pp1 - pp0);
    out[4] = 0.5f * (mm0 + mm1);
    out[5] = 0.5f * (mp1 - mp0);
    out[6] = 0.5f * (pm1 - pm0);
    out[7] = mm1 - mm0;
}

SIMD_INLINE void kernel_fit_wedge_polynomial(const vf v[6], vf out[8])
{
    const vf low = (v[0] + v[1]) + v[2], high = (v[3] + v[4]) + v[5];
    out[0] = (low + high) * (1.0f / 6);
    out[1] = 0.5f * ((v[1] - v[0]) + (v[4] - v[3]));
    out[2] = 0.5f * ((v[2] - v[0]) + (v[5] - v[3]));
    out[3] = (high - low) * (1.0f / 3);
    out[4] = (v[4] - v[3]) - (v[1] - v[0]);
    out[5] = (v[5] - v[3]) - (v[2] - v[0]);
}

SIMD_INLINE void kernel_fit_pyramid_polynomial(const vf v[5], vf out[8])
{
    const vf along = v[1] - v[0], across = v[3] - v[0], nonlinear_part = (v[0] - v[1]) + (v[2] - v[3]);
    out[0] = v[4];
    out[1] = along + 0.5f * nonlinear_part;
    out[2] = across + 0.5f * nonlinear_part;
    out[3] = 0.25f * ((v[0] + v[1]) + (v[2] + v[3])) - v[4];
    out[4] = nonlinear_part;
}

SIMD_INLINE void kernel_local_fit_polynomial(int type, const vf *v, vf out[8])
{
    if (kernel_is_box(type))
        kernel_fit_hex_polynomial(v, out);
    else if (kernel_is_prism(type))
        kernel_fit_wedge_polynomial(v, out);
    else
        kernel_fit_pyramid_polynomial(v, out);
}

/* Computes the products of reference coordinates that are the nonlinear terms of a cell's map. term[k]: product k at r;
 * slopes[k][i]: its derivative along reference coordinate i. */
SIMD_INLINE void kernel_nonlinear_terms_at(int type, const vf r[3], vf term[KERNEL_NONLINEAR_TERMS],
                                           vf slopes[KERNEL_NONLINEAR_TERMS][3])
{
    const vf zero = vf_set(0);
    if (kernel_is_box(type)) {
        term[0] = r[0] * r[1];
        term[1] = r[0] * r[2];
        term[2] = r[1] * r[2];
        term[3] = term[0] * r[2];
        const vf along[4][3] = {
            {r[1], r[0], zero}, {r[2], zero, r[0]}, {zero, r[2], r[1]}, {term[2], term[1], term[0]}};
        memcpy(slopes, along, sizeof along);
    } else if (kernel_is_prism(type)) {
        term[0] = r[0] * r[2];
        term[1] = r[1] * r[2];
        const vf along[2][3] = {{r[2], zero, r[0]}, {zero, r[2], r[1]}};
        memcpy(slopes, along, sizeof along);
    } else {
        /* inside the cell |α / k| and |β / k| are at most 1/2; the clamp limits steps beyond the apex */
        const vf half = vf_set(0.75f), inverse = 1.0f / vf_max(r[2], vf_set(1e-6f));
        const vf a = vf_clamp(r[0] * inverse, -half, half), c = vf_clamp(r[1] * inverse, -half, half);
        term[0] = a * r[1];
        const vf along[1][3] = {{c, a, -(a * c)}};
        memcpy(slopes, along, sizeof along);
    }
}

/* Converts reference coordinates r from those of kernel_map.h, which are counted from a corner, to those of this file,
 * which are counted from the middle. */
SIMD_INLINE void kernel_local_shift_reference_origin(int type, vf r[3])
{
    vf middle = vf_set(kernel_is_box(type) ? 0.5f : 1.0f / 3);
    if (kernel_has_apex(type)) middle = 0.5f * r[2];
    for (int a = 0; a < 2; a++) r[a] -= middle;
    if (!kernel_has_apex(type)) r[2] -= 0.5f;
}

/* Returns the distance, in reference coordinates, of r from the border of the reference domain; it is negative
 * outside. */
SIMD_INLINE vf kernel_local_border_distance(int type, const vf r[3])
{
    if (kernel_is_box(type)) return 0.5f - vf_max(vf_max(vf_abs(r[0]), vf_abs(r[1])), vf_abs(r[2]));
    if (kernel_is_prism(type)) {
        const vf within = vf_min(vf_min(r[0], r[1]) + 1.0f / 3, 1.0f / 3 - (r[0] + r[1]));
        return vf_min(within, 0.5f - vf_abs(r[2]));
    }
    if (kernel_has_apex(type)) return vf_min(0.5f * r[2] - vf_max(vf_abs(r[0]), vf_abs(r[1])), 1.0f - r[2]);
    return vf_min(vf_min(vf_min(r[0], r[1]), r[2]) + 0.25f, 0.25f - ((r[0] + r[1]) + r[2]));
}

/* ---- maps of cells ---- */

/* Returns an upper bound, over the cell, of the squared Frobenius norm of the derivative of n, the nonlinear part of
 * the cell's map. For hexes and wedges it is the maximum at the corners. */
SIMD_INLINE vf kernel_local_bound_nonlinearity(int type, const vf nonlinear_part[KERNEL_NONLINEAR_TERMS][3])
{
    static const float corners[2][8][3] = {{{-0.5f, -0.5f, -0.5f},
                                            {0.5f, -0.5f, -0.5f},
                                            {0.5f, 0.5f, -0.5f},
                                            {-0.5f, 0.5f, -0.5f},
                                            {-0.5f, -0.5f, 0.5f},
                                            {0.5f, -0.5f, 0.5f},
                                            {0.5f, 0.5f, 0.5f},
                                            {-0.5f, 0.5f, 0.5f}},
                                           {{-1.0f / 3, -1.0f / 3, -0.5f},
                                            {2.0f / 3, -1.0f / 3, -0.5f},
                                            {-1.0f / 3, 2.0f / 3, -0.5f},
                                            {-1.0f / 3, -1.0f / 3, 0.5f},
                                            {2.0f / 3, -1.0f / 3, 0.5f},
                                            {-1.0f / 3, 2.0f / 3, 0.5f}}};
    const vf *b0 = nonlinear_part[0];
    vf most = vf_set(0);
    /* the derivatives of αβ / k along k, α and β are at most 1/4, 1/2 and 1/2 */
    if (kernel_has_apex(type)) return 0.5625f * ((b0[0] * b0[0] + b0[1] * b0[1]) + b0[2] * b0[2]);
    for (int n = 0; n < (kernel_is_box(type) ? 8 : kernel_is_prism(type) ? 6 : 0); n++) {
        const float *corner = corners[kernel_is_box(type) ? 0 : 1][n];
        const vf r[3] = {vf_set(corner[0]), vf_set(corner[1]), vf_set(corner[2])};
        vf term[KERNEL_NONLINEAR_TERMS], slopes[KERNEL_NONLINEAR_TERMS][3], sum = vf_set(0);
        kernel_nonlinear_terms_at(type, r, term, slopes);
        for (int i = 0; i < 3; i++)
            for (int a = 0; a < 3; a++) {
                vf slope = vf_set(0);
                for (int k = 0; k < kernel_nonlinear_count(type); k++) slope += nonlinear_part[k][a] * slopes[k][i];
                sum += slope * slope;
            }
        most = vf_max(sum, most);
    }
    return most;
}

/* Inverts the 3 × 3 matrix whose row a is m[a][1], m[a][2], m[a][3]. Returns its determinant. */
SIMD_INLINE vf kernel_local_invert(const vf m[3][8], vf inverse[3][3])
{
    for (int i = 0; i < 3; i++) {
        const int u = 1 + (i + 1) % 3, v = 1 + (i + 2) % 3;
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            inverse[i][a] = m[b][u] * m[c][v] - m[c][u] * m[b][v];
        }
    }
    const vf det = (m[0][1] * inverse[0][0] + m[1][1] * inverse[0][1]) + m[2][1] * inverse[0][2], one = 1.0f / det;
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) inverse[i][a] *= one;
    return det;
}

/* Computes the bounds `low` and `high` of y, the affine approximation of the reference coordinates: the range of y over
 * all vertices, widened by the error bound. The bounds hold in the whole cell, because each point of the cell is a mean
 * of the vertices with non-negative weights. at: positions of the vertices relative to vertex 0. */
SIMD_INLINE void kernel_local_affine_bounds(int count, const vf at[3][8], const vf inverse[3][3], const vf offset[3],
                                            kernel_local_cells *out)
{
    const vf pad = 1e-3f + vf_load(out->error_bound);
    for (int i = 0; i < 3; i++) {
        vf low = vf_set(INFINITY), high = vf_set(-INFINITY);
        for (int n = 0; n < count; n++) {
            const vf y = ((inverse[i][0] * at[0][n] + inverse[i][1] * at[1][n]) + inverse[i][2] * at[2][n]) + offset[i];
            low = vf_min(y, low);
            high = vf_max(y, high);
        }
        vf_store(out->low[i], low - pad);
        vf_store(out->high[i], high + pad);
    }
}

/* Computes an upper bound of the error of the reference coordinates r (kernel_local_cells.error_bound). Four errors add
 * up: crossings of faces (kernel_quad.h) have errors of 3e-7 of the cell's size, and of half a unit in the last place
 * of their depth; x and y of vertices have errors of a few units in the last place; Newton's method leaves an error of
 * 2e-6 in r; and positions from which r is computed have errors of a few units in the last place. */
SIMD_INLINE void kernel_local_error_bound(int count, const vf places[3][8], const vf inverse[3][3],
                                          kernel_local_cells *out)
{
    vf size[3], most = vf_set(0);
    for (int a = 0; a < 3; a++) {
        size[a] = vf_set(0);
        for (int n = 0; n < count; n++) size[a] = vf_max(vf_abs(places[a][n]), size[a]);
    }
    for (int i = 0; i < 3; i++)
        most = vf_max((vf_abs(inverse[i][0]) * size[0] + vf_abs(inverse[i][1]) * size[1]) * 4.0f +
                          vf_abs(inverse[i][2]) * size[2],
                      most);
    vf_store(out->error_bound, 4e-6f + 1.2e-7f * most);
}

/* Computes the maps of one cell of this type per lane. places: vertices in tile space; values: the field at them.
 * Returns the lanes whose map can be inverted: those with `bend` (kernel_local_cells) below most_bent and with an error
 * bound below 0.05. The data of other lanes must not be used. */
SIMD_INLINE vm kernel_local_compute_maps(int type, const vf places[3][8], const vf values[8], float most_bent,
                                         kernel_local_cells *out)
{
    const int count = grid_type_vertex_count(type), bends = kernel_nonlinear_count(type);
    vf at[3][8], terms[3][8], field[8], inverse[3][3], offset[3], nonlinear_part[KERNEL_NONLINEAR_TERMS][3];
    for (int a = 0; a < 3; a++) {
        for (int n = 0; n < count; n++) at[a][n] = places[a][n] - places[a][0];
        kernel_local_fit_polynomial(type, at[a], terms[a]);
        vf_store(out->origin[a], places[a][0]);
    }
    kernel_local_fit_polynomial(type, values, field);
    for (int n = 0; n < 4 + bends; n++) vf_store(out->field[n], field[n]);
    kernel_local_invert((const vf(*)[8])terms, inverse);
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) vf_store(out->inverse[i][a], inverse[i][a]);
        offset[i] = -((inverse[i][0] * terms[0][0] + inverse[i][1] * terms[1][0]) + inverse[i][2] * terms[2][0]);
        vf_store(out->offset[i], offset[i]);
        for (int k = 0; k < bends; k++) {
            nonlinear_part[k][i] = inverse[i][0] * terms[0][4 + k] + inverse[i][1] * terms[1][4 + k];
            nonlinear_part[k][i] += inverse[i][2] * terms[2][4 + k];
            vf_store(out->nonlinear_part[k][i], nonlinear_part[k][i]);
        }
    }
    kernel_local_error_bound(count, places, (const vf(*)[3])inverse, out);
    kernel_local_affine_bounds(count, (const vf(*)[8])at, (const vf(*)[3])inverse, offset, out);
    const vm sharp = vf_lt(vf_load(out->error_bound), vf_set(0.05f));
    const vf bend = kernel_local_bound_nonlinearity(type, (const vf(*)[3])nonlinear_part);
    vf_store(out->bend, bend);
    return vm_and(sharp, vf_lt(bend, vf_set(most_bent)));
}

/* ---- reference coordinates of points ---- */

/* Points, one per lane, each in its own cell. y: affine approximation of the point's reference coordinates r;
 * nonlinear_part: the coefficients of n, the nonlinear part of the cell's map. */
typedef struct kernel_local_points {
    vf y[3], r[3], nonlinear_part[KERNEL_NONLINEAR_TERMS][3];
    /* The nonlinear terms of the map (products of the reference coordinates) at the current r, and their
     * derivatives. */
    vf term[KERNEL_NONLINEAR_TERMS], slopes[KERNEL_NONLINEAR_TERMS][3];
    /* column: columns of the adjugate of the Jacobian of r + n(r); det: 1 divided by the Jacobian's determinant */
    vf column[3][3], det;
} kernel_local_points;

/* Computes the residual y - (r + n(r)) of Newton's method, where y is the affine approximation of the reference
 * coordinates r and n the map's nonlinear part. */
SIMD_INLINE void kernel_local_newton_residual(int type, const kernel_local_points *p, vf out[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = p->y[a] - p->r[a];
        for (int k = 0; k < kernel_nonlinear_count(type); k++)
            out[a] = vf_muladd(-p->nonlinear_part[k][a], p->term[k], out[a]);
    }
}

SIMD_INLINE void kernel_local_compute_inverse_jacobian(int type, kernel_local_points *p)
{
    /* derivatives of r + n(r) along each component of the reference coordinates r, where n is the map's nonlinear
     * part */
    vf j[3][3];
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) {
            j[i][a] = vf_set(i == a);
            for (int k = 0; k < kernel_nonlinear_count(type); k++)
                j[i][a] = vf_muladd(p->nonlinear_part[k][a], p->slopes[k][i], j[i][a]);
        }
    for (int i = 0; i < 3; i++) {
        const vf *u = j[(i + 1) % 3], *v = j[(i + 2) % 3];
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            p->column[i][a] = vf_muladd(u[b], v[c], -(u[c] * v[b]));
        }
    }
    const vf *c = p->column[0];
    p->det = 1.0f / vf_muladd(j[0][0], c[0], vf_muladd(j[0][1], c[1], j[0][2] * c[2]));
}

/* Does a step of Newton's method in the given lanes, with the derivatives that the last call of
 * kernel_local_compute_inverse_jacobian() computed. Returns the magnitude of the largest component of each lane's step.
 */
SIMD_INLINE vf kernel_local_step(int type, kernel_local_points *p, vm lanes)
{
    const vf most = vf_set(1), far = vf_set(1.25f);
    vf left[3], largest = vf_set(0);
    kernel_local_newton_residual(type, p, left);
    for (int i = 0; i < 3; i++) {
        const vf *c = p->column[i];
        const vf sum = vf_muladd(c[0], left[0], vf_muladd(c[1], left[1], c[2] * left[2]));
        const vf move = vf_clamp(sum * p->det, -most, most);
        largest = vf_max(largest, vf_abs(move));
        p->r[i] = vf_select(lanes, vf_clamp(p->r[i] + move, -far, far), p->r[i]);
    }
    kernel_nonlinear_terms_at(type, p->r, p->term, p->slopes);
    return largest;
}

/* Computes the reference coordinates r of the points at the positions `at` in tile space. lane: the lane that holds
 * each point's cell in `cells`. Returns the lanes whose r is accurate to 1e-6. A lane's result does not depend on the
 * other lanes. */
SIMD_INLINE vm kernel_local_invert_maps(int type, const kernel_local_cells *cells, vi lane, const vf at[3],
                                        kernel_local_points *p)
{
    vf d[3];
    for (int a = 0; a < 3; a++) d[a] = at[a] - kernel_gather_lane(cells->origin[a], lane);
    for (int i = 0; i < 3; i++) {
        p->y[i] = kernel_gather_lane(cells->offset[i], lane);
        for (int a = 0; a < 3; a++) p->y[i] = vf_muladd(kernel_gather_lane(cells->inverse[i][a], lane), d[a], p->y[i]);
        p->r[i] = p->y[i];
    }
    for (int k = 0; k < kernel_nonlinear_count(type); k++)
        for (int a = 0; a < 3; a++) p->nonlinear_part[k][a] = kernel_gather_lane(cells->nonlinear_part[k][a], lane);
    vf left[3];
    kernel_nonlinear_terms_at(type, p->r, p->term, p->slopes);
    kernel_local_newton_residual(type, p, left);
    for (int i = 0; i < 3; i++) p->r[i] += left[i];
    kernel_nonlinear_terms_at(type, p->r, p->term, p->slopes);
    kernel_local_compute_inverse_jacobian(type, p);
    const vf first = kernel_local_step(type, p, vm_all_lanes()), second = kernel_local_step(type, p, vm_all_lanes());
    vm open = vm_not(vf_le(first * second, vf_set(5e-7f)));
    for (int step = 0; step < KERNEL_LOCAL_STEPS && __builtin_expect(vm_any(open), 0); step++) {
        kernel_local_compute_inverse_jacobian(type, p);
        open = vm_andnot(open, vf_le(kernel_local_step(type, p, open), vf_set(7e-4f)));
    }
    return vm_not(open);
}

/* Returns the field at the reference coordinates r in each point's cell. lane: the lane that holds the cell. */
SIMD_INLINE vf kernel_local_evaluate_field(int type, const kernel_local_cells *cells, vi lane,
                                           const kernel_local_points *p)
{
    vf v = kernel_gather_lane(cells->field[0], lane);
    for (int i = 0; i < 3; i++) v = vf_muladd(kernel_gather_lane(cells->field[1 + i], lane), p->r[i], v);
    for (int k = 0; k < kernel_nonlinear_count(type); k++)
        v = vf_muladd(kernel_gather_lane(cells->field[4 + k], lane), p->term[k], v);
    return v;
}

#endif
