/* Evaluates the field along rays between two faces of their hexes, wedges or pyramids, one ray-cell pair per lane: each
 * lane has a ray and the index of the lane that holds its cell. Terms:
 *     interval     a ray's interval in its cell, between two faces; it may be halved repeatedly into parts
 *     places       the ends, quarters and middle of an interval or part, at which the field is evaluated
 *     chord        the linear function along the interval that has the field's values at its two ends
 *     deviation    the field minus its chord
 *     residual     error of the equation for reference coordinates that Newton's method leaves, defined below
 *     bend         square of the bound N of the derivative of the map's nonlinear part
 *
 * Callers pass the cell type as a constant. GRID_NO_TYPE means that a packet's rays are in one cell, and the field is
 * computed by that cell's inverse map.
 *
 * In kernel_local.h's reference coordinates r the field is f0 + g r + (its nonlinear terms), and y = r + n(r) is linear
 * along the ray, where the map's nonlinear terms are n = B b with the products b of coordinates. So with r = y - n(r)
 *     field = f0 + g y + h b(r),   h = (the field's nonlinear terms) - g B.
 * f0 + g y is linear along the ray. So the field deviates from its chord by h times the deviation of b from b's chord.
 * Because that is small, r need not be known as accurately as for computing the field itself.
 *
 * r is found by Newton's method, from the line between its values at the faces. A step uses the derivatives in the
 * middle of the cell, where n' is zero: it adds the residual to r, and the next residual is about |n'| times as large.
 * Such a step has a third of the terms of a step with the derivatives at the current point. The steps for all places
 * are computed together.
 *
 * Error bound. Let the residual be the sum over the coordinates of |y - (r + n(r))|. The derivative of n is at most N
 * in the cell. If r lies slightly outside the cell (kernel_local_is_in_or_near_cell()), the derivative is at most 1.082
 * N: r may be up to                                   derivative          gradients of b hex      |ρ|, |σ|, |κ| <= 0.52
 * 1.04^2 N            sqrt(2) 0.52, sqrt(3) 0.52^2 wedge    0.02 outside, within the cell times 1.06         1.06 N
 * |(0.52, 0.707)| pyramid  |α|, |β| <= 0.52 k, k <= 1.02                    1.045 N             |(0.52, 0.52, 0.52^2)|
 * These regions are convex. So r errs by at most residual / (1 - 1.082 N), provided that r itself is no farther
 * outside, which is checked; rays that fail the check are processed by the inverse map. */
#ifndef RENDER_KERNEL_LOCAL_DEVIATION_H
#define RENDER_KERNEL_LOCAL_DEVIATION_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_tile_trace.h"
#include "simd.h"

enum { KERNEL_DEVIATION_STEPS = 8 };

/* Distance, in the reference coordinates of kernel_local.h, by which points may lie outside their cell. (A hex extends
 * from -1/2 to 1/2.) */
#define KERNEL_DEVIATION_MARGIN 0.02f

/* Error bounds of one cell per lane. kernel_local_budget.h defines the quantities and computes most of them. */
typedef struct kernel_local_bounds {
    /* h: coefficients of the field's deviation from a linear function, by nonlinear term (the opening comment of this
     * file) */
    float terms[KERNEL_NONLINEAR_TERMS][SIMD_WIDTH];
    /* square of the upper bound N of the derivative of the map's nonlinear part */
    float bend[SIMD_WIDTH];
    /* e N^2 S of kernel_local_budget.h, a lower limit of E, the quartic part of the field's deviation. It covers
     * deviations that are 0 at a quarter, the middle and three quarters of the interval, the only places where the
     * deviation is evaluated. */
    float unsampled[SIMD_WIDTH];
    float sensitivity[SIMD_WIDTH];    /* error bound of the field per unit of the residual */
    float residual_limit[SIMD_WIDTH]; /* largest residual for which the field's value is valid */
    float tolerance[SIMD_WIDTH];      /* Newton's method stops at a residual of at most this */
    /* Bounds of the change of light by a field error, over the values from `low` to `high`: the range of the lane's
     * cell, with a margin. cost: maximum of the change per unit of error and unit distance; error_variation: largest
     * difference between the changes at two of the values (KERNEL_LIGHT_COST, KERNEL_LIGHT_VARIATION). */
    float low[SIMD_WIDTH], high[SIMD_WIDTH];
    float cost[SIMD_WIDTH], error_variation[SIMD_WIDTH];
    /* Upper bound of how much T g changes per unit of optical depth: cost + R |s'|. T is the transmittance in front of
     * a point, and g the change of light per unit of field error there (kernel_local_budget.h). */
    float weight_change[SIMD_WIDTH];
    float extinction[SIMD_WIDTH]; /* maximum of the extinction over these values, per unit distance */
} kernel_local_bounds;

