/* Integrates emission and absorption along a segment on which the field is linear.
 *
 * The transfer function is divided into pieces: ranges of values on which opacity and colour are linear in the value,
 * and so along the segment. The integration along a ray goes from piece to piece, in one or more steps per piece that
 * are short enough for Gauss's rule. Lengths are in unit distances (render_transfer), values in the transfer function's
 * domain. `clear` is 1 - opacity, `rest` a rounding error. With the extinction
 *     sigma = -ln(1 - opacity)
 * at the nodes c_j, the optical depth up to node j is that of the polynomial through all nodes (the coefficients of the
 * Gauss collocation method), and
 *     colour = length * sum w_j colour(c_j) sigma_j exp(-depth_j),    transmittance = exp(-length * sum w_j sigma_j).
 *
 * Why quadrature and not the closed forms of a linear extinction (erfcx, Dawson): the documented function has linear
 * opacity. An extinction that is linear between knots follows it to 1e-7 only with some 2,000 knots per ramp, each of
 * which costs a step. Three nodes follow the logarithm itself. The sums have only positive terms, so nothing cancels,
 * whether the optical depth is 1e-8 or 1e3.
 *
 * Errors of a step with 3 nodes, in float. With u = 1 - opacity and |u1 - u0| <= 0.3 u0, the remainder of sigma's
 * integral is 5e-7 * 120 (du / u)^6 times the length, with u at the middle, which is less than 1.2e-7 of the step's
 * length in unit distances. With an optical depth d of at most 0.35, the remainder for sigma exp(-depth), whose sixth
 * derivative is below 35 d^3.5 if sigma decreases to nothing (the worst case, a Gaussian), is less than 4.4e-7. If the
 * colour changes by as much as sigma, the sixth derivative is 720 d^3, where d is the depth caused by the change of
 * sigma, and the remainder is 3.6e-4 d^3; that depth is limited to 0.1, so that the remainder is less than 9e-7 of d
 * even in one step alone. Towards an opacity of 1, where sigma has a logarithmic pole, steps become ever shorter. But
 * for a step that begins at the pole itself, three nodes miss only 5 % of sigma's integral (that of -ln s from 0 to 1
 * is computed as 0.948), so no step need be shorter than KERNEL_SHORT, in unit distances and as a share of the ray's
 * interval in the piece.
 *
 * A ray's position in a piece is stored as its distances to the piece's two ends, and opacity and 1 - opacity are
 * interpolated from both ends. The length in a piece is computed from the values that the ray takes there, not from
 * positions on the segment. Each quantity is then exact to a few units in its own last place. If a value and a position
 * from 0 to 1 on the segment were stored instead, both would have the rounding errors of numbers near 1, which steep
 * slopes and narrow pieces of the function would magnify.
 *
 * Tests compile this file a second time for doubles with more nodes (KERNEL_REAL_IS_DOUBLE), to show that it converges
 * to the exact integral. */
#ifndef RENDER_KERNEL_INTEGRAL_H
#define RENDER_KERNEL_INTEGRAL_H

#include "kernel_types.h"

#if !defined(KERNEL_REAL_IS_DOUBLE)
#include "kernel_exponentials.h"

enum { KERNEL_NODES = 3 };

static const struct {
    float node[KERNEL_NODES], weight[KERNEL_NODES], partial[KERNEL_NODES][KERNEL_NODES];
} kernel_gauss = {{0.11270167f, 0.5f, 0.88729833f},
                  {0.27777778f, 0.44444444f, 0.27777778f},
                  {{0.13888889f, -0.035976668f, 0.0097894440f},
                   {0.30026319f, 0.22222222f, -0.022485417f},
                   {0.26798833f, 0.48042111f, 0.13888889f}}};

/* Returns -ln(1 - a) with a relative error of 3e-7, for a in [0, 1]. clear: 1 - a, rounded to float32 or more accurate
 * than that. If a is small, the rounding error of `clear` is corrected to first order. */
SIMD_INLINE vf kernel_extinction(vf a, vf clear)
{
    const vf rest = vf_select(vf_lt(a, vf_set(0.5f)), (1.0f - clear) - a, vf_set(0));
    return -(vf_log2(clear) * 0.69314718f + rest / clear);
}

