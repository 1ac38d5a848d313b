/* Intersects rays with a quad's bilinear patch: computes how often they meet it, and at which points.
 *
 * Corners 0 to 3 are in cyclic order. Projected along the ray, with the ray at the origin, they are the two-dimensional
 * vectors c0 to c3. The patch's point with the parameters (s, r) is (1-r) ((1-s) c0 + s c1) + r ((1-s) c3 + s c2). For
 * a given r these are the points of the line from u = (1-r) c0 + r c3 to w = (1-r) c1 + r c2, which passes through the
 * origin if B(r) = u × w = 0. In the same way A(s) = 0 is the condition for s:
 *     B(r) = (1-r)² b0 + 2 r (1-r) b1 + r² b2,   b0 = c0×c1,  2 b1 = c0×c2 + c3×c1,  b2 = c3×c2
 *     A(s) = (1-s)² a0 + 2 s (1-s) a1 + s² a2,   a0 = c0×c3,  2 a1 = c0×c2 + c1×c3,  a2 = c1×c2
 * b0, b2, a0 and a2 are the edge functions of the four sides. Their exact signs, with ties decided, are the same for
 * all cells of the face. These signs decide almost everything:
 * - The ray meets the patch an odd number of times if and only if it meets the quad's two triangles an odd number of
 *   times, because both surfaces have the same border. A bilinear patch is met at most twice; so odd means once.
 * - The two discriminants b1² - b0 b2 and a1² - a0 a2 are the same number D. At a root the patch's Jacobian in the
 *   plane is J = A'(s) = -B'(r) = 2 sqrt(D) or -2 sqrt(D): its sign pairs the two roots of A with those of B.
 * - Odd: b0 and b2 differ in sign, or a0 and a2 do. If b0 and b2 do, B rises or falls through (0, 1) once, which gives
 *   the sign of B' and so of J: the root is chosen without any arithmetic. Likewise for A.
 * - Even: the ray meets the patch twice or never, and twice only if b0 and b2 have one sign, a0 and a2 have one sign,
 *   b1 and a1 have the opposite signs, and D > 0. It is the only decision that depends on rounding, for a ray at the
 *   patch's silhouette, whose two points then differ by less than 1e-8; all cells of the face decide it from the same
 *   numbers.
 * If b0 and b2 differ in sign, D is a sum of two positive terms, and a root is a quotient of sums of terms of one sign:
 * nothing cancels. So a point that is computed in double from the corners' float32 positions has only rounding errors
 * of double, even if the quad is almost parallel to the ray, thin or warped: near the common edge of two quads, a ray's
 * crossings come in the order that follows from the float32 positions. Therefore a ray's intervals do not overlap.
 *
 * If B(r) = 0 for all r, the ray runs along the patch (along an edge, or a ruling), and the point is the limit of those
 * of rays moved by (e, e²), as kernel_cell.h defines for ties: there B(r) is -e times the y of w - u.
 *
 * Most rays meet a quad far from its border, and not at a small angle. Newton's method in float32 is then accurate
 * enough, because no other crossing of the cell is near. */
#ifndef RENDER_KERNEL_QUAD_H
#define RENDER_KERNEL_QUAD_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "grid.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "simd.h"

/* A quad. x, y: projected corners, relative to each ray; z: depths of the corners; e01, e32, e03, e12: edge functions
 * of the four sides, e01 from corner 0 to corner 1 and so on, with exact sign bits. */
typedef struct kernel_quad {
    vf x[4], y[4], z[4];
    vf e01, e32, e03, e12;
} kernel_quad;

/* Below, a kernel_point is a point at which rays meet a quad's bilinear patch. Its coordinates r[0] and r[1] are the
 * patch's parameters s, from corner 0 to corner 1, and r, from corner 0 to corner 3; r[2] and the value are not set. */

SIMD_INLINE vf kernel_bilinear(const vf f[4], vf s, vf r)
{
    const vf low = f[0] + s * (f[1] - f[0]), high = f[3] + s * (f[2] - f[3]);
    return low + r * (high - low);
}

/* ---- one ray, in double ---- */

/* The quadratic (1-x)² c0 + 2 x (1-x) c1 + x² c2, and the exact sign bits of c0 and c2. */
typedef struct kernel_scalar_quadratic {
    double c0, c1, c2;
    bool is_negative0, is_negative2;
} kernel_scalar_quadratic;

