/* Computes all crossings of an isovalue in a ray's interval in a cell. Each crossing is isolated, then refined. In this
 * file, a piece is a part of the interval, X(r) the position and F(r) the field minus the isovalue at the reference
 * coordinates r, and a root is a point of the ray at which F is 0.
 *
 * Along a piece, the ray's points have the reference coordinates r*(u), 0 <= u <= 1: a curve from a to b whose image
 * X(r*(u)) is straight. The field on the ray is F(r*(u)). It is approximated by the field F(c(u)) on the chord c(u) = a
 * + u (b - a). F(c(u)) is a cubic, because F is trilinear. Its values and slopes at both ends are known; they determine
 * its four Bernstein coefficients, which bound it. The distance from the chord to the curve is bounded as follows. Let
 * Y = J0^-1 X with J0 the Jacobian of X at the cell's centre: Y(r) = r + N(r) + const, where the norm of N's derivative
 * is at most theta. (It is computed at the corners of the reference domain, because a norm is convex along each axis.)
 * So |r1 - r2| <= L |Y(r1) - Y(r2)| with L = 1 / (1 - theta). And Y(c(u)) - Y(r*(u)) = e(u) is N(c(u)) minus the line
 * between its ends: again a cubic, with the known Bernstein coefficients 0, e1, e2, 0. Hence
 *     |c - r*| <= dev = L 3/4 max(|e1|, |e2|),          |F(c) - F(r*)| <= G dev,
 *     |c' - r*'| <= L (K dev |b - a| + |e'|) = dev',    |F(c)' - F(r*)'| <= H dev (|b - a| + dev') + G dev',
 * where primes are derivatives along u, and G, H and K are bounds of F's gradient, F's Hessian and N's Hessian. dev
 * decreases by a factor of four when a piece is halved, and is 0 if the map is affine: then F(c(u)) is the field
 * itself.
 *
 * A piece whose Bernstein coefficients are all of one sign and farther from 0 than G dev has no root. A piece on which
 * the coefficients of the derivative are all of one sign and farther from 0 than the bound of |F(c)' - F(r*)'| has one
 * root if F's signs at the ends differ, and otherwise none. Any other piece is halved, and the nearer half is processed
 * first. Bisection ends at 2^-12 of the interval: a pair of roots that is missed there dips below 0 by at most |F''|
 * (2^-12)^2 / 8 < 16 · 7.5e-9 of the range, which is float32's own rounding of F.
 *
 * Before any piece is processed, bounds of the whole cell are tested (kernel_bounds.h): if the field is monotone along
 * every ray in the cell, the signs at the faces decide; if a linear function that approximates the field is far enough
 * from 0 at both faces, with the same sign, there is no root.
 *
 * In a pyramid the term m = a b / k (kernel_map.h) is not a polynomial, but its second derivative along a line has one
 * sign. So F(c(u)) lies between its chord and the tangents at its ends, and e(u) between 0 and its tangents: the slopes
 * at both ends bound both.
 *
 * The signs at the faces are those of the values that are interpolated on the faces, as in kernel_surface.h. If the
 * field just inside a warped face has the other sign than the face's value, there is a crossing at the face itself. So
 * F alternately rises and falls through 0 at the crossings along a ray, through all cells that the ray meets.
 *
 * If theta is 0.9 or more (the map is not one-to-one, or nearly so), the bounds are not proved: then L is taken as 10,
 * and the interval is divided into at least 8 pieces. */
#ifndef RENDER_KERNEL_ROOTS_H
#define RENDER_KERNEL_ROOTS_H

#include <math.h>

#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_contraction.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_wide.h"
#include "simd.h"

/* bound of the rounding error of F (field minus isovalue), whose largest magnitude at a vertex is near 1 */
#define KERNEL_ROOT_BAND 3e-7f
/* Length, as a share of the interval, of the pieces at which bisection ends. */
#define KERNEL_SMALLEST_PIECE 0x1p-12f
enum { KERNEL_ROOT_PIECES = 256, KERNEL_POLISH_STEPS = 8, KERNEL_BRACKET_STEPS = 48 };

