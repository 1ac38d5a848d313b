/* Computes the point at which a ray crosses the isovalue in a cell whose map is nearly affine, if there is exactly one
 * such point, without intersecting the cell's faces.
 *
 * Let X be a position in tile space, r its reference coordinates in the cell, and J0 the Jacobian of X(r) at the middle
 * of the reference domain. Then J0^-1 X = r + N(r), and the field minus the isovalue is L(X) + E(r), with a linear
 * function L (kernel_bounds.h). N and E contain only products of reference coordinates. On a ray X = X0 + t d, with y =
 * J0^-1 X0 and w = J0^-1 d, the two equations
 *     r + N(r) = y + t w                          r is on the ray
 *     L(X0) + t grad L . d + E(r) = 0             the field is the isovalue there
 * become one equation when the second is used to eliminate t:
 *     r = f(r) = a - N(r) - w E(r) / (grad L . d),        a = y - w L(X0) / (grad L . d).
 * f changes by no more than K = theta + |w| |grad E| / |grad L . d| per unit length in the domain, where theta is an
 * upper bound of the norm of N's derivative (kernel_bounds.h computes these bounds). If K < 1, f is a contraction, and
 * by the theorems of Banach and Krawczyk, for a point q of the domain, with s = f(q) - q:
 *     one     The ball of radius K / (1 - K) |s| about f(q), if it lies in the domain, is mapped into itself: it
 *             contains a root, and the domain has no other.
 *     none    A root x in a convex part D of the domain satisfies |f(q) - x| <= K |q - x|, hence
 *             |s|^2 <= 2 s . (x - q), which is at most its maximum over the corners of D. If |s|^2 is larger, D has no
 *             root. With q = f(q) moved to the nearest point of D, that is the case whenever f(q) is outside.
 * Rounding: the computed f has an error of at most error_bound, which comes from the rounding of positions, and from
 * that of the field times |w| / |grad L . d|. The crossings of rays with faces, which decide for other rays, have
 * rounding errors of their own, which move a root by at most domain_margin, including the factor 1 / (1 - K). A root is
 * accepted if its distance from the domain's border is more than domain_margin plus its own error, and excluded if the
 * domain widened by domain_margin has no root. For rays with a root closer to a face, the faces are intersected. So the
 * result agrees with that of intersecting the faces, in this cell and in its neighbour. */
#ifndef RENDER_KERNEL_CONTRACTION_H
#define RENDER_KERNEL_CONTRACTION_H

#include <math.h>

#include "grid.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "simd.h"

enum { KERNEL_CONTRACTION_STEPS = 7 };

/* Error of the reference coordinates r below which one more step of Newton's method is sufficient. The derivative of f
 * changes by about 4 K per unit length, where K is the contraction constant. So that step leaves an error of about 2 K
 * / (1 - K) times the square of this one: 1.8e-7 at most, because K is below 0.9. */
#define KERNEL_CONTRACTION_END 1e-4f

/* A ray in the reference space of its cell, and the cell's coefficients and error bounds; one ray per lane. */
typedef struct kernel_contraction {
    /* y and w are defined at the top of this file; X0 is the ray's point at the depth of vertex 0. level: L at X0;
     * rise: the change of L per unit of depth along the ray (grad L . d). */
    vf y[3], w[3], level, rise;
    /* the members of the same names of kernel_bounds, gathered from the lane of each ray's cell */
    vf offset[3], middle, terms[4][3], field_terms[4], error_growth, error_bound, domain_margin;
} kernel_contraction;

/* Computes the members of *out that depend on the ray (y, w, level and rise). lane: the lane that holds each ray's
 * cell. */
SIMD_INLINE void kernel_contraction_set_ray(const kernel_curved *c, const kernel_rays *rays, vi lane,
                                            kernel_contraction *out)
{
    vf origin[3], normal[3], g[3];
    for (int a = 0; a < 3; a++) {
        origin[a] = kernel_gather_lane(c->at[a][0], lane);
        g[a] = kernel_gather_lane(c->bounds->gradient[a], lane);
    }
    const vf x = (rays->origin_x + rays->slope_x * origin[2]) - origin[0];
    const vf y = (rays->origin_y + rays->slope_y * origin[2]) - origin[1];
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) normal[a] = kernel_gather_lane(c->bounds->normal[i][a], lane);
        out->y[i] = normal[0] * x + normal[1] * y;
        out->w[i] = (normal[0] * rays->slope_x + normal[1] * rays->slope_y) + normal[2];
    }
    out->level = kernel_gather_lane(c->bounds->level, lane) + (g[0] * x + g[1] * y);
    out->rise = (g[0] * rays->slope_x + g[1] * rays->slope_y) + g[2];
}