static inline bool kernel_is_negative(vf v, int lane)
{
    return __builtin_signbit(v[lane]) != 0;
}

/* Returns the cross product of corners i and j in double. The products of float32 numbers are exact, so only their
 * difference is rounded. */
static inline double kernel_scalar_cross(const kernel_quad *q, int lane, int i, int j)
{
    return (double)q->x[i][lane] * (double)q->y[j][lane] - (double)q->x[j][lane] * (double)q->y[i][lane];
}

static inline kernel_scalar_quadratic kernel_make_quadratic_in_r(const kernel_quad *q, int lane)
{
    return (kernel_scalar_quadratic){kernel_scalar_cross(q, lane, 0, 1),
                                     0.5 * (kernel_scalar_cross(q, lane, 0, 2) + kernel_scalar_cross(q, lane, 3, 1)),
                                     kernel_scalar_cross(q, lane, 3, 2), kernel_is_negative(q->e01, lane),
                                     kernel_is_negative(q->e32, lane)};
}

static inline kernel_scalar_quadratic kernel_make_quadratic_in_s(const kernel_quad *q, int lane)
{
    return (kernel_scalar_quadratic){kernel_scalar_cross(q, lane, 0, 3),
                                     0.5 * (kernel_scalar_cross(q, lane, 0, 2) + kernel_scalar_cross(q, lane, 1, 3)),
                                     kernel_scalar_cross(q, lane, 1, 2), kernel_is_negative(q->e03, lane),
                                     kernel_is_negative(q->e12, lane)};
}

static inline bool kernel_scalar_changes_sign(const kernel_scalar_quadratic *c)
{
    return c->is_negative0 != c->is_negative2;
}

static inline bool kernel_scalar_vanishes(const kernel_scalar_quadratic *c)
{
    return c->c0 == 0 && c->c1 == 0 && c->c2 == 0;
}

static inline double kernel_scalar_discriminant(const kernel_scalar_quadratic *c)
{
    const double d = c->c1 * c->c1 - c->c0 * c->c2;
    return d > 0 ? d : 0;
}

/* Returns the root x in [0, 1] of the quadratic at which half of its derivative equals `half_slope` (plus or minus the
 * square root of the discriminant). There are two formulas for the root; the one in which digits do not cancel is used.
 */
static inline double kernel_scalar_root(const kernel_scalar_quadratic *c, double half_slope)
{
    const bool is_sum = c->c1 * half_slope <= 0;
    const double n = is_sum ? half_slope - c->c1 : c->c0, d = is_sum ? n + c->c2 : c->c0 - c->c1 - half_slope;
    const double x = d != 0 ? n / d : is_sum;
    return x >= 0 ? fmin(x, 1) : 0;
}

/* Solves v0 + x (v1 - v0) = 0 for x, clamped to [0, 1]. v0 and v1 must not both be 0. */
static inline double kernel_find_linear_zero(double v0, double v1)
{
    const double x = v0 / (v0 - v1);
    return x >= 0 ? fmin(x, 1) : 0;
}

/* Returns the patch's parameter at the ray's point if the quadratic A or B of this parameter (see the top of this file)
 * is zero everywhere: the limit of the parameters on rays that are moved by (e, e²). The quad's two sides at the ends
 * of the parameter's range are from corner i to i2 and from corner j to j2. */
static inline double kernel_find_limit_of_patch_parameter(const kernel_quad *q, int lane, int i, int i2, int j, int j2)
{
    double x[4], y[4];
    for (int k = 0; k < 4; k++) x[k] = (double)q->x[k][lane], y[k] = (double)q->y[k][lane];
    const double y0 = y[i2] - y[i], y1 = y[j2] - y[j];
    return y0 != y1 ? kernel_find_linear_zero(y0, y1) : kernel_find_linear_zero(x[i2] - x[i], x[j2] - x[j]);
}

/* Computes, for the ray in one lane, the point at which it meets the patch and at which the patch's Jacobian J has the
 * sign of `root`. The magnitude of root is the square root of the discriminant D. (The top of this file defines J and
 * D.) */