SIMD_INLINE vf kernel_exp(vf x)
{
    return vf_exp2(x * 1.4426950f);
}

/* Reads upper bounds of the effect of a field error on light, over the values from low to high of each lane
 * (KERNEL_LIGHT_VARIATION etc., kernel_types.h). */
SIMD_INLINE void kernel_look_up_light_error_bounds(const kernel_pieces *t, vf low, vf high,
                                                   vf out[KERNEL_LIGHT_ENTRIES])
{
    const vf zero = vf_set(0), last = vf_set(KERNEL_VARIATION_BINS - 1);
    const vf begin = vf_clamp((low - t->bin_low) * t->variation_inverse, zero, last);
    const vf end = vf_clamp((high - t->bin_low) * t->variation_inverse, begin, last);
    /* The row of the table is the class of the range's width: the width in bins, plus 1, is rounded down to 1, 1.25,
     * 1.5 or 1.75 times a power of two, and these numbers are the classes 0, 1, 2 and so on. */
    const vi width = (vi_from_bits((end - begin) + 1.0f) >> 21) - (127 << 2);
    int32_t at[SIMD_WIDTH];
    vi_store(at, (width * KERNEL_VARIATION_BINS + vi_from_vf(begin)) * KERNEL_LIGHT_ENTRIES);
    vf_gather_rows(t->variations[0], at, out);
}
#endif

/* Limits of an integration step, derived at the top of this file: optical depth, optical depth caused by the change of
 * extinction along the step, and relative change of 1 - opacity. */
#define KERNEL_STEP_DEPTH ((kernel_real)0.35)
#define KERNEL_STEP_CHANGE ((kernel_real)0.1)
#define KERNEL_STEP_RATIO ((kernel_real)0.3)
/* Extinction, per unit distance, of a piece on which the opacity is constantly 1. */
#define KERNEL_OPAQUE ((kernel_real)1e6)
/* Smallest argument of logarithms, and smallest change of a value that counts as a change. */
#define KERNEL_TINY ((kernel_real)1e-30)

/* The light of a segment: premultiplied colour and transmittance. */
typedef struct kernel_light {
    /* depth: optical depth, -ln(transmittance); sums of depths have less rounding than products of transmittances near
     * 1 */
    vf colour[3], depth;
    vf transmittance;
} kernel_light;

SIMD_INLINE kernel_light kernel_light_none(void)
{
    return (kernel_light){{vf_set(0), vf_set(0), vf_set(0)}, vf_set(0), vf_set(1)};
}

/* One segment per lane: its length in unit distances, and the values at its ends in the transfer function's domain.
 * Each value is v + rest, where rest is the rounding error of v as far as it is known. This error matters because it is
 * magnified at steps of the opacity, and where the extinction grows towards infinity, at an opacity of 1. */
typedef struct kernel_unit_segment {
    vf length, v_in, v_out, rest_in, rest_out;
} kernel_unit_segment;

/* Returns a segment whose values have no known rounding errors. */
SIMD_INLINE kernel_unit_segment kernel_unit_segment_of(vf length, vf v_in, vf v_out)
{
    return (kernel_unit_segment){length, v_in, v_out, vf_set(0), vf_set(0)};
}

/* The piece of the transfer function that contains each ray's current value. at: index of the piece. common: the
 * entries of that piece if it is the same for all rays, which saves gathers; otherwise NULL. */
typedef struct kernel_piece_index {
    vi at;
    const kernel_real *common;
    vf low, high, low_rest, high_rest; /* values at the piece's two ends, and their rounding errors */
} kernel_piece_index;

/* Returns a kernel_piece_index for the pieces with the given indices; the values at the pieces' ends are not set.
 * piece: index of each ray's piece, as a float. */
SIMD_INLINE kernel_piece_index kernel_piece_index_of(const kernel_pieces *t, vm rays, vf piece)
{
    const int lane = __builtin_ctz(vm_bits(rays));
    const int first = (int)piece[lane];
    const bool is_common = !vm_any(vm_andnot(rays, vf_eq(piece, vf_set((kernel_real)first))));
    return (kernel_piece_index){.at = vi_from_vf(vf_select(rays, piece, vf_set(0))),
                                .common = is_common ? t->pieces[first] : NULL};
}

