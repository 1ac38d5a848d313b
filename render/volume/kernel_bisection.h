/* Bisects those parts of a ray's interval in a hex, wedge or pyramid for which no number of equal segments is accurate
 * enough (kernel_segments.h defines segments). A step is a value at which the opacity jumps. No finite slope bounds the
 * effect that a small field error has there on the light. If a curved field barely exceeds that value, the length of
 * the part of the ray on which it exceeds the value grows with the square root of the excess: at 800 optical depths an
 * error of the field of 1e-6 of the transfer function's domain changes such a pixel by a tenth. So the bisection is
 * computed in double, from the mesh's coordinates and values and the ray's position in the picture, one ray at a time,
 * and identically for all instruction sets.
 *
 * Subintervals. The chord of a subinterval is the linear function with the field's values at the two ends. The field is
 * computed at the ends, quarters and middle; its deviation from the chord is taken as at most d, which is 1.5 times the
 * largest deviation at the quarters and the middle. (For a cubic, the largest of these three deviations is at least 7/8
 * of the maximum deviation.) A cubic deviates from its chord by s (1 - s) (u + q (s - 1/2)), s from 0 to 1, and its
 * slope deviates from the chord's by at most u + q / 2, at an end. If the deviation is at most e at the middle and the
 * quarters, then |u| <= 4 e, |u| + |q| / 4 <= 16/3 e, and the slope's deviation is at most 32/3 e. So if the chord
 * rises by 12 e or more the field is monotone on the subinterval and on each part of it; the criterion leaves a margin
 * for nonlinear maps. If the field is monotone, its values lie between the values at the ends. Otherwise they lie in
 * this range, extended by d on both sides. A subinterval that
 *   - lies on one side of each step and has a chord that is close enough becomes a segment;
 *   - is monotone, with a step's value strictly between those at its ends, is cut where the field has that value;
 *   - is of neither kind is halved, and the halves are treated in the same way, the nearer one first.
 * So where a field barely reaches a step, only the subintervals around its extremum are halved, until the subinterval
 * there lies on one side of the step or is too short to be visible.
 *
 * The error of a subinterval (see also docs/development/error_budget.md). Let L be its length in unit distances, and T
 * the share of the light that passes from it to the interval's begin. Over the subinterval's values let the extinction
 * range from s0 to s1 and change by at most s' per value, let the colour change by at most c' per value, and let R be
 * the colours' contrast. A field error of d on average changes the extinction by ds <= s' d, and by at most s1 - s0,
 * and the colour by dc <= c' d. Light in the subinterval falls at least as exp(-s0 t), so that R ds is visible over at
 * most min(L, 1 / s0), and s1 dc over min(s1 L, 1) / s1: error <= R ds min(L, 1 / s0) + dc min(s1 L, 1), times T. The
 * error may be 7/8 of that which equal segments may have. With the frame's a = allowance and reach (the longest
 * ray, in unit distances) and D = s0 L: T error <= 7/8 a (L / reach + T D / (1 + D)). The remaining eighth is for
 * subintervals at an extremum that touches a step, for which no bisection suffices: a subinterval is not divided
 * further if T times its error for any d (from s1 - s0 alone) is at most 1/32 of a (length of the interval / reach). A
 * cubic has two extrema, and four such subintervals use the remaining eighth. */
#ifndef RENDER_KERNEL_BISECTION_H
#define RENDER_KERNEL_BISECTION_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_bound.h"
#include "kernel_cell.h"
#include "kernel_exact.h"
#include "kernel_integral.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_segment_list.h"
#include "kernel_types.h"
#include "simd.h"

/* Returns the rays for which the opacity has a step at a value from low to high. */
SIMD_INLINE vm kernel_has_opacity_step_in_range(const kernel_pieces *t, vf low, vf high)
{
    vm any = vm_none();
    for (int i = 0; i < t->step_count; i++) {
        const vf cut = vf_set(kernel_round_opacity_step(t->steps[i]));
        any = vm_or(any, vm_and(vf_le(low, cut), vf_le(cut, high)));
    }
    return any;
}

/* KERNEL_BISECTION_DEPTH: maximum number of halvings; 2^-40 of an interval is negligible in any medium.
 * KERNEL_BISECTION_ROOM: size of the stack of subintervals. KERNEL_BISECTION_SEGMENTS: after that many segments the
 * rest of the interval is not divided further; this is a safeguard that no known transfer function reaches. */
enum { KERNEL_BISECTION_DEPTH = 40, KERNEL_BISECTION_ROOM = 128, KERNEL_BISECTION_SEGMENTS = 8192 };

