/* All crossings of an isovalue in a cell's interval: each isolated, then polished.
 *
 * Along the ray a point has the cell's coordinates r*(u), 0 <= u <= 1, a curve with X(r*(u)) straight, and the field
 * is F(r*(u)). On a piece of the curve from a to b take the chord c(u) = a + u (b - a). F(c(u)) is a cubic (F is
 * trilinear), of which we know both ends and both end slopes, so its four Bernstein coefficients, which bound it. How
 * far is the curve from the chord? Let Y = J0^-1 X with J0 the Jacobian at the cell's centre: Y(r) = r + N(r) + const,
 * N's derivative at most theta (found at the corners of the cell's domain: a norm is convex along each axis).
 * So |r1 - r2| <= L |Y(r1) - Y(r2)|, L = 1 / (1 - theta). And Y(c(u)) - Y(r*(u)) = e(u) is N(c(u)) less the line
 * between its ends: again a cubic with known coefficients 0, e1, e2, 0, hence
 *     |c - r*| <= dev = L 3/4 max(|e1|, |e2|),          |F(c) - F(r*)| <= G dev,
 *     |c' - r*'| <= L (K dev |b - a| + |e'|) = dev',    |F(c)' - F(r*)'| <= H dev (|b - a| + dev') + G dev',
 * with G, H, K bounds of F's gradient, F's Hessian and N's. dev falls by four when a piece is halved, and is 0 where
 * the map is affine: there F(c(u)) is the field itself.
 *
 * A piece whose coefficients are all farther from 0 than G dev has no root; one whose derivative's coefficients are
 * all of one sign and farther from 0 than their bound has one root where the ends' signs differ, else none; any other
 * piece is halved, the nearer half first. At 2^-12 of the interval halving ends: a pair of roots that is missed there
 * dips below 0 by at most |F''| (2^-12)^2 / 8 < 16 · 7.5e-9 of the range, which is float32's own rounding of F.
 *
 * Before any of that a bound of the whole cell is asked. Let L be linear in the point, with the field's gradient at the
 * cell's centre, and E = F - L(X), polynomial as F is and small where the field is smooth. Along the ray L(X) is
 * linear, and |(r*)'| <= L_stretch |J0^-1 d|, d the ray's direction: where |grad L . d| is more than the largest |grad
 * E| times that, F is monotone along every ray in the cell, and the signs at the faces tell all. And where L at both
 * ends is farther from 0 than the largest |E|, on one side, there is no root. Both ask for no coordinates in the cell.
 *
 * The pyramid's m = a b / k is no polynomial, but its second derivative along a line has one sign, so that F(c(u)) lies
 * between its chord and its end tangents and e(u) below e's: the same two slopes at the ends bound them.
 *
 * The signs at the faces are the face values', as in all of kernel_surface.h: where the interpolant just inside a
 * warped face has the other sign, the crossing is at the face. So crossings alternate along a ray, through all its
 * cells.
 *
 * Where theta is 0.9 and more (cells folded or nearly so) nothing is proved: L = 10 and at least 8 pieces are taken. */
#ifndef RENDER_KERNEL_ROOTS_H
#define RENDER_KERNEL_ROOTS_H

#include "kernel_neubauer.h"
#include "kernel_wide.h"

#define KERNEL_ROOT_BAND 3e-7f /* rounding of F where the largest |F| at a vertex is near 1 */
#define KERNEL_FACE_BAND 1e-6f /* F at a face and the face's value differ by rounding up to here */
#define KERNEL_SMALLEST_PIECE 0x1p-12f
#define KERNEL_DOMAIN_RIM 0.03125
enum { KERNEL_ROOT_PIECES = 256, KERNEL_POLISH_STEPS = 8, KERNEL_BRACKET_STEPS = 48 };

/* Of one cell and isovalue. */
typedef struct kernel_bounds {
    kernel_polynomial bent[3]; /* N */
    float inverse[3][3];       /* J0^-1 */
    float stretch;             /* L */
    float slope;               /* G */
    float curve, twist;        /* H, K; of a pyramid: times k */
    float coarsest;            /* longer pieces are halved in any case */
    bool is_monotone;          /* the field along any ray of the beam */
    float level, gradient[3];  /* of L: at vertex 0, and along tile space */
    float thickness;           /* of |E|, and what rounding adds to it */
} kernel_bounds;

