/* Emission and absorption along a segment on which the field is linear.
 *
 * The transfer function is cut into pieces on which opacity and colour are linear in the value, and so along the
 * segment. A ray's march goes from piece to piece, in steps that are short enough for Gauss's rule: with the extinction
 *     sigma = -ln(1 - opacity)
 * at the nodes c_j, the optical depth up to node j is that of the polynomial through all nodes (the coefficients of the
 * Gauss collocation method), and
 *     colour = length * sum w_j colour(c_j) sigma_j exp(-depth_j),    transmittance = exp(-length * sum w_j sigma_j).
 *
 * Why quadrature and not the closed forms of a linear extinction (erfcx, Dawson): the documented function has opacity
 * linear, and an extinction that is linear between knots follows it to 1e-7 only with some 2,000 knots a ramp, each of
 * which costs a step. Three nodes follow the logarithm itself. The sums have positive terms alone: nothing cancels, be
 * the optical depth 1e-8 or 1e3.
 *
 * Errors of a step with 3 nodes, in float: with u = 1 - opacity, |u1 - u0| <= 0.3 u0 makes the remainder of sigma's
 * integral, 5e-7 * 120 (du / u)^6 over the length with u at the middle, less than 1.2e-7 of the step's length in unit
 * distances; an optical depth d of at most 0.35 makes that of sigma exp(-depth), whose sixth derivative is below
 * 35 d^3.5 where sigma falls to nothing (the worst case, a Gaussian's), less than 4.4e-7.
 *
 * The file is compiled a second time by the tests on doubles with more nodes (KERNEL_REAL_IS_DOUBLE), which shows
 * that what it computes is the integral and not something near it. */
#ifndef RENDER_KERNEL_INTEGRAL_H
#define RENDER_KERNEL_INTEGRAL_H

#include "kernel_pieces.h"

#if !defined(KERNEL_REAL_IS_DOUBLE)
#include "kernel_colour.h"

enum { KERNEL_NODES = 3 };

static const struct {
    float node[KERNEL_NODES], weight[KERNEL_NODES], partial[KERNEL_NODES][KERNEL_NODES];
} kernel_gauss = {{0.11270167f, 0.5f, 0.88729833f},
                  {0.27777778f, 0.44444444f, 0.27777778f},
                  {{0.13888889f, -0.035976668f, 0.0097894440f},
                   {0.30026319f, 0.22222222f, -0.022485417f},
                   {0.26798833f, 0.48042111f, 0.13888889f}}};

/* -ln(1 - a), relative to 3e-7, for a in [0, 1]; what 1 - a lost to rounding is put back to first order. */
SIMD_INLINE vf kernel_extinction(vf a)
{
    const vf clear = vf_max(1.0f - a, vf_set(6e-8f));
    const vf rest = (1.0f - clear) - a;
    return -(vf_log2(clear) * 0.69314718f + rest / clear);
}

SIMD_INLINE vf kernel_exp(vf x)
{
    return vf_exp2(x * 1.4426950f);
}
#endif

/* Limits of a step (see above). Below LEAST_CLEAR of 1 - opacity what the rule misses is nothing. */
#define KERNEL_STEP_DEPTH ((kernel_real)0.35)
#define KERNEL_STEP_RATIO ((kernel_real)0.3)
#define KERNEL_LEAST_CLEAR ((kernel_real)1e-4)
/* The extinction where the opacity is 1 throughout. */
#define KERNEL_OPAQUE ((kernel_real)1e6)

/* What a segment adds: colour (premultiplied) and what it lets through. */
typedef struct kernel_light {
    vf colour[3], depth; /* depth: -ln(transmittance), whose sums round less than products near 1 */
    vf transmittance;
} kernel_light;

SIMD_INLINE kernel_light kernel_clear(void)
{
    return (kernel_light){{vf_set(0), vf_set(0), vf_set(0)}, vf_set(0), vf_set(1)};
}

/* Pieces that rays are in: most often one for all, which saves the gathers. */
typedef struct kernel_piece_place {
    vi at;
    const kernel_piece *common;
} kernel_piece_place;

