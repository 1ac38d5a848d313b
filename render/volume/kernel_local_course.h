/* The field along rays between two faces of their hexes, a ray and its cell a lane, from three places between them.
 *
 * In kernel_local.h's coordinates the field is f0 + g r + (its bent terms), and y = r + n(r) goes in a line along the
 * ray, with the same bent terms b in n = B b. So with r = y - n(r)
 *
 *     field = f0 + g y + h b(r),   h = (the field's bent terms) - g B,
 *
 * of which the first part is linear along the ray: the field is off its chord between the faces by h times what b is
 * off its own. That is little, so r need not be known as well as for the field itself.
 *
 * r is found from the line between its values at the faces. In the middle of a cell n' is zero, so that a step of
 * Newton's method with the derivatives there adds what is left, and takes |n'| of it into the next. It has a
 * third of the terms of a step with the derivatives at the place, and all three places take theirs side by side.
 *
 * How wrong it is. Let the slip be the sum over the coordinates of what y - (r + n(r)) is off zero by. The derivative
 * of n is no more than N in the cell; r may be KERNEL_COURSE_OFF outside, where it is no more than 1.08 N, as bent
 * terms have no more than two coordinates in their derivatives. So r is off by no more than slip / (1 - 1.08 N), or the
 * slip is too large. The gradients of b up to there are sqrt(2) 0.52 of two coordinates and sqrt(3) 0.52^2 of three. */
#ifndef RENDER_KERNEL_LOCAL_COURSE_H
#define RENDER_KERNEL_LOCAL_COURSE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_local.h"
#include "simd.h"

enum { KERNEL_COURSE_STEPS = 8 };

/* In r, whose cell goes from -1/2 to 1/2. */
#define KERNEL_COURSE_OFF 0.02f

/* Lane by lane. */
typedef struct kernel_local_bow {
    float own[KERNEL_BENT_TERMS][SIMD_WIDTH]; /* h */
    float slip[SIMD_WIDTH];                   /* what the field may be off by, by how large the slip is */
    float most[SIMD_WIDTH];                   /* a larger slip says nothing of the field */
    float slack[SIMD_WIDTH];                  /* a smaller one is small enough */
} kernel_local_bow;

typedef struct kernel_local_course {
    vf deviation[3]; /* of the field off its chord, at the quarters and the middle */
    vf slip;         /* at the one of them where that is most */
    vm is_lost;      /* rays on which r has not been found */
} kernel_local_course;

/* ---- cells ---- */

/* But for the slack. */
SIMD_INLINE void kernel_local_bow_of(const kernel_local_cells *c, kernel_local_bow *out)
{
    vf most = vf_set(0);
    for (int k = 0; k < KERNEL_BENT_TERMS; k++) {
        vf own = vf_load(c->field[4 + k]);
        for (int a = 0; a < 3; a++) own = vf_muladd(-vf_load(c->field[1 + a]), vf_load(c->bent[k][a]), own);
        vf_store(out->own[k], own);
        most += vf_abs(own) * (k < 3 ? 0.74f : 0.47f);
    }
    const vf room = 1.0f - 1.08f * vf_sqrt(vf_load(c->bend));
    vf_store(out->slip, most / room);
    vf_store(out->most, KERNEL_COURSE_OFF * room);
}

/* ---- rays in cells ---- */

/* What lanes have of their rays and cells. The ray's share u goes from -1/2 to 1/2. */
typedef struct kernel_local_arc {
    vf middle[3], span[3];                               /* of the line between r at the faces */
    vf mean[KERNEL_BENT_TERMS], rise[KERNEL_BENT_TERMS]; /* of the terms' chords */
    vf bent[KERNEL_BENT_TERMS][3], own[KERNEL_BENT_TERMS];
} kernel_local_arc;

typedef struct kernel_local_stop {
    vf r[3], left[3], deviation;
} kernel_local_stop;

SIMD_INLINE void kernel_hex_bent(const vf r[3], vf out[KERNEL_BENT_TERMS])
{
    out[0] = r[0] * r[1];
    out[1] = r[0] * r[2];
    out[2] = r[1] * r[2];
    out[3] = out[0] * r[2];
}