/* Gathers the members of *out that depend only on the cell. */
SIMD_INLINE void kernel_contraction_set_cell(const kernel_bounds *b, vi lane, int type, kernel_contraction *out)
{
    for (int i = 0; i < 3; i++) out->offset[i] = kernel_gather_lane(b->offset[i], lane);
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        for (int i = 0; i < 3; i++) out->terms[k][i] = kernel_gather_lane(b->terms[k][i], lane);
        out->field_terms[k] = kernel_gather_lane(b->field_terms[k], lane);
    }
    out->middle = kernel_gather_lane(b->middle, lane);
    out->error_growth = kernel_gather_lane(b->error_growth, lane);
    out->error_bound = kernel_gather_lane(b->error_bound, lane);
    out->domain_margin = kernel_gather_lane(b->domain_margin, lane);
}

/* Moves the reference coordinates r to the nearest point of the domain D. For hexes and wedges, D is the reference
 * domain widened by domain_margin; for pyramids it is the reference domain itself, and r is moved to a point of D that
 * is only close to the nearest one. */
SIMD_INLINE void kernel_contraction_clamp_to_domain(int type, vf domain_margin, vf r[3])
{
    const vf half = 0.5f + domain_margin;
    if (kernel_is_box(type)) {
        for (int a = 0; a < 3; a++) r[a] = vf_clamp(r[a], -half, half);
    } else if (kernel_is_prism(type)) {
        const vf low = -1.0f / 3 - domain_margin, most = 1.0f / 3 + 2.0f * domain_margin, high = most - low;
        const vm over = vf_lt(most, r[0] + r[1]);
        const vf slant = vf_clamp(0.5f * ((r[0] - r[1]) + most), low, high);
        r[0] = vf_select(over, slant, vf_max(r[0], low));
        r[1] = vf_select(over, most - slant, vf_clamp(r[1], low, high));
        r[0] = vf_min(r[0], most - r[1]);
        r[2] = vf_clamp(r[2], -half, half);
    } else {
        for (int a = 0; a < 2; a++) {
            const vf beyond = 0.5f * vf_max(r[a] - r[2], vf_set(0));
            r[a] = vf_max(r[a] - beyond, vf_set(0));
            r[2] += beyond;
        }
        r[2] = vf_clamp(r[2], vf_set(1e-6f), vf_set(1));
        for (int a = 0; a < 2; a++) r[a] = vf_min(r[a], r[2]);
    }
}

/* Returns the maximum of the dot product s . x over all points x of the domain D
 * (kernel_contraction_clamp_to_domain()). */
SIMD_INLINE vf kernel_evaluate_domain_support(int type, vf domain_margin, const vf s[3])
{
    const vf half = 0.5f + domain_margin;
    if (kernel_is_box(type)) return half * ((vf_abs(s[0]) + vf_abs(s[1])) + vf_abs(s[2]));
    if (kernel_is_prism(type)) {
        const vf low = -1.0f / 3 - domain_margin, side = 1.0f + 4.0f * domain_margin;
        return low * (s[0] + s[1]) + side * vf_max(vf_max(s[0], s[1]), vf_set(0)) + half * vf_abs(s[2]);
    }
    return vf_max((vf_max(s[0], vf_set(0)) + vf_max(s[1], vf_set(0))) + s[2], vf_set(0));
}

/* Converts the reference coordinates r to those of kernel_local.h, which differ only for a pyramid: there the first two
 * are counted from the pyramid's axis. */
SIMD_INLINE void kernel_convert_to_local_reference(int type, const vf r[3], vf out[3])
{
    for (int i = 0; i < 3; i++) out[i] = r[i];
    if (!kernel_has_apex(type)) return;
    for (int i = 0; i < 2; i++) out[i] -= 0.5f * r[2];
}

/* Returns a lower bound of the distance from the reference coordinates r to the border of the reference domain. It is
 * negative if r is outside. */
SIMD_INLINE vf kernel_bound_distance_to_domain_border(int type, const vf r[3])
{
    vf local[3];
    kernel_convert_to_local_reference(type, r, local);
    const vf inside = kernel_local_border_distance(type, local);
    return inside * (kernel_is_box(type) ? 1.0f : 0.7f);
}