/* The state of a search for roots, one ray per lane. The interval is divided into pieces, which are processed from the
 * nearest to the farthest. The current piece extends from number * size to (number + 1) * size, as shares of the
 * interval's length. */
typedef struct kernel_search {
    kernel_rays rays;
    /* The following members up to is_monotone are the cell's map, and copies of members of kernel_bounds or numbers
     * derived from these, for each ray's own cell. Except for the map, they are set only if some ray is not decided by
     * the values at the ends of its interval. */
    kernel_map map;
    vf nonlinear_part[3][8], inverse[3][3], stretch, slope, field_curvature, map_curvature;
    vf coarsest;    /* pieces longer than this share of the interval are always halved */
    vm is_monotone; /* rays on which the field is monotone in the whole cell */
    const kernel_interval *interval;
    int64_t *failures;       /* number of failed inversions of the map */
    vm open;                 /* rays that have unprocessed pieces */
    vm ended;                /* rays whose last piece has been processed; `side` is then the field's sign at its end */
    vf side;                 /* sign of the field at the begin of the current piece (`from`): 1 or -1 */
    vf number, size, pieces; /* number, size: the current piece; pieces: number of pieces that have been tested */
    kernel_point from, end;  /* from: begin of the current piece; end: end of the interval */
    vm found;                /* rays on which a root has been isolated between the points low and high */
    kernel_point low, high;
} kernel_search;

SIMD_INLINE void kernel_search_gather_bounds(const kernel_bounds *b, vi lane, kernel_search *out)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            out->nonlinear_part[i][j] = vf_set(0);
            out->nonlinear_part[i][4 + j] = kernel_gather_lane(b->nonlinear_part[i][j], lane);
        }
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) out->inverse[i][a] = kernel_gather_lane(b->normal[i][a], lane);
    out->stretch = kernel_gather_lane(b->stretch, lane);
    out->slope = kernel_gather_lane(b->slope, lane);
    out->field_curvature = kernel_gather_lane(b->field_curvature, lane);
    out->map_curvature = kernel_gather_lane(b->map_curvature, lane);
    const vm is_proved = vf_lt(kernel_gather_lane(b->thickness, lane), vf_set(INFINITY));
    out->coarsest = vf_select(is_proved, vf_set(1), vf_set(0.125f));
    out->is_monotone = vf_le(vf_set(0), kernel_gather_lane(b->jump, lane));
}

/* Computes how far the map bends along the chord between two points in reference coordinates. *size: the larger of |e1|
 * and |e2|, by which the distance from the chord to the ray is bounded (top of this file); *slope: the largest
 * Bernstein coefficient of e's derivative, divided by 3. m: the map's product (kernel_map.h) at both ends; move: to -
 * from. */
SIMD_INLINE void kernel_compute_chord_bend(const kernel_search *s, const vf from[3], const vf to[3],
                                           const kernel_product m[2], const vf move[3], vf *size, vf *slope)
{
    const bool is_pyramid = s->map.is_pyramid;
    vf first = vf_set(0), second = first, between = first;
    for (int i = 0; i < 3; i++) {
        vf g0[3], g1[3];
        kernel_polynomial_gradient(s->nonlinear_part[i], is_pyramid, &m[0], from, g0);
        kernel_polynomial_gradient(s->nonlinear_part[i], is_pyramid, &m[1], to, g1);
        const vf rise = kernel_polynomial_value(s->nonlinear_part[i], is_pyramid, &m[1], to) -
                        kernel_polynomial_value(s->nonlinear_part[i], is_pyramid, &m[0], from);
        const vf e1 = (kernel_dot(g0, move) - rise) * (1.0f / 3), e2 = (rise - kernel_dot(g1, move)) * (1.0f / 3);
        first += e1 * e1;
        second += e2 * e2;
        between += (e2 - e1) * (e2 - e1);
    }
    const vf largest = vf_max(first, second);
    *size = vf_sqrt(largest);
    *slope = vf_sqrt(vf_max(largest, between));
}

