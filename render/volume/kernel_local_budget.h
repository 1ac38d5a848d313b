/* Computes the number of equal segments into which a ray's interval in a hex, wedge or pyramid is divided, from bounds
 * of the error of light (docs/development/error_budget.md derives the allowed error). kernel_segments.h defines
 * segments and their units.
 *
 * Let f be the field on the ray, and v its approximation by segments, each of which is linear and has the same mean
 * along its length as a polynomial that is fitted to f. Let s be the extinction, c the colour, b the light from behind,
 * T the transmittance up to a point, and let primes be derivatives by the value. The approximation changes the light by
 * the integral of T g (v - f) along the ray, with g = (s c)' - s' b. On each segment v - f has mean zero, apart from
 * the polynomial's own error, so that only the variation of T g along the segment counts: the error is at most half the
 * oscillation (maximum minus minimum) of T g, times the integral of |v - f|. Over a range of values |g| is at most
 * `cost`, and for a fixed b, g varies by at most `swing` (error_variation in the code). g is linear in b, so both
 * follow from the minimum and the maximum of b (kernel_look_up_light_error_bounds()). Let D be the segment's optical
 * depth and R the colours' contrast. Along the segment T falls by at most min(D, 1), and b changes by at most R min(D,
 * 1):
 *
 *     oscillation of T g <= T (swing + min(D, 1) (cost + R |s'|)),      and no more than 2 T cost.
 *
 * Let d1, d2 and d3 be the deviations of f from its chord over the whole interval, at a quarter, the middle and three
 * quarters of it. The mean of |v - f| for one segment is the sum of three parts. The quadratic part is 0.26 P, where P
 * = |d2|. The cubic part is 1.09 A, where A = |d3 - d1| / 2 (the factor is 0.67 for one segment; for n >= 2 segments it
 * is at most 1.082 if the mean is multiplied by n^2). The quartic part is at most 4 E, where E = |(d1 + d3) / 2 - 3/4
 * d2|. With n equal segments all three are divided by n^2.
 *
 * The error of the polynomial itself does not have mean zero. The mean of its magnitude is 3.1 E, but its mean along
 * the ray is at most E. So its effect on light is at most cost E, plus half the oscillation of T g times 3.1 E (which
 * the 4 E of a single segment include); or 3.1 cost E in all if that is less. The error of f by the residual of
 * Newton's method (kernel_local_deviation.h) is multiplied by the cost.
 *
 * cost and swing are first computed over all values in the cell. If the error is then too large for one segment, they
 * are computed over the ray's own values, whose range is about a third of the cell's: from the lesser to the greater of
 * the values at the faces, extended by 1.17 P on the side to which the quadratic part deviates (P, and P / 6 by which
 * the ends of segments are raised), and on both sides by 1.7 A (1.03 A of the cubic part, and 0.67 A of the segments'
 * ends) and 10 E (1.33 E and 0.71 E of the quartic part and the segments' ends, the rest for the polynomial's error).
 *
 * E may vanish although parts of higher order do not, and in hexes P and A may vanish too: values at eight vertices can
 * be such that the field equals its chord at all three places. So E is taken as at least 0.01 (P + A) N^2 + e N^2 S,
 * where N is the bound of the derivative of the map's nonlinear part, S the sum of |h| times the nonlinear terms'
 * slopes (both in kernel_local_deviation.h), and e is 0.0011 in hexes and 0.0004 in wedges. Along a ray in a pyramid
 * the field is a linear function and a piece of a conic section, whose three numbers the three places determine: e is
 * 0. A deviation that the three places do not show is of at least the fifth order, so that 2 p^4 e is enough for a part
 * of the interval with share p.
 *
 * These constants are measured. The test set was random rays in 5,000 random cells with N up to 0.89. Two kinds of
 * fields were tested: those for which E = 0, and those that equal the chord at all three places; in both cases with the
 * largest possible error of the mean. The polynomial's mean erred by at most 0.54 E on whole intervals, 0.57 E on
 * halves, 0.72 E on quarters and 0.36 E on eighths. The field itself deviated by at most 3.1 E on average, except for
 * 19 of 133,000 of these fields (5.8 E), and by 50 E for fields optimized to make E, P and A vanish in hexes that are
 * hardly bent (N < 0.05). The bound of the mean of |v - f| for one segment held in all of them; the bound for several
 * segments is too small there. */
#ifndef RENDER_KERNEL_LOCAL_BUDGET_H
#define RENDER_KERNEL_LOCAL_BUDGET_H

#include "grid.h"
#include "kernel_bisection.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_integral.h"
#include "kernel_local_deviation.h"
#include "kernel_types.h"
#include "simd.h"