/* Derivatives of the products r s, r q, s q, r s q. */
static inline void kernel_product_slopes(const double r[3], double out[4][3])
{
    const double slopes[4][3] = {
        {r[1], r[0], 0}, {r[2], 0, r[0]}, {0, r[2], r[1]}, {r[1] * r[2], r[0] * r[2], r[0] * r[1]}};
    memcpy(out, slopes, sizeof slopes);
}

/* The corners of the cell's domain, widened by KERNEL_DOMAIN_RIM on all sides for what rounding takes out of it; of a
 * pyramid a / k, b / k and k. */
static inline int kernel_corner_count(int type)
{
    return type == GRID_WEDGE ? 6 : 8;
}

static inline void kernel_domain_corner(int type, int n, double r[3])
{
    const double wide = KERNEL_DOMAIN_RIM;
    if (type == GRID_WEDGE) {
        r[0] = n % 3 == 1 ? 1 + 2 * wide : -wide;
        r[1] = n % 3 == 2 ? 1 + 2 * wide : -wide;
        r[2] = n < 3 ? -wide : 1 + wide;
        return;
    }
    for (int a = 0; a < 3; a++) r[a] = n >> a & 1 ? 1 + wide : -wide;
}

/* The extreme slopes of the products over the cell's widened domain. Returns how many; the first is the centre's. */
static inline int kernel_extreme_slopes(int type, double out[9][4][3])
{
    int n = 0;
    if (type == GRID_WEDGE) kernel_product_slopes((const double[]){1.0 / 3, 1.0 / 3, 0.5}, out[n++]);
    if (type == GRID_HEX) kernel_product_slopes((const double[]){0.5, 0.5, 0.5}, out[n++]);
    if (type == GRID_PYRAMID) {
        memset(out, 0, 9 * sizeof *out);
        for (int a = 0; a < 3; a++) out[n][0][a] = a == 2 ? -0.5 : 0.5;
        n++;
    }
    for (int i = 0; i < kernel_corner_count(type); i++, n++) {
        double r[3];
        kernel_domain_corner(type, i, r);
        if (type != GRID_PYRAMID) kernel_product_slopes(r, out[n]);
        if (type == GRID_PYRAMID)
            for (int a = 0; a < 3; a++) out[n][0][a] = a == 2 ? -r[a] : r[a];
    }
    return n;
}

/* Frobenius norm of a polynomial's Hessian over the widened domain; of a pyramid's times k: those of a b / k with a / k
 * and b / k in [-1/32, 33/32] are at most 1, 33/32, 33/32 and 2.13 over k, their norm 3.29. */
static inline double kernel_hessian_norm(int type, const double c[4])
{
    if (type == GRID_PYRAMID) return fabs(c[0]) * 3.29;
    double sum = 0;
    for (int j = 0; j < 3; j++) {
        const double largest =
            fmax(fabs(c[j] - KERNEL_DOMAIN_RIM * c[3]), fabs(c[j] + (1 + 2 * KERNEL_DOMAIN_RIM) * c[3]));
        sum += 2 * largest * largest;
    }
    return sqrt(sum);
}

static inline bool kernel_invert_matrix(const double m[3][3], double out[3][3])
{
    double cofactor[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            cofactor[i][k] = m[i1][k1] * m[i2][k2] - m[i1][k2] * m[i2][k1];
        }
    const double det = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[0][1] + m[0][2] * cofactor[0][2];
    const double inverse = det != 0 ? 1 / det : 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) out[i][k] = cofactor[k][i] * inverse;
    return det != 0 && isfinite(inverse);
}

static inline void kernel_bounds_bend(kernel_bounds *b, const kernel_map *map, const double slopes[4][3],
                                      double bent[3][4])
{
    double jacobian[3][3], inverse[3][3];
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) {
            jacobian[i][a] = (double)map->position[i].c[1 + a];
            for (int j = 0; j < 4; j++) jacobian[i][a] += (double)map->position[i].c[4 + j] * slopes[j][a];
        }
    const bool is_solid = kernel_invert_matrix(jacobian, inverse);
    memset(b, 0, sizeof *b);
    for (int i = 0; i < 3; i++) {
        for (int a = 0; a < 3; a++) b->inverse[i][a] = is_solid ? (float)inverse[i][a] : 0;
        for (int j = 0; j < 4; j++) {
            bent[i][j] = 0;
            for (int a = 0; a < 3; a++) bent[i][j] += is_solid ? inverse[i][a] * (double)map->position[a].c[4 + j] : 0;
            b->bent[i].c[4 + j] = (float)bent[i][j];
        }
    }
    b->coarsest = is_solid ? 1 : 0.125f;
}

