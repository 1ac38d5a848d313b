/* Computes emission and absorption along a segment from tables of the transfer function's integrals over the values, if
 * the job allows an error (max_error). The tables have bins of equal width, and hold for each bin the integrals over
 * all earlier bins. A knot is a value at which opacity or colour bends. Along a segment of length L on which the field
 * goes from v0 to v1, optical depth and emission (without absorption) are
 *     D = L (S(v1) - S(v0)) / (v1 - v0),    E = L (K(v1) - K(v0)) / (v1 - v0),
 * where S and K are the integrals of the extinction s, and of s times the colour c, over the values (Max, Hanrahan and
 * Crawfis 1990; Engel, Kraus and Ertl 2001). S and K are looked up at the two ends; the time does not depend on the
 * number of knots between them. Neighbouring segments share an end.
 *
 * How much of E the segment itself absorbs. If the colour c were E / D on the whole segment, the light would be A E /
 * D, with the absorption A = 1 - exp(-D). This A E / D exceeds the segment's light by the integral of c (m - exp(-t))
 * dt over the optical depth t from 0 to D, with m = A / D. The bracket is negative first, then positive. So among all c
 * whose values have a range of width R, the integral is largest if c jumps from its minimum to its maximum where the
 * bracket is zero. The integral is then R (1 - m + m ln m), or with u = 1 - m: R u^2 (1 / 2 + u / 6 + u^2 / 12 + ...)
 * <= R U / 2, U = u^2 (1 + u). If c is linear in the value, from c0 to c1, it is monotone in t however the depth is
 * distributed, so that the excess is between 0 and (c1 - c0) U / 2. Half of that is subtracted from the light, and the
 * error is at most |c1 - c0| U / 4. If c deviates from the chord between c0 and c1 by at most b, the error grows by b
 * U.
 *
 * The deviation b from a chord over an interval of values of width h, from low to high: a knot at x at which the slope
 * of the colour changes by k adds at most k (x - low) (high - x) / h. The sum over all knots between low and high, if
 * neighbouring knots have the distance d, is at most k (h^2 / (6 d) + h / 4). At the ends of the colour table, beyond
 * which colours are constant, a knot adds k h / 4 more.
 *
 * The tables. S and K are exact at the borders of bins and linear within a bin. In a bin of width w over which the
 * extinction varies by o (maximum minus minimum), the extinction that S implies has an error of at most o, and S / w of
 * at most o / 4. So the mean extinction over an interval of n bins has an error of at most the sum of both end bins' o
 * times min(1, 1 / (2 n)); the same holds for K. S and K are stored as integers, so that their differences are exact; o
 * includes their rounding. The mean is computed as a sum of positive terms, so that nothing cancels however close the
 * two ends are.
 *
 * The budget (docs/development/error_budget.md). The light of a segment may have an error of 0.15 max_error A + 0.05
 * max_error L / reach, where reach is the length of the longest ray, times the transmittance in front of the segment:
 * summed over a ray at most 0.2 max_error. If the error is larger, the segment is divided into subintervals over which
 * the value changes by equal amounts; the error of the absorption falls with the square of their number. If too many
 * subintervals would be needed, or a bin is too wide, kernel_integrate_segments() computes the segment. */
#ifndef RENDER_KERNEL_PREINTEGRAL_H
#define RENDER_KERNEL_PREINTEGRAL_H

#include "kernel_integral.h"
#include "kernel_types.h"
#include "simd.h"

/* Maximum number of subintervals of a segment. */
#define KERNEL_PRE_PARTS 32.0f

/* The position of a value in the table, one value per lane, and the entries of its bin (kernel_preint_entry). */
typedef struct kernel_preint_end {
    /* bin: index of the bin; position: position within the bin, from 0 to 1, or outside this range in the first and the
     * last bin */
    vf value, bin, position;
    /* own: the integrals over this bin of the extinction and of the emission in three channels, in integer units;
     * table_error: bound of the light's error that they cause, per unit distance */
    vf own[4], table_error;
    /* before: the integrals over all earlier bins, in the same units; colour: packed colour at the bin's middle */
    vi before[4], colour;
} kernel_preint_end;

/* The light of a segment or of a subinterval of it, and bounds of its error. */
typedef struct kernel_preint_subinterval {
    vf colour[3], depth, absorbed; /* premultiplied colour; optical depth; 1 - transmittance */
    /* Bounds of the error of light. error: caused by the absorption within the segment; table_error: caused by the
     * table's integrals; allowed: the error that the segment may have. */
    vf error, table_error, allowed;
} kernel_preint_subinterval;