/* Ray-cell pairs, one per lane, and the rays' intervals in their cells. */
typedef struct kernel_local_pairs {
    kernel_lane_rays rays;
    kernel_point ends[2]; /* begin and end of the interval */
    vm active;
    vf begin;    /* depth at which the ray's window begins */
    vf per_t;    /* unit distances of the transfer function per unit of t */
    vf count;    /* number of segments into which the interval is divided */
    float share; /* length of this interval as a share of the ray's whole interval in its cell */
    vf field[3]; /* deviation of the field at a quarter, the middle and three quarters of the interval */
    /* largest residual that Newton's method has left at the quarters and the middle of this interval and, if it is a
     * part, of the larger parts that contain it */
    vf residual;
    vm has_diverged; /* rays for which Newton's method did not find the reference coordinates */
} kernel_local_pairs;

/* ---- cells ---- */

/* Returns an upper bound of the gradient of nonlinear term number `term` in cells of this type. */
SIMD_INLINE float kernel_local_get_nonlinear_slope_bound(int type, int term)
{
    return kernel_is_prism(type) ? 0.88f : kernel_has_apex(type) ? 0.79f : term < 3 ? 0.74f : 0.47f;
}

/* Returns the factor e of kernel_local_budget.h. It bounds deviations of the field from its chord that are 0 at the
 * quarters and the middle of the interval. */
SIMD_INLINE float kernel_local_get_unsampled_factor(int type)
{
    return kernel_is_box(type) ? 0.0011f : kernel_is_prism(type) ? 0.0004f : 0;
}

/* Computes those bounds that depend only on the cells' maps and fields: the members terms, bend, unsampled, sensitivity
 * and residual_limit of *out. */
SIMD_INLINE void kernel_local_set_nonlinear_bounds(const kernel_local_cells *c, int type, kernel_local_bounds *out)
{
    vf most = vf_set(0);
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        vf own = vf_load(c->field[4 + k]);
        for (int a = 0; a < 3; a++) own = vf_muladd(-vf_load(c->field[1 + a]), vf_load(c->nonlinear_part[k][a]), own);
        vf_store(out->terms[k], own);
        most += vf_abs(own) * kernel_local_get_nonlinear_slope_bound(type, k);
    }
    const vf bend = vf_sqrt(vf_load(c->bend)), room = 1.0f - 1.082f * bend;
    vf_store(out->bend, vf_load(c->bend));
    vf_store(out->unsampled, kernel_local_get_unsampled_factor(type) * vf_load(c->bend) * most);
    vf_store(out->sensitivity, most / room);
    vf_store(out->residual_limit, KERNEL_DEVIATION_MARGIN * room);
}

/* ---- rays in cells ---- */

/* The line between the reference coordinates at a ray's two faces, and the chords of the nonlinear terms, one ray per
 * lane. A position u on the whole interval goes from -1/2 at its begin to 1/2 at its end. */
typedef struct kernel_local_chord {
    /* reference coordinates at the line's middle, and their difference between the line's ends */
    vf middle[3], span[3];
    /* the nonlinear terms' chords: value at the middle, and difference between the ends */
    vf mean[KERNEL_NONLINEAR_TERMS], rise[KERNEL_NONLINEAR_TERMS];
    /* gathered from each ray's cell: the coefficients B of the map's nonlinear terms, and h (kernel_local_bounds.terms,
     * here `own`) */
    vf nonlinear_part[KERNEL_NONLINEAR_TERMS][3], own[KERNEL_NONLINEAR_TERMS];
    vf tolerance, residual_limit;
    /* Used instead of the members above if the type is GRID_NO_TYPE: the packet, its cell, the cell's inverse map, and
     * the rays' intervals in the cell. */
    kernel_packet *packet;
    const kernel_cell *cell;
    const kernel_map *map;
    const kernel_interval *interval;
} kernel_local_chord;

/* The five places (0 to 4) of an interval or of a part of it: begin, quarter, middle, three quarters and end, for one
 * ray per lane. */