/* Returns the rays for which the piece between two points has no root: the field has the sign s->side, which is its
 * sign at `from`, on the whole piece. *monotone: rays on which the field is monotone, so that the piece has at most one
 * root; *negligible: rays on which the field is 0 within rounding on the whole piece, so that its sign is not
 * significant. gap: upper bound of the distance of Y(from) and Y(to) from the ray (Y: see the top of this file). */
SIMD_INLINE vm kernel_classify_piece(const kernel_search *s, const kernel_point *from, const kernel_point *to, vf gap,
                                     vm *monotone, vm *negligible)
{
    const bool is_pyramid = s->map.is_pyramid;
    const vf side = s->side;
    const kernel_product m[2] = {kernel_compute_coordinate_product(is_pyramid, from->r),
                                 kernel_compute_coordinate_product(is_pyramid, to->r)};
    vf move[3], g0[3], g1[3], bend, bend_slope;
    for (int a = 0; a < 3; a++) move[a] = to->r[a] - from->r[a];
    kernel_polynomial_gradient(s->map.field, is_pyramid, &m[0], from->r, g0);
    kernel_polynomial_gradient(s->map.field, is_pyramid, &m[1], to->r, g1);
    kernel_compute_chord_bend(s, from->r, to->r, m, move, &bend, &bend_slope);
    const vf d0 = kernel_dot(g0, move), d1 = kernel_dot(g1, move), rise = to->value - from->value;
    vf b1 = from->value + d0 * (1.0f / 3), b2 = to->value - d1 * (1.0f / 3), middle = 3.0f * (b2 - b1);
    vf scale = vf_set(1);
    if (is_pyramid) {
        /* the fraction of the piece at which the tangents at both ends intersect */
        const vf turn = d0 - d1;
        const vf at = vf_select(vf_eq(turn, vf_set(0)), vf_set(0), (rise - d1) / turn);
        b1 = b2 = from->value + d0 * vf_clamp(at, vf_set(0), vf_set(1));
        middle = d0;
        scale = 1.0f / vf_max(vf_min(from->r[2], to->r[2]) - s->stretch * (1.5f * bend + gap), vf_set(1e-30f));
    }
    const vf off = s->stretch * ((is_pyramid ? 1.5f : 0.75f) * bend + gap);
    const vf wrong = s->slope * off, bound = wrong + KERNEL_ROOT_BAND;
    const vf least = vf_min(vf_min(from->value * side, to->value * side), vf_min(b1 * side, b2 * side));
    const vf most = vf_max(vf_max(vf_abs(from->value), vf_abs(to->value)), vf_max(vf_abs(b1), vf_abs(b2)));
    const vf length = vf_sqrt(kernel_dot(move, move));
    const vf off_slope = s->stretch * (s->map_curvature * scale * off * length + 3.0f * bend_slope + 2.0f * gap);
    const vf tolerance =
        s->field_curvature * scale * off * (length + off_slope) + s->slope * off_slope + KERNEL_ROOT_BAND;
    const vf low = vf_min(middle, vf_min(d0, d1)), high = vf_max(middle, vf_max(d0, d1));
    *monotone = vm_or(vf_lt(tolerance, low), vf_lt(tolerance, -high));
    *negligible = vf_le(most + wrong, vf_set(KERNEL_ROOT_BAND));
    return vf_lt(bound, least);
}

/* Returns -1 for negative numbers and 1 for others. */
SIMD_INLINE vf kernel_sign_of(vf v)
{
    return vf_select(vf_lt(v, vf_set(0)), vf_set(-1), vf_set(1));
}

/* Sets at->value to the field in the cell at the point *at of each ray, which lies on a face. face: the value
 * interpolated on the face alone; it is stored instead if the two values differ only by rounding. */
SIMD_INLINE void kernel_search_evaluate_inside_face(const kernel_search *s, vm rays, vf face, kernel_point *at)
{
    const vf inside = kernel_evaluate_field_on_rays(&s->rays, &s->map, s->interval, rays, at->t, at->r, s->failures);
    at->value = vf_select(vf_le(vf_abs(inside - face), vf_set(KERNEL_FACE_BAND)), face, inside);
}