static inline void kernel_compute_patch_point_of_ray(const kernel_quad *q, int lane, const kernel_scalar_quadratic *a,
                                                     const kernel_scalar_quadratic *b, double root, kernel_point *out)
{
    const double s = kernel_scalar_vanishes(a) ? kernel_find_limit_of_patch_parameter(q, lane, 0, 3, 1, 2)
                                               : kernel_scalar_root(a, root);
    const double r = kernel_scalar_vanishes(b) ? kernel_find_limit_of_patch_parameter(q, lane, 0, 1, 3, 2)
                                               : kernel_scalar_root(b, -root);
    double z[4];
    for (int k = 0; k < 4; k++) z[k] = (double)q->z[k][lane];
    out->r[0][lane] = (float)s;
    out->r[1][lane] = (float)r;
    out->t[lane] = (float)((1 - r) * ((1 - s) * z[0] + s * z[1]) + r * ((1 - s) * z[3] + s * z[2]));
}

/* Computes the point at which a ray that crosses exactly one of the quad's two triangles meets the patch. */
static inline void kernel_scalar_single_point(const kernel_quad *q, int lane, kernel_point *out)
{
    const kernel_scalar_quadratic a = kernel_make_quadratic_in_s(q, lane), b = kernel_make_quadratic_in_r(q, lane);
    const bool by_b = kernel_scalar_changes_sign(&b);
    const double root = __builtin_sqrt(kernel_scalar_discriminant(by_b ? &b : &a));
    const bool is_rising = by_b ? b.is_negative0 : a.is_negative0;
    kernel_compute_patch_point_of_ray(q, lane, &a, &b, by_b != is_rising ? root : -root, out);
}

/* Returns whether the quadratic may have two roots in (0, 1), because c0 and c2, its values at 0 and 1, have one sign
 * and c1 has the other. */
static inline bool kernel_scalar_may_have_two_roots(const kernel_scalar_quadratic *c)
{
    return !kernel_scalar_changes_sign(c) && (c->is_negative0 ? c->c1 > 0 : c->c1 < 0);
}

/* Computes the two points at which a ray that crosses both triangles or none meets the patch. Returns false if it does
 * not meet the patch. */
static inline bool kernel_scalar_two_points(const kernel_quad *q, int lane, kernel_point out[2])
{
    const kernel_scalar_quadratic a = kernel_make_quadratic_in_s(q, lane), b = kernel_make_quadratic_in_r(q, lane);
    if (!kernel_scalar_may_have_two_roots(&a) || !kernel_scalar_may_have_two_roots(&b)) return false;
    const double root = __builtin_sqrt(kernel_scalar_discriminant(&b));
    if (!(root > 0)) return false;
    kernel_compute_patch_point_of_ray(q, lane, &a, &b, root, &out[0]);
    kernel_compute_patch_point_of_ray(q, lane, &a, &b, -root, &out[1]);
    return true;
}

/* Computes in double the points at which the wanted rays, each of which crosses exactly one of the two triangles, meet
 * the patch. These rays are few: Newton's method in float32 is accurate enough for most rays
 * (kernel_patch_converged()). */
static __attribute__((noinline)) void kernel_quad_single_point(const kernel_quad *q, vm wanted, kernel_point *out)
{
    for (unsigned bits = vm_bits(wanted); bits; bits &= bits - 1)
        kernel_scalar_single_point(q, __builtin_ctz(bits), out);
}

/* Computes the points of those of the wanted rays that meet the patch twice: one in out[0], the other in out[1].
 * Returns these rays. */
static __attribute__((noinline, cold)) vm kernel_quad_two_points(const kernel_quad *q, vm wanted, kernel_point out[2])
{
    unsigned found = 0;
    for (unsigned bits = vm_bits(wanted); bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits);
        if (kernel_scalar_two_points(q, lane, out)) found |= 1u << lane;
    }
    return vm_from_bits(found);
}

/* ---- a packet, in float32 ---- */

/* The patch's point, relative to the ray, is a + s e + r g + s r h. a: corner 0; e: corner 1 - corner 0; g: corner 3 -
 * corner 0; h: corner 0 - corner 1 + corner 2 - corner 3. ez: the larger one of the extents in depth of the two sides
 * along which s varies; gz: the same for the two sides along which r varies. */
typedef struct kernel_patch {
    vf ax, ay, ex, ey, gx, gy, hx, hy;
    vf ez, gz;
    /* sx, sy, rx, ry: derivatives of the patch's point along s and along r, at the current parameters (s, r); det:
     * their determinant; dx, dy: vector from the point to the ray */
    vf sx, sy, rx, ry, det, dx, dy;
} kernel_patch;

