/* Bounds of a cell's map and field, for all rays that meet it (kernel_roots.h has what they are bounds of).
 *
 * Let L be linear in the point, with the field's gradient at the cell's centre, and E = F - L(X), polynomial as F is
 * and small where the field is smooth. Along a ray of direction d L(X) is linear, and r* has the slope J^-1 d: where
 * |grad L . d| is more than the most that grad E . J^-1 d may be, F is monotone along every ray in the cell. And where
 * L at both ends is farther from 0 than the largest |E|, on one side, there is no root. */
#ifndef RENDER_KERNEL_BOUNDS_H
#define RENDER_KERNEL_BOUNDS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_map.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* A number at each corner of a cell's domain. */
typedef double kernel_corners __attribute__((vector_size(64)));

static inline double kernel_corners_most(kernel_corners v)
{
    double most = v[0];
    for (int n = 1; n < 8; n++) most = v[n] > most ? v[n] : most;
    return most;
}

static inline void kernel_domain_corners(int type, kernel_corners r[3])
{
    const kernel_domain *domain = kernel_domain_of(type);
    for (int n = 0; n < 8; n++)
        for (int a = 0; a < 3; a++) r[a][n] = domain->corners[n][a];
}

/* Derivatives of the products r s, r q, s q, r s q at the centre and the corners, there the extreme ones. */
typedef struct kernel_slopes {
    double centre[4][3];
    kernel_corners corners[4][3];
} kernel_slopes;

static inline void kernel_domain_slopes(int type, kernel_slopes *out)
{
    const double *c = kernel_domain_of(type)->centre;
    kernel_corners r[3];
    memset(out, 0, sizeof *out);
    kernel_domain_corners(type, r);
    if (kernel_has_apex(type)) {
        for (int a = 0; a < 3; a++) {
            out->centre[0][a] = a == 2 ? -c[a] : c[a];
            out->corners[0][a] = a == 2 ? -r[a] : r[a];
        }
        return;
    }
    for (int j = 0; j < 4; j++)
        for (int a = 0; a < 3; a++) {
            const bool has = j == 3 || a != 2 - j;
            const int k = j == 3 ? (a + 1) % 3 : 3 - a - (2 - j), l = (a + 2) % 3;
            if (!has) continue;
            out->centre[j][a] = j == 3 ? c[k] * c[l] : c[k];
            out->corners[j][a] = j == 3 ? r[k] * r[l] : r[k];
        }
}

/* Frobenius norm of a polynomial's Hessian over the widened domain; of a pyramid's times k: those of a b / k with a / k
 * and b / k in [-1/32, 33/32] are at most 1, 33/32, 33/32 and 2.13 over k, their norm 3.29. */