typedef struct kernel_local_places {
    float u, width;     /* u: position at which the part begins; width: its length, as a share of the whole interval */
    vf r[5][3], off[5]; /* r: reference coordinates; off: the field minus the chord of the whole interval */
    vf residual;        /* largest residual at places 1 to 3 of this part and of the larger parts that contain it */
    vm is_known;        /* rays for which Newton's method found all reference coordinates */
} kernel_local_places;

/* Computes the nonlinear terms (products of coordinates) at the reference coordinates r. */
SIMD_INLINE void kernel_local_evaluate_nonlinear_terms(int type, const vf r[3], vf out[KERNEL_NONLINEAR_TERMS])
{
    vf unused[KERNEL_NONLINEAR_TERMS][3];
    kernel_nonlinear_terms_at(type, r, out, unused);
}

/* Returns the rays whose reference coordinates r lie in the cell, or outside by at most KERNEL_DEVIATION_MARGIN. */
SIMD_INLINE vm kernel_local_is_in_or_near_cell(int type, const vf r[3])
{
    if (kernel_is_prism(type)) return vf_le(vf_set(-KERNEL_DEVIATION_MARGIN), kernel_local_border_distance(type, r));
    const vf most = vf_max(vf_abs(r[0]), vf_abs(r[1])), half = vf_set(0.5f + KERNEL_DEVIATION_MARGIN);
    if (kernel_is_box(type)) return vf_le(vf_max(most, vf_abs(r[2])), half);
    return vm_and(vf_le(most, half * r[2]), vf_le(r[2], vf_set(1 + KERNEL_DEVIATION_MARGIN)));
}

/* Computes the lines and chords between the ends of the rays' intervals, and gathers coefficients and limits of the
 * rays' cells (kernel_local_chord). lane: the lane that holds each ray's cell. */
SIMD_INLINE void kernel_local_compute_chords(const kernel_local_cells *cells, const kernel_local_bounds *bounds,
                                             vi lane, const kernel_point ends[2], int type, kernel_local_chord *out)
{
    vf first[KERNEL_NONLINEAR_TERMS], last[KERNEL_NONLINEAR_TERMS];
    kernel_local_evaluate_nonlinear_terms(type, ends[0].r, first);
    kernel_local_evaluate_nonlinear_terms(type, ends[1].r, last);
    for (int a = 0; a < 3; a++) {
        out->middle[a] = 0.5f * (ends[0].r[a] + ends[1].r[a]);
        out->span[a] = ends[1].r[a] - ends[0].r[a];
    }
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        out->mean[k] = 0.5f * (first[k] + last[k]);
        out->rise[k] = last[k] - first[k];
        out->own[k] = kernel_gather_lane(bounds->terms[k], lane);
        for (int a = 0; a < 3; a++) out->nonlinear_part[k][a] = kernel_gather_lane(cells->nonlinear_part[k][a], lane);
    }
    out->tolerance = kernel_gather_lane(bounds->tolerance, lane);
    out->residual_limit = kernel_gather_lane(bounds->residual_limit, lane);
}

/* Computes the residual y - (r + n(r)) of the reference coordinates r = p->r at position u on the interval, where y is
 * linear along the ray and n(r) are the map's nonlinear terms (top of this file). Stores the field's deviation at this
 * position as p->value. */
SIMD_INLINE void kernel_local_compute_residual(const kernel_local_chord *c, vf u, int type, kernel_point *p,
                                               vf residual[3])
{
    vf term[KERNEL_NONLINEAR_TERMS];
    kernel_local_evaluate_nonlinear_terms(type, p->r, term);
    for (int a = 0; a < 3; a++) residual[a] = vf_muladd(c->span[a], u, c->middle[a]) - p->r[a];
    for (int k = 0; k < kernel_nonlinear_count(type); k++) {
        term[k] -= vf_muladd(c->rise[k], u, c->mean[k]);
        for (int a = 0; a < 3; a++) residual[a] = vf_muladd(-c->nonlinear_part[k][a], term[k], residual[a]);
    }
    p->value = c->own[0] * term[0];
    for (int k = 1; k < kernel_nonlinear_count(type); k++) p->value = vf_muladd(c->own[k], term[k], p->value);
}

/* Refines reference coordinates by Newton's method, at `count` (at most 3) positions on the interval. places[i]:
 * position u number i; at[i].r: its reference coordinates, on entry an initial guess. at[i].value becomes the field's
 * deviation there. *residual becomes the largest residual that is left at any position. Returns the rays for which all
 * at[i].r are valid: in the cell or slightly outside, with a small enough residual. */