/* A bound of how much m lengthens a vector, at most 1.15 times what it is: the norm of its singular values to the
 * eighth power, which is one, and so convex as they all are. */
static inline double kernel_matrix_norm(const double m[3][3])
{
    double square[3][3], sum = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++)
            square[i][k] = square[k][i] = m[0][i] * m[0][k] + m[1][i] * m[1][k] + m[2][i] * m[2][k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const double fourth =
                square[i][0] * square[k][0] + square[i][1] * square[k][1] + square[i][2] * square[k][2];
            sum += fourth * fourth;
        }
    return sqrt(sqrt(sqrt(sum)));
}

/* Rays' directions: (x, y, 1), and up to spread off that in both. */
typedef struct kernel_beam {
    float x, y, spread;
} kernel_beam;

/* The largest and least of |v . d| over the beam's directions d. */
static inline double kernel_beam_most(const kernel_beam *beam, double v0, double v1, double v2)
{
    return fabs(v0 * (double)beam->x + v1 * (double)beam->y + v2) + (double)beam->spread * (fabs(v0) + fabs(v1));
}

static inline double kernel_beam_least(const kernel_beam *beam, double v0, double v1, double v2)
{
    return fabs(v0 * (double)beam->x + v1 * (double)beam->y + v2) - (double)beam->spread * (fabs(v0) + fabs(v1));
}

/* E and what follows of it. */
static inline void kernel_bounds_linear(kernel_bounds *b, const kernel_map *map, const double slopes[9][4][3],
                                        const int count, const int type, const kernel_beam *beam)
{
    double e[8], most = 0, steep = 0, speed = 0, size = 0;
    for (int i = 0; i < 3; i++) {
        double g = 0;
        for (int a = 0; a < 3; a++) {
            double df = map->exact[3][1 + a];
            for (int j = 0; j < 4; j++) df += map->exact[3][4 + j] * slopes[0][j][a];
            g += df * (double)b->inverse[a][i];
        }
        b->gradient[i] = (float)g;
    }
    for (int j = 0; j < 8; j++) {
        e[j] = map->exact[3][j];
        for (int i = 0; i < 3; i++) e[j] -= (double)b->gradient[i] * map->exact[i][j];
    }
    b->level = (float)e[0];
    e[0] -= (double)b->level;
    for (int n = 1; n < count; n++) {
        double sum = 0;
        for (int a = 0; a < 3; a++) {
            double d = e[1 + a];
            for (int j = 0; j < 4; j++) d += e[4 + j] * slopes[n][j][a];
            sum += d * d;
        }
        steep = sum > steep ? sum : steep;
    }
    for (int n = 0; n < kernel_corner_count(type); n++) {
        double r[3];
        kernel_domain_corner(type, n, r);
        const double m = r[0] * r[1] * (type == GRID_PYRAMID ? r[2] : 1);
        if (type == GRID_PYRAMID) r[0] *= r[2], r[1] *= r[2];
        const double at = ((e[0] + r[0] * e[1]) + (r[1] * e[2] + r[2] * e[3])) + m * e[4] +
                          r[2] * ((r[0] * e[5] + r[1] * e[6]) + m * e[7]);
        most = fabs(at) > most ? fabs(at) : most;
    }
    for (int i = 0; i < 3; i++) size += fabs((double)b->gradient[i]) * (double)map->reach[i];
    /* A hundred-thousandth for the rounding of what is near 1, and of places to some units of where they are. */
    b->thickness = (float)(most + 1e-5 + 16 * 6e-8 * size);
    for (int i = 0; i < 3; i++) {
        const double most_of =
            kernel_beam_most(beam, (double)b->inverse[i][0], (double)b->inverse[i][1], (double)b->inverse[i][2]);
        speed += most_of * most_of;
    }
    const double rise = kernel_beam_least(beam, (double)b->gradient[0], (double)b->gradient[1], (double)b->gradient[2]);
    b->is_monotone = b->coarsest == 1 && rise * 0.9999 > sqrt(steep * speed) * (double)b->stretch;
}