SIMD_INLINE void kernel_patch_setup(kernel_patch *p, const kernel_quad *q)
{
    p->ez = vf_max(vf_abs(q->z[1] - q->z[0]), vf_abs(q->z[2] - q->z[3]));
    p->gz = vf_max(vf_abs(q->z[3] - q->z[0]), vf_abs(q->z[2] - q->z[1]));
    p->ax = q->x[0], p->ay = q->y[0];
    p->ex = q->x[1] - p->ax, p->ey = q->y[1] - p->ay;
    p->gx = q->x[3] - p->ax, p->gy = q->y[3] - p->ay;
    p->hx = (q->x[2] - q->x[1]) - p->gx, p->hy = (q->y[2] - q->y[1]) - p->gy;
}

SIMD_INLINE void kernel_patch_evaluate(kernel_patch *p, vf s, vf r)
{
    p->rx = p->gx + s * p->hx, p->ry = p->gy + s * p->hy;
    p->dx = -((p->ax + s * p->ex) + r * p->rx), p->dy = -((p->ay + s * p->ey) + r * p->ry);
    p->sx = p->ex + r * p->hx, p->sy = p->ey + r * p->hy;
    p->det = p->sx * p->ry - p->sy * p->rx;
}

/* Number of steps of Newton's method by which the parameters (s, r) of a ray's point are computed. The parameters are
 * clamped to [0, 1]. Each step squares the error, so that four steps reduce it from 0.2 to 1e-9. */
enum { KERNEL_PATCH_STEPS = 4 };

SIMD_INLINE void kernel_patch_step(kernel_patch *p, vf *s, vf *r)
{
    const vf zero = vf_set(0), one = vf_set(1);
    kernel_patch_evaluate(p, *s, *r);
    const vf inverse = vf_select(vf_eq(p->det, zero), zero, 1.0f / p->det);
    *s = vf_clamp(*s + (p->dx * p->ry - p->dy * p->rx) * inverse, zero, one);
    *r = vf_clamp(*r + (p->sx * p->dy - p->sy * p->dx) * inverse, zero, one);
}

/* Returns the rays whose points are accurate: the distance from the point to the ray is at most float32's resolution of
 * the quad's size. Three kinds of rays are excluded: those that meet the quad at so small an angle that the error along
 * the ray would be 8 times as large, those for which the projected quad is nearly folded, and those whose point is so
 * near the quad's border that it and a neighbouring face's crossing, with errors of 1e-6 of the face's size, could come
 * in the wrong order. */
SIMD_INLINE vm kernel_patch_converged(kernel_patch *p, vf s, vf r)
{
    const vf one = vf_set(1);
    kernel_patch_evaluate(p, s, r);
    const vf e = vf_abs(p->ex) + vf_abs(p->ey), g = vf_abs(p->gx) + vf_abs(p->gy);
    const vf domain_margin = vf_min(vf_min(s, one - s), vf_min(r, one - r));
    const vm open = vf_lt(e * (p->gz + 0.5f * g) + g * p->ez, vf_abs(p->det) * 8.0f);
    const vm inside = vm_and(open, vf_lt(vf_set(1.0f / 1024), domain_margin));
    return vm_and(inside, vf_le(vf_abs(p->dx) + vf_abs(p->dy), (e + g) * 1.2e-7f));
}

/* Returns a first guess of the patch parameter s or r: the distance of the ray from one side of the quad, divided by
 * the sum of its distances from this and the opposite side. Instead of distances, the areas of the triangles that the
 * ray forms with the sides are used. The first side has the corners i and j, the opposite one k and l. */
SIMD_INLINE vf kernel_guess_patch_parameter(const kernel_quad *q, int i, int j, int k, int l)
{
    const vf near = vf_abs(q->x[i] * q->y[j] - q->x[j] * q->y[i]), far = vf_abs(q->x[k] * q->y[l] - q->x[l] * q->y[k]);
    const vf sum = near + far;
    return vf_select(vf_lt(vf_set(0), sum), near / sum, vf_set(0.5f));
}

/* Computes the points of the wanted rays as kernel_quad_single_point() does, for rays that meet no edge. The members of
 * *q for edge functions need not be set, because the edge functions are computed from the projected corners. */
