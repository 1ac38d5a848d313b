/* Evaluates the field along rays between two faces of their hexes, wedges or pyramids, one ray-cell pair per lane. It
 * is evaluated at three places between the faces, or in each part of a ray's interval. Callers pass the cell type as a
 * constant.
 *
 * In kernel_local.h's reference coordinates r the field is f0 + g r + (its nonlinear terms), and y = r + n(r) is linear
 * along the ray, where the nonlinear terms are n = B b with products b of coordinates. So with r = y - n(r)
 *     field = f0 + g y + h b(r),   h = (the field's nonlinear terms) - g B.
 * The first part is linear along the ray. So the field deviates from its chord between the faces by h times the
 * deviation of b from its own chord. As that is small, r need not be known as accurately as for the field itself.
 *
 * r is found by Newton's method, from the line between its values at the faces. In the middle of a cell n' is zero, so
 * that a step with the derivatives there adds the residual, and leaves |n'| of it to the next step. Such a step has a
 * third of the terms of a step with the derivatives at the current point, and all places are computed side by side.
 *
 * Error bound. Let the residual be the sum over the coordinates of |y - (r + n(r))|. The derivative of n is at most N
 * in the cell. If r lies slightly outside the cell (kernel_local_is_near()), the derivative is at most 1.082 N:
 *              r may be up to                                   derivative          gradients of b
 *     hex      |ρ|, |σ|, |κ| <= 0.52                            1.04^2 N            sqrt(2) 0.52, sqrt(3) 0.52^2
 *     wedge    0.02 outside, within the cell times 1.06         1.06 N              |(0.52, 0.707)|
 *     pyramid  |α|, |β| <= 0.52 k, k <= 1.02                    1.045 N             |(0.52, 0.52, 0.52^2)|
 * These regions are convex. So r errs by at most residual / (1 - 1.082 N), provided that r itself is no farther
 * outside, which is checked; rays that fail the check are traced one by one. */
#ifndef RENDER_KERNEL_LOCAL_DEVIATION_H
#define RENDER_KERNEL_LOCAL_DEVIATION_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_local.h"
#include "kernel_packet.h"
#include "simd.h"

enum { KERNEL_DEVIATION_STEPS = 8 };

/* Distance, in reference coordinates, by which points may lie outside the cell, which extends from -1/2 to 1/2. */
#define KERNEL_DEVIATION_MARGIN 0.02f

/* Coefficients and error bounds of the nonlinear terms of each lane's cell. */
typedef struct kernel_local_nonlinear {
    /* h: coefficients of the field's deviation from linear (the file's opening comment) */
    float terms[KERNEL_NONLINEAR_TERMS][SIMD_WIDTH];
    /* square of the upper bound of the derivative of the map's nonlinear part */
    float bend[SIMD_WIDTH];
    /* lower bound of the part of the field's deviation that is not visible at the three sampled places (the error E of
     * kernel_local_budget.h) */
    float unsampled[SIMD_WIDTH];
    float sensitivity[SIMD_WIDTH];    /* error bound of the field per unit of the residual */
    float residual_limit[SIMD_WIDTH]; /* largest residual for which the field's value is valid */
    float tolerance[SIMD_WIDTH];      /* Newton's method stops at a residual of at most this */
} kernel_local_nonlinear;

typedef struct kernel_local_deviations {
    vf field[3]; /* the field minus its chord, at a quarter, the middle and three quarters of the interval */
    /* largest residual at these places; if an interval is cut into parts, the largest at all places and parts' ends so
     * far */
    vf residual;
    vm has_diverged; /* rays for which Newton's method did not find the reference coordinates */
} kernel_local_deviations;

/* ---- cells ---- */

/* Returns an upper bound of the gradient of nonlinear term number `term` in cells of this type. */
SIMD_INLINE float kernel_local_nonlinear_slope(int type, int term)
{
    return kernel_is_prism(type) ? 0.88f : kernel_has_apex(type) ? 0.79f : term < 3 ? 0.74f : 0.47f;
}

/* Returns the factor e of kernel_local_budget.h: the part of the field's deviation that the three sampled places may
 * miss is at most e times its bound. */
SIMD_INLINE float kernel_local_nonlinear_unsampled(int type)
{
    return kernel_is_box(type) ? 0.0011f : kernel_is_prism(type) ? 0.0004f : 0;
}