static inline double kernel_hessian_norm(int type, const double c[4])
{
    if (kernel_has_apex(type)) return fabs(c[0]) * 3.29;
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
static inline double kernel_matrix_norm(const kernel_corners m[3][3])
{
    kernel_corners square[3][3], sum = {0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++)
            square[i][k] = square[k][i] = m[0][i] * m[0][k] + m[1][i] * m[1][k] + m[2][i] * m[2][k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const kernel_corners fourth =
                square[i][0] * square[k][0] + square[i][1] * square[k][1] + square[i][2] * square[k][2];
            sum += fourth * fourth;
        }
    return sqrt(sqrt(sqrt(kernel_corners_most(sum))));
}

/* The gradient of what has these coefficients, at the corners. */
static inline void kernel_corner_gradient(const double c[8], const kernel_slopes *slopes, kernel_corners out[3])
{
    for (int a = 0; a < 3; a++) {
        out[a] = (kernel_corners){0} + c[1 + a];
        for (int j = 0; j < 4; j++) out[a] += c[4 + j] * slopes->corners[j][a];
    }
}

/* E's largest value at the corners of the domain, and so in it. */
static inline double kernel_bounds_error(const double e[8], int type)
{
    kernel_corners r[3];
    kernel_domain_corners(type, r);
    if (kernel_has_apex(type)) r[0] *= r[2], r[1] *= r[2];
    const kernel_corners m = kernel_has_apex(type) ? r[0] * r[1] / r[2] : r[0] * r[1];
    const kernel_corners at = ((e[0] + r[0] * e[1]) + (r[1] * e[2] + r[2] * e[3])) + m * e[4] +
                              r[2] * ((r[0] * e[5] + r[1] * e[6]) + m * e[7]);
    return sqrt(kernel_corners_most(at * at));
}

/* Bounds how far a face's value may be from the field on the ray. The value is that of the patch at the coordinates
 * found, and that point lies beside the ray by the rounding of places: by no more than this across and along. */
static inline float kernel_bounds_jump(const kernel_bounds *b, const kernel_map *map, const kernel_beam *beam)
{
    const double across = 2e-6 * ((double)map->reach[0] + (double)map->reach[1] + (double)beam->offset +
                                  (double)beam->spread * (double)map->reach[2]);
    double gap = 0;
    for (int i = 0; i < 3; i++) {
        const double term = across * (fabs((double)b->inverse[i][0]) + fabs((double)b->inverse[i][1])) +
                            1e-6 * (double)map->reach[2] * fabs((double)b->inverse[i][2]);
        gap += term * term;
    }
    return (float)((double)b->slope * (double)b->stretch * sqrt(gap)) + KERNEL_FACE_BAND;
}

/* Is F monotone along the beam's rays? With M = J0^-1 J - I, whose norm is at most theta, and w = J0^-1 d, what E adds
 * to the slope of L is grad E . (I + M)^-1 w = grad E . (w - M w + M M (I + M)^-1 w); each is bounded alone, by its
 * largest at the corners, for the ray in the middle and by how far w may be from its. */
static inline bool kernel_bounds_rise(const kernel_bounds *b, const double e[8], const kernel_slopes *slopes,
                                      const kernel_corners bend[3][3], double theta, const kernel_beam *beam)
{
    const double x = (double)beam->x, y = (double)beam->y, spread = (double)beam->spread;
    const double g[3] = {(double)b->gradient[0], (double)b->gradient[1], (double)b->gradient[2]};
    kernel_corners de[3], along = {0}, steep = {0}, bent = {0};
    double w[3], length = 0, off = 0;
    kernel_corner_gradient(e, slopes, de);
    for (int i = 0; i < 3; i++) {
        const double j0 = (double)b->inverse[i][0], j1 = (double)b->inverse[i][1];
        const double term = spread * (fabs(j0) + fabs(j1));
        w[i] = j0 * x + j1 * y + (double)b->inverse[i][2];
        length += w[i] * w[i];
        off += term * term;
        along += de[i] * w[i];
        steep += de[i] * de[i];
    }
    for (int i = 0; i < 3; i++) {
        const kernel_corners term = bend[i][0] * w[0] + bend[i][1] * w[1] + bend[i][2] * w[2];
        bent += term * term;
    }
    const double stretch = (double)b->stretch, slant = sqrt(kernel_corners_most(steep));
    length = sqrt(length);
    off = sqrt(off);
    const double whole = slant * stretch * (length + off);
    const double apart =
        sqrt(kernel_corners_most(along * along)) +
        slant * (sqrt(kernel_corners_most(bent)) + theta * theta * stretch * (length + off) + (1 + theta) * off);
    const double rise = fabs(g[0] * x + g[1] * y + g[2]) - spread * (fabs(g[0]) + fabs(g[1]));
    return rise * 0.9999 > (whole < apart ? whole : apart);
}

/* L, E and what follows of them. */
static inline void kernel_bounds_linear(kernel_bounds *b, const kernel_map *map, const kernel_slopes *slopes,
                                        const kernel_corners bend[3][3], double theta, int type,
                                        const kernel_beam *beam)
{
    double e[8], df[3], size = 0;
    for (int a = 0; a < 3; a++) {
        df[a] = map->exact[3][1 + a];
        for (int j = 0; j < 4; j++) df[a] += map->exact[3][4 + j] * slopes->centre[j][a];
    }
    for (int i = 0; i < 3; i++) {
        double g = 0;
        for (int a = 0; a < 3; a++) g += df[a] * (double)b->inverse[a][i];
        b->gradient[i] = (float)g;
        size += fabs(g) * (double)map->reach[i];
    }
    for (int j = 0; j < 8; j++) {
        e[j] = map->exact[3][j];
        for (int i = 0; i < 3; i++) e[j] -= (double)b->gradient[i] * map->exact[i][j];
    }
    b->level = (float)e[0];
    e[0] -= (double)b->level;
    /* A hundred-thousandth for the rounding of what is near 1, and of places to some units of where they are. */
    b->thickness = (float)(kernel_bounds_error(e, type) + 1e-5 + 16 * 6e-8 * size);
    b->jump = kernel_bounds_jump(b, map, beam);
    b->is_monotone = b->coarsest == 1 && kernel_bounds_rise(b, e, slopes, bend, theta, beam);
}

static inline void kernel_bounds_setup(kernel_bounds *b, const kernel_map *map, int type, const kernel_beam *beam)
{
    double bent[3][4], field[8], twist = 0;
    kernel_slopes slopes;
    kernel_corners df[3], bend[3][3];
    kernel_domain_slopes(type, &slopes);
    kernel_bounds_bend(b, map, (const double(*)[3])slopes.centre, bent);
    for (int j = 0; j < 8; j++) field[j] = (double)map->field.c[j];
    kernel_corner_gradient(field, &slopes, df);
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) {
            bend[i][a] = (kernel_corners){0};
            for (int j = 0; j < 4; j++) bend[i][a] += bent[i][j] * (slopes.corners[j][a] - slopes.centre[j][a]);
        }
    const double theta = kernel_matrix_norm((const kernel_corners(*)[3])bend);
    if (!(theta < 0.9)) b->coarsest = 0.125f;
    b->stretch = theta < 0.9 ? (float)(1 / (1 - theta)) : 10;
    b->slope = (float)sqrt(kernel_corners_most(df[0] * df[0] + df[1] * df[1] + df[2] * df[2]));
    for (int i = 0; i < 3; i++) {
        const double h = kernel_hessian_norm(type, bent[i]);
        twist += h * h;
    }
    b->curve = (float)kernel_hessian_norm(type, field + 4);
    b->twist = (float)sqrt(twist);
    kernel_bounds_linear(b, map, &slopes, (const kernel_corners(*)[3])bend, theta, type, beam);
}

/* Set up once for a cell and isovalue and used by all packets of a tile. Each place of the cell cache has one beside
 * it. */
typedef struct kernel_curved {
    bool is_set_up, has_contraction;
    int value;
    kernel_map map;
    kernel_bounds bounds; /* robust roots alone */
    kernel_cell_contraction contraction;
} kernel_curved;

/* The tile's rays. */
SIMD_INLINE kernel_beam kernel_tile_beam(const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const float shift = fabsf((float)f->depth_shift), radius = tile->radius;
    return (kernel_beam){.spread = flat ? 0 : radius, .offset = flat ? radius : radius * shift};
}

SIMD_INLINE void kernel_curved_setup(const kernel_frame *f, const kernel_tile *tile, kernel_curved *curved,
                                     const render_surface_layer *layer, const kernel_cell *c, int value)
{
    if (curved->is_set_up) return;
    curved->is_set_up = true;
    curved->has_contraction = false;
    curved->value = value;
    kernel_map_setup(&curved->map, c);
    if (layer->colour_map) kernel_map_colour(&curved->map, c);
    const kernel_beam beam = kernel_tile_beam(f, tile);
    kernel_bounds_setup(&curved->bounds, &curved->map, c->type, &beam);
}

#endif