static __attribute__((noinline)) void kernel_quad_single_point_off_edges(const kernel_quad *q, vm wanted,
                                                                         kernel_point *out)
{
    kernel_quad own = *q;
    own.e01 = vf_diff_of_products(q->x[0], q->y[1], q->x[1], q->y[0]);
    own.e03 = vf_diff_of_products(q->x[0], q->y[3], q->x[3], q->y[0]);
    own.e12 = vf_diff_of_products(q->x[1], q->y[2], q->x[2], q->y[1]);
    own.e32 = vf_diff_of_products(q->x[3], q->y[2], q->x[2], q->y[3]);
    kernel_quad_single_point(&own, wanted, out);
}

/* Computes the points at which rays meet the patches of `count` (1 or 2) quads. once[n]: the rays that cross exactly
 * one triangle of quad n. Two quads are processed alternately, because each step of Newton's method waits for the
 * result of the one before. are_off_edges: set if no ray meets an edge; the quads' edge functions are then not read and
 * need not be set. */
SIMD_INLINE void kernel_quads_cross(const kernel_quad *q, int count, const vm once[2], bool are_off_edges,
                                    kernel_point *out)
{
    kernel_patch patch[2];
    vf s[2], r[2];
    for (int n = 0; n < count; n++) {
        s[n] = kernel_guess_patch_parameter(&q[n], 0, 3, 1, 2);
        r[n] = kernel_guess_patch_parameter(&q[n], 0, 1, 3, 2);
        kernel_patch_setup(&patch[n], &q[n]);
    }
    for (int step = 0; step < KERNEL_PATCH_STEPS; step++)
        for (int n = 0; n < count; n++) kernel_patch_step(&patch[n], &s[n], &r[n]);
    for (int n = 0; n < count; n++) {
        const vm left = vm_andnot(once[n], kernel_patch_converged(&patch[n], s[n], r[n]));
        out[n].mask = once[n];
        out[n].r[0] = s[n];
        out[n].r[1] = r[n];
        out[n].t = kernel_bilinear(q[n].z, s[n], r[n]);
        if (__builtin_expect(!vm_any(left), 1)) continue;
        if (are_off_edges)
            kernel_quad_single_point_off_edges(&q[n], left, &out[n]);
        else
            kernel_quad_single_point(&q[n], left, &out[n]);
    }
}

/* Returns those of the rays that may meet the patch twice according to the signs of the edge functions of its four
 * sides. A ray that crosses exactly one triangle is never among them. */
SIMD_INLINE vm kernel_quad_sides_allow_two_points(vm rays, vf e01, vf e32, vf e03, vf e12)
{
    const vi b = vi_from_bits(e01) ^ vi_from_bits(e32), a = vi_from_bits(e03) ^ vi_from_bits(e12);
    return vm_and(rays, vm_sign(~(a | b)));
}

/* Returns v, negated in lanes in which the sign bit of `other` is set. */
SIMD_INLINE vf kernel_multiply_by_sign(vf v, vf other)
{
    return vf_from_bits(vi_from_bits(v) ^ (vi_from_bits(other) & vi_set((int32_t)0x80000000u)));
}

/* Returns those of the rays that may meet the patch twice according to the signs of a1 and b1 (see the top of this
 * file). rays: the result of kernel_quad_sides_allow_two_points(). */
SIMD_INLINE vm kernel_quad_may_cross_twice(const kernel_quad *q, vm rays)
{
    const vf across = vf_diff_of_products(q->x[0], q->y[2], q->x[2], q->y[0]);
    const vf other = vf_diff_of_products(q->x[3], q->y[1], q->x[1], q->y[3]);
    const vf slack = 1e-6f * (vf_abs(across) + vf_abs(other));
    const vm b = vf_le(kernel_multiply_by_sign(across + other, q->e01), slack);
    const vm a = vf_le(kernel_multiply_by_sign(across - other, q->e03), slack);
    return vm_and(rays, vm_and(a, b));
}

/* Returns the rays that cross exactly one of the two triangles into which a diagonal splits a quad. around[i]: the rays
 * on which the edge function of the quad's edge i is negative; the edges are in cyclic order and begin at the
 * diagonal's first corner. side: the rays on which the diagonal's edge function is negative. */
SIMD_INLINE vm kernel_find_rays_crossing_one_triangle(const vm around[4], vm side)
{
    const vm half0 = vm_andnot(vm_xor(around[1], side), vm_xor(around[0], around[1]));
    const vm half1 = vm_not(vm_or(vm_xor(side, around[2]), vm_xor(around[2], around[3])));
    return vm_xor(half0, half1);
}