SIMD_INLINE vm kernel_local_refine_coordinates(const kernel_local_chord *c, const vf *places, int count, vm rays,
                                               int type, kernel_point *at, vf *residual)
{
    vf off[3][3];
    for (int n = 0;; n++) {
        *residual = vf_set(0);
        for (int i = 0; i < count; i++) {
            kernel_local_compute_residual(c, places[i], type, &at[i], off[i]);
            *residual = vf_max((vf_abs(off[i][0]) + vf_abs(off[i][1])) + vf_abs(off[i][2]), *residual);
        }
        const vm open = vm_andnot(rays, vf_le(*residual, c->tolerance));
        if (n == KERNEL_DEVIATION_STEPS || !vm_any(open)) break;
        for (int i = 0; i < count; i++)
            for (int a = 0; a < 3; a++) at[i].r[a] = vf_select(open, at[i].r[a] + off[i][a], at[i].r[a]);
    }
    vm is_near = vf_le(*residual, c->residual_limit);
    for (int i = 0; i < count; i++) is_near = vm_and(is_near, kernel_local_is_in_or_near_cell(type, at[i].r));
    return is_near;
}

/* Computes the field's deviations at `count` positions u on the interval between `ends`, by the inverse map of the
 * packet's cell. */
static __attribute__((noinline)) void kernel_local_find_deviations_by_map(const kernel_local_chord *c,
                                                                          const kernel_point *ends, const vf *u,
                                                                          int count, vm rays, vf *out)
{
    for (int i = 0; i < count; i++) {
        const vf along = u[i] + 0.5f, t = ends[0].t + (ends[1].t - ends[0].t) * along;
        const vf value = kernel_evaluate_field_in_one_cell(c->packet, c->map, c->interval, rays, t);
        out[i] = value - (ends[0].value + (ends[1].value - ends[0].value) * along);
    }
}

/* Evaluates the field at the places 1, 2 and 3 (kernel_local_places) if `step` is 1, and at the places 1 and 3 if
 * `step` is 2. On entry, p->r has guesses of the places' reference coordinates. ends: the ends of the whole
 * interval. */
SIMD_INLINE void kernel_local_evaluate_field_at_places(const kernel_local_chord *c, const kernel_point *ends, int step,
                                                       vm rays, int type, kernel_local_places *p)
{
    kernel_point at[3];
    vf u[3], off[3], residual;
    int count = 0;
    for (int i = 1; i < 4; i += step, count++) {
        u[count] = vf_set(p->u + 0.25f * (float)i * p->width);
        if (type != GRID_NO_TYPE) memcpy(at[count].r, p->r[i], sizeof p->r[i]);
    }
    if (type == GRID_NO_TYPE) {
        kernel_local_find_deviations_by_map(c, ends, u, count, rays, off);
        for (int i = 1, n = 0; i < 4; i += step, n++) p->off[i] = off[n];
        return;
    }
    p->is_known = vm_and(p->is_known, kernel_local_refine_coordinates(c, u, count, rays, type, at, &residual));
    p->residual = vf_max(residual, p->residual);
    for (int i = 1, n = 0; i < 4; i += step, n++) {
        memcpy(p->r[i], at[n].r, sizeof p->r[i]);
        p->off[i] = at[n].value;
    }
}

/* Evaluates the field at the five places of a whole interval. */
SIMD_INLINE void kernel_local_sample_whole_interval(const kernel_local_chord *c, const kernel_point ends[2], vm rays,
                                                    int type, kernel_local_places *out)
{
    out->u = -0.5f;
    out->width = 1;
    out->off[0] = out->off[4] = out->residual = vf_set(0);
    out->is_known = vm_all_lanes();
    if (type != GRID_NO_TYPE) {
        kernel_point middle;
        vf residual[3];
        memcpy(middle.r, c->middle, sizeof middle.r);
        for (int n = 0; n < 2; n++) {
            kernel_local_compute_residual(c, vf_set(0), type, &middle, residual);
            for (int a = 0; a < 3; a++) middle.r[a] += residual[a];
        }
        for (int a = 0; a < 3; a++) {
            const vf near_middle = 0.25f * c->middle[a];
            out->r[0][a] = ends[0].r[a];
            out->r[1][a] = vf_muladd(c->span[a], vf_set(-0.25f), near_middle) + 0.75f * middle.r[a];
            out->r[2][a] = middle.r[a];
            out->r[3][a] = vf_muladd(c->span[a], vf_set(0.25f), near_middle) + 0.75f * middle.r[a];
            out->r[4][a] = ends[1].r[a];
        }
    }
    kernel_local_evaluate_field_at_places(c, ends, 1, rays, type, out);
}