static inline void kernel_bounds_setup(kernel_bounds *b, const kernel_map *map, int type, const kernel_beam *beam)
{
    double slopes[9][4][3], bent[3][4], field[4], theta = 0, gradient = 0, twist = 0;
    const int count = kernel_extreme_slopes(type, slopes);
    kernel_bounds_bend(b, map, slopes[0], bent);
    for (int n = 1; n < count; n++) {
        double steep = 0, m[3][3];
        for (int a = 0; a < 3; a++) {
            double f = (double)map->field.c[1 + a];
            for (int j = 0; j < 4; j++) f += (double)map->field.c[4 + j] * slopes[n][j][a];
            steep += f * f;
            for (int i = 0; i < 3; i++) {
                m[i][a] = 0;
                for (int j = 0; j < 4; j++) m[i][a] += bent[i][j] * (slopes[n][j][a] - slopes[0][j][a]);
            }
        }
        const double move = kernel_matrix_norm((const double(*)[3])m);
        theta = move > theta ? move : theta;
        gradient = steep > gradient ? steep : gradient;
    }
    if (!(theta < 0.9)) b->coarsest = 0.125f;
    b->stretch = theta < 0.9 ? (float)(1 / (1 - theta)) : 10;
    b->slope = (float)sqrt(gradient);
    for (int j = 0; j < 4; j++) field[j] = (double)map->field.c[4 + j];
    for (int i = 0; i < 3; i++) {
        const double h = kernel_hessian_norm(type, bent[i]);
        twist += h * h;
    }
    b->curve = (float)kernel_hessian_norm(type, field);
    b->twist = (float)sqrt(twist);
    kernel_bounds_linear(b, map, (const double(*)[4][3])slopes, count, type, beam);
}

/* What is known of a piece. */
typedef struct kernel_verdict {
    vm clear;    /* no root, and all of side's sign */
    vm monotone; /* at most one root */
    vm tiny;     /* all of it rounding */
} kernel_verdict;

/* Deviation of the chord from the line in Y: the largest of |e1|, |e2|, and of the derivative's coefficients / 3. */
SIMD_INLINE void kernel_chord_bend(const kernel_map *map, const kernel_bounds *b, const kernel_point *from,
                                   const kernel_point *to, const kernel_product m[2], const vf move[3], vf *size,
                                   vf *slope)
{
    vf first = vf_set(0), second = first, between = first;
    for (int i = 0; i < 3; i++) {
        vf g0[3], g1[3];
        kernel_polynomial_gradient(map, &b->bent[i], &m[0], from->r, g0);
        kernel_polynomial_gradient(map, &b->bent[i], &m[1], to->r, g1);
        const vf rise = kernel_polynomial_value(map, &b->bent[i], &m[1], to->r) -
                        kernel_polynomial_value(map, &b->bent[i], &m[0], from->r);
        const vf e1 = (kernel_dot(g0, move) - rise) * (1.0f / 3), e2 = (rise - kernel_dot(g1, move)) * (1.0f / 3);
        first += e1 * e1;
        second += e2 * e2;
        between += (e2 - e1) * (e2 - e1);
    }
    const vf largest = vf_max(first, second);
    *size = vf_sqrt(largest);
    *slope = vf_sqrt(vf_max(largest, between));
}