/* Looks up the bin of each lane's value. */
SIMD_INLINE void kernel_preint_look_up_value(const kernel_preintegral *t, vf value, kernel_preint_end *e)
{
    const vf y = (value - t->low) * t->inverse + 1.0f;
    const float *entries = (const float *)t->entries;
    vf before[4], rest[4];
    e->value = value;
    e->bin = vf_clamp(vf_floor(y), vf_set(0), vf_set((float)(t->bin_count + 1)));
    e->position = y - e->bin;
    const vi index = vi_from_vf(e->bin) * (int)(sizeof *t->entries / sizeof(float));
    int32_t at[SIMD_WIDTH];
    vi_store(at, index);
    vf_gather_rows(entries, at, before);
    vf_gather_rows(entries + 4, at, e->own);
    vf_gather_rows(entries + 8, at, rest);
    for (int i = 0; i < 4; i++) e->before[i] = vi_from_bits(before[i]);
    e->table_error = rest[1];
    e->colour = vi_from_bits(rest[0]);
}

/* Returns 1 - exp(-y); *share becomes this number divided by y. For small y a series is used, whose first omitted term
 * is y^6 / 5040. */
SIMD_INLINE vf kernel_compute_absorption(vf y, vf *share)
{
    vf p = y * (-1.0f / 720) + 1.0f / 120;
    p = p * y - 1.0f / 24;
    p = p * y + 1.0f / 6;
    p = p * y - 0.5f;
    p = p * y + 1.0f;
    const vm thick = vf_lt(vf_set(0.25f), y);
    if (!vm_any(thick)) {
        *share = p;
        return p * y;
    }
    const vf gone = vf_select(thick, 1.0f - kernel_exp(-y), p * y);
    *share = vf_select(thick, gone / y, p);
    return gone;
}

/* Returns a channel of a packed colour. */
SIMD_INLINE vf kernel_preint_unpack_colour_channel(const kernel_preintegral *t, vi colour, int channel)
{
    return vf_from_vi(colour >> (10 * channel) & 1023) * t->colour_unit;
}

/* Returns an upper bound of the deviation of a colour channel from its chord between two values. */
SIMD_INLINE vf kernel_preint_bound_colour_deviation(const kernel_preintegral *t, vf v0, vf v1)
{
    const vf width = vf_abs(v1 - v0), low = vf_min(v0, v1), high = vf_max(v0, v1);
    const vm outside = vm_or(vf_lt(low, vf_set(0)), vf_lt(vf_set(1), high));
    const vf bend = width * (width * t->bend_square + t->bend) + t->colour_error;
    return bend + vf_select(outside, vf_min(width * t->bend_at_ends, vf_set(t->contrast)), vf_set(0));
}

/* Computes the light of a segment between the values a and b, and the bounds of its error. length: in unit distances.
 */
SIMD_INLINE void kernel_preint_compute_light(const kernel_preintegral *t, const kernel_preint_end *a,
                                             const kernel_preint_end *b, vf length, kernel_preint_subinterval *out)
{
    const vf one = vf_set(1), bins = vf_abs(b->bin - a->bin);
    const vm same = vf_eq(a->bin, b->bin), rising = vf_lt(a->bin, b->bin);
    const vf of_a = vf_select(same, one, vf_select(rising, one - a->position, a->position));
    const vf of_b = vf_select(same, one, vf_select(rising, b->position, one - b->position));
    const vf inverse = one / ((bins - one) + (of_a + of_b)), per_bin = length * inverse;
    vf sum[4], change = vf_set(0), mean;
    for (int i = 0; i < 4; i++) {
        const vf all = vf_abs(vf_from_vi(b->before[i] - a->before[i])), own = vf_select(rising, a->own[i], b->own[i]);
        sum[i] = ((all - own) + (of_a * a->own[i] + of_b * b->own[i])) * per_bin;
    }
    out->depth = sum[0] * t->depth_unit;
    const vf gone = kernel_compute_absorption(0.5f * out->depth, &mean);
    /* mean: mean transmittance along the segment; it is the absorption divided by the optical depth */
    mean *= 1.0f - 0.5f * gone;
    const vf lost = 1.0f - mean, square = lost * lost * (1.0f + lost);
    mean *= t->light_unit;
    out->absorbed = gone * (2.0f - gone);
    for (int c = 0; c < 3; c++) {
        const vf rise =
            kernel_preint_unpack_colour_channel(t, b->colour, c) - kernel_preint_unpack_colour_channel(t, a->colour, c);
        change = vf_max(change, vf_abs(rise));
        out->colour[c] = sum[1 + c] * mean - (0.25f * rise) * square;
    }
    const vf table_error = (a->table_error + b->table_error) * vf_min(one, 0.5f * inverse);
    out->error = (0.25f * change + kernel_preint_bound_colour_deviation(t, a->value, b->value)) * square;
    out->table_error = table_error * length;
    out->allowed = out->absorbed * t->allowed_absorbed + length * t->allowed_length;
}

/* Computes the light of each ray's segment from `count` subintervals over which the value changes by equal amounts.
 * Each ray has its own count, so that its result does not depend on other lanes. most: maximum of the counts. */