/* Computes all members of *out except tolerance, for one cell per lane. */
SIMD_INLINE void kernel_local_nonlinear_of(const kernel_local_cells *c, int type, kernel_local_nonlinear *out)
{
    vf most = vf_set(0);
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        vf own = vf_load(c->field[4 + k]);
        for (int a = 0; a < 3; a++) own = vf_muladd(-vf_load(c->field[1 + a]), vf_load(c->nonlinear_part[k][a]), own);
        vf_store(out->terms[k], own);
        most += vf_abs(own) * kernel_local_nonlinear_slope(type, k);
    }
    const vf bend = vf_sqrt(vf_load(c->bend)), room = 1.0f - 1.082f * bend;
    vf_store(out->bend, vf_load(c->bend));
    vf_store(out->unsampled, kernel_local_nonlinear_unsampled(type) * vf_load(c->bend) * most);
    vf_store(out->sensitivity, most / room);
    vf_store(out->residual_limit, KERNEL_DEVIATION_MARGIN * room);
}

/* ---- rays in cells ---- */

/* The line between the reference coordinates at a ray's two faces, and the chords of the nonlinear terms, per ray. A
 * position u on the ray goes from -1/2 to 1/2. */
typedef struct kernel_local_chord {
    /* reference coordinates at the line's middle, and their difference between the line's ends */
    vf middle[3], span[3];
    /* the nonlinear terms' chords: value at the middle, and difference between the ends */
    vf mean[KERNEL_NONLINEAR_TERMS], rise[KERNEL_NONLINEAR_TERMS];
    vf nonlinear_part[KERNEL_NONLINEAR_TERMS][3], own[KERNEL_NONLINEAR_TERMS];
    vf tolerance, residual_limit;
} kernel_local_chord;

typedef struct kernel_local_iterate {
    vf r[3], residual[3], deviation;
} kernel_local_iterate;

SIMD_INLINE void kernel_local_nonlinear_at(int type, const vf r[3], vf out[KERNEL_NONLINEAR_TERMS])
{
    kernel_nonlinear_terms b;
    kernel_nonlinear_terms_at(type, r, &b);
    memcpy(out, b.term, sizeof b.term);
}

/* Returns the rays whose reference coordinates r lie in the cell, or outside by at most KERNEL_DEVIATION_MARGIN. */
SIMD_INLINE vm kernel_local_is_near(int type, const vf r[3])
{
    if (kernel_is_prism(type)) return vf_le(vf_set(-KERNEL_DEVIATION_MARGIN), kernel_local_border_distance(type, r));
    const vf most = vf_max(vf_abs(r[0]), vf_abs(r[1])), half = vf_set(0.5f + KERNEL_DEVIATION_MARGIN);
    if (kernel_is_box(type)) return vf_le(vf_max(most, vf_abs(r[2])), half);
    return vm_and(vf_le(most, half * r[2]), vf_le(r[2], vf_set(1 + KERNEL_DEVIATION_MARGIN)));
}

SIMD_INLINE void kernel_local_chord_of(const kernel_local_cells *cells, const kernel_local_nonlinear *nonlinear,
                                       vi lane, const kernel_point ends[2], int type, kernel_local_chord *out)
{
    vf first[KERNEL_NONLINEAR_TERMS], last[KERNEL_NONLINEAR_TERMS];
    kernel_local_nonlinear_at(type, ends[0].r, first);
    kernel_local_nonlinear_at(type, ends[1].r, last);
    for (int a = 0; a < 3; a++) {
        out->middle[a] = 0.5f * (ends[0].r[a] + ends[1].r[a]);
        out->span[a] = ends[1].r[a] - ends[0].r[a];
    }
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        out->mean[k] = 0.5f * (first[k] + last[k]);
        out->rise[k] = last[k] - first[k];
        out->own[k] = kernel_gather_lane(nonlinear->terms[k], lane);
        for (int a = 0; a < 3; a++) out->nonlinear_part[k][a] = kernel_gather_lane(cells->nonlinear_part[k][a], lane);
    }
    out->tolerance = kernel_gather_lane(nonlinear->tolerance, lane);
    out->residual_limit = kernel_gather_lane(nonlinear->residual_limit, lane);
}

/* Computes the residual of the reference coordinates r at position u on the ray, and the field's deviation from its
 * chord there. */
SIMD_INLINE void kernel_local_iterate_at(const kernel_local_chord *c, float u, int type, kernel_local_iterate *p)
{
    vf term[KERNEL_NONLINEAR_TERMS];
    kernel_local_nonlinear_at(type, p->r, term);
    for (int a = 0; a < 3; a++) p->residual[a] = vf_muladd(c->span[a], vf_set(u), c->middle[a]) - p->r[a];
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        term[k] -= vf_muladd(c->rise[k], vf_set(u), c->mean[k]);
        for (int a = 0; a < 3; a++) p->residual[a] = vf_muladd(-c->nonlinear_part[k][a], term[k], p->residual[a]);
    }
    p->deviation = c->own[0] * term[0];
    for (int k = 1; k < kernel_nonlinear_count(type); k++) p->deviation = vf_muladd(c->own[k], term[k], p->deviation);
}