/* side: 1 or -1. gap: how far Y(from), Y(to) may be from the ray. */
SIMD_INLINE kernel_verdict kernel_judge(const kernel_map *map, const kernel_bounds *b, const kernel_point *from,
                                        const kernel_point *to, vf gap, vf side)
{
    const kernel_product m[2] = {kernel_map_product(map, from->r), kernel_map_product(map, to->r)};
    vf move[3], g0[3], g1[3], bend, bend_slope;
    for (int a = 0; a < 3; a++) move[a] = to->r[a] - from->r[a];
    kernel_polynomial_gradient(map, &map->field, &m[0], from->r, g0);
    kernel_polynomial_gradient(map, &map->field, &m[1], to->r, g1);
    kernel_chord_bend(map, b, from, to, m, move, &bend, &bend_slope);
    const vf d0 = kernel_dot(g0, move), d1 = kernel_dot(g1, move), rise = to->value - from->value;
    vf b1 = from->value + d0 * (1.0f / 3), b2 = to->value - d1 * (1.0f / 3), middle = 3.0f * (b2 - b1);
    vf scale = vf_set(1);
    if (map->is_pyramid) {
        /* Where the tangents at the ends meet. */
        const vf turn = d0 - d1;
        const vf at = vf_select(vf_eq(turn, vf_set(0)), vf_set(0), (rise - d1) / turn);
        b1 = b2 = from->value + d0 * vf_clamp(at, vf_set(0), vf_set(1));
        middle = d0;
        scale = 1.0f / vf_max(vf_min(from->r[2], to->r[2]) - b->stretch * (1.5f * bend + gap), vf_set(1e-30f));
    }
    const vf off = b->stretch * ((map->is_pyramid ? 1.5f : 0.75f) * bend + gap);
    const vf wrong = b->slope * off, bound = wrong + KERNEL_ROOT_BAND;
    const vf least = vf_min(vf_min(from->value * side, to->value * side), vf_min(b1 * side, b2 * side));
    const vf most = vf_max(vf_max(vf_abs(from->value), vf_abs(to->value)), vf_max(vf_abs(b1), vf_abs(b2)));
    const vf length = vf_sqrt(kernel_dot(move, move));
    const vf off_slope = b->stretch * (b->twist * scale * off * length + 3.0f * bend_slope + 2.0f * gap);
    const vf tolerance = b->curve * scale * off * (length + off_slope) + b->slope * off_slope + KERNEL_ROOT_BAND;
    const vf low = vf_min(middle, vf_min(d0, d1)), high = vf_max(middle, vf_max(d0, d1));
    kernel_verdict out;
    out.clear = vf_lt(bound, least);
    out.monotone = vm_or(vf_lt(tolerance, low), vf_lt(tolerance, -high));
    out.tiny = vf_le(most + wrong, vf_set(KERNEL_ROOT_BAND));
    return out;
}

/* A search under way: pieces [number, number + 1] * size of the interval, in order. */
typedef struct kernel_search {
    const kernel_map *map;
    const kernel_bounds *bounds;
    const kernel_interval *interval;
    vm open;  /* rays that have pieces left */
    vm ended; /* rays that came to the end: side is that of their last piece */
    vf side;  /* of from: 1 or -1 */
    vf number, size, pieces;
    kernel_point from, end;
    vm found; /* rays with a root between low and high, */
    kernel_point low, high;
} kernel_search;

SIMD_INLINE vf kernel_side(vf v)
{
    return vf_select(vf_lt(v, vf_set(0)), vf_set(-1), vf_set(1));
}

/* The interpolant at a face, or the face's value where that is the same but for rounding. */
SIMD_INLINE void kernel_search_face(kernel_packet *p, const kernel_search *s, vm rays, vf face, kernel_point *at)
{
    const vf inside = kernel_solve(p, s->map, s->interval, rays, at->t, at->r);
    at->value = vf_select(vf_le(vf_abs(inside - face), vf_set(KERNEL_FACE_BAND)), face, inside);
}

/* How far Y at the coordinates that a face gave is from the ray. */
SIMD_INLINE vf kernel_face_gap(const kernel_packet *p, const kernel_search *s, const kernel_point *at)
{
    const kernel_product m = kernel_map_product(s->map, at->r);
    const vf target[3] = {(p->origin_x + p->slope_x * at->t) - s->map->origin[0],
                          (p->origin_y + p->slope_y * at->t) - s->map->origin[1], at->t - s->map->origin[2]};
    vf off[3], sum = vf_set(0);
    for (int a = 0; a < 3; a++) off[a] = kernel_polynomial_value(s->map, &s->map->position[a], &m, at->r) - target[a];
    for (int i = 0; i < 3; i++) {
        const float *row = s->bounds->inverse[i];
        const vf y = (off[0] * row[0] + off[1] * row[1]) + off[2] * row[2];
        sum += y * y;
    }
    return vf_sqrt(sum);
}

