/* A ray's one crossing in a cell that is bent little, without the faces.
 *
 * With J0 the Jacobian at the middle of the cell's domain, Y = J0^-1 X is r + N(r), and with L linear in space the
 * field is L(X) + E(r) (kernel_bounds.h); N and E have the products of the domain's coordinates alone. On a ray X = X0
 * + t d, with y = J0^-1 X0 and w = J0^-1 d, the two equations
 *
 *     r + N(r) = y + t w                          r is on the ray
 *     L(X0) + t grad L . d + E(r) = 0             the field is the isovalue there
 *
 * become one when t is taken out of the second and put into the first:
 *
 *     r = f(r) = a - N(r) - w E(r) / (grad L . d),        a = y - w L(X0) / (grad L . d).
 *
 * f changes by no more than K = theta + |w| |grad E| / |grad L . d| a length in the domain (the norms are those of
 * kernel_bounds.h). Where K < 1 that says all, by Banach and Krawczyk. For a place q of the domain, with s = f(q) - q:
 *
 *     one     The ball of K / (1 - K) |s| about f(q), if it is in the domain, is taken into itself: it has a root, and
 *             the domain has no other.
 *     none    A root x of a convex part D of the domain has |f(q) - x| <= K |q - x|, hence
 *             |s|^2 <= 2 s . (x - q), which is not more than its largest at the corners of D: where |s|^2 is more, D
 *             has none. With q = f(q) moved to the nearest place of D, that is the case wherever f(q) is outside.
 *
 * What else is rounding. f is computed to blur: of places, and of the field times |w| / |grad L . d|. Faces tell where
 * a crossing is to their own rounding, which moves a root by no more than rim, in which 1 / (1 - K) is counted. A root
 * is taken where it is inside by more than that, and left out where all that is wider by rim has none; what is nearer
 * to a face is for the faces. So this agrees with them, in this cell and in the next one. */
#ifndef RENDER_KERNEL_CONTRACTION_H
#define RENDER_KERNEL_CONTRACTION_H

#include <math.h>

#include "grid.h"
#include "kernel_bounds.h"
#include "kernel_cell.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_shapes.h"
#include "simd.h"

enum { KERNEL_CONTRACTION_STEPS = 7 };

/* How far r may be off so that one step of Newton's method is the last: that leaves 2 K / (1 - K) times its square, as
 * f's slope changes by some 4 K a length, 1.8e-7 at most. */
#define KERNEL_CONTRACTION_END 1e-4f

/* A ray as its cell has it: y and w as above, from the ray's place at the depth of vertex 0 on, and L there and its
 * slope. */
typedef struct kernel_sight {
    vf y[3], w[3], level, rise;
} kernel_sight;

/* Each lane's own cell's (kernel_contractions). */
typedef struct kernel_contraction {
    vf offset[3], middle, bent[4][3], field[4], grow, blur, rim;
} kernel_contraction;

/* Where the crossing is: of lanes of one, to KERNEL_CONTRACTION_END in r, the cell's own coordinates. t from vertex 0
 * on. */
typedef struct kernel_contracted {
    vm one, none;
    vf t, r[3];
} kernel_contracted;

/* The rays as their cells have them. */
SIMD_INLINE void kernel_sight_of(const kernel_curved *c, const kernel_rays *rays, vi lane, kernel_sight *out)
{
    vf origin[3], normal[3], g[3];
    for (int a = 0; a < 3; a++) {
        origin[a] = kernel_take(c->at[a][0], lane);
        g[a] = kernel_take(c->bounds->gradient[a], lane);
    }
    const vf x = (rays->origin_x + rays->slope_x * origin[2]) - origin[0];
    const vf y = (rays->origin_y + rays->slope_y * origin[2]) - origin[1];
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) normal[a] = kernel_take(c->bounds->normal[i][a], lane);
        out->y[i] = normal[0] * x + normal[1] * y;
        out->w[i] = (normal[0] * rays->slope_x + normal[1] * rays->slope_y) + normal[2];
    }
    out->level = kernel_take(c->bounds->level, lane) + (g[0] * x + g[1] * y);
    out->rise = (g[0] * rays->slope_x + g[1] * rays->slope_y) + g[2];
}

SIMD_INLINE void kernel_contraction_of(const kernel_bounds *b, vi lane, int type, kernel_contraction *out)
{
    const kernel_contractions *c = &b->contractions;
    for (int i = 0; i < 3; i++) out->offset[i] = kernel_take(c->offset[i], lane);
    for (int k = 0; k < kernel_bent_terms(type); k++) {
        for (int i = 0; i < 3; i++) out->bent[k][i] = kernel_take(c->bent[k][i], lane);
        out->field[k] = kernel_take(c->field[k], lane);
    }
    out->middle = kernel_take(c->middle, lane);
    out->grow = kernel_take(c->grow, lane);
    out->blur = kernel_take(c->blur, lane);
    out->rim = kernel_take(c->rim, lane);
}

/* The places of D: the domain, of hexes and wedges wider by rim. Takes r to the nearest, of a pyramid to one that is
 * near. */