/* ---- the field on a ray ---- */

/* A point of the ray: depth t, value v of the field in the transfer function's domain, and reference coordinates r in
 * the cell. */
typedef struct kernel_exact_point {
    double t, v, r[3];
} kernel_exact_point;

/* State of the bisection of a ray's interval in a cell. */
typedef struct kernel_bisection {
    const kernel_frame *frame;
    kernel_segments *list;
    /* polynomial coefficients of the cell's map (3 rows) and of the field (kernel_exact_fit_cell_polynomials()) */
    const double (*map)[8];
    bool is_pyramid;
    /* constants of the ray: at depth t its x and y in tile space are (u, v) * (slope * t + depth_offset) */
    double u, v, slope, depth_offset;
    kernel_exact_point in, out; /* ends of the interval, at the crossings of the faces */
    /* per_t: unit distances per unit of t; length: length of the interval, in unit distances; light: share of the light
     * that passes from the begin of the current subinterval to the begin of the interval */
    double per_t, length, light;
    int64_t *map_failures; /* counts the points at which the inversion of the cell's map failed */
    int count;             /* number of segments so far */
} kernel_bisection;

static inline double kernel_interpolate(double from, double to, double share)
{
    return from + (to - from) * share;
}

/* Computes the ray's point at depth t, as kernel_evaluate_field_in_one_cell() does, but in double. Newton's method
 * finds the reference coordinates, first from the initial guess `guess` and, if it does not converge, from a point near
 * the cell's middle. If both attempts fail, reference coordinates and field are interpolated between the ends of the
 * interval. */
static kernel_exact_point kernel_find_exact_point_at_depth(const kernel_bisection *h, double t, const double guess[3])
{
    kernel_exact_point out = {.t = t};
    const double reach = h->slope * t + h->depth_offset, target[3] = {h->u * reach, h->v * reach, t};
    double slopes[3];
    memcpy(out.r, guess, sizeof out.r);
    if (!kernel_exact_invert_map(h->map, h->is_pyramid, target, out.r) || !kernel_exact_is_in_or_near_cell(out.r)) {
        out.r[0] = out.r[1] = 0.4;
        out.r[2] = 0.5;
        if (!kernel_exact_invert_map(h->map, h->is_pyramid, target, out.r) || !kernel_exact_is_in_or_near_cell(out.r)) {
            const double share = (t - h->in.t) / (h->out.t - h->in.t);
            for (int a = 0; a < 3; a++) out.r[a] = kernel_interpolate(h->in.r[a], h->out.r[a], share);
            out.v = kernel_interpolate(h->in.v, h->out.v, share);
            ++*h->map_failures;
            return out;
        }
    }
    out.v = kernel_exact_evaluate_polynomial(h->map[3], out.r,
                                             kernel_exact_compute_product_term(h->is_pyramid, out.r, slopes));
    return out;
}

/* Returns the ray's point at the depth a->t + share * (b->t - a->t), between the points a and b. */
static kernel_exact_point kernel_find_exact_point_between(const kernel_bisection *h, const kernel_exact_point *a,
                                                          const kernel_exact_point *b, double share)
{
    double guess[3];
    for (int n = 0; n < 3; n++) guess[n] = kernel_interpolate(a->r[n], b->r[n], share);
    return kernel_find_exact_point_at_depth(h, kernel_interpolate(a->t, b->t, share), guess);
}

/* Returns the ray's point between a and b at which the field is x. The values at a and b must lie on different sides of
 * x. The search is regula falsi in the Illinois variant (it halves the value at an end that is kept), with a bisection
 * in every third step. */
static kernel_exact_point kernel_find_exact_point_of_value(const kernel_bisection *h, const kernel_exact_point *a,
                                                           const kernel_exact_point *b, double x)
{
    kernel_exact_point low = *a, high = *b, at = *a;
    double low_v = low.v - x, high_v = high.v - x;
    const double enough = 1e-15 * fmax(1, fabs(x));
    for (int n = 0; n < 60; n++) {
        const double share = n % 3 == 2 ? 0.5 : low_v / (low_v - high_v);
        at = kernel_find_exact_point_between(h, &low, &high, share);
        const double v = at.v - x;
        if (fabs(v) <= enough || high.t - low.t <= 1e-16 * fabs(at.t)) break;
        if ((v < 0) == (low_v < 0)) {
            low = at;
            low_v = v;
            high_v *= 0.5;
        } else {
            high = at;
            high_v = v;
            low_v *= 0.5;
        }
    }
    at.v = x;
    return at;
}

/* ---- effect of a subinterval on the light ---- */