/* L on rays at depth t. */
SIMD_INLINE vf kernel_linear_at(const kernel_packet *p, const kernel_search *s, vf t)
{
    const float *g = s->bounds->gradient, *origin = s->map->origin;
    const vf x = (p->origin_x + p->slope_x * t) - origin[0], y = (p->origin_y + p->slope_y * t) - origin[1];
    return (s->bounds->level + g[0] * x) + (g[1] * y + g[2] * (t - origin[2]));
}

/* The whole interval first, by the faces' coordinates and values: most rays are done with it. */
SIMD_INLINE void kernel_search_begin(kernel_packet *p, kernel_search *s, vm rays)
{
    const kernel_interval *i = s->interval;
    const vf zero = vf_set(0);
    kernel_point_ends(i, &s->low, &s->high);
    s->from = s->low;
    s->end = s->high;
    s->side = kernel_side(i->v_in);
    s->ended = s->found = s->open = vm_none();
    s->number = s->pieces = zero;
    s->size = vf_set(0.5f);
    const vm change = vm_xor(vf_lt(i->v_in, zero), vf_lt(i->v_out, zero));
    if (s->bounds->coarsest == 1) {
        const vf thick = vf_set(s->bounds->thickness);
        const vm far = vm_and(vf_lt(thick, s->side * kernel_linear_at(p, s, i->t_in)),
                              vf_lt(thick, s->side * kernel_linear_at(p, s, i->t_out)));
        rays = vm_andnot(rays, vm_andnot(far, change));
        if (s->bounds->is_monotone) {
            s->found = vm_and(rays, change);
            rays = vm_andnot(rays, change);
        }
        if (!vm_any(rays)) return;
    }
    const vf gap = vf_max(kernel_face_gap(p, s, &s->low), kernel_face_gap(p, s, &s->high));
    const kernel_verdict v = kernel_judge(s->map, s->bounds, &s->low, &s->high, gap, s->side);
    const vf jump = s->bounds->slope * s->bounds->stretch * gap + KERNEL_ROOT_BAND;
    const vm faced = vf_lt(jump, vf_min(i->v_in * s->side, i->v_out * s->side));
    const vm monotone = s->bounds->is_monotone ? rays : v.monotone;
    vm none = vm_or(v.clear, vm_and(monotone, faced)), one = vm_and(monotone, change);
    if (s->bounds->coarsest < 1) none = one = vm_none();
    s->found = vm_or(s->found, vm_and(rays, one));
    s->open = vm_andnot(vm_andnot(rays, none), one);
    if (!vm_any(s->open)) return;
    kernel_search_face(p, s, s->open, i->v_in, &s->from);
    kernel_search_face(p, s, s->open, i->v_out, &s->end);
    /* Just inside a warped face the other sign: a root in no room. */
    const vm jumps = vm_andnot(s->open, vf_eq(kernel_side(s->from.value), s->side));
    kernel_place_move(jumps, &s->from, &s->low);
    kernel_place_move(jumps, &s->from, &s->high);
    s->side = vf_select(s->open, kernel_side(s->from.value), s->side);
    s->found = vm_or(s->found, jumps);
}

/* The end of the current piece. */
SIMD_INLINE void kernel_search_piece(kernel_packet *p, const kernel_search *s, vm rays, kernel_point *to)
{
    const kernel_interval *i = s->interval;
    const vf u = (s->number + 1.0f) * s->size;
    const vm inner = vm_and(rays, vf_lt(u, vf_set(1)));
    *to = s->end;
    if (!vm_any(inner)) return;
    kernel_point at = {.t = vf_select(inner, i->t_in + (i->t_out - i->t_in) * u, i->t_out)};
    kernel_place_between(&s->from, &s->end, at.t, at.r);
    at.value = kernel_solve(p, s->map, i, inner, at.t, at.r);
    kernel_place_move(inner, &at, to);
}

/* On to the next piece, to a longer one where there is one that starts there. */
SIMD_INLINE void kernel_search_advance(kernel_search *s, vm rays, const kernel_point *to)
{
    kernel_place_move(rays, to, &s->from);
    const vf next = s->number + 1.0f, half = next * 0.5f;
    const vm up = vm_and(vf_eq(vf_floor(half), half), vf_lt(s->size, vf_set(0.5f)));
    s->number = vf_select(rays, vf_select(up, half, next), s->number);
    s->size = vf_select(vm_and(rays, up), s->size * 2.0f, s->size);
    const vm over = vm_andnot(rays, vf_lt(s->number * s->size, vf_set(1)));
    s->open = vm_andnot(s->open, over);
    s->ended = vm_or(s->ended, over);
}