SIMD_INLINE vf kernel_local_residual_of(const kernel_local_iterate *p)
{
    return (vf_abs(p->residual[0]) + vf_abs(p->residual[1])) + vf_abs(p->residual[2]);
}

/* Refines the reference coordinates r at `count` places from initial guesses by Newton's method. *residual receives the
 * largest residual left at any place. Returns the rays for which r is valid at all places: in the cell or slightly
 * outside, with a small enough residual. */
SIMD_INLINE vm kernel_local_newton(const kernel_local_chord *c, const float *places, int count, vm rays, int type,
                                   kernel_local_iterate *at, vf *residual)
{
    for (int n = 0;; n++) {
        *residual = vf_set(0);
        for (int i = 0; i < count; i++) {
            kernel_local_iterate_at(c, places[i], type, &at[i]);
            *residual = vf_max(kernel_local_residual_of(&at[i]), *residual);
        }
        const vm open = vm_andnot(rays, vf_le(*residual, c->tolerance));
        if (n == KERNEL_DEVIATION_STEPS || !vm_any(open)) break;
        for (int i = 0; i < count; i++)
            for (int a = 0; a < 3; a++) at[i].r[a] = vf_select(open, at[i].r[a] + at[i].residual[a], at[i].r[a]);
    }
    vm is_near = vf_le(*residual, c->residual_limit);
    for (int i = 0; i < count; i++) is_near = vm_and(is_near, kernel_local_is_near(type, at[i].r));
    return is_near;
}

SIMD_INLINE void kernel_local_deviations_of(const kernel_local_cells *cells, const kernel_local_nonlinear *nonlinear,
                                            vi lane, vm rays, const kernel_point ends[2], int type,
                                            kernel_local_deviations *out)
{
    static const float places[3] = {-0.25f, 0, 0.25f};
    kernel_local_chord chord;
    kernel_local_iterate iterates[3];
    kernel_local_iterate *middle = &iterates[1];
    kernel_local_chord_of(cells, nonlinear, lane, ends, type, &chord);
    memcpy(middle->r, chord.middle, sizeof middle->r);
    for (int n = 0; n < 2; n++) {
        kernel_local_iterate_at(&chord, 0, type, middle);
        for (int a = 0; a < 3; a++) middle->r[a] += middle->residual[a];
    }
    for (int q = 0; q < 3; q += 2)
        for (int a = 0; a < 3; a++)
            iterates[q].r[a] =
                vf_muladd(chord.span[a], vf_set(places[q]), 0.25f * chord.middle[a]) + 0.75f * middle->r[a];
    out->has_diverged = vm_not(kernel_local_newton(&chord, places, 3, rays, type, iterates, &out->residual));
    for (int i = 0; i < 3; i++) out->field[i] = iterates[i].deviation;
}

/* ---- parts of an interval ---- */

/* The state at the end of one of the equal parts into which a ray's interval is cut. */
typedef struct kernel_local_part {
    float u;
    vf r[3], deviation; /* the field minus the chord of the whole interval, at u */
    vf residual;        /* largest residual of the parts so far */
} kernel_local_part;

SIMD_INLINE void kernel_local_part_begin(const kernel_point *first, kernel_local_part *out)
{
    *out = (kernel_local_part){.u = -0.5f, .deviation = vf_set(0), .residual = vf_set(0)};
    memcpy(out->r, first->r, sizeof out->r);
}

/* Advances to the end of the next part, whose length is `share` of the interval, and computes the field's deviations
 * from the chord of that part. */
SIMD_INLINE void kernel_local_part_next(const kernel_local_chord *c, float share, vm rays, int type,
                                        kernel_local_part *part, kernel_local_deviations *out)
{
    const vf before = part->deviation;
    float places[4];
    kernel_local_iterate at[4];
    vf residual;
    for (int i = 0; i < 4; i++) {
        const float along = 0.25f * (float)(i + 1) * share;
        places[i] = part->u + along;
        for (int a = 0; a < 3; a++) at[i].r[a] = vf_muladd(c->span[a], vf_set(along), part->r[a]);
    }
    out->has_diverged = vm_not(kernel_local_newton(c, places, 4, rays, type, at, &residual));
    part->u = places[3];
    part->deviation = part->u < 0.5f ? at[3].deviation : vf_set(0);
    part->residual = vf_max(residual, part->residual);
    memcpy(part->r, at[3].r, sizeof part->r);
    out->residual = part->residual;
    for (int i = 0; i < 3; i++) {
        const vf chord = vf_muladd(part->deviation - before, vf_set(0.25f * (float)(i + 1)), before);
        out->field[i] = at[i].deviation - chord;
    }
}

#endif