SIMD_INLINE void kernel_contraction_hold(int type, vf rim, vf r[3])
{
    const vf half = 0.5f + rim;
    if (kernel_is_box(type)) {
        for (int a = 0; a < 3; a++) r[a] = vf_clamp(r[a], -half, half);
    } else if (kernel_is_prism(type)) {
        const vf low = -1.0f / 3 - rim, most = 1.0f / 3 + 2.0f * rim, high = most - low;
        const vm over = vf_lt(most, r[0] + r[1]);
        const vf slant = vf_clamp(0.5f * ((r[0] - r[1]) + most), low, high);
        r[0] = vf_select(over, slant, vf_max(r[0], low));
        r[1] = vf_select(over, most - slant, vf_clamp(r[1], low, high));
        r[0] = vf_min(r[0], most - r[1]);
        r[2] = vf_clamp(r[2], -half, half);
    } else {
        for (int a = 0; a < 2; a++) {
            const vf beyond = 0.5f * vf_max(r[a] - r[2], vf_set(0));
            r[a] = vf_max(r[a] - beyond, vf_set(0));
            r[2] += beyond;
        }
        r[2] = vf_clamp(r[2], vf_set(1e-6f), vf_set(1));
        for (int a = 0; a < 2; a++) r[a] = vf_min(r[a], r[2]);
    }
}

/* The largest s . x in D. */
SIMD_INLINE vf kernel_contraction_reach(int type, vf rim, const vf s[3])
{
    const vf half = 0.5f + rim;
    if (kernel_is_box(type)) return half * ((vf_abs(s[0]) + vf_abs(s[1])) + vf_abs(s[2]));
    if (kernel_is_prism(type)) {
        const vf low = -1.0f / 3 - rim, side = 1.0f + 4.0f * rim;
        return low * (s[0] + s[1]) + side * vf_max(vf_max(s[0], s[1]), vf_set(0)) + half * vf_abs(s[2]);
    }
    return vf_max((vf_max(s[0], vf_set(0)) + vf_max(s[1], vf_set(0))) + s[2], vf_set(0));
}

/* r as kernel_local.h has it: of a pyramid, a and b are counted from the axis. */
SIMD_INLINE void kernel_contraction_local(int type, const vf r[3], vf out[3])
{
    for (int i = 0; i < 3; i++) out[i] = r[i];
    if (!kernel_has_apex(type)) return;
    for (int i = 0; i < 2; i++) out[i] -= 0.5f * r[2];
}

/* How far r is inside of the domain; of wedges and pyramids no more than that. */
SIMD_INLINE vf kernel_contraction_inside(int type, const vf r[3])
{
    vf local[3];
    kernel_contraction_local(type, r, local);
    const vf inside = kernel_local_inside(type, local);
    return inside * (kernel_is_box(type) ? 1.0f : 0.7f);
}

/* Rays on which s at q says that there is no root in D. A root needs
 * |s| of two diameters of D at most, so 8 blur is no less than 2 blur times |s| + 2; what is beyond has room in a
 * thousandth of |s|^2. */
SIMD_INLINE vm kernel_contraction_none(int type, const kernel_contraction *c, const vf q[3], const vf s[3])
{
    const vf most = kernel_contraction_reach(type, c->rim, s) - kernel_dot(s, q);
    vf blur = 8.0f * c->blur;
    if (kernel_has_apex(type)) blur = 4.0f * c->rim; /* twice what faces are off by, as D is no wider */
    return vf_lt(2.0f * most + blur, 0.999f * kernel_dot(s, s));
}

SIMD_INLINE void kernel_contract(const kernel_contraction *c, const kernel_sight *ray, vm rays, kernel_contracted *out,
                                 int type)
{
    const int terms = kernel_bent_terms(type);
    const vf over = 1.0f / ray->rise, t = (ray->level + c->middle) * over;
    vf a[3], slope[4][3], q[3], s[3], local[3];
    kernel_bend bend;
    out->one = out->none = vm_none();
    out->t = vf_set(0);
    for (int i = 0; i < 3; i++) q[i] = a[i] = (ray->y[i] + c->offset[i]) - ray->w[i] * t;
    for (int k = 0; k < terms; k++) {
        const vf rate = c->field[k] * over;
        for (int i = 0; i < 3; i++) slope[k][i] = c->bent[k][i] + ray->w[i] * rate;
    }
    const vm sure = vm_and(rays, vf_lt(c->grow, vf_set(INFINITY)));
    for (int n = 0; n < KERNEL_CONTRACTION_STEPS; n++) {
        kernel_contraction_hold(type, c->rim, q);
        kernel_contraction_local(type, q, local);
        kernel_bend_at(type, local, &bend);
        if (kernel_has_apex(type)) bend.term[0] += 0.25f * q[2]; /* kernel_bounds.h has J0 at a b / k² of a half */
        for (int i = 0; i < 3; i++) {
            vf at = a[i];
            for (int k = 0; k < terms; k++) at -= slope[k][i] * bend.term[k];
            s[i] = at - q[i];
            out->r[i] = at;
        }
        if (n == 1 || n == KERNEL_CONTRACTION_STEPS - 1) {
            out->none = vm_or(out->none, vm_and(sure, kernel_contraction_none(type, c, q, s)));
            if (!vm_any(vm_andnot(sure, out->none))) return;
        }
        for (int i = 0; i < 3; i++) q[i] = out->r[i];
    }
    const vf off = c->grow * vf_sqrt(kernel_dot(s, s)) + (1.0f + c->grow) * c->blur;
    const vm inside = vf_lt(off + c->rim, kernel_contraction_inside(type, out->r));
    out->one = vm_andnot(vm_and(sure, vm_and(inside, vf_lt(off, vf_set(KERNEL_CONTRACTION_END)))), out->none);
    vf e = ray->level + c->middle;
    for (int k = 0; k < terms; k++) e += c->field[k] * bend.term[k];
    out->t = -(e * over);
    if (kernel_has_apex(type)) return;
    for (int i = 0; i < 3; i++) out->r[i] += (float)kernel_domain_of(type)->centre[i];
}

#endif