static inline double kernel_piece_low(const kernel_real *p)
{
    return (double)p[KERNEL_PIECE_LOW] + (double)p[KERNEL_PIECE_LOW_REST];
}

static inline double kernel_piece_high(const kernel_real *p)
{
    return (double)p[KERNEL_PIECE_HIGH] + (double)p[KERNEL_PIECE_HIGH_REST];
}

/* Returns bounds of the transfer function over the values from low to high. */
static kernel_bound kernel_bound_transfer_over_values(const kernel_pieces *t, double low, double high)
{
    const double last = KERNEL_PIECE_BINS - 1;
    kernel_bound out = {.extinction_low = 1e30f};
    int at = (int)t->bin_first[(int)fmin(fmax((low - (double)t->bin_low) * (double)t->bin_inverse, 0), last)];
    while (at > 0 && low < kernel_piece_low(t->pieces[at])) at--;
    while (at + 1 < t->count && kernel_piece_high(t->pieces[at]) <= low) at++;
    do {
        const kernel_real *p = t->pieces[at++];
        kernel_bound_widen(&out, p, fmax(low, kernel_piece_low(p)), fmin(high, kernel_piece_high(p)));
    } while (at < t->count && kernel_piece_low(t->pieces[at]) < high);
    return out;
}

/* A subinterval of a ray's interval. Its begin is not stored, because it is the end of the previous subinterval. depth:
 * number of divisions that made the subinterval; is_monotone: the field has been proved to be monotone on it;
 * deviation: largest deviation of the field from its chord at the quarters and the middle; low, high: range of the
 * field's values. */
typedef struct kernel_subinterval {
    kernel_exact_point end, middle;
    int depth;
    bool is_monotone;
    double deviation, low, high;
} kernel_subinterval;

/* Computes the deviation of the field from its chord on a subinterval, and the range of its values. from: begin of the
 * subinterval; first, third: its points at one and three quarters. */
static void kernel_measure_subinterval_deviation(const kernel_exact_point *from, kernel_subinterval *sub,
                                                 const kernel_exact_point *first, const kernel_exact_point *third)
{
    const double a = from->v, b = sub->end.v, rise = b - a;
    sub->low = fmin(a, b);
    sub->high = fmax(a, b);
    sub->deviation = fmax(fmax(fabs(a + 0.25 * rise - first->v), fabs(a + 0.75 * rise - third->v)),
                          fabs(a + 0.5 * rise - sub->middle.v));
    sub->is_monotone = sub->is_monotone || fabs(rise) >= 12 * sub->deviation;
    if (sub->is_monotone) return;
    sub->low -= 1.5 * sub->deviation;
    sub->high += 1.5 * sub->deviation;
}

/* Returns an upper bound of the error of light if the subinterval becomes one segment. s: bounds of the transfer
 * function over its values; length: its length in unit distances; *all: becomes an upper bound of the error that holds
 * for any deviation of the field from its chord. */
static double kernel_bound_subinterval_error(const kernel_bisection *h, const kernel_subinterval *sub,
                                             const kernel_bound *s, double length, double *all)
{
    const double least = (double)s->extinction_low, most = (double)s->extinction_high;
    const double contrast = (double)h->list->pieces->contrast, colour_slope = (double)s->colour_slope;
    const double seen = fmin(length, 1 / fmax(least, 1e-30)), lit = fmin(most * length, 1);
    const double tint = fmin(colour_slope * (sub->high - sub->low), contrast);
    *all = fmin(contrast * (most - least) * seen + tint * lit, contrast * lit);
    return fmin(contrast * ((double)s->extinction_slope * sub->deviation) * seen +
                    fmin(colour_slope * sub->deviation, contrast) * lit,
                *all);
}

/* ---- steps ---- */

/* Returns a step of the opacity whose value is strictly between low and high, or NULL if there is none. */
static const double *kernel_find_opacity_step_between(const kernel_bisection *h, double low, double high)
{
    const double *steps = h->list->pieces->steps;
    for (int i = 0; i < h->list->pieces->step_count; i++)
        if (low < steps[i] && steps[i] < high) return &steps[i];
    return NULL;
}

/* Computes the range side[0] .. side[1] of float32 values between two neighbouring steps of the opacity: those between
 * which the value `inside` lies. */
static void kernel_range_between_steps(const kernel_bisection *h, double inside, float side[2])
{
    const double *steps = h->list->pieces->steps;
    int n = 0;
    side[0] = -3e38f, side[1] = 3e38f;
    for (; n < h->list->pieces->step_count && steps[n] <= inside; n++) side[0] = kernel_round_opacity_step(steps[n]);
    /* a segment whose values all equal a step's value counts as above the step; so the range ends at the float32 just
     * below the step, and values below the step are never rounded up to the step */
    if (n < h->list->pieces->step_count) side[1] = nextafterf(kernel_round_opacity_step(steps[n]), side[0]);
}