/* Returns an entry (KERNEL_PIECE_OPACITY etc.) of each ray's piece. */
SIMD_INLINE vf kernel_gather_piece_entry(const kernel_pieces *t, const kernel_piece_index *place, int entry)
{
    if (place->common) return vf_set(place->common[entry]);
    return vf_gather(t->pieces[0] + entry, place->at * KERNEL_PIECE_ENTRIES);
}

/* Reads, into *at, the values at which each ray's piece of the transfer function begins and ends, and the rounding
 * errors of these values. */
SIMD_INLINE void kernel_piece_read_ends(const kernel_pieces *t, kernel_piece_index *at)
{
    at->low = kernel_gather_piece_entry(t, at, KERNEL_PIECE_LOW);
    at->high = kernel_gather_piece_entry(t, at, KERNEL_PIECE_HIGH);
    at->low_rest = at->high_rest = vf_set(0);
    if (__builtin_expect(t->has_rests, 0)) {
        at->low_rest = kernel_gather_piece_entry(t, at, KERNEL_PIECE_LOW_REST);
        at->high_rest = kernel_gather_piece_entry(t, at, KERNEL_PIECE_HIGH_REST);
    }
}

/* Returns the index of the piece that contains each ray's value x + rest. If the value is the boundary of two pieces,
 * the upper piece is returned or, for rays in `falling` (whose value decreases along the segment), the lower one. */
SIMD_INLINE vf kernel_piece_find(const kernel_pieces *t, vm rays, vf x, vf rest, vm falling)
{
    const vf spot = vf_clamp((x - t->bin_low) * t->bin_inverse, vf_set(0), vf_set(KERNEL_PIECE_BINS - 1));
    vf piece = vf_gather(t->bin_first, vi_from_vf(spot));
    for (vm open = rays; vm_any(open);) {
        kernel_piece_index at = kernel_piece_index_of(t, open, piece);
        kernel_piece_read_ends(t, &at);
        vf below = x - at.low, above = at.high - x;
        if (__builtin_expect(t->has_rests, 0)) {
            below += rest - at.low_rest;
            above += at.high_rest - rest;
        }
        const vf zero = vf_set(0);
        const vm up = vm_and(open, vm_or(vf_lt(above, zero), vm_andnot(vf_eq(above, zero), falling)));
        const vm down = vm_and(open, vm_or(vf_lt(below, zero), vm_and(vf_eq(below, zero), falling)));
        piece = vf_select(up, piece + 1.0f, vf_select(down, piece - 1.0f, piece));
        open = vm_or(up, down);
    }
    return piece;
}

/* The state of the integration of one segment per lane: the ray's position in the segment and in the current piece of
 * the transfer function, and the current step. */
typedef struct kernel_piece_state {
    vf below, above;     /* distances of the value to the piece's low and high end */
    vf remaining;        /* remaining change of the value within this piece */
    vf remaining_length; /* length of the ray over which this change takes place, in unit distances */
    vf shortest;         /* lower limit of a step's length, in unit distances */
    /* value at that end of the piece towards which the field changes along the ray, and the rounding error of this
     * value; before the first piece is entered: the value at the segment's begin */
    vf edge, rest;
    vm is_last; /* the segment ends in this piece */
    /* The following members are the same in all pieces: falling: the value decreases along the ray; level: it is
     * constant. */
    vm falling, level;
    vf sign;      /* sign of the value's change along the ray: 1 or -1 */
    vf per_value; /* unit distances along the ray per change of the value */
    /* The following members describe the step. */
    vf opacity, clear; /* opacity at the step's begin, and 1 - opacity */
    vf rise;           /* change of the opacity over the part of the piece that lies ahead of the ray */
    vf share;          /* fraction of that part that the step covers */
    vf length;         /* length of the step, in unit distances */
    vm is_opaque;      /* the opacity is 1 on the whole step */
} kernel_piece_state;

/* Returns the state at the begin of a segment, before a piece is entered (kernel_piece_state_enter()). */
SIMD_INLINE kernel_piece_state kernel_piece_state_begin(const kernel_unit_segment *run)
{
    const vf one = vf_set(1), rise = (run->v_out - run->v_in) + (run->rest_out - run->rest_in), change = vf_abs(rise);
    kernel_piece_state out = {.edge = run->v_in, .rest = run->rest_in, .is_last = vm_none()};
    out.falling = vf_lt(rise, vf_set(0));
    out.level = vf_lt(change, vf_set(KERNEL_TINY));
    out.sign = vf_select(out.falling, -one, one);
    out.per_value = run->length / vf_select(out.level, one, change);
    return out;
}