/* An interval is halved up to KERNEL_LOCAL_LEVELS times into parts, each with a polynomial of its own.
 * KERNEL_LOCAL_PIECES: maximum number of segments of a part. */
enum { KERNEL_LOCAL_LEVELS = 5, KERNEL_LOCAL_PIECES = 32 };
/* Length of the shortest parts, as a share of the interval. */
#define KERNEL_LOCAL_LEAST_SHARE (1.0f / (1 << KERNEL_LOCAL_LEVELS))

/* Share of the allowed error of light that the residual of Newton's method may cause. */
#define KERNEL_LOCAL_SLACK 0.4f

/* Upper bound of the rounding of a ray's values in float32, relative to max(1, |value|). This bound is added to the
 * error of the field if the opacity has narrow ramps. docs/development/error_budget.md derives at most 4e-7; this is
 * ten times as much. */
#define KERNEL_VALUE_ROUNDING 4e-6f

/* ---- cells ---- */

/* Computes, for the cell in each lane, the bounds that depend on the range of its values: the members low, high, cost,
 * error_variation, weight_change, extinction and tolerance of *out. `sensitivity` and `residual_limit` must be set.
 * values: the field at the cells' vertices, by vertex and lane. The bounds must also hold at the ends of segments,
 * which may lie outside of the vertices' values. If there is one segment, its ends exceed them by at most 3/16 of the
 * values' range (kernel_local_exceeds_bounded_values()). If there are several, their ends exceed them by a sixth of the
 * quadratic part's maximum, which is less than that. */
SIMD_INLINE void kernel_local_set_light_error_bounds(const kernel_frame *f, int volume,
                                                     const float (*values)[SIMD_WIDTH], int type,
                                                     kernel_local_bounds *out)
{
    const kernel_pieces *t = &f->pieces[volume];
    vf low = vf_load(values[0]), high = low, light[KERNEL_LIGHT_ENTRIES];
    for (int i = 1; i < grid_type_vertex_count(type); i++) {
        low = vf_min(vf_load(values[i]), low);
        high = vf_max(vf_load(values[i]), high);
    }
    const vf margin = 0.1875f * (high - low);
    low -= margin;
    high += margin;
    kernel_look_up_light_error_bounds(t, low, high, light);
    const vf cost = light[KERNEL_LIGHT_COST];
    vf_store(out->cost, cost);
    vf_store(out->error_variation, light[KERNEL_LIGHT_VARIATION]);
    vf_store(out->weight_change, cost + light[KERNEL_LIGHT_STEEPNESS]);
    vf_store(out->extinction, light[KERNEL_LIGHT_EXTINCTION]);
    vf_store(out->low, low);
    vf_store(out->high, high);
    /* the residual of Newton's method may cause the share KERNEL_LOCAL_SLACK of the error of light that is allowed in
     * proportion to the ray's length */
    const vf slack = vf_set(KERNEL_LOCAL_SLACK * f->allowance / f->reach[volume]) / (cost * vf_load(out->sensitivity));
    const vf tolerance = vf_min(vf_max(slack, vf_set(1e-6f)), vf_load(out->residual_limit));
    vf_store(out->tolerance, tolerance);
}

/* Computes the bounds of a cell whose map is too nonlinear for processing in lanes; all lanes of *out get the same
 * bounds. No bounds of the map's derivatives are known. In the lower limit of E (top of this file) N^2 is therefore
 * taken as 3, and the range of the values takes the place of S. This limit was at least 1.4 times the error of the
 * polynomial's mean in a test of 200,000 hexes, wedges and pyramids whose vertices were moved by up to 0.55 edges along
 * each axis, so that some were nearly folded. The test used fields whose three sampled deviations give E = 0, or are
 * all 0. */
SIMD_INLINE void kernel_local_set_bounds_of_single_cell(const kernel_frame *f, int volume, const kernel_cell *c,
                                                        kernel_local_bounds *out)
{
    const float bend = 3;
    float values[8][SIMD_WIDTH];
    for (int i = 0; i < c->count; i++) vf_store(values[i], vf_set(c->f[i]));
    vf_store(out->sensitivity, vf_set(0));
    vf_store(out->residual_limit, vf_set(0));
    kernel_local_set_light_error_bounds(f, volume, (const float(*)[SIMD_WIDTH])values, c->type, out);
    vf_store(out->bend, vf_set(bend));
    vf_store(out->unsampled,
             bend * kernel_local_get_unsampled_factor(c->type) * (vf_load(out->high) - vf_load(out->low)));
}

/* ---- rays in cells ---- */

/* Returns by how much a segment that replaces the whole interval must be raised above the field's chord, so that its
 * mean equals the mean of the fitted polynomial. */