/* Returns by how far a computed crossing of a face misses its ray, measured in Y = J0^-1 X (top of this file): the
 * distance from Y at the crossing's reference coordinates to Y at the ray's point at the crossing's depth. It is not 0
 * if the reference coordinates are rounded, or belong to a point beside the ray. */
SIMD_INLINE vf kernel_face_distance_from_ray(const kernel_search *s, const kernel_point *at)
{
    const kernel_map *map = &s->map;
    const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, at->r);
    vf target[3], off[3], sum = vf_set(0);
    kernel_rays_at(&s->rays, map, at->t, target);
    for (int a = 0; a < 3; a++)
        off[a] = kernel_polynomial_value(map->position[a], map->is_pyramid, &m, at->r) - target[a];
    for (int i = 0; i < 3; i++) {
        const vf *row = s->inverse[i];
        const vf y = (off[0] * row[0] + off[1] * row[1]) + off[2] * row[2];
        sum += y * y;
    }
    return vf_sqrt(sum);
}

/* Initializes a search in which only the ends of the interval are known. */
SIMD_INLINE void kernel_search_begin(kernel_search *s)
{
    kernel_get_points_at_interval_ends(s->interval, &s->low, &s->high);
    s->from = s->low;
    s->end = s->high;
    s->side = kernel_sign_of(s->interval->v_in);
    s->ended = s->found = s->open = vm_none();
    s->number = s->pieces = vf_set(0);
    s->size = vf_set(0.5f);
}

/* Returns the value, at depth t on each ray, of the linear function L that approximates the field in the ray's cell
 * (kernel_bounds.h). */
SIMD_INLINE vf kernel_evaluate_linear_approximation(const kernel_curved *c, const kernel_rays *rays, vi lane, vf t)
{
    vf g[3], at[3];
    for (int a = 0; a < 3; a++) {
        g[a] = kernel_gather_lane(c->bounds->gradient[a], lane);
        at[a] = kernel_gather_lane(c->at[a][0], lane);
    }
    const vf x = (rays->origin_x + rays->slope_x * t) - at[0], y = (rays->origin_y + rays->slope_y * t) - at[1];
    return (kernel_gather_lane(c->bounds->level, lane) + g[0] * x) + (g[1] * y + g[2] * (t - at[2]));
}

/* Decides as many rays as possible by the values at the ends of their intervals (in, out) and the bounds of their
 * cells. *found becomes the rays with exactly one root. Returns the rays that remain undecided. Rays in neither mask
 * have no root. */
SIMD_INLINE vm kernel_decide_by_ends(const kernel_curved *c, const kernel_rays *rays, vi lane, vm wanted,
                                     const kernel_point *in, const kernel_point *out, vm *found)
{
    const vf zero = vf_set(0), jump = kernel_gather_lane(c->bounds->jump, lane), side = kernel_sign_of(in->value);
    const vm change = vm_xor(vf_lt(in->value, zero), vf_lt(out->value, zero)), monotone = vf_le(zero, jump);
    *found = vm_and(wanted, vm_and(monotone, change));
    vm left = vm_andnot(wanted, *found);
    left = vm_andnot(left, vm_and(monotone, vf_lt(jump, vf_min(vf_abs(in->value), vf_abs(out->value)))));
    const vm searched = vm_andnot(vm_andnot(left, monotone), change);
    if (!vm_any(searched)) return left;
    const vf thick = kernel_gather_lane(c->bounds->thickness, lane);
    const vm far = vm_and(vf_lt(thick, side * kernel_evaluate_linear_approximation(c, rays, lane, in->t)),
                          vf_lt(thick, side * kernel_evaluate_linear_approximation(c, rays, lane, out->t)));
    return vm_andnot(left, vm_and(searched, far));
}

/* Tests the whole interval as one piece, from the reference coordinates and values at its two ends on faces; this
 * decides most rays. Adds the rays on which a root is isolated to s->found; s->open becomes the rays whose interval
 * must be bisected. */