/* Enters a new piece with the given ends, for the rays in `fresh`: sets their positions in the piece. */
SIMD_INLINE void kernel_piece_state_enter(kernel_piece_state *s, const kernel_unit_segment *run, vm fresh,
                                          const kernel_piece_index *ends)
{
    const vf v = s->edge, zero = vf_set(0);
    const vf below = vf_max((v - ends->low) + (s->rest - ends->low_rest), zero);
    const vf above = vf_max((ends->high - v) + (ends->high_rest - s->rest), zero);
    const vf ahead = vf_abs((run->v_out - v) + (run->rest_out - s->rest));
    const vf most = vf_select(s->falling, below, above), remaining = vf_min(most, ahead);
    s->below = vf_select(fresh, below, s->below);
    s->above = vf_select(fresh, above, s->above);
    s->remaining = vf_select(fresh, remaining, s->remaining);
    const vf left = vf_select(s->level, run->length, remaining * s->per_value);
    s->remaining_length = vf_select(fresh, left, s->remaining_length);
    s->shortest = vf_select(fresh, vf_min(left, vf_set(1)) * KERNEL_SHORT, s->shortest);
    s->edge = vf_select(fresh, vf_select(s->falling, ends->low, ends->high), s->edge);
    s->rest = vf_select(fresh, vf_select(s->falling, ends->low_rest, ends->high_rest), s->rest);
    s->is_last = vm_or(vm_andnot(s->is_last, fresh), vm_and(fresh, vf_le(ahead, most)));
}

/* Interpolates a number linearly between the two ends of each ray's piece, at the ray's current value. at_low, at_high:
 * the number at the piece's ends; inverse: 1 / the piece's width. The result is computed from the distances to both
 * ends, so that near an end at which the number is 0 it is as exact as the distance to that end. */
SIMD_INLINE vf kernel_piece_state_interpolate(const kernel_piece_state *s, vf inverse, vf at_low, vf at_high)
{
    const vf zero = vf_set(0), one = vf_set(1);
    const vf from_low = at_low * vf_clamp(s->above * inverse, zero, one);
    const vf from_high = at_high * vf_clamp(s->below * inverse, zero, one);
    return vf_min(from_low + from_high, one);
}

/* Computes opacity and 1 - opacity at the begin of a step, and the change of the opacity up to the end of the piece. */
SIMD_INLINE void kernel_compute_step_begin_opacity(const kernel_pieces *t, const kernel_piece_index *at,
                                                   kernel_piece_state *s)
{
    const vf inverse = kernel_gather_piece_entry(t, at, KERNEL_PIECE_INVERSE);
    s->opacity = kernel_piece_state_interpolate(s, inverse, kernel_gather_piece_entry(t, at, KERNEL_PIECE_OPACITY),
                                                kernel_gather_piece_entry(t, at, KERNEL_PIECE_OPACITY_HIGH));
    s->clear = kernel_piece_state_interpolate(s, inverse, kernel_gather_piece_entry(t, at, KERNEL_PIECE_CLEAR),
                                              kernel_gather_piece_entry(t, at, KERNEL_PIECE_CLEAR_HIGH));
    s->rise = s->sign * s->remaining * kernel_gather_piece_entry(t, at, KERNEL_PIECE_SLOPE);
}

