/* What segments of a ray in a hex, a wedge or a pyramid make wrong, and so how many there are to be
 * (kernel_local_segments.h has what they are, docs/development/error_budget.md what they may make wrong).
 *
 * Let f be the field, v what segments have instead. Light changes by the integral of T g (v - f) along the ray, with g
 * = (s c)' - s' b, where b is the light of all that lies behind. On each segment v - f is of mean zero, but for what
 * the polynomial is off, so that of T g only what varies along the segment counts: the error is at most half the
 * oscillation of T g times the integral of |v - f|. g changes with the value and with b. Over a stretch of values it is
 * at most `cost`, and varies by `swing` while b stays; g is linear in b, so both are known from b's two bounds
 * (kernel_swing). Let D be the segment's depth and R the colours' contrast. Along it T falls by min(D, 1), and b
 * changes by R min(D, 1):
 *
 *     oscillation of T g <= T (swing + min(D, 1) (cost + R |s'|)),      and no more than 2 T cost.
 *
 * The mean of |v - f| is 0.26 of a parabola's most at the middle, P = |d2|; of the cubic's part, A = |d3 - d1| / 2 at
 * the quarters, 1.09 (0.67 of one chord, which crosses it in the middle; 1.082 at most, times n^2, of n >= 2); and of
 * the quartic's no more than four times E = |(d1 + d3) / 2 - 3/4 d2|. In n equal segments all are divided by n^2.
 *
 * What the polynomial itself is off is not of mean zero: 3.1 E on average, but no more than E in the ray's mean. So it
 * costs E, and half the oscillation of T g times 3.1 E, which of one segment the four times E hold; or 3.1 E in all
 * where that is less. What Newton's method leaves counts whole.
 *
 * Bounds are those of the cell's values, and where these ask for more than one segment, of the ray's own, which are a
 * third of them: from the lesser to the greater of those at the faces, on the parabola's side 1.17 P more (the ends of
 * chords are raised by P / 6), and on both 1.7 A (the cubic has 1.03 A, chords' ends 0.67 A more) and 10 E (1.33 E and
 * 0.71 E of the quartic, the rest what the polynomial is off).
 *
 * E may vanish where higher orders do not, and of hexes P and A may as well: values at eight vertices can be such that
 * the field is on its chord at all three places. So E is taken to be no less than 0.01 (P + A) N^2 + e N^2 S, where N
 * is the bend, S the sum of |h| times the bent terms' slopes (kernel_local_deviation.h), and e is 0.0011 in hexes and
 * 0.0004 in wedges. Along a ray in a pyramid the field is a linear function and a piece of a conic section, whose three
 * numbers the three places tell: e is 0. What may hide from the looks is of the fifth order at least, so that of a part
 * of the way, a share of p, 2 p^4 e is enough.
 *
 * That is measured. Of random rays in 5,000 random cells with bends up to 0.89, and the fields that have E = 0 or all
 * three places on the chord, and their mean as far off as can be, the polynomial's mean was off by no more than 0.54 E
 * on the whole way, 0.57 E on halves, 0.72 E on quarters and 0.36 E on eighths. The field itself was off by 3.1 E on
 * average at most, but for 19 of 133,000 of these fields, 5.8 E, and by 50 E where all of E, P and A were sought to be
 * nothing in hexes that are hardly bent (N < 0.05). What one segment is charged for the mean of |v - f| held in all of
 * them; what several are charged for it is too little there. */
#ifndef RENDER_KERNEL_LOCAL_BUDGET_H
#define RENDER_KERNEL_LOCAL_BUDGET_H

#include "grid.h"
#include "kernel_colour.h"
#include "kernel_integral.h"
#include "kernel_local.h"
#include "kernel_local_deviation.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_LOCAL_PIXELS = KERNEL_TILE * KERNEL_TILE, KERNEL_LOCAL_PIECES = 32 };

/* The share of the allowed error that Newton's method may leave. */
#define KERNEL_LOCAL_SLACK 0.4f

/* Lane by lane, what a field that is off does to the light over the cell's values (kernel_swing). */
typedef struct kernel_local_bounds {
    float cost[SIMD_WIDTH];
    float sway[SIMD_WIDTH];
    float fade[SIMD_WIDTH]; /* cost and R |s'| */
    float extinction[SIMD_WIDTH];
    float low[SIMD_WIDTH], high[SIMD_WIDTH]; /* the bounds hold between these values */
} kernel_local_bounds;