/* To the next root of each open ray. */
SIMD_INLINE void kernel_search_next(kernel_packet *p, kernel_search *s)
{
    vm going = s->open;
    s->found = vm_none();
    while (vm_any(going)) {
        kernel_point to;
        kernel_search_piece(p, s, going, &to);
        const kernel_verdict v = kernel_judge(s->map, s->bounds, &s->from, &to, vf_set(0), s->side);
        const vm small =
            vm_or(vf_le(s->size, vf_set(KERNEL_SMALLEST_PIECE)), vf_lt(vf_set(KERNEL_ROOT_PIECES), s->pieces));
        const vm certain = vm_and(vm_or(v.monotone, v.clear), vf_le(s->size, vf_set(s->bounds->coarsest)));
        const vm decided = vm_and(going, vm_or(vm_or(certain, v.tiny), small));
        const vm roots = vm_andnot(decided, vf_eq(kernel_side(to.value), s->side));
        const vm halve = vm_andnot(going, decided);
        s->pieces += 1.0f;
        kernel_place_move(roots, &s->from, &s->low);
        kernel_place_move(roots, &to, &s->high);
        s->found = vm_or(s->found, roots);
        s->side = vf_select(roots, -s->side, s->side);
        s->number = vf_select(halve, s->number * 2.0f, s->number);
        s->size = vf_select(halve, s->size * 0.5f, s->size);
        kernel_search_advance(s, decided, &to);
        going = vm_and(vm_andnot(going, roots), s->open);
    }
}

/* Rays that have come to their end with the other sign than the face's: a root in no room there. */
SIMD_INLINE void kernel_search_end(kernel_search *s)
{
    s->found = vm_andnot(s->ended, vf_eq(kernel_side(s->interval->v_out), s->side));
    s->ended = vm_none();
    kernel_place_move(s->found, &s->end, &s->low);
    kernel_place_move(s->found, &s->end, &s->high);
}

/* Regula falsi that halves the value of an end that stays (Illinois), within low and high. */
SIMD_INLINE void kernel_bracket(kernel_packet *p, const kernel_search *s, vm rays, kernel_point *out)
{
    kernel_point low = s->low, high = s->high;
    for (int n = 0; n < KERNEL_BRACKET_STEPS && vm_any(rays); n++) {
        kernel_point at = {.t = kernel_secant(low.t, low.value, high.t, high.value)};
        if (n % 3 == 2) at.t = low.t + (high.t - low.t) * 0.5f;
        kernel_place_between(&low, &high, at.t, at.r);
        at.value = kernel_solve(p, s->map, s->interval, rays, at.t, at.r);
        const vm same = vf_eq(kernel_side(at.value), kernel_side(low.value));
        kernel_place_move(rays, &at, out);
        high.value = vf_select(same, high.value * 0.5f, high.value);
        low.value = vf_select(same, low.value, low.value * 0.5f);
        kernel_place_move(vm_and(rays, same), &at, &low);
        kernel_place_move(vm_andnot(rays, same), &at, &high);
        rays = vm_andnot(rays, vf_le(vf_abs(at.value), vf_set(1e-7f)));
    }
}

/* ---- the last step ---- */