SIMD_INLINE vf kernel_local_compute_segment_offset(const kernel_local_pairs *p)
{
    const vf *d = p->field;
    return (2.0f / 15) * d[1] + (16.0f / 45) * (d[0] + d[2]);
}

/* Returns the rays whose interval must not become a single segment: the values at its raised ends are outside of the
 * range of values for which the error bounds hold (kernel_local_bounds.low and high). */
SIMD_INLINE vm kernel_local_exceeds_bounded_values(const kernel_local_bounds *b, const kernel_local_pairs *p)
{
    const vf v0 = p->ends[0].value, v1 = p->ends[1].value, lift = kernel_local_compute_segment_offset(p);
    const vf low = vf_min(v0, v1) + lift, high = vf_max(v0, v1) + lift;
    return vm_or(vf_lt(low, kernel_gather_lane(b->low, p->rays.lane)),
                 vf_lt(kernel_gather_lane(b->high, p->rays.lane), high));
}

/* Parameters of the functions below. They describe the errors of one segment that replaces a ray's whole interval in
 * its cell:
 *     mean            mean of |v - f|, the magnitude of the field's error; with n segments it is divided by n^2
 *     quartic         E, the bound of the quartic part of the field's deviation from its chord
 *     residual_error  error of the field that the residual of Newton's method causes
 *     weight_change   how much the weight T g of the field's error (top of this file) varies along the segment, because
 *                     the transmittance T and the light from behind, b, change there */

/* Returns an upper bound of the error of light, per unit distance, if the interval becomes one segment: the effect of
 * the part of v - f (segment minus field) that has mean zero, plus the effect of the errors of the segment's mean. */
SIMD_INLINE vf kernel_local_bound_single_segment_error(vf mean, vf quartic, vf residual_error, vf weight_change,
                                                       vf error_variation, vf cost)
{
    const vf half = vf_min(0.5f * (error_variation + weight_change), cost);
    return vf_muladd(half, mean, cost * (quartic + residual_error));
}

/* Computes *error_variation (`swing` at the top of this file) and *cost, the bounds of the effect of field errors on
 * light, over the range of values on the ray's own interval and at the ends of its segments. quartic: E. Returns the
 * rays on which the opacity has a step in this range. */
SIMD_INLINE vm kernel_local_bound_light_error_on_ray(const kernel_pieces *t, const kernel_local_pairs *p, vf quartic,
                                                     vf *error_variation, vf *cost)
{
    const vf *d = p->field, v0 = p->ends[0].value, v1 = p->ends[1].value, zero = vf_set(0);
    const vf wide = 0.85f * vf_abs(d[2] - d[0]) + 10.0f * quartic;
    const vf low = vf_min(v0, v1) + (1.17f * vf_min(d[1], zero) - wide);
    const vf high = vf_max(v0, v1) + (1.17f * vf_max(d[1], zero) + wide);
    vf light[KERNEL_LIGHT_ENTRIES];
    kernel_look_up_light_error_bounds(t, low, high, light);
    *error_variation = light[KERNEL_LIGHT_VARIATION];
    *cost = light[KERNEL_LIGHT_COST];
    const vf rounding = KERNEL_VALUE_ROUNDING * vf_max(vf_max(vf_abs(v0), vf_abs(v1)), vf_set(1));
    return kernel_has_opacity_step_in_range(t, low - rounding, high + rounding);
}

/* Sets p->count, the number of segments of each ray, for an allowed error that grows with the absorption in the
 * interval. length: length of the interval, in unit distances; least: lower limit of p->count. Returns the rays for
 * which no number of segments is accurate enough. */
static __attribute__((noinline)) vm kernel_local_count_segments_by_depth(const kernel_frame *f, int volume, vf mean,
                                                                         vf quartic, vf residual_error,
                                                                         vf weight_change, vf length, vf least,
                                                                         kernel_local_pairs *p)
{
    const kernel_transfer *transfer = &f->volumes[volume];
    const vf v0 = p->ends[0].value, v1 = p->ends[1].value, one = vf_set(1);
    vf opacities = 0.125f * (kernel_opacity(transfer, v0) + kernel_opacity(transfer, v1)), error_variation, cost;
    for (int i = 0; i < 3; i++) {
        const vf value = v0 + (float)(i + 1) * 0.25f * (v1 - v0) + p->field[i];
        opacities += 0.25f * kernel_opacity(transfer, value);
    }
    const vm has_step = kernel_local_bound_light_error_on_ray(&f->pieces[volume], p, quartic, &error_variation, &cost);
    /* The error of light that is allowed per unit distance. */
    const vf allowed = f->allowance * (vf_set(1 / f->reach[volume]) + opacities / vf_muladd(length, opacities, one));
    const vm few = vf_le(
        kernel_local_bound_single_segment_error(mean, quartic, residual_error, weight_change, error_variation, cost),
        allowed);
    const vf half = vf_min(0.5f * (error_variation + weight_change), cost), made = half * mean;
    const vf rest = cost * (quartic + residual_error) + vf_min(3.1f * half, 2.1f * cost) * quartic;
    const vf wanted = -vf_floor(-vf_sqrt(made / vf_max(allowed - rest, vf_set(1e-30f))));
    p->count = vf_select(few, least, vf_clamp(wanted, vf_set(2), vf_set(KERNEL_LOCAL_PIECES + 1)));
    const vm fails = vm_or(vm_not(vf_lt(rest, 0.9f * allowed)), vf_lt(vf_set(KERNEL_LOCAL_PIECES), p->count));
    return vm_or(vm_andnot(fails, few), has_step);
}