SIMD_INLINE void kernel_local_arc_of(const kernel_local_cells *cells, const kernel_local_bow *bow, vi lane,
                                     const kernel_local_crossing ends[2], kernel_local_arc *out)
{
    vf first[KERNEL_BENT_TERMS], last[KERNEL_BENT_TERMS];
    kernel_hex_bent(ends[0].r, first);
    kernel_hex_bent(ends[1].r, last);
    for (int a = 0; a < 3; a++) {
        out->middle[a] = 0.5f * (ends[0].r[a] + ends[1].r[a]);
        out->span[a] = ends[1].r[a] - ends[0].r[a];
    }
    for (int k = 0; k < KERNEL_BENT_TERMS; k++) {
        out->mean[k] = 0.5f * (first[k] + last[k]);
        out->rise[k] = last[k] - first[k];
        out->own[k] = kernel_local_take(bow->own[k], lane);
        for (int a = 0; a < 3; a++) out->bent[k][a] = kernel_local_take(cells->bent[k][a], lane);
    }
}

/* What is left at the place u, and how far the field is off its chord. */
SIMD_INLINE void kernel_local_stop_at(const kernel_local_arc *c, float u, kernel_local_stop *p)
{
    vf term[KERNEL_BENT_TERMS];
    kernel_hex_bent(p->r, term);
    for (int a = 0; a < 3; a++) p->left[a] = vf_muladd(c->span[a], vf_set(u), c->middle[a]) - p->r[a];
    for (int k = 0; k < KERNEL_BENT_TERMS; k++) {
        term[k] -= vf_muladd(c->rise[k], vf_set(u), c->mean[k]);
        for (int a = 0; a < 3; a++) p->left[a] = vf_muladd(-c->bent[k][a], term[k], p->left[a]);
    }
    p->deviation = c->own[0] * term[0];
    for (int k = 1; k < KERNEL_BENT_TERMS; k++) p->deviation = vf_muladd(c->own[k], term[k], p->deviation);
}

SIMD_INLINE vf kernel_local_slip_of(const kernel_local_stop *p)
{
    return (vf_abs(p->left[0]) + vf_abs(p->left[1])) + vf_abs(p->left[2]);
}

SIMD_INLINE void kernel_local_course_of(const kernel_local_cells *cells, const kernel_local_bow *bow, vi lane, vm rays,
                                        const kernel_local_crossing ends[2], kernel_local_course *out)
{
    static const float places[3] = {-0.25f, 0, 0.25f};
    kernel_local_arc arc;
    kernel_local_stop stops[3];
    kernel_local_stop *middle = &stops[1];
    const vf slack = kernel_local_take(bow->slack, lane);
    kernel_local_arc_of(cells, bow, lane, ends, &arc);
    memcpy(middle->r, arc.middle, sizeof middle->r);
    for (int n = 0; n < 2; n++) {
        kernel_local_stop_at(&arc, 0, middle);
        for (int a = 0; a < 3; a++) middle->r[a] += middle->left[a];
    }
    for (int q = 0; q < 3; q += 2)
        for (int a = 0; a < 3; a++)
            stops[q].r[a] = vf_muladd(arc.span[a], vf_set(places[q]), 0.25f * arc.middle[a]) + 0.75f * middle->r[a];
    for (int n = 0;; n++) {
        out->slip = vf_set(0);
        for (int i = 0; i < 3; i++) {
            kernel_local_stop_at(&arc, places[i], &stops[i]);
            out->slip = vf_max(kernel_local_slip_of(&stops[i]), out->slip);
        }
        const vm open = vm_andnot(rays, vf_le(out->slip, slack));
        if (n == KERNEL_COURSE_STEPS || !vm_any(open)) break;
        for (int i = 0; i < 3; i++)
            for (int a = 0; a < 3; a++)
                stops[i].r[a] = vf_select(open, stops[i].r[a] + stops[i].left[a], stops[i].r[a]);
    }
    out->is_lost = vm_not(vf_le(out->slip, kernel_local_take(bow->most, lane)));
    for (int i = 0; i < 3; i++) out->deviation[i] = stops[i].deviation;
}

#endif