/* What the rays in a vector of cells may spend. */
typedef struct kernel_local_budget {
    const kernel_pieces *pieces;
    float allowance, reach;
    kernel_local_bounds bounds;
    kernel_local_nonlinear nonlinear;
    float per_t[KERNEL_LOCAL_PIXELS]; /* by packet and lane: unit distances per t */
} kernel_local_budget;

/* ---- cells ---- */

/* The lanes' bounds by the values at their vertices. Chords end beyond the cell's values: one chord by no more than
 * three sixteenths of their range (kernel_local_strays()), several by a sixth of the parabola's most, which is less
 * than that range. */
SIMD_INLINE void kernel_local_bound(kernel_local_budget *b, const float (*values)[SIMD_WIDTH], int type)
{
    const kernel_pieces *t = b->pieces;
    vf low = vf_load(values[0]), high = low, sway, cost, extinction, steepness;
    for (int i = 1; i < grid_type_vertices(type); i++) {
        low = vf_min(vf_load(values[i]), low);
        high = vf_max(vf_load(values[i]), high);
    }
    const vf margin = 0.1875f * (high - low);
    low -= margin;
    high += margin;
    const vi entry = kernel_swing_entry(t, low, high);
    vf_gather_pair(&t->swings->swing, entry, &sway, &cost);
    vf_gather_pair(&t->swings->extinction, entry, &extinction, &steepness);
    vf_store(b->bounds.cost, cost);
    vf_store(b->bounds.sway, sway);
    vf_store(b->bounds.fade, cost + steepness);
    vf_store(b->bounds.extinction, extinction);
    vf_store(b->bounds.low, low);
    vf_store(b->bounds.high, high);
    /* A share of what the ray's length alone allows. */
    const vf slack = vf_set(KERNEL_LOCAL_SLACK * b->allowance / b->reach) / (cost * vf_load(b->nonlinear.sensitivity));
    const vf tolerance = vf_min(vf_max(slack, vf_set(1e-6f)), vf_load(b->nonlinear.residual_limit));
    vf_store(b->nonlinear.tolerance, tolerance);
}

/* ---- rays in cells ---- */

/* A vector of rays, each in its cell. */
typedef struct kernel_local_pairs {
    kernel_local_rays rays;
    kernel_point ends[2];
    kernel_local_deviations off_chord;
    vm active;
    vf begin;     /* for the window */
    vf count;     /* segments */
    float unseen; /* the share that is taken of kernel_local_nonlinear's */
} kernel_local_pairs;

/* By how much one chord is raised to the field's mean. */
SIMD_INLINE vf kernel_local_lift(const kernel_local_pairs *p)
{
    const vf *d = p->off_chord.field;
    return (2.0f / 15) * d[1] + (16.0f / 45) * (d[0] + d[2]);
}

/* Rays of which one chord would end among values that have not been looked at. */
SIMD_INLINE vm kernel_local_strays(const kernel_local_budget *b, const kernel_local_pairs *p)
{
    const vf v0 = p->ends[0].value, v1 = p->ends[1].value, lift = kernel_local_lift(p);
    const vf low = vf_min(v0, v1) + lift, high = vf_max(v0, v1) + lift;
    return vm_or(vf_lt(low, kernel_take(b->bounds.low, p->rays.lane)),
                 vf_lt(kernel_take(b->bounds.high, p->rays.lane), high));
}

/* What makes one segment for all of a ray's way through its cell wrong. */
typedef struct kernel_local_wrong {
    vf mean;    /* how far it is off in the mean: by that over the square of their number, if there are more */
    vf quartic; /* E */
    vf unknown; /* what Newton's method leaves */
    vf length;  /* unit distances */
    vf fade;    /* what T and b make g vary by */
} kernel_local_wrong;

SIMD_INLINE void kernel_local_wrong_of(const kernel_local_budget *b, const kernel_local_pairs *p,
                                       kernel_local_wrong *out)
{
    const vi lane = p->rays.lane;
    const vf *d = p->off_chord.field, length = (p->ends[1].t - p->ends[0].t) * vf_gather(b->per_t, p->rays.at);
    const vf parabola = vf_abs(d[1]), cubic = 0.5f * vf_abs(d[2] - d[0]);
    const vf bend = kernel_take(b->nonlinear.bend, lane);
    const vf unseen = p->unseen * kernel_take(b->nonlinear.unseen, lane);
    const vf least = vf_muladd(0.01f * bend, parabola + cubic, unseen);
    const vf depth = vf_min(kernel_take(b->bounds.extinction, lane) * length, vf_set(1));
    out->quartic = vf_max(vf_abs(0.5f * (d[0] + d[2]) - 0.75f * d[1]), least);
    out->mean = 0.26f * parabola + (1.09f * cubic + 4.0f * out->quartic);
    out->unknown = kernel_take(b->nonlinear.sensitivity, lane) * p->off_chord.residual;
    out->length = length;
    out->fade = kernel_take(b->bounds.fade, lane) * depth;
}