SIMD_INLINE kernel_piece_place kernel_piece_place_of(const kernel_pieces *t, vm rays, vf piece)
{
    const int lane = __builtin_ctz(vm_bits(rays));
    const int first = (int)piece[lane];
    const bool is_common = !vm_any(vm_andnot(rays, vf_eq(piece, vf_set((kernel_real)first))));
    return (kernel_piece_place){vi_from_vf(vf_select(rays, piece, vf_set(0))), is_common ? &t->pieces[first] : NULL};
}

SIMD_INLINE vf kernel_piece_entry(const kernel_pieces *t, const kernel_piece_place *place, int entry)
{
    if (place->common) return vf_set(place->common->entry[entry]);
    return vf_gather(t->pieces[0].entry + entry, place->at * KERNEL_PIECE_ENTRIES);
}

/* The piece that holds value x; at a knot the one above, or (where falling) below. */
SIMD_INLINE vf kernel_piece_find(const kernel_pieces *t, vm rays, vf x, vm falling)
{
    const vf spot = vf_clamp((x - t->bin_low) * t->bin_inverse, vf_set(0), vf_set(KERNEL_PIECE_BINS - 1));
    vf piece = vf_gather(t->bin_first, vi_from_vf(spot));
    for (vm open = rays; vm_any(open);) {
        const kernel_piece_place at = kernel_piece_place_of(t, open, piece);
        const vf low = kernel_piece_entry(t, &at, KERNEL_PIECE_LOW),
                 high = kernel_piece_entry(t, &at, KERNEL_PIECE_HIGH);
        const vm up = vm_and(open, vm_or(vf_lt(high, x), vm_andnot(vf_eq(high, x), falling)));
        const vm down = vm_and(open, vm_or(vf_lt(x, low), vm_and(vf_eq(low, x), falling)));
        piece = vf_select(up, piece + 1.0f, vf_select(down, piece - 1.0f, piece));
        open = vm_or(up, down);
    }
    return piece;
}

/* Weighed from both ends, so that near an end of no opacity it is as exact as the distance to it. */
SIMD_INLINE vf kernel_piece_opacity(const kernel_pieces *t, const kernel_piece_place *place, vf x, vf low, vf high)
{
    const vf inverse = kernel_piece_entry(t, place, KERNEL_PIECE_INVERSE), zero = vf_set(0), one = vf_set(1);
    const vf from_low = kernel_piece_entry(t, place, KERNEL_PIECE_OPACITY) * vf_clamp((high - x) * inverse, zero, one);
    const vf from_high =
        kernel_piece_entry(t, place, KERNEL_PIECE_OPACITY_HIGH) * vf_clamp((x - low) * inverse, zero, one);
    return vf_min(from_low + from_high, one);
}

/* The stretch of one piece under way: from s to end of the segment's [0, 1]. */
typedef struct kernel_stretch {
    vf opacity, rise; /* at its begin; over the whole stretch */
    vf share;         /* of it that is taken now */
    vf length;        /* taken now, in unit distances */
    vm is_opaque;
} kernel_stretch;

SIMD_INLINE void kernel_stretch_limit(kernel_stretch *st, vf length)
{
    const vf zero = vf_set(0), one = vf_set(1), rise = vf_abs(st->rise);
    const vf clear = vf_max(1.0f - st->opacity, vf_set(KERNEL_LEAST_CLEAR));
    st->share = vf_select(vf_lt(clear * KERNEL_STEP_RATIO, rise), clear * KERNEL_STEP_RATIO / rise, one);
    st->is_opaque = vm_and(vf_le(one, st->opacity), vf_eq(st->rise, zero));
    /* -ln(1 - a) <= a / sqrt(1 - a) */
    const vf most = vf_max(st->opacity, st->opacity + st->share * st->rise);
    const vf bound = vf_select(st->is_opaque, vf_set(KERNEL_OPAQUE),
                               most / vf_sqrt(vf_max(1.0f - most, vf_set(KERNEL_LEAST_CLEAR))));
    const vf depth = length * st->share * bound;
    st->share = vf_select(vf_lt(vf_set(KERNEL_STEP_DEPTH), depth), st->share * (KERNEL_STEP_DEPTH / depth), st->share);
    st->length = length * st->share;
}