SIMD_INLINE void kernel_search_test_whole(kernel_search *s, vm rays)
{
    const kernel_interval *i = s->interval;
    const vm change = vm_xor(vf_lt(i->v_in, vf_set(0)), vf_lt(i->v_out, vf_set(0)));
    const vf gap = vf_max(kernel_face_distance_from_ray(s, &s->low), kernel_face_distance_from_ray(s, &s->high));
    vm is_monotone, unused;
    const vm clear = kernel_classify_piece(s, &s->low, &s->high, gap, &is_monotone, &unused);
    const vf jump = s->slope * s->stretch * gap + KERNEL_ROOT_BAND;
    const vm faced = vf_lt(jump, vf_min(i->v_in * s->side, i->v_out * s->side));
    const vm monotone = vm_or(s->is_monotone, is_monotone), sure = vf_le(vf_set(1), s->coarsest);
    const vm none = vm_and(sure, vm_or(clear, vm_and(monotone, faced))), one = vm_and(sure, vm_and(monotone, change));
    s->found = vm_or(s->found, vm_and(rays, one));
    s->open = vm_andnot(vm_andnot(rays, none), one);
    if (!vm_any(s->open)) return;
    kernel_search_evaluate_inside_face(s, s->open, i->v_in, &s->from);
    kernel_search_evaluate_inside_face(s, s->open, i->v_out, &s->end);
    /* the field just inside a warped face may have the other sign than the face's value: then there is a root at the
     * face itself */
    const vm jumps = vm_andnot(s->open, vf_eq(kernel_sign_of(s->from.value), s->side));
    kernel_point_copy_lanes(jumps, &s->from, &s->low);
    kernel_point_copy_lanes(jumps, &s->from, &s->high);
    s->side = vf_select(s->open, kernel_sign_of(s->from.value), s->side);
    s->found = vm_or(s->found, jumps);
}

/* Begins a search for the roots of rays, each in its own cell. lane: the lane that holds each ray's cell; i: the rays'
 * intervals in their cells. Afterwards s->found has the rays whose first root is isolated. Returns false if no ray has
 * a root. */
static __attribute__((noinline, unused)) bool kernel_search_cells(kernel_search *s, const kernel_curved *c,
                                                                  const kernel_rays *rays, vi lane,
                                                                  const kernel_interval *i, vm wanted,
                                                                  int64_t *failures)
{
    s->rays = *rays;
    s->interval = i;
    s->failures = failures;
    kernel_search_begin(s);
    wanted = kernel_decide_by_ends(c, rays, lane, wanted, &s->low, &s->high, &s->found);
    if (!vm_any(vm_or(wanted, s->found))) return false;
    kernel_compute_maps((const float(*)[8][SIMD_WIDTH])c->at, lane, c->type, &s->map);
    if (vm_any(wanted)) {
        kernel_search_gather_bounds(c->bounds, lane, s);
        kernel_search_test_whole(s, wanted);
    }
    return true;
}

/* Computes the end of each ray's current piece: depth, reference coordinates and field. */
SIMD_INLINE void kernel_search_compute_piece_end(const kernel_search *s, vm rays, kernel_point *to)
{
    const kernel_interval *i = s->interval;
    const vf u = (s->number + 1.0f) * s->size;
    const vm inner = vm_and(rays, vf_lt(u, vf_set(1)));
    *to = s->end;
    if (!vm_any(inner)) return;
    kernel_point at = {.t = vf_select(inner, i->t_in + (i->t_out - i->t_in) * u, i->t_out)};
    kernel_reference_between(&s->from, &s->end, at.t, at.r);
    at.value = kernel_evaluate_field_on_rays(&s->rays, &s->map, i, inner, at.t, at.r, s->failures);
    kernel_point_copy_lanes(inner, &at, to);
}

/* Advances rays to the next piece, which begins at the end of the current one (to). The next piece is the longest one
 * that repeated bisection of the whole interval gives there. */