/* Chooses the length of the step by the limits that are derived at the top of this file. */
SIMD_INLINE void kernel_choose_integration_step_length(kernel_piece_state *s)
{
    const vf left = s->remaining_length, zero = vf_set(0), one = vf_set(1), rise = vf_abs(s->rise),
             ratio = s->clear * KERNEL_STEP_RATIO;
    const vm nonlinear_part = vf_lt(ratio, rise);
    s->share = one;
    if (vm_any(nonlinear_part))
        s->share = vf_select(nonlinear_part, vf_min(vf_max(ratio / rise, s->shortest / left), one), one);
    s->is_opaque = vm_and(vf_eq(s->clear, zero), vf_eq(rise, zero));
    const vf up = vf_max(s->share * s->rise, zero), clear = vf_max(s->clear - up, vf_set(KERNEL_TINY));
    const vf most = kernel_extinction(vf_min(s->opacity + up, one), clear), length = left * s->share;
    const vf depth = length * vf_select(s->is_opaque, vf_set(KERNEL_OPAQUE), most);
    if (vm_any(vf_lt(vf_set(KERNEL_STEP_CHANGE), depth))) {
        const vf change = vf_min(length * s->share * rise / clear, depth);
        const vf over = vf_max(depth * (1 / KERNEL_STEP_DEPTH), vf_sqrt(change * (1 / KERNEL_STEP_CHANGE)));
        s->share = vf_select(vf_lt(one, over), s->share / over, s->share);
    }
    s->length = left * s->share;
}

/* Integrates a step: *e0 receives the integral of the extinction times the transmittance from the step's begin, and *e1
 * the same integral with the position on the step, from 0 to 1, as a factor. Returns the step's optical depth. */
SIMD_INLINE vf kernel_integrate_step(const kernel_piece_state *s, vf *e0, vf *e1)
{
    vf sigma[KERNEL_NODES], depth = vf_set(0);
    const vf rise = s->rise * s->share, zero = vf_set(0), one = vf_set(1);
    for (int j = 0; j < KERNEL_NODES; j++) {
        const vf up = rise * kernel_gauss.node[j], clear = vf_clamp(s->clear - up, vf_set(KERNEL_TINY), one);
        const vf extinction = kernel_extinction(vf_clamp(s->opacity + up, zero, one), clear);
        sigma[j] = vf_select(s->is_opaque, vf_set(KERNEL_OPAQUE), extinction) * s->length;
    }
    *e0 = *e1 = zero;
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

/* Adds the light of one step, over which the value changes by `move`, to *light, on the rays in `open`. */
SIMD_INLINE void kernel_add_light_of_step(const kernel_pieces *t, const kernel_piece_index *at, vm open, vf move,
                                          const kernel_piece_state *s, kernel_light *light)
{
    vf e0, e1;
    const vf depth = kernel_integrate_step(s, &e0, &e1);
    const vf whole = light->transmittance * e0, moment = light->transmittance * e1 * move;
    for (int a = 0; a < 3; a++) {
        const vf slope = kernel_gather_piece_entry(t, at, KERNEL_PIECE_COLOUR_SLOPE + a);
        const vf colour = kernel_gather_piece_entry(t, at, KERNEL_PIECE_COLOUR + a) + s->below * slope;
        const vf sum = light->colour[a] + (whole * colour + moment * slope);
        light->colour[a] = vf_select(open, sum, light->colour[a]);
    }
    light->depth = vf_select(open, light->depth + depth, light->depth);
    light->transmittance = kernel_exp(-light->depth);
}

/* Integrates the segment, and adds its light to *light, behind the light already there. */
static __attribute__((noinline)) void kernel_integrate_segments(const kernel_pieces *t, vm rays,
                                                                const kernel_unit_segment *run, kernel_light *light)
{
    kernel_piece_state s = kernel_piece_state_begin(run);
    vf piece = kernel_piece_find(t, rays, run->v_in, run->rest_in, s.falling);
    vm open = rays, fresh = rays;
    while (vm_any(open)) {
        kernel_piece_index at = kernel_piece_index_of(t, open, piece);
        if (vm_any(fresh)) {
            kernel_piece_read_ends(t, &at);
            kernel_piece_state_enter(&s, run, fresh, &at);
        }
        kernel_compute_step_begin_opacity(t, &at, &s);
        kernel_choose_integration_step_length(&s);
        const vf size = s.remaining * s.share, move = s.sign * size;
        kernel_add_light_of_step(t, &at, open, move, &s, light);
        s.below += move;
        s.above -= move;
        s.remaining -= size;
        s.remaining_length -= s.length;
        const vm through = vf_le(vf_set(1), s.share);
        open = vm_and(vm_andnot(open, vm_and(through, s.is_last)), vf_lt(vf_set(KERNEL_BLACK), light->transmittance));
        fresh = vm_and(open, through);
        piece = vf_select(fresh, piece + s.sign, piece);
    }
}

#endif