/* Of the step: emitted light (e0) and its first moment along the step (e1); returns the optical depth. */
SIMD_INLINE vf kernel_stretch_sum(const kernel_stretch *st, vf *e0, vf *e1)
{
    vf sigma[KERNEL_NODES], depth = vf_set(0);
    const vf rise = st->rise * st->share;
    for (int j = 0; j < KERNEL_NODES; j++) {
        const vf a = vf_clamp(st->opacity + rise * kernel_gauss.node[j], vf_set(0), vf_set(1));
        sigma[j] = vf_select(st->is_opaque, vf_set(KERNEL_OPAQUE), kernel_extinction(a)) * st->length;
    }
    *e0 = *e1 = vf_set(0);
    for (int j = 0; j < KERNEL_NODES; j++) {
        vf before = sigma[0] * kernel_gauss.partial[j][0];
        for (int k = 1; k < KERNEL_NODES; k++) before += sigma[k] * kernel_gauss.partial[j][k];
        const vf light = sigma[j] * kernel_gauss.weight[j] * kernel_exp(-before);
        *e0 += light;
        *e1 += light * kernel_gauss.node[j];
        depth += sigma[j] * kernel_gauss.weight[j];
    }
    return depth;
}

/* Add the segment of the given length (in unit distances) on which the value goes from v_in to v_out, behind what light
 * holds. Values are in the transfer's domain. */
SIMD_INLINE void kernel_integrate(const kernel_pieces *t, vm rays, vf length, vf v_in, vf v_out, kernel_light *light)
{
    const vf zero = vf_set(0), one = vf_set(1), rise = v_out - v_in;
    const vm falling = vf_lt(rise, zero), level = vf_eq(rise, zero);
    const vf turn = vf_select(falling, -one, one);
    vf piece = kernel_piece_find(t, rays, v_in, falling), s = zero, value = v_in;
    vm open = rays;
    while (vm_any(open)) {
        const kernel_piece_place at = kernel_piece_place_of(t, open, piece);
        const vf low = kernel_piece_entry(t, &at, KERNEL_PIECE_LOW),
                 high = kernel_piece_entry(t, &at, KERNEL_PIECE_HIGH);
        const vf edge = vf_select(falling, low, high), to_edge = (edge - v_in) / vf_select(level, one, rise);
        const vf end = vf_select(level, one, vf_clamp(to_edge, s, one)), span = end - s;
        const vf slope = kernel_piece_entry(t, &at, KERNEL_PIECE_SLOPE);
        kernel_stretch st;
        st.opacity = kernel_piece_opacity(t, &at, value, low, high);
        st.rise = vf_clamp(st.opacity + span * rise * slope, zero, one) - st.opacity;
        kernel_stretch_limit(&st, span * length);
        vf e0, e1;
        const vf depth = kernel_stretch_sum(&st, &e0, &e1), step = span * st.share * rise;
        const vf whole = light->transmittance * e0, moment = light->transmittance * e1 * step;
        for (int a = 0; a < 3; a++) {
            const vf colour_slope = kernel_piece_entry(t, &at, KERNEL_PIECE_COLOUR_SLOPE + a);
            const vf colour = kernel_piece_entry(t, &at, KERNEL_PIECE_COLOUR + a) + (value - low) * colour_slope;
            const vf sum = light->colour[a] + (whole * colour + moment * colour_slope);
            light->colour[a] = vf_select(open, sum, light->colour[a]);
        }
        light->depth = vf_select(open, light->depth + depth, light->depth);
        light->transmittance = kernel_exp(-light->depth);
        const vm through = vf_le(one, st.share);
        piece = vf_select(through, piece + turn, piece);
        value = vf_select(through, edge, value + step);
        s = vf_select(through, end, s + span * st.share);
        open = vm_and(open, vm_and(vf_lt(s, one), vf_lt(vf_set(KERNEL_BLACK), light->transmittance)));
    }
}

#endif