SIMD_INLINE void kernel_search_advance(kernel_search *s, vm rays, const kernel_point *to)
{
    kernel_point_copy_lanes(rays, to, &s->from);
    const vf next = s->number + 1.0f, half = next * 0.5f;
    const vm up = vm_and(vf_eq(vf_floor(half), half), vf_lt(s->size, vf_set(0.5f)));
    s->number = vf_select(rays, vf_select(up, half, next), s->number);
    s->size = vf_select(vm_and(rays, up), s->size * 2.0f, s->size);
    const vm over = vm_andnot(rays, vf_lt(s->number * s->size, vf_set(1)));
    s->open = vm_andnot(s->open, over);
    s->ended = vm_or(s->ended, over);
}

/* Advances each open ray, piece by piece, until a root is isolated on it or its pieces are exhausted. */
SIMD_INLINE void kernel_search_isolate_next_root(kernel_search *s)
{
    vm going = s->open;
    s->found = vm_none();
    while (vm_any(going)) {
        kernel_point to;
        vm monotone, negligible;
        kernel_search_compute_piece_end(s, going, &to);
        const vm clear = kernel_classify_piece(s, &s->from, &to, vf_set(0), &monotone, &negligible);
        const vm small =
            vm_or(vf_le(s->size, vf_set(KERNEL_SMALLEST_PIECE)), vf_lt(vf_set(KERNEL_ROOT_PIECES), s->pieces));
        const vm certain = vm_and(vm_or(monotone, clear), vf_le(s->size, s->coarsest));
        const vm decided = vm_and(going, vm_or(vm_or(certain, negligible), small));
        const vm roots = vm_andnot(decided, vf_eq(kernel_sign_of(to.value), s->side));
        const vm halve = vm_andnot(going, decided);
        /* tested pieces are counted per ray, so that a ray's result does not depend on the other rays */
        s->pieces += vf_select(going, vf_set(1), vf_set(0));
        kernel_point_copy_lanes(roots, &s->from, &s->low);
        kernel_point_copy_lanes(roots, &to, &s->high);
        s->found = vm_or(s->found, roots);
        s->side = vf_select(roots, -s->side, s->side);
        s->number = vf_select(halve, s->number * 2.0f, s->number);
        s->size = vf_select(halve, s->size * 0.5f, s->size);
        kernel_search_advance(s, decided, &to);
        going = vm_and(vm_andnot(going, roots), s->open);
    }
}

/* Tests the exit faces of rays whose last piece has been processed: if the field just inside the face has the other
 * sign than the face's value, there is a root at the face itself. */
SIMD_INLINE void kernel_search_test_exit_faces(kernel_search *s)
{
    s->found = vm_andnot(s->ended, vf_eq(kernel_sign_of(s->interval->v_out), s->side));
    s->ended = vm_none();
    kernel_point_copy_lanes(s->found, &s->end, &s->low);
    kernel_point_copy_lanes(s->found, &s->end, &s->high);
}

/* Continues the search: s->found becomes the rays on which the next root is isolated, perhaps none. Returns false if
 * the search has ended on all rays. */
static __attribute__((noinline, unused)) bool kernel_search_continue(kernel_search *s)
{
    if (vm_any(s->open))
        kernel_search_isolate_next_root(s);
    else if (vm_any(s->ended))
        kernel_search_test_exit_faces(s);
    else
        return false;
    return true;
}

/* Ends the search for the given rays. */
SIMD_INLINE void kernel_search_close(kernel_search *s, vm rays)
{
    s->open = vm_andnot(s->open, rays);
    s->ended = vm_andnot(s->ended, rays);
}

/* Refines roots between the points s->low and s->high by regula falsi in the Illinois variant, which halves the value
 * at an end that is kept; every third step is a bisection. */