static __attribute__((noinline)) void kernel_preint_subdivide(const kernel_preintegral *t,
                                                              const kernel_preint_end *from, vf v_out, vf length,
                                                              vf count, int most, kernel_preint_subinterval *all)
{
    const vf zero = vf_set(0), share = 1.0f / count, rise = (v_out - from->value) * share;
    const kernel_preint_end *begin = from;
    kernel_preint_end ends[2];
    vf clear = vf_set(1), table_error = zero;
    *all = (kernel_preint_subinterval){{zero, zero, zero}, zero, zero, zero, zero, zero};
    for (int n = 1; n <= most; n++) {
        const vf number = vf_set((float)n);
        const vm inner = vf_lt(number, count), open = vf_le(number, count);
        kernel_preint_end *end = &ends[n & 1];
        kernel_preint_subinterval sub;
        kernel_preint_look_up_value(t, vf_select(inner, from->value + rise * number, v_out), end);
        kernel_preint_compute_light(t, begin, end, vf_select(open, length * share, zero), &sub);
        begin = end;
        for (int c = 0; c < 3; c++) all->colour[c] += clear * sub.colour[c];
        all->depth += sub.depth;
        all->error += clear * sub.error;
        table_error += sub.table_error;
        clear -= clear * sub.absorbed;
    }
    all->absorbed = 1.0f - clear;
    all->table_error = all->absorbed * table_error;
}

SIMD_INLINE void kernel_preint_get_light(const kernel_preint_subinterval *sub, kernel_light *light)
{
    for (int c = 0; c < 3; c++) light->colour[c] = sub->colour[c];
    light->depth = sub->depth;
    light->transmittance = 1.0f - sub->absorbed;
}

/* Replaces the light of the rays in m by other light. */
SIMD_INLINE void kernel_light_replace(vm m, const kernel_light *by, kernel_light *light)
{
    for (int c = 0; c < 3; c++) light->colour[c] = vf_select(m, by->colour[c], light->colour[c]);
    light->depth = vf_select(m, by->depth, light->depth);
    light->transmittance = vf_select(m, by->transmittance, light->transmittance);
}

/* Computes the light of segments for which a single subinterval is not accurate enough: by several subintervals or, if
 * that is not accurate enough either, by kernel_integrate_segments(). */
static __attribute__((noinline)) void kernel_preint_refine(const kernel_pieces *pieces, vm rays,
                                                           const kernel_preint_end *from,
                                                           const kernel_unit_segment *run,
                                                           const kernel_preint_subinterval *whole, kernel_light *light)
{
    const vf room = vf_max(whole->allowed - whole->table_error, vf_set(1e-30f));
    const vf wanted = vf_sqrt(vf_min(whole->error / room, vf_set(1e6f))) * 1.1f;
    const vm few = vm_and(rays, vf_le(wanted, vf_set(KERNEL_PRE_PARTS)));
    vm left = rays;
    if (vm_any(few)) {
        kernel_preint_subinterval subdivisions;
        const vf count = vf_select(few, 1.0f + vf_floor(wanted), vf_set(1));
        kernel_preint_subdivide(pieces->preintegral, from, run->v_out, run->length, count, (int)vf_reduce_max(count),
                                &subdivisions);
        const vm good =
            vm_and(few, vf_le(subdivisions.error + subdivisions.table_error, whole->allowed - whole->table_error));
        kernel_light subdivided;
        kernel_preint_get_light(&subdivisions, &subdivided);
        kernel_light_replace(good, &subdivided, light);
        left = vm_andnot(rays, good);
    }
    if (!vm_any(left)) return;
    kernel_light exact = kernel_light_none();
    kernel_integrate_segments(pieces, left, run, &exact);
    kernel_light_replace(left, &exact, light);
}

/* Computes the light of one segment per ray, without what lies in front of it, within the allowed error; *light is
 * undefined on other rays. *begin: the position in the table of the value at which the previous segments ended; if
 * this segment begins with another value, that value is looked up instead. *end becomes the position of the value at
 * this segment's end. The caller passes it as `begin` for the next segment. Both results are written in place, because
 * gcc 12 copies structs of vectors through memory: copying *end would take 4 %, and *light 11 % of a frame of tets
 * (AVX2). */
SIMD_INLINE void kernel_preint_compute_segment_light(const kernel_pieces *pieces, vm rays,
                                                     const kernel_unit_segment *run, kernel_preint_end *begin,
                                                     kernel_preint_end *end, kernel_light *light)
{
    kernel_preint_subinterval sub;
    if (vm_any(vm_andnot(rays, vf_eq(begin->value, run->v_in))))
        kernel_preint_look_up_value(pieces->preintegral, run->v_in, begin);
    kernel_preint_look_up_value(pieces->preintegral, run->v_out, end);
    kernel_preint_compute_light(pieces->preintegral, begin, end, run->length, &sub);
    kernel_preint_get_light(&sub, light);
    const vm bad = vm_andnot(rays, vf_le(sub.error + sub.table_error, sub.allowed));
    if (vm_any(bad)) kernel_preint_refine(pieces, bad, begin, run, &sub, light);
}

#endif