/* Returns those of the rays that may meet a quad's patch twice according to the discriminant D (see the top of this
 * file). across, other: cross products of corners 0 and 2, and of corners 3 and 1. A ray is excluded only if the
 * discriminant is negative by more than its rounding error in float32, which is less than a millionth of the sum of its
 * terms' magnitudes. */
static __attribute__((noinline)) vm kernel_curved_may_cross_twice_by_discriminant(const vf x[8], const vf y[8],
                                                                                  const signed char *loop, vm rays,
                                                                                  vf across, vf other)
{
    const int a = loop[0], b = loop[1], c = loop[2], d = loop[3];
    const vf b0 = vf_diff_of_products(x[a], y[b], x[b], y[a]), b2 = vf_diff_of_products(x[d], y[c], x[c], y[d]);
    const vf b1 = 0.5f * (across + other), most = 0.5f * (vf_abs(across) + vf_abs(other)), product = b0 * b2;
    return vm_andnot(rays, vf_lt(b1 * b1 - product, -1e-6f * (most * most + vf_abs(product))));
}

/* Returns the rays that may meet a quad's patch twice: those of kernel_quad_may_cross_twice() and, because of rounding,
 * a few more. Let all four edges be directed around the quad. Only a ray that is on different sides of two opposite
 * edges can meet the patch twice. x, y: projected vertices; loop: corners 0 to 3 in cyclic order; side[i]: the rays on
 * which the edge function of the edge from corner i to the next is negative. */
SIMD_INLINE vm kernel_curved_may_cross_twice(const vf x[8], const vf y[8], const signed char *loop, vm rays,
                                             const vm side[4])
{
    const int a = loop[0], b = loop[1], c = loop[2], d = loop[3];
    const vm outside = vm_and(rays, vm_and(vm_xor(side[0], side[2]), vm_xor(side[1], side[3])));
    const vf across = vf_diff_of_products(x[a], y[c], x[c], y[a]), other = vf_diff_of_products(x[d], y[b], x[b], y[d]);
    const vf slack = 2e-6f * (vf_abs(across) + vf_abs(other)), sum = across + other, difference = across - other;
    const vm b_bends = vf_le(vf_select(side[0], -sum, sum), slack);
    const vm bends = vm_and(outside, vm_and(b_bends, vf_le(vf_select(side[3], difference, -difference), slack)));
    return __builtin_expect(vm_any(bends), 0)
               ? kernel_curved_may_cross_twice_by_discriminant(x, y, loop, bends, across, other)
               : bends;
}

/* Computes the points at which rays meet the patch. Rays in `once` meet it once; rays in `twice` meet it twice or
 * never. Returns how many entries of `out` are set, 0 to 2. Rays that meet it twice have a point in both. */
SIMD_INLINE int kernel_compute_quad_points(const kernel_quad *q, vm once, vm twice, kernel_point out[2])
{
    int count = 0;
    if (vm_any(once)) {
        const vm all[2] = {once, once};
        kernel_quads_cross(q, 1, all, false, &out[0]);
        count = 1;
    }
    if (!vm_any(twice)) return count;
    const vm bends = kernel_quad_may_cross_twice(q, twice);
    if (__builtin_expect(!vm_any(bends), 1)) return count;
    if (!count) out[0] = (kernel_point){.mask = vm_none()};
    out[1] = (kernel_point){.mask = vm_none()};
    out[1].mask = kernel_quad_two_points(q, bends, out);
    out[0].mask = vm_or(out[0].mask, out[1].mask);
    return vm_any(out[1].mask) ? 2 : count;
}

/* ---- quads that look convex, one cell per lane ---- */

/* A quad looks convex along a ray if, going around the projected quad, all its corners turn in the same direction. A
 * ray crosses a convex quad once if it is on the same side of all four edges, else never: neither the quad's
 * diagonal nor the curvature of its patch need be tested. The turn at a corner is p × q of the projected edges p and
 * q there, which is N · (u, v, 1) with their normal N = p × q in space and the ray's slopes u and v. Over a box of
 * rays (the rays through a rectangle of pixels) it differs from the middle ray's by at most |Nx| half width + |Ny|
 * half height, which is no more than |p| |q| (half width + half height).
 *
 * Rounding: let l be the longest edge, h the sum of the largest |u| and |v|, and S a bound of positions minus
 * origins plus slopes times depth. A projected edge is no longer than k = sqrt(2 + h h) l, as |x| + |y| + h |z|. A
 * vertex projected in float32 errs by at most two units (6e-8) of S, d = 1.2e-7 S; a turn of such vertices errs by 2
 * d in each coordinate of both edges: 4 d k + 8 d d. The products that are computed here have magnitudes that sum to
 * at most k k, and each is rounded at most 10 times: 6e-7 k k. */