SIMD_INLINE void kernel_refine_by_bracketing(const kernel_search *s, vm rays, kernel_point *out)
{
    kernel_point low = s->low, high = s->high;
    for (int n = 0; n < KERNEL_BRACKET_STEPS && vm_any(rays); n++) {
        kernel_point at = {.t = kernel_secant(low.t, low.value, high.t, high.value)};
        if (n % 3 == 2) at.t = low.t + (high.t - low.t) * 0.5f;
        kernel_reference_between(&low, &high, at.t, at.r);
        at.value = kernel_evaluate_field_on_rays(&s->rays, &s->map, s->interval, rays, at.t, at.r, s->failures);
        const vm same = vf_eq(kernel_sign_of(at.value), kernel_sign_of(low.value));
        kernel_point_copy_lanes(rays, &at, out);
        high.value = vf_select(same, high.value * 0.5f, high.value);
        low.value = vf_select(same, low.value, low.value * 0.5f);
        kernel_point_copy_lanes(vm_and(rays, same), &at, &low);
        kernel_point_copy_lanes(vm_andnot(rays, same), &at, &high);
        rays = vm_andnot(rays, vf_le(vf_abs(at.value), vf_set(1e-7f)));
    }
}

/* ---- the last step of Newton's method, with residuals in double ---- */

/* Returns the value at the reference coordinates r of the polynomial with the coefficients c (kernel_map.h). m: the
 * product r[0] * r[1], for a pyramid divided by r[2]. */
SIMD_INLINE kernel_f64 kernel_f64_evaluate_polynomial(const kernel_f64 c[8], const kernel_f64 r[3], kernel_f64 m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* Computes residuals in double: the ray's point at depth t minus the position at the reference coordinates r (off), and
 * the field at r (*value). They are exact except for the rounding of r and t. */
SIMD_INLINE void kernel_compute_residuals(const kernel_rays *rays, const kernel_map *map, const kernel_point *at,
                                          vf off[3], vf *value)
{
    for (int half = 0; half < 2; half++) {
        kernel_f64 r[3], target[3];
        const kernel_f64 t = kernel_f64_widen_half(&at->t, half);
        for (int a = 0; a < 3; a++) r[a] = kernel_f64_widen_half(&at->r[a], half);
        kernel_f64 m = r[0] * r[1];
        if (map->is_pyramid) {
            const vf k = vf_max(at->r[2], vf_set(1e-6f));
            m /= kernel_f64_widen_half(&k, half);
        }
        target[0] = kernel_f64_widen_half(&rays->origin_x, half) + kernel_f64_widen_half(&rays->slope_x, half) * t;
        target[1] = kernel_f64_widen_half(&rays->origin_y, half) + kernel_f64_widen_half(&rays->slope_y, half) * t;
        target[2] = t;
        for (int a = 0; a < 3; a++)
            kernel_f64_store_half_of_vector(&off[a], half,
                                            target[a] - kernel_f64_widen_half(&map->origin[a], half) -
                                                kernel_f64_evaluate_polynomial(map->exact[half][a], r, m));
        kernel_f64_store_half_of_vector(value, half, kernel_f64_evaluate_polynomial(map->exact[half][3], r, m));
    }
}

/* Does a step of Newton's method for t and r in the four equations X(r) = (the ray's point at depth t) and F(r) = 0; t
 * stays between low->t and high->t. off: the ray's point minus X(r); value: F(r). Returns the rays that have not
 * converged. */
SIMD_INLINE vm kernel_take_root_newton_step(const kernel_rays *rays, const kernel_map *map, const kernel_point *low,
                                            const kernel_point *high, vm wanted, const vf off[3], vf value,
                                            kernel_point *out)
{
    const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, out->r);
    const vf zero = vf_set(0);
    vf cross[3][3], gradient[3], step[3], speed[3], largest = zero;
    const vf det = kernel_jacobian(map->position, map->is_pyramid, &m, out->r, cross);
    kernel_polynomial_gradient(map->field, map->is_pyramid, &m, out->r, gradient);
    const vm flat = vf_eq(det, zero);
    const vf inverse = vf_select(flat, zero, 1.0f / det);
    for (int a = 0; a < 3; a++) {
        step[a] = ((cross[0][a] * off[0] + cross[1][a] * off[1]) + cross[2][a] * off[2]) * inverse;
        speed[a] = ((cross[0][a] * rays->slope_x + cross[1][a] * rays->slope_y) + cross[2][a]) * inverse;
    }
    const vf left = value + kernel_dot(gradient, step), rate = kernel_dot(gradient, speed);
    const vf move = vf_select(vf_eq(rate, zero), zero, -(left / rate));
    const vf t = vf_clamp(out->t + move, low->t, high->t);
    for (int a = 0; a < 3; a++) {
        const vf change = vf_clamp(step[a] + speed[a] * (t - out->t), vf_set(-1), vf_set(1));
        largest = vf_max(largest, vf_abs(change));
        out->r[a] = vf_select(wanted, vf_clamp(out->r[a] + change, vf_set(-1), vf_set(2)), out->r[a]);
    }
    out->t = vf_select(wanted, t, out->t);
    return vm_and(wanted, vm_not(vm_andnot(vf_le(largest, vf_set(map->tolerance)), flat)));
}