/* What one segment makes wrong a unit distance: by what varies along it, and by its mean. */
SIMD_INLINE vf kernel_local_wrong_by_one(const kernel_local_wrong *w, vf sway, vf cost)
{
    const vf half = vf_min(0.5f * (sway + w->fade), cost);
    return vf_muladd(half, w->mean, cost * (w->quartic + w->unknown));
}

/* The bounds over the ray's own values: of the field and of chords (see above). */
SIMD_INLINE void kernel_local_own_bound(const kernel_pieces *t, const kernel_local_pairs *p, vf quartic, vf *sway,
                                        vf *cost)
{
    const vf *d = p->off_chord.field, v0 = p->ends[0].value, v1 = p->ends[1].value, zero = vf_set(0);
    const vf wide = 0.85f * vf_abs(d[2] - d[0]) + 10.0f * quartic;
    const vf low = vf_min(v0, v1) + (1.17f * vf_min(d[1], zero) - wide);
    const vf high = vf_max(v0, v1) + (1.17f * vf_max(d[1], zero) + wide);
    vf_gather_pair(&t->swings->swing, kernel_swing_entry(t, low, high), sway, cost);
}

/* Into how many segments, and the rays for which no number will do. */
static __attribute__((noinline)) vm kernel_local_count_by_depth(const kernel_tile_trace *t,
                                                                const kernel_local_budget *b,
                                                                const kernel_local_wrong *wrong, vf least,
                                                                kernel_local_pairs *p)
{
    const kernel_transfer *transfer = &t->frame->volumes[0];
    const vf v0 = p->ends[0].value, v1 = p->ends[1].value, one = vf_set(1);
    vf opacities = 0.125f * (kernel_opacity(transfer, v0) + kernel_opacity(transfer, v1)), sway, cost;
    for (int i = 0; i < 3; i++) {
        const vf value = v0 + (float)(i + 1) * 0.25f * (v1 - v0) + p->off_chord.field[i];
        opacities += 0.25f * kernel_opacity(transfer, value);
    }
    kernel_local_own_bound(b->pieces, p, wrong->quartic, &sway, &cost);
    /* A unit distance. */
    const vf allowed = b->allowance * (vf_set(1 / b->reach) + opacities / vf_muladd(wrong->length, opacities, one));
    const vm few = vf_le(kernel_local_wrong_by_one(wrong, sway, cost), allowed);
    const vf half = vf_min(0.5f * (sway + wrong->fade), cost), made = half * wrong->mean;
    const vf rest = cost * (wrong->quartic + wrong->unknown) + vf_min(3.1f * half, 2.1f * cost) * wrong->quartic;
    const vf wanted = -vf_floor(-vf_sqrt(made / vf_max(allowed - rest, vf_set(1e-30f))));
    p->count = vf_select(few, least, vf_clamp(wanted, vf_set(2), vf_set(KERNEL_LOCAL_PIECES + 1)));
    const vm fails = vm_or(vm_not(vf_lt(rest, 0.9f * allowed)), vf_lt(vf_set(KERNEL_LOCAL_PIECES), p->count));
    return vm_andnot(fails, few);
}

/* As above, but asks first by the ray's length alone, and by the bounds over all of the cell's values, whether one
 * segment is enough. */
SIMD_INLINE vm kernel_local_count(const kernel_tile_trace *t, const kernel_local_budget *b, kernel_local_pairs *p)
{
    kernel_local_wrong wrong;
    kernel_local_wrong_of(b, p, &wrong);
    const vf one = vf_set(1), allowed = vf_set(b->allowance * (1 / b->reach));
    const vf sway = kernel_take(b->bounds.sway, p->rays.lane), cost = kernel_take(b->bounds.cost, p->rays.lane);
    const vm strays = kernel_local_strays(b, p);
    const vm enough = vm_andnot(vf_le(kernel_local_wrong_by_one(&wrong, sway, cost), allowed), strays);
    p->count = one;
    if (!vm_any(vm_andnot(p->active, enough))) return vm_none();
    const vm none = kernel_local_count_by_depth(t, b, &wrong, vf_select(strays, 2.0f * one, one), p);
    p->count = vf_select(enough, one, p->count);
    return vm_andnot(none, enough);
}

#endif