/* Rounds x to float32 and clamps it to `side`, the range between two neighbouring steps; *rest: the rounding error,
 * taken as 0 if the result is an end of the range. */
static void kernel_step_round(const float side[2], double x, float *v, double *rest)
{
    const double clamped = fmax(fmin(x, (double)side[1]), (double)side[0]);
    *v = (float)clamped;
    *rest = side[0] < *v && *v < side[1] ? clamped - (double)*v : 0;
}

/* Returns bounds of the transfer function over the values of the subinterval. step: a step of the opacity among these
 * values, or NULL. */
static kernel_bound kernel_bound_transfer_on_subinterval(const kernel_bisection *h, const kernel_subinterval *sub,
                                                         const double *step)
{
    float side[2];
    kernel_range_between_steps(h, sub->middle.v, side);
    if (step)
        return kernel_bound_transfer_over_values(
            h->list->pieces, fmin(sub->low, (double)nextafterf(kernel_round_opacity_step(*step), -3e38f)),
            fmax(sub->high, (double)nextafterf(kernel_round_opacity_step(*step), 3e38f)));
    const double low = fmin(fmax(sub->low, (double)side[0]), (double)side[1]);
    const double high = fmin(fmax(sub->high, (double)side[0]), (double)side[1]);
    return kernel_bound_transfer_over_values(h->list->pieces, low, high);
}

/* ---- segments ---- */

/* Returns the same segment in all lanes. length: in unit distances. The values at the segment's ends are v[0] + rest[0]
 * and v[1] + rest[1]. */
static kernel_unit_segment kernel_broadcast_segment(double length, const float v[2], const double rest[2])
{
    return (kernel_unit_segment){vf_set((float)length), vf_set(v[0]), vf_set(v[1]), vf_set((float)rest[0]),
                                 vf_set((float)rest[1])};
}

/* Adds the subinterval as a segment that has the field's values at its ends. Unlike segments of equal length, to whose
 * values an offset is added so that their mean is that of the field (kernel_local_budget.h), it gets no offset: with
 * one it might reach values for which no error bound has been computed. */
static void kernel_subinterval_add_segment(const kernel_bisection *h, int lane, const kernel_exact_point *from,
                                           const kernel_subinterval *sub)
{
    const bool is_cut = kernel_find_opacity_step_between(h, sub->low, sub->high) != NULL;
    const double x[2] = {from->v, sub->end.v}, length = (sub->end.t - from->t) * h->per_t;
    double rest[2] = {0, 0};
    float v[2] = {(float)x[0], (float)x[1]}, side[2];
    kernel_range_between_steps(h, sub->middle.v, side);
    for (int i = 0; i < 2 && !is_cut; i++) kernel_step_round(side, x[i], &v[i], &rest[i]);
    const float t0 = (float)from->t, t1 = (float)sub->end.t;
    const kernel_unit_segment run = kernel_broadcast_segment(length, v, rest);
    if (h->list->is_double || t0 < t1)
        kernel_segments_add(h->list, false, h->list->is_double, vi_set(lane), vm_from_bits(1u << lane), vf_set(t0),
                            vf_set(t1), &run);
}

/* ---- bisection of an interval ---- */

/* Returns whether the error of light is small enough if the subinterval becomes one segment. is_cut: a step of the
 * opacity lies among its values; length: in unit distances. */
static bool kernel_is_subinterval_accurate(const kernel_bisection *h, const kernel_subinterval *sub,
                                           const kernel_bound *s, double length, bool is_cut)
{
    const double reach = (double)h->frame->reach[h->list->volume], a = (double)h->frame->allowance;
    const double depth = (double)s->extinction_low * length;
    double all;
    const double error = kernel_bound_subinterval_error(h, sub, s, length, &all);
    if (!is_cut && h->light * error <= 0.875 * a * (length / reach + h->light * depth / (1 + depth))) return true;
    return (is_cut || !sub->is_monotone) && h->light * all <= a * h->length / (32 * reach);
}

/* Divides a part of a ray's interval, whose ends and middle are known, into subintervals by bisection, and adds their
 * segments. lane: the ray's lane in its packet; from: begin of the part. */