SIMD_INLINE kernel_wide kernel_wide_value(const double c[8], const kernel_wide r[3], kernel_wide m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* How far the places r at depth t are off their rays, and the field there, in double: exact but for the rounding of r
 * and t themselves. */
SIMD_INLINE void kernel_residuals(const kernel_packet *p, const kernel_map *map, const kernel_point *at, vf off[3],
                                  vf *value)
{
    const kernel_wide r[3] = {kernel_widen(at->r[0]), kernel_widen(at->r[1]), kernel_widen(at->r[2])};
    const kernel_wide t = kernel_widen(at->t);
    kernel_wide m = r[0] * r[1];
    if (map->is_pyramid) m /= kernel_widen(vf_max(at->r[2], vf_set(1e-6f)));
    const kernel_wide x = kernel_widen(p->origin_x) + kernel_widen(p->slope_x) * t;
    const kernel_wide y = kernel_widen(p->origin_y) + kernel_widen(p->slope_y) * t;
    off[0] = kernel_narrow(x - (double)map->origin[0] - kernel_wide_value(map->exact[0], r, m));
    off[1] = kernel_narrow(y - (double)map->origin[1] - kernel_wide_value(map->exact[1], r, m));
    off[2] = kernel_narrow(t - (double)map->origin[2] - kernel_wide_value(map->exact[2], r, m));
    *value = kernel_narrow(kernel_wide_value(map->exact[3], r, m));
}

/* A step of Newton's method on the four equations X(r) = ray(t), F(r) = 0 at once, from how far these are off; t is
 * kept within the bracket. Returns who has come to its end. */
SIMD_INLINE vm kernel_polish_step(const kernel_packet *p, const kernel_search *s, vm rays, const kernel_product *m,
                                  const vf off[3], vf field, kernel_point *out)
{
    const kernel_map *map = s->map;
    const vf zero = vf_set(0);
    kernel_jacobian j;
    vf gradient[3], step[3], speed[3], largest = zero;
    kernel_map_jacobian(map, m, out->r, &j);
    kernel_polynomial_gradient(map, &map->field, m, out->r, gradient);
    const vm flat = vf_eq(j.det, zero);
    const vf inverse = vf_select(flat, zero, 1.0f / j.det);
    for (int a = 0; a < 3; a++) {
        step[a] = ((j.cross[0][a] * off[0] + j.cross[1][a] * off[1]) + j.cross[2][a] * off[2]) * inverse;
        speed[a] = ((j.cross[0][a] * p->slope_x + j.cross[1][a] * p->slope_y) + j.cross[2][a]) * inverse;
    }
    const vf value = field + kernel_dot(gradient, step), rate = kernel_dot(gradient, speed);
    const vf move = vf_select(vf_eq(rate, zero), zero, -(value / rate));
    const vf t = vf_clamp(out->t + move, s->low.t, s->high.t);
    for (int a = 0; a < 3; a++) {
        const vf change = vf_clamp(step[a] + speed[a] * (t - out->t), vf_set(-1), vf_set(1));
        largest = vf_max(largest, vf_abs(change));
        out->r[a] = vf_select(rays, vf_clamp(out->r[a] + change, vf_set(-1), vf_set(2)), out->r[a]);
    }
    out->t = vf_select(rays, t, out->t);
    return vm_and(rays, vm_andnot(vf_le(largest, vf_set(map->tolerance)), flat));
}

/* The roots between low and high by such steps, the last of them from residuals in double; where they do not converge,
 * by the bracket alone. */
SIMD_INLINE void kernel_polish(kernel_packet *p, const kernel_search *s, kernel_point *out)
{
    const kernel_map *map = s->map;
    const vf zero = vf_set(0), fall = s->low.value - s->high.value;
    const vf along = vf_clamp(vf_select(vf_eq(fall, zero), zero, s->low.value / fall), zero, vf_set(1));
    vm open = s->found;
    vf off[3], value;
    out->t = s->low.t + along * (s->high.t - s->low.t);
    out->value = zero;
    for (int a = 0; a < 3; a++) out->r[a] = s->low.r[a] + along * (s->high.r[a] - s->low.r[a]);
    for (int n = 0; n < KERNEL_POLISH_STEPS && vm_any(open); n++) {
        const kernel_product m = kernel_map_product(map, out->r);
        const vf target[3] = {(p->origin_x + p->slope_x * out->t) - map->origin[0],
                              (p->origin_y + p->slope_y * out->t) - map->origin[1], out->t - map->origin[2]};
        for (int a = 0; a < 3; a++) off[a] = target[a] - kernel_polynomial_value(map, &map->position[a], &m, out->r);
        value = kernel_polynomial_value(map, &map->field, &m, out->r);
        open = vm_andnot(open, kernel_polish_step(p, s, open, &m, off, value, out));
    }
    const vm close = vm_andnot(s->found, open);
    if (vm_any(close)) {
        const kernel_product m = kernel_map_product(map, out->r);
        kernel_point last = *out;
        kernel_residuals(p, map, out, off, &value);
        /* At a double root the field's slope is rounding, and a step by it leads away. */
        kernel_place_move(kernel_polish_step(p, s, close, &m, off, value, &last), &last, out);
    }
    if (vm_any(open)) kernel_bracket(p, s, open, out);
}

#endif