/* Does the last step of Newton's method, with residuals computed in double. */
SIMD_INLINE void kernel_take_last_newton_step(const kernel_rays *rays, const kernel_map *map, vm wanted,
                                              const kernel_point *low, const kernel_point *high, kernel_point *out)
{
    kernel_point last = *out;
    vf off[3], value;
    kernel_compute_residuals(rays, map, out, off, &value);
    /* at a double root the computed derivative of the field is only a rounding error; a step that uses it would lead
     * away from the root, and is not taken */
    const vm away = kernel_take_root_newton_step(rays, map, low, high, wanted, off, value, &last);
    kernel_point_copy_lanes(vm_andnot(wanted, away), &last, out);
}

/* Does the last step of Newton's method for roots whose reference coordinates have an error of at most
 * KERNEL_CONTRACTION_END. Changes map->tolerance. */
SIMD_INLINE void kernel_refine_accurate_roots(const kernel_rays *rays, kernel_map *map, vm wanted, kernel_point *at)
{
    const kernel_point low = {.t = vf_set(-INFINITY)}, high = {.t = vf_set(INFINITY)};
    map->tolerance = 4 * KERNEL_CONTRACTION_END;
    at->value = vf_set(0);
    kernel_take_last_newton_step(rays, map, wanted, &low, &high, at);
}

/* Refines the roots between the points low and high by Newton's method; the residuals of the last step are computed in
 * double. Returns those of the wanted rays for which it does not converge. */
SIMD_INLINE vm kernel_refine_roots_by_newton(const kernel_rays *rays, const kernel_map *map, vm wanted,
                                             const kernel_point *low, const kernel_point *high, kernel_point *out)
{
    const vf zero = vf_set(0), fall = low->value - high->value;
    const vf along = vf_clamp(vf_select(vf_eq(fall, zero), zero, low->value / fall), zero, vf_set(1));
    vm open = wanted;
    out->t = low->t + along * (high->t - low->t);
    out->value = zero;
    for (int a = 0; a < 3; a++) out->r[a] = low->r[a] + along * (high->r[a] - low->r[a]);
    for (int n = 0; n < KERNEL_POLISH_STEPS && vm_any(open); n++) {
        const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, out->r);
        vf off[3];
        kernel_rays_at(rays, map, out->t, off);
        for (int a = 0; a < 3; a++) off[a] -= kernel_polynomial_value(map->position[a], map->is_pyramid, &m, out->r);
        const vf value = kernel_polynomial_value(map->field, map->is_pyramid, &m, out->r);
        open = kernel_take_root_newton_step(rays, map, low, high, open, off, value, out);
    }
    const vm close = vm_andnot(wanted, open);
    if (vm_any(close)) kernel_take_last_newton_step(rays, map, close, low, high, out);
    return open;
}

/* Refines the isolated roots of the rays in s->found. Rays for which Newton's method does not converge are refined by
 * bracketing. */
static __attribute__((noinline, unused)) void kernel_refine_roots(const kernel_search *s, kernel_point *out)
{
    const vm open = kernel_refine_roots_by_newton(&s->rays, &s->map, s->found, &s->low, &s->high, out);
    if (vm_any(open)) kernel_refine_by_bracketing(s, open, out);
}

#endif