static void kernel_subinterval_bisect(kernel_bisection *h, int lane, kernel_exact_point from, kernel_subinterval whole)
{
    const kernel_segments *list = h->list;
    kernel_subinterval stack[KERNEL_BISECTION_ROOM];
    int count = 1;
    stack[0] = whole;
    while (count > 0 && (float)from.t < list->t_end[lane]) {
        kernel_subinterval sub = stack[--count];
        const kernel_exact_point first = kernel_find_exact_point_between(h, &from, &sub.middle, 0.5);
        const kernel_exact_point third = kernel_find_exact_point_between(h, &sub.middle, &sub.end, 0.5);
        kernel_measure_subinterval_deviation(&from, &sub, &first, &third);
        const double *step = kernel_find_opacity_step_between(h, sub.low, sub.high);
        const kernel_bound s = kernel_bound_transfer_on_subinterval(h, &sub, step);
        const double length = (sub.end.t - from.t) * h->per_t;
        const bool is_last = sub.depth >= KERNEL_BISECTION_DEPTH || h->count >= KERNEL_BISECTION_SEGMENTS ||
                             count + 2 > KERNEL_BISECTION_ROOM;
        if (is_last || kernel_is_subinterval_accurate(h, &sub, &s, length, step != NULL)) {
            if (list->t_begin[lane] <= (float)from.t) kernel_subinterval_add_segment(h, lane, &from, &sub);
            const double depth = (double)s.extinction_low * length;
            h->light /= 1 + depth * (1 + 0.5 * depth);
            h->count++;
            from = sub.end;
            continue;
        }
        kernel_subinterval near = {.end = sub.middle, .middle = first, sub.depth + 1, sub.is_monotone};
        kernel_subinterval far = {.end = sub.end, .middle = third, sub.depth + 1, sub.is_monotone};
        if (step && sub.is_monotone) {
            near.end = kernel_find_exact_point_of_value(h, &from, &sub.end, *step);
            near.middle = kernel_find_exact_point_between(h, &from, &near.end, 0.5);
            far.middle = kernel_find_exact_point_between(h, &near.end, &far.end, 0.5);
        }
        stack[count++] = far;
        stack[count++] = near;
    }
}

/* Divides the rays' intervals between the depths t0 and t1 by bisection, and adds those of their segments that begin in
 * the window. i: the rays' intervals in the whole cell. */
static __attribute__((noinline, cold)) void kernel_interval_bisect(kernel_packet *p, kernel_segments *list,
                                                                   const kernel_cell *c, const kernel_interval *i,
                                                                   vm rays, vf t0, vf t1)
{
    const kernel_frame *f = p->frame;
    const bool is_flat = f->job->camera.is_orthographic;
    double map[4][8];
    double u[SIMD_WIDTH], v[SIMD_WIDTH];
    kernel_get_ray_parameters_in_double(p, u, v);
    kernel_exact_fit_cell_polynomials(map, p, c, &f->volumes[list->volume]);
    for (unsigned bits = vm_bits(rays); bits; bits &= bits - 1) {
        const int n = __builtin_ctz(bits);
        kernel_bisection h = {.frame = f,
                              .list = list,
                              .map = (const double(*)[8])map,
                              .is_pyramid = kernel_has_apex(c->type),
                              .u = u[n],
                              .v = v[n],
                              .slope = is_flat ? 0 : 1,
                              .depth_offset = is_flat ? f->job->space.scale : p->tile->depth_shift,
                              .in = {.t = (double)i->t_in[n], .v = (double)i->v_in[n]},
                              .out = {.t = (double)i->t_out[n], .v = (double)i->v_out[n]},
                              .per_t = (double)list->per_t[n],
                              .length = (double)((t1[n] - t0[n]) * list->per_t[n]),
                              .light = 1,
                              .map_failures = &p->thread->map_failures};
        for (int a = 0; a < 3; a++) {
            h.in.r[a] = (double)i->r_in[a][n];
            h.out.r[a] = (double)i->r_out[a][n];
        }
        const double whole = h.out.t - h.in.t;
        if (!(whole > 0)) continue;
        const double a = ((double)t0[n] - h.in.t) / whole, b = ((double)t1[n] - h.in.t) / whole;
        const kernel_exact_point from = kernel_find_exact_point_between(&h, &h.in, &h.out, a);
        kernel_subinterval sub = {.end = kernel_find_exact_point_between(&h, &h.in, &h.out, b)};
        kernel_exact_point begin = from;
        begin.t = (double)t0[n];
        sub.end.t = (double)t1[n];
        sub.middle = kernel_find_exact_point_between(&h, &from, &sub.end, 0.5);
        kernel_subinterval_bisect(&h, n, begin, sub);
    }
}

#endif