/* Returns the lanes whose quad looks convex along all rays of the box. edge: the cell's edges, projected along the
 * middle ray of the box; square: the squares of the edges' lengths in space, not projected; spread: half the width plus
 * half the height of the range of the rays' slopes; margin: upper bound of the rounding error of a cross product of two
 * edges; sides: the quad's edges in cyclic order, and whether each is reversed. */
SIMD_INLINE vm kernel_quad_is_convex(const vf (*edge)[2], const vf *square, vf spread, vf margin,
                                     const signed char (*sides)[2])
{
    const int n[4] = {sides[0][0], sides[1][0], sides[2][0], sides[3][0]};
    const vf along = vf_max(square[n[0]], square[n[2]]), across = vf_max(square[n[1]], square[n[3]]);
    const vf least = vf_sqrt(along * across) * (1.0001f * spread) + margin;
    vm left = vm_all_lanes(), right = vm_all_lanes();
    for (int i = 0; i < 4; i++) {
        const int next = (i + 1) & 3;
        const vf *p = edge[n[i]], *q = edge[n[next]];
        const vf turn = sides[i][1] == sides[next][1] ? p[0] * q[1] - p[1] * q[0] : p[1] * q[0] - p[0] * q[1];
        left = vm_and(left, vf_lt(least, turn));
        right = vm_and(right, vf_lt(least, -turn));
    }
    return vm_or(left, right);
}

/* Returns, per lane, a mask of the cell's faces with the bits of the quads that may not look convex along some ray of a
 * box. at: x, y, z of the cells' vertices. slope[axis][end], origin[axis][end]: slope and origin along an axis of the
 * tile of the first (end = 0) and the last ray (end = 1) of the box along this axis. */
SIMD_INLINE vi kernel_curved_nonconvex_quads(vf (*const at)[8], vf (*const slope)[2], vf (*const origin)[2], int type)
{
    const kernel_shape *shape = kernel_cell_shape(type);
    vf edge[12][2], square[12], middle[2], steep[2], reach[2], longest = vf_set(0), spread = longest;
    vi nonconvex = vi_set(0);
    for (int a = 0; a < 2; a++) {
        middle[a] = 0.5f * (slope[a][0] + slope[a][1]);
        spread += 0.5f * vf_abs(slope[a][1] - slope[a][0]);
        steep[a] = vf_max(vf_abs(slope[a][0]), vf_abs(slope[a][1]));
    }
    for (int n = 0; n < shape->edge_count; n++) {
        const int i = shape->edges[n][0], j = shape->edges[n][1];
        const vf x = at[0][j] - at[0][i], y = at[1][j] - at[1][i], z = at[2][j] - at[2][i];
        edge[n][0] = x - middle[0] * z;
        edge[n][1] = y - middle[1] * z;
        square[n] = (x * x + y * y) + z * z;
        longest = vf_max(square[n], longest);
    }
    /* Every vertex can be reached from the first by at most three edges. */
    const vf far = 3.0f * vf_sqrt(longest), depth = vf_abs(at[2][0]) + far, slopes = steep[0] + steep[1];
    for (int a = 0; a < 2; a++)
        reach[a] = ((vf_abs(at[a][0]) + far) + vf_max(vf_abs(origin[a][0]), vf_abs(origin[a][1]))) + steep[a] * depth;
    const vf off = 1.25e-7f * vf_max(reach[0], reach[1]), most = (2.0f + slopes * slopes) * longest;
    const vf margin = (1e-6f * most + 4.0f * off * vf_sqrt(most)) + (8.0f * off * off + KERNEL_EDGE_LEAST);
    for (int face = 0; face < shape->face_count; face++) {
        if (shape->faces[face].count == 3) continue;
        const vm convex = kernel_quad_is_convex((const vf(*)[2])edge, square, spread, margin, shape->faces[face].sides);
        nonconvex |= vi_select(convex, vi_set(0), vi_set(1 << face));
    }
    return nonconvex;
}

#endif