/* Evaluates the field at the five places of one half (0 or 1) of the part p. Three of these places are places of p, at
 * which the field is already known. */
SIMD_INLINE void kernel_local_sample_half_interval(const kernel_local_chord *c, const kernel_point ends[2],
                                                   const kernel_local_places *p, int half, vm rays, int type,
                                                   kernel_local_places *out)
{
    out->width = 0.5f * p->width;
    out->u = p->u + (float)half * out->width;
    out->residual = p->residual;
    out->is_known = p->is_known;
    for (int i = 0; i < 3; i++) out->off[2 * i] = p->off[2 * half + i];
    if (type != GRID_NO_TYPE) {
        for (int i = 0; i < 3; i++) memcpy(out->r[2 * i], p->r[2 * half + i], sizeof p->r[0]);
        for (int i = 1; i < 4; i += 2)
            for (int a = 0; a < 3; a++) out->r[i][a] = 0.5f * (out->r[i - 1][a] + out->r[i + 1][a]);
    }
    kernel_local_evaluate_field_at_places(c, ends, 2, rays, type, out);
}

/* Returns the number at position u of a whole interval (-1/2 to 1/2), at whose ends it is `first` and `last`, by linear
 * interpolation. */
SIMD_INLINE vf kernel_local_interpolate(vf first, vf last, float u)
{
    if (u < 0.5f) return first + (last - first) * (u + 0.5f);
    return last;
}

/* Sets *out to a copy of *whole that is restricted to one part of the rays' intervals: to the part's ends, and the
 * field's deviations from the chord between them. whole: the rays with their whole intervals; p: the part's places;
 * rays: the active rays. */
SIMD_INLINE void kernel_local_restrict_to_part(const kernel_local_pairs *whole, const kernel_local_places *p, vm rays,
                                               kernel_local_pairs *out)
{
    const kernel_point *first = &whole->ends[0], *last = &whole->ends[1];
    *out = *whole;
    out->active = rays;
    out->share = whole->share * p->width;
    for (int n = 0; n < 2; n++) {
        const float u = p->u + (float)n * p->width;
        out->ends[n].t = kernel_local_interpolate(first->t, last->t, u);
        out->ends[n].value = kernel_local_interpolate(first->value, last->value, u) + p->off[4 * n];
    }
    for (int i = 0; i < 3; i++)
        out->field[i] = p->off[i + 1] - vf_muladd(p->off[4] - p->off[0], vf_set(0.25f * (float)(i + 1)), p->off[0]);
    out->residual = p->residual;
    out->has_diverged = vm_not(p->is_known);
}

/* Computes p->field, the field's deviations on the whole interval in the cell, and the residual. */
SIMD_INLINE void kernel_local_compute_deviations(const kernel_local_cells *cells, const kernel_local_bounds *bounds,
                                                 kernel_local_pairs *p, int type)
{
    kernel_local_chord chord;
    kernel_local_places places;
    kernel_local_compute_chords(cells, bounds, p->rays.lane, p->ends, type, &chord);
    kernel_local_sample_whole_interval(&chord, p->ends, p->active, type, &places);
    p->has_diverged = vm_not(places.is_known);
    p->residual = places.residual;
    for (int i = 0; i < 3; i++) p->field[i] = places.off[i + 1];
}

/* Computes *out, the point at depth t on each of the given rays, between the ends of the ray's interval (`ends`).
 * Returns the rays for which Newton's method did not find the point's reference coordinates. */
SIMD_INLINE vm kernel_local_find_point_at_depth(const kernel_local_chord *c, const kernel_point ends[2], vm rays, vf t,
                                                int type, kernel_point *out)
{
    const vf along = (t - ends[0].t) / (ends[1].t - ends[0].t), u = along - 0.5f;
    kernel_point at;
    vf residual;
    for (int a = 0; a < 3; a++) at.r[a] = vf_muladd(c->span[a], u, c->middle[a]);
    const vm known = kernel_local_refine_coordinates(c, &u, 1, rays, type, &at, &residual);
    at.t = t;
    at.value = (ends[0].value + (ends[1].value - ends[0].value) * along) + at.value;
    kernel_point_copy_lanes(rays, &at, out);
    return vm_andnot(rays, known);
}

#endif