/* Returns the rays for which the step s = f(q) - q of the iteration proves that the domain D contains no root (case
 * "none" at the top of this file: |s|^2 is larger than 2 s . (x - q) for all x in D). If there were a root, |s| would
 * be at most two diameters of D. So the rounding errors of the two sides together are at most 2 error_bound (|s| + 2).
 * The test allows for 8 error_bound and a thousandth of |s|^2, which is more. */
SIMD_INLINE vm kernel_contraction_excludes_root(int type, const kernel_contraction *c, const vf q[3], const vf s[3])
{
    const vf most = kernel_evaluate_domain_support(type, c->domain_margin, s) - kernel_dot(s, q);
    vf error_bound = 8.0f * c->error_bound;
    /* the domain D of a pyramid is not widened by domain_margin, the bound of the errors of face crossings; instead,
     * twice the maximum over D is increased by 4 domain_margin */
    if (kernel_has_apex(type)) error_bound = 4.0f * c->domain_margin;
    return vf_lt(2.0f * most + error_bound, 0.999f * kernel_dot(s, s));
}

/* Finds each ray's only crossing of the isovalue in its cell, or proves that there is none, without intersecting faces.
 * out->mask: rays with exactly one crossing; out->t: its depth relative to vertex 0; out->r: its reference coordinates.
 * The crossing is accurate to KERNEL_CONTRACTION_END. *none: rays without a crossing. The other rays are undecided. */
SIMD_INLINE void kernel_find_only_root_by_contraction(const kernel_contraction *c, vm rays, kernel_point *out, vm *none,
                                                      int type)
{
    const int terms = kernel_nonlinear_count(type);
    const vf over = 1.0f / c->rise, t = (c->level + c->middle) * over;
    vf a[3], slope[4][3], q[3], s[3], local[3], term[KERNEL_NONLINEAR_TERMS], unused[KERNEL_NONLINEAR_TERMS][3];
    out->mask = *none = vm_none();
    out->t = vf_set(0);
    for (int i = 0; i < 3; i++) q[i] = a[i] = (c->y[i] + c->offset[i]) - c->w[i] * t;
    for (int k = 0; k < terms; k++) {
        const vf rate = c->field_terms[k] * over;
        for (int i = 0; i < 3; i++) slope[k][i] = c->terms[k][i] + c->w[i] * rate;
    }
    const vm sure = vm_and(rays, vf_lt(c->error_growth, vf_set(INFINITY)));
    for (int n = 0; n < KERNEL_CONTRACTION_STEPS; n++) {
        kernel_contraction_clamp_to_domain(type, c->domain_margin, q);
        kernel_convert_to_local_reference(type, q, local);
        kernel_nonlinear_terms_at(type, local, term, unused);
        /* For a pyramid, kernel_bounds.h computes J0 with the value 1/2 of a b / k^2 instead of 1/4, its value at the
         * centre. Therefore N also has this linear term. */
        if (kernel_has_apex(type)) term[0] += 0.25f * q[2];
        for (int i = 0; i < 3; i++) {
            vf at = a[i];
            for (int k = 0; k < terms; k++) at -= slope[k][i] * term[k];
            s[i] = at - q[i];
            out->r[i] = at;
        }
        if (n == 1 || n == KERNEL_CONTRACTION_STEPS - 1) {
            *none = vm_or(*none, vm_and(sure, kernel_contraction_excludes_root(type, c, q, s)));
            if (!vm_any(vm_andnot(sure, *none))) return;
        }
        for (int i = 0; i < 3; i++) q[i] = out->r[i];
    }
    const vf off = c->error_growth * vf_sqrt(kernel_dot(s, s)) + (1.0f + c->error_growth) * c->error_bound;
    const vm inside = vf_lt(off + c->domain_margin, kernel_bound_distance_to_domain_border(type, out->r));
    out->mask = vm_andnot(vm_and(sure, vm_and(inside, vf_lt(off, vf_set(KERNEL_CONTRACTION_END)))), *none);
    vf e = c->level + c->middle;
    for (int k = 0; k < terms; k++) e += c->field_terms[k] * term[k];
    out->t = -(e * over);
    if (kernel_has_apex(type)) return;
    for (int i = 0; i < 3; i++) out->r[i] += (float)kernel_domain_of(type)->centre[i];
}

#endif