/* Sets p->count, the number of segments of each ray, so that no segment is longer than the sampling step. step, length:
 * the step and the interval in unit distances. Returns the rays that need more than 4 segments per part, for which one
 * polynomial is not accurate enough; none if the parts are already as short as allowed. */
SIMD_INLINE vm kernel_local_count_segments_by_step(float step, vf length, kernel_local_pairs *p)
{
    const vf wanted = vf_max(-vf_floor(length * (-1 / step)), vf_set(1));
    p->count = vf_min(wanted, vf_set(KERNEL_LOCAL_PIECES));
    return p->share > KERNEL_LOCAL_LEAST_SHARE ? vf_lt(vf_set(4), wanted) : vm_none();
}

/* Sets p->count, the number of segments of each ray; returns the rays for which no number of segments is accurate
 * enough. The function first tests whether one segment is accurate enough, with bounds over all of the cell's values,
 * and with the error that is allowed in proportion to the interval's length. Only for rays that fail this test, it
 * calls kernel_local_count_segments_by_depth(). */
SIMD_INLINE vm kernel_local_choose_segment_counts(const kernel_frame *f, int volume, const kernel_local_bounds *bounds,
                                                  kernel_local_pairs *p)
{
    const kernel_pieces *pieces = &f->pieces[volume];
    const vi lane = p->rays.lane;
    const vf *d = p->field, length = (p->ends[1].t - p->ends[0].t) * p->per_t;
    if (!(f->allowance > 0)) return kernel_local_count_segments_by_step(f->volumes[volume].exponent, length, p);
    const vf parabola = vf_abs(d[1]), cubic = 0.5f * vf_abs(d[2] - d[0]);
    const float square = p->share * p->share, unsampled = p->share < 1 ? 2 * square * square : 1;
    const vf unseen = unsampled * kernel_gather_lane(bounds->unsampled, lane);
    const vf lower = vf_muladd(0.01f * kernel_gather_lane(bounds->bend, lane), parabola + cubic, unseen);
    const vf depth = vf_min(kernel_gather_lane(bounds->extinction, lane) * length, vf_set(1));
    const vf quartic = vf_max(vf_abs(0.5f * (d[0] + d[2]) - 0.75f * d[1]), lower);
    const vf mean = 0.26f * parabola + (1.09f * cubic + 4.0f * quartic);
    const vf weight_change = kernel_gather_lane(bounds->weight_change, lane) * depth;
    vf residual_error = kernel_gather_lane(bounds->sensitivity, lane) * p->residual;
    if (__builtin_expect(pieces->has_rests, 0)) {
        const vf largest = vf_max(vf_max(vf_abs(p->ends[0].value), vf_abs(p->ends[1].value)), vf_set(1));
        residual_error += KERNEL_VALUE_ROUNDING * largest;
    }
    const vf one = vf_set(1), allowed = vf_set(f->allowance * (1 / f->reach[volume]));
    const vf error_variation = kernel_gather_lane(bounds->error_variation, lane),
             cost = kernel_gather_lane(bounds->cost, lane);
    const vm strays = kernel_local_exceeds_bounded_values(bounds, p);
    vm enough = vm_andnot(vf_le(kernel_local_bound_single_segment_error(mean, quartic, residual_error, weight_change,
                                                                        error_variation, cost),
                                allowed),
                          strays);
    if (__builtin_expect(pieces->step_count > 0, 0))
        enough = vm_andnot(enough, kernel_has_opacity_step_in_range(pieces, kernel_gather_lane(bounds->low, lane),
                                                                    kernel_gather_lane(bounds->high, lane)));
    p->count = one;
    if (!vm_any(vm_andnot(p->active, enough))) return vm_none();
    const vm none = kernel_local_count_segments_by_depth(f, volume, mean, quartic, residual_error, weight_change,
                                                         length, vf_select(strays, 2.0f * one, one), p);
    p->count = vf_select(enough, one, p->count);
    return vm_andnot(none, enough);
}

#endif
