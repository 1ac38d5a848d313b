/* Computes bounds of hexes, wedges or pyramids, one cell per lane: of the nonlinearity of the cell's map, which takes
 * reference coordinates to positions, and of the field. The bounds hold for all rays of a tile; the header comment of
 * kernel_roots.h defines the quantities that are bounded. A derivative that does not depend on all three coordinates
 * has the same value at several corners, and is computed once for these corners.
 *
 * Let the position X and the field F, from which the isovalue has been subtracted, be functions of the reference
 * coordinates r. J is the Jacobian of X, and J0 its value at the cell's centre. N is the nonlinear part of J0^-1 X, so
 * that J0^-1 X = r + N(r) + const. Let L be a linear function of the position whose gradient is the field's at the
 * cell's centre, and E = F - L(X). E is a polynomial like F, and small if the field is smooth. Along a ray of direction
 * d, L(X) is linear and r has the derivative J^-1 d. If |grad L . d| is larger than the maximum of grad E . J^-1 d, F
 * is monotone along every ray in the cell. And if L at both ends of an interval is farther from 0 than the largest |E|,
 * on the same side, the interval has no root. */
#ifndef RENDER_KERNEL_BOUNDS_H
#define RENDER_KERNEL_BOUNDS_H

#include <math.h>
#include <string.h>

#include "kernel_cell.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_shapes.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* Bounds for one cell and isovalue per lane. */
typedef struct kernel_bounds {
    /* Upper bound of the difference between the value at a computed crossing of a face and the field on the ray there.
     * A negative number means: it has not been proved that the field is monotone along all rays in the cell. */
    float jump[SIMD_WIDTH];
    /* The linear function L that approximates the field. level: its value at vertex 0; gradient: in tile space;
     * thickness: upper bound of |E| = |F - L| including rounding, infinite if nothing has been proved about the
     * cell. */
    float level[SIMD_WIDTH], gradient[3][SIMD_WIDTH], thickness[SIMD_WIDTH];
    /* normal: inverse of the map's Jacobian at the cell's centre. Row i of this matrix is the normal of two parallel
     * planes between which the cell lies: low[i] <= normal[i] . (X - vertex 0) <= high[i]. */
    float normal[3][3][SIMD_WIDTH], low[3][SIMD_WIDTH], high[3][SIMD_WIDTH];
    /* for each component of the map's nonlinear part N, its coefficients 4 to 7: those of products of reference
     * coordinates (kernel_map.h) */
    float nonlinear_part[3][4][SIMD_WIDTH];
    /* stretch: upper bound of the factor by which the inverse map stretches distances (L of kernel_roots.h); slope:
     * upper bound of the magnitude of the field's gradient with respect to reference coordinates (G of
     * kernel_roots.h) */
    float stretch[SIMD_WIDTH], slope[SIMD_WIDTH];
    /* Upper bounds of the second derivatives of the field (H of kernel_roots.h) and of the map's nonlinear part (K).
     * For a pyramid they are upper bounds of these derivatives times the reference coordinate k, because the
     * derivatives grow like 1 / k towards the apex. */
    float field_curvature[SIMD_WIDTH], map_curvature[SIMD_WIDTH];
    /* Coefficients from which surface/kernel_contraction.h computes a ray's crossing of the isovalue in a cell in which
     * the ray has no other crossing of it. J0^-1 (X - vertex 0) + offset equals r + N(r), where r is counted from the
     * reference domain's middle (in a pyramid from the apex), and terms has the coefficients of N. The field is L +
     * middle + a polynomial with the coefficients field_terms, in the same products of coordinates as N. */
    float offset[3][SIMD_WIDTH], middle[SIMD_WIDTH], terms[4][3][SIMD_WIDTH], field_terms[4][SIMD_WIDTH];
    /* K / (1 - K), where K < 1 is the contraction constant of the fixed-point iteration that computes the crossing
     * (kernel_contraction.h); infinite if the iteration is not a contraction */
    float error_growth[SIMD_WIDTH];
    /* Both in reference coordinates: error_bound is an upper bound of the rounding error of the iteration's result, and
     * domain_margin an upper bound of the distance by which rounding moves a root (kernel_contraction.h). */
    float error_bound[SIMD_WIDTH], domain_margin[SIMD_WIDTH];
} kernel_bounds;

/* Intermediate results in double for SIMD_WIDTH / 2 cells. */
typedef struct kernel_bounds_lanes {
    /* exact[n]: polynomial coefficients (kernel_map.h) of x, y and z (n = 0, 1, 2) and of the field (n = 3);
     * apart[a][i]: coordinate a of vertex i minus that of vertex 0 */
    kernel_f64 exact[4][8], apart[3][8];
    /* nonlinear_part: coefficients 4 to 7 of the map's nonlinear part N; inverse: inverse of the Jacobian at the
     * centre; reach: largest |X|, |Y| and |Z| of the vertices in tile space */
    kernel_f64 nonlinear_part[3][4], inverse[3][3], reach[3];
    kernel_f64_mask is_solid;     /* cells whose Jacobian at the centre has an inverse */
    kernel_f64 gradient[3], e[8]; /* gradient of the linear function L, and the coefficients of E = F - L */
    /* Derivatives along the reference coordinates at the domain's corners: of the map's nonlinear part N minus those at
     * the centre (bend), of the field (df) and of E (de). Derivatives that are equal at several corners are stored
     * once. The indices are the component of N (for bend only), the axis, and the index in the list of different
     * derivatives (kernel_domain). */
    kernel_f64 bend[3][3][4], df[3][4], de[3][4];
    /* upper bounds over the cell of derivatives along the reference coordinates. slope: of |grad F|; theta: of the norm
     * of J0^-1 J - I; slant: of |grad E|; most_along: of |grad E . w|; most_turn: of |N' w|, where w = J0^-1 d is the
     * direction of the middle ray */
    kernel_f64 slope, theta, slant, most_along, most_turn;
    kernel_f64 across; /* upper bound of the rounding error of positions, across the rays */
    /* gap: upper bound, in reference coordinates, of the distance between a ray and its computed crossing of a face;
     * length: upper bound of |J0^-1 d| over the directions d of the tile's rays; rise: lower bound of |grad L . d| */
    kernel_f64 gap, length, rise;
    kernel_f64_mask is_regular; /* cells with is_solid whose theta is below 0.9 */
} kernel_bounds_lanes;

/* KERNEL_LOW and KERNEL_HIGH are the ends of the interval [0, 1] of a reference coordinate, extended by
 * KERNEL_DOMAIN_RIM to both sides for points that rounding moves out of the cell. KERNEL_WIDE is the upper end of r and
 * s in a wedge, which is extended twice as far because the third side of the triangle is oblique. For a pyramid the
 * coordinates are a / k, b / k and k (kernel_map.h). */
#define KERNEL_DOMAIN_RIM 0.03125
#define KERNEL_LOW -KERNEL_DOMAIN_RIM
#define KERNEL_HIGH (1 + KERNEL_DOMAIN_RIM)
#define KERNEL_WIDE (1 + 2 * KERNEL_DOMAIN_RIM)

static const double kernel_box_corners[8][3] = {
    {KERNEL_LOW, KERNEL_LOW, KERNEL_LOW},   {KERNEL_HIGH, KERNEL_LOW, KERNEL_LOW},
    {KERNEL_LOW, KERNEL_HIGH, KERNEL_LOW},  {KERNEL_HIGH, KERNEL_HIGH, KERNEL_LOW},
    {KERNEL_LOW, KERNEL_LOW, KERNEL_HIGH},  {KERNEL_HIGH, KERNEL_LOW, KERNEL_HIGH},
    {KERNEL_LOW, KERNEL_HIGH, KERNEL_HIGH}, {KERNEL_HIGH, KERNEL_HIGH, KERNEL_HIGH}};

static const double kernel_wedge_corners[6][3] = {
    {KERNEL_LOW, KERNEL_LOW, KERNEL_LOW},   {KERNEL_WIDE, KERNEL_LOW, KERNEL_LOW},
    {KERNEL_LOW, KERNEL_WIDE, KERNEL_LOW},  {KERNEL_LOW, KERNEL_LOW, KERNEL_HIGH},
    {KERNEL_WIDE, KERNEL_LOW, KERNEL_HIGH}, {KERNEL_LOW, KERNEL_WIDE, KERNEL_HIGH}};

/* The extended reference domain of a cell type: its middle and its corners. Derivatives of a polynomial along axis a
 * are equal at some corners. slope_count[a]: number of different derivatives along axis a; first[a][n]: index of the
 * corner at which the n-th of them is computed; at[a][c]: index n of the derivative that is valid at corner c. For a
 * hex a derivative depends on the two other coordinates. For a wedge it depends only on the last coordinate; along the
 * last axis it depends on the two others. For a pyramid it depends only on the coordinate along which it is taken. */
typedef struct kernel_domain {
    double centre[3];
    const double (*corners)[3];
    int corner_count, slope_count[3];
    signed char first[3][4], at[3][8];
} kernel_domain;

static const kernel_domain kernel_domains[3] = {
    {{0.5, 0.5, 0.5},
     kernel_box_corners,
     8,
     {4, 4, 4},
     {{0, 2, 4, 6}, {0, 4, 1, 5}, {0, 1, 2, 3}},
     {{0, 0, 1, 1, 2, 2, 3, 3}, {0, 2, 0, 2, 1, 3, 1, 3}, {0, 1, 2, 3, 0, 1, 2, 3}}},
    {{1.0 / 3, 1.0 / 3, 0.5},
     kernel_wedge_corners,
     6,
     {2, 2, 3},
     {{0, 3}, {0, 3}, {0, 1, 2}},
     {{0, 0, 0, 1, 1, 1}, {0, 0, 0, 1, 1, 1}, {0, 1, 2, 0, 1, 2}}},
    {{0.5, 0.5, 0.5},
     kernel_box_corners,
     8,
     {2, 2, 2},
     {{0, 1}, {0, 2}, {0, 4}},
     {{0, 1, 0, 1, 0, 1, 0, 1}, {0, 0, 1, 1, 0, 0, 1, 1}, {0, 0, 0, 0, 1, 1, 1, 1}}},
};

SIMD_INLINE const kernel_domain *kernel_domain_of(int type)
{
    return &kernel_domains[kernel_shape_number(type)];
}

SIMD_INLINE kernel_f64 kernel_f64_set(double x)
{
    return (kernel_f64){0} + x;
}

/* Returns v rounded to float32 and converted to double again. */
SIMD_INLINE kernel_f64 kernel_f64_rounded(kernel_f64 v)
{
    return kernel_f64_widen(kernel_f64_narrow(v));
}

SIMD_INLINE kernel_f64 kernel_f64_select_larger(kernel_f64 v, kernel_f64 most)
{
    return kernel_f64_select((kernel_f64_mask)(v > most), v, most);
}

/* Returns the derivative along reference coordinate a, at the reference coordinates r, of a polynomial with
 * coefficients c (kernel_map.h). */
SIMD_INLINE kernel_f64 kernel_f64_evaluate_derivative(int type, const kernel_f64 c[8], int a, const double r[3])
{
    if (kernel_has_apex(type)) return c[1 + a] + c[4] * (a == 2 ? -r[2] : r[a]);
    kernel_f64 out = c[1 + a];
    for (int j = kernel_is_box(type) ? 0 : 1; j < 3; j++)
        if (a != 2 - j) out += c[4 + j] * r[3 - a - (2 - j)];
    return kernel_is_box(type) ? out + c[7] * (r[(a + 1) % 3] * r[(a + 2) % 3]) : out;
}

/* Returns the derivative along reference coordinate a at the reference coordinates r, minus that at the domain's
 * centre, of a polynomial whose coefficients 4 to 7 are nonlinear_part. */
SIMD_INLINE kernel_f64 kernel_f64_derivative_minus_centre(int type, const kernel_f64 nonlinear_part[4], int a,
                                                          const double r[3])
{
    const double *centre = kernel_domain_of(type)->centre;
    const int next = (a + 1) % 3, last = (a + 2) % 3;
    kernel_f64 out = {0};
    if (kernel_has_apex(type)) return nonlinear_part[0] * (a == 2 ? centre[2] - r[2] : r[a] - centre[a]);
    for (int j = kernel_is_box(type) ? 0 : 1; j < 3; j++)
        if (a != 2 - j) out += nonlinear_part[j] * (r[3 - a - (2 - j)] - centre[3 - a - (2 - j)]);
    return kernel_is_box(type) ? out + nonlinear_part[3] * (r[next] * r[last] - centre[next] * centre[last]) : out;
}

/* Computes the polynomial coefficients of the map and of the field from the vertices' positions and values. */
SIMD_INLINE void kernel_bounds_fit_polynomials(kernel_bounds_lanes *b, int type, const float at[4][8][SIMD_WIDTH],
                                               int half)
{
    const int count = grid_type_vertex_count(type);
    for (int n = 0; n < 4; n++) {
        kernel_f64 d[8];
        vf v[8];
        for (int i = 0; i < count; i++) {
            v[i] = vf_load(at[n][i]);
            d[i] = kernel_f64_widen_half(&v[i], half);
        }
        if (n < 3) {
            b->reach[n] = kernel_f64_abs(d[0]);
            for (int i = 1; i < count; i++) b->reach[n] = kernel_f64_select_larger(kernel_f64_abs(d[i]), b->reach[n]);
            for (int i = count - 1; i >= 0; i--) d[i] -= d[0];
            for (int i = 0; i < count; i++) b->apart[n][i] = d[i];
        }
        kernel_f64_fit(type, b->exact[n], d);
    }
}

/* Multiplies the map's nonlinear coefficients by the inverse of its Jacobian at the centre. The result is the
 * coefficients of the map's nonlinear part N in reference coordinates (kernel_roots.h). */
SIMD_INLINE void kernel_bounds_compute_nonlinear_map(kernel_bounds_lanes *b, int type)
{
    const double *centre = kernel_domain_of(type)->centre;
    const kernel_f64 zero = {0};
    kernel_f64 m[3][3], cofactor[3][3], position[3][8];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 8; j++) position[i][j] = kernel_f64_rounded(b->exact[i][j]);
        for (int a = 0; a < 3; a++) m[i][a] = kernel_f64_evaluate_derivative(type, position[i], a, centre);
    }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            cofactor[i][k] = m[i1][k1] * m[i2][k2] - m[i1][k2] * m[i2][k1];
        }
    const kernel_f64 det = m[0][0] * cofactor[0][0] + m[0][1] * cofactor[0][1] + m[0][2] * cofactor[0][2];
    const kernel_f64_mask some = (kernel_f64_mask)(det != 0);
    const kernel_f64 over = kernel_f64_select(some, 1 / kernel_f64_select(some, det, zero + 1), zero);
    b->is_solid = some & (kernel_f64_mask)(kernel_f64_abs(over) < kernel_f64_set((double)INFINITY));
    for (int i = 0; i < 3; i++) {
        kernel_f64 inverse[3];
        for (int a = 0; a < 3; a++) {
            inverse[a] = cofactor[a][i] * over;
            b->inverse[i][a] = kernel_f64_select(b->is_solid, kernel_f64_rounded(inverse[a]), zero);
        }
        for (int j = 0; j < 4; j++) {
            b->nonlinear_part[i][j] = zero;
            for (int a = 0; a < 3; a++)
                b->nonlinear_part[i][j] += kernel_f64_select(b->is_solid, inverse[a] * position[a][4 + j], zero);
        }
    }
}

/* Computes the gradient, rounded to float32, of the linear function L that approximates the field, and the coefficients
 * of the difference E = field - L. Returns a bound of the sum of the magnitudes of L's terms at positions in the cell;
 * the rounding error of L is proportional to this sum. */
SIMD_INLINE kernel_f64 kernel_bounds_fit_linear_function(kernel_bounds_lanes *b, int type)
{
    const double *centre = kernel_domain_of(type)->centre;
    kernel_f64 df[3], size = {0};
    for (int a = 0; a < 3; a++) df[a] = kernel_f64_evaluate_derivative(type, b->exact[3], a, centre);
    for (int i = 0; i < 3; i++) {
        kernel_f64 g = {0};
        for (int a = 0; a < 3; a++) g += df[a] * b->inverse[a][i];
        b->gradient[i] = kernel_f64_rounded(g);
        size += kernel_f64_abs(g) * b->reach[i];
    }
    for (int j = 0; j < 8; j++) {
        b->e[j] = b->exact[3][j];
        for (int i = 0; i < 3; i++) b->e[j] -= b->gradient[i] * b->exact[i][j];
    }
    return size;
}

/* Returns the maximum of |E| over the corners of the reference domain, where E is the field minus its linear
 * approximation. e: the polynomial coefficients of E. */
SIMD_INLINE kernel_f64 kernel_f64_largest_error(int type, const kernel_f64 e[8])
{
    const kernel_domain *table = kernel_domain_of(type);
    kernel_f64 most = {0};
    for (int n = 0; n < table->corner_count; n++) {
        const double *corner = table->corners[n], k = kernel_has_apex(type) ? corner[2] : 1;
        const double r[3] = {corner[0] * k, corner[1] * k, corner[2]}, m = r[0] * r[1] / k;
        kernel_f64 at = (e[0] + r[0] * e[1]) + (r[1] * e[2] + r[2] * e[3]);
        if (!kernel_is_prism(type)) at += m * e[4];
        if (kernel_is_prism(type)) at += r[2] * (r[0] * e[5] + r[1] * e[6]);
        if (kernel_is_box(type)) at += r[2] * ((r[0] * e[5] + r[1] * e[6]) + m * e[7]);
        most = n ? kernel_f64_select_larger(at * at, most) : at * at;
    }
    return kernel_f64_sqrt(most);
}

/* Computes, at all corners, the gradients of the field and of E = field - L, and the difference between the derivative
 * of the map's nonlinear part N and that at the centre. */
SIMD_INLINE void kernel_bounds_compute_corner_derivatives(kernel_bounds_lanes *b, int type)
{
    const kernel_domain *table = kernel_domain_of(type);
    kernel_f64 field[8];
    for (int j = 0; j < 8; j++) field[j] = kernel_f64_rounded(b->exact[3][j]);
    for (int a = 0; a < 3; a++)
        for (int n = 0; n < table->slope_count[a]; n++) {
            const double *r = table->corners[(int)table->first[a][n]];
            b->df[a][n] = kernel_f64_evaluate_derivative(type, field, a, r);
            b->de[a][n] = kernel_f64_evaluate_derivative(type, b->e, a, r);
            for (int i = 0; i < 3; i++)
                b->bend[i][a][n] = kernel_f64_derivative_minus_centre(type, b->nonlinear_part[i], a, r);
        }
}

SIMD_INLINE kernel_f64 kernel_f64_squared_length(const kernel_f64 v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/* Returns the sum of the 8th powers of the singular values of m. Let |m| be the matrix norm, the largest singular
 * value. The sum is at least |m|^8 and at most 1.15^8 |m|^8. Its 8th root is a norm, too, so that the maximum of the
 * sum over the corners is an upper bound of |m|^8 in the whole domain. */
SIMD_INLINE kernel_f64 kernel_f64_eighth_power_norm(const kernel_f64 m[3][3])
{
    kernel_f64 square[3][3], fourth[3][3], sum = {0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++)
            square[i][k] = square[k][i] = m[0][i] * m[0][k] + m[1][i] * m[1][k] + m[2][i] * m[2][k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k <= i; k++)
            fourth[i][k] = fourth[k][i] =
                square[i][0] * square[k][0] + square[i][1] * square[k][1] + square[i][2] * square[k][2];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) sum += fourth[i][k] * fourth[i][k];
    return sum;
}

/* Computes the members theta, slope, most_along, slant and most_turn, which are maxima over the corners of the domain.
 * w: direction of the tile's middle ray in reference coordinates, J0^-1 (0, 0, 1). */
SIMD_INLINE void kernel_bounds_maximize_over_corners(kernel_bounds_lanes *b, int type, const kernel_f64 w[3])
{
    const kernel_domain *table = kernel_domain_of(type);
    const kernel_f64 zero = {0};
    /* these variables hold squares of the maxima; only theta holds an upper bound of the 8th power */
    kernel_f64 theta = zero, slope = zero, most_along = zero, slant = zero, most_turn = zero;
    for (int n = 0; n < table->corner_count; n++) {
        kernel_f64 bend[3][3], df[3], de[3], along = zero, steep = zero, turn = zero;
        for (int a = 0; a < 3; a++) {
            const int at = table->at[a][n];
            df[a] = b->df[a][at];
            de[a] = b->de[a][at];
            for (int i = 0; i < 3; i++) bend[i][a] = b->bend[i][a][at];
        }
        for (int i = 0; i < 3; i++) {
            const kernel_f64 term = bend[i][0] * w[0] + bend[i][1] * w[1] + bend[i][2] * w[2];
            along += de[i] * w[i];
            steep += de[i] * de[i];
            turn += term * term;
        }
        const kernel_f64 eighth = kernel_f64_eighth_power_norm((const kernel_f64(*)[3])bend),
                         square = kernel_f64_squared_length(df);
        theta = n ? kernel_f64_select_larger(eighth, theta) : eighth;
        slope = n ? kernel_f64_select_larger(square, slope) : square;
        most_along = n ? kernel_f64_select_larger(along * along, most_along) : along * along;
        slant = n ? kernel_f64_select_larger(steep, slant) : steep;
        most_turn = n ? kernel_f64_select_larger(turn, most_turn) : turn;
    }
    b->theta = kernel_f64_sqrt(kernel_f64_sqrt(kernel_f64_sqrt(theta)));
    b->slope = kernel_f64_rounded(kernel_f64_sqrt(slope));
    b->most_along = kernel_f64_sqrt(most_along);
    b->slant = kernel_f64_sqrt(slant);
    b->most_turn = kernel_f64_sqrt(most_turn);
}

/* Computes two planes between which all vertices lie, and stores them in row i of out->normal, low and high. Row i of
 * the inverse Jacobian at the centre is the normal of both planes. The planes are moved outward by `pad`, an upper
 * bound of the error of a ray's positions in reference coordinates. */
SIMD_INLINE void kernel_bounds_store_enclosing_planes(const kernel_bounds_lanes *b, int type, int i, kernel_f64 pad,
                                                      int half, kernel_bounds *out)
{
    kernel_f64 low = {0}, high = {0};
    for (int n = 1; n < grid_type_vertex_count(type); n++) {
        const kernel_f64 at =
            b->inverse[i][0] * b->apart[0][n] + b->inverse[i][1] * b->apart[1][n] + b->inverse[i][2] * b->apart[2][n];
        low = -kernel_f64_select_larger(-at, -low);
        high = kernel_f64_select_larger(at, high);
    }
    for (int a = 0; a < 3; a++) kernel_f64_store_half(out->normal[i][a], half, b->inverse[i][a]);
    kernel_f64_store_half(out->low[i], half, low - pad);
    kernel_f64_store_half(out->high[i], half, high + pad);
}

/* Converts the coefficients of a polynomial's nonlinear terms (products of two coordinates, for a hex also of all
 * three) to coordinates that are counted from the domain's middle. */
SIMD_INLINE void kernel_f64_shift_terms_to_middle(int type, const kernel_f64 nonlinear_part[4], kernel_f64 out[4])
{
    const int first = kernel_is_prism(type) ? 1 : 0;
    for (int j = 0; j < 4; j++) out[j] = (kernel_f64){0};
    for (int j = 0; j < kernel_nonlinear_count(type); j++) out[j] = nonlinear_part[first + j];
    if (kernel_has_triangles(type)) return;
    for (int j = 0; j < 3; j++) out[j] += 0.5 * nonlinear_part[3];
}

/* Computes error_growth = K / (1 - K), where K is the contraction constant of the iteration of kernel_contraction.h,
 * and the bounds of the rounding errors of reference coordinates r. Let u = 6e-8, let e be the largest distance of a
 * vertex from vertex 0 along an axis, and let `wide` be the maximum of |x| and |y| over rays and vertices. y and w (the
 * ray's point and direction in reference coordinates), L and E (which sum to the field) are those of
 * kernel_contraction.h. Three errors of r add up to error_bound:
 *
 * y and w have errors of about 4 u |inverse| times `wide` across the ray, and times e along each axis. The rounding of
 * the inverse itself is included. For the first of these two errors the code uses an eighth of the 2e-6 that
 * kernel_f64_compute_bounds() uses for the positions of faces, for the second 3e-7 e.
 *
 * L and E have errors of 4 u times 2, the bound of values (domain_margin has a factor 2 for this), and of 4 u times the
 * gradient, times `wide` across and e along the ray. The rounding of the gradient itself adds as much again: 5e-7 in
 * all. Divided by the field's derivative along the ray, and multiplied by |w|, this is an error of r.
 *
 * The iteration adds a few units in the last place of r. Near a pyramid's apex k is at least 1e-6. The code uses 1e-6
 * for this error.
 *
 * domain_margin is an upper bound of the distance by which rounding errors move a root, compared with the root that is
 * found between the computed crossings of faces. These crossings lie within `gap` of the ray, and the values there
 * differ from the field by at most KERNEL_FACE_BAND. Each error moves the root by at most itself / (1 - K).
 * domain_margin is twice the sum of all these. */
SIMD_INLINE void kernel_bounds_store_iteration_errors(const kernel_bounds_lanes *b, int type, int half,
                                                      kernel_bounds *out)
{
    const kernel_f64 zero = {0}, one = zero + 1, speed = b->length / b->rise, wide = b->across * 5e5;
    const kernel_f64 rate = b->theta + b->slant * speed * 1.0001, rest = one - rate;
    kernel_f64 extent[3], own = zero,
                          value = one + (kernel_f64_abs(b->gradient[0]) + kernel_f64_abs(b->gradient[1])) * wide;
    for (int a = 0; a < 3; a++) {
        extent[a] = kernel_f64_abs(b->apart[a][1]);
        for (int n = 2; n < grid_type_vertex_count(type); n++)
            extent[a] = kernel_f64_select_larger(kernel_f64_abs(b->apart[a][n]), extent[a]);
    }
    for (int i = 0; i < 3; i++) {
        kernel_f64 term = 0.125 * b->across * (kernel_f64_abs(b->inverse[i][0]) + kernel_f64_abs(b->inverse[i][1]));
        for (int a = 0; a < 3; a++) term += 3e-7 * kernel_f64_abs(b->inverse[i][a]) * extent[a];
        own += term * term;
    }
    value += kernel_f64_abs(b->gradient[2]) * extent[2];
    const kernel_f64 face = b->gap + speed * (b->slope * b->gap + 1e-6);
    const kernel_f64 error_bound = kernel_f64_sqrt(own) + speed * value * 5e-7 + 1e-6;
    const kernel_f64 domain_margin = 2 * ((face + error_bound) / rest) + 4e-6;
    const kernel_f64_mask contracts = b->is_regular & (kernel_f64_mask)(b->rise > 0) & (kernel_f64_mask)(rate < 0.9) &
                                      (kernel_f64_mask)(domain_margin < 0.015625);
    kernel_f64_store_half(out->error_growth, half,
                          kernel_f64_select(contracts, 1.0001 * rate / rest, kernel_f64_set((double)INFINITY)));
    kernel_f64_store_half(out->error_bound, half, error_bound);
    kernel_f64_store_half(out->domain_margin, half, domain_margin);
}

SIMD_INLINE void kernel_f64_store_contraction_of_type(const kernel_bounds_lanes *b, int half, kernel_bounds *out,
                                                      int type)
{
    const double *centre = kernel_domain_of(type)->centre;
    kernel_f64 middle[4], terms[4];
    for (int n = 0; n < 4; n++) {
        const kernel_f64 *c = n < 3 ? b->exact[n] : b->e;
        middle[n] = c[0];
        if (kernel_has_apex(type)) continue;
        middle[n] += (centre[0] * c[1] + centre[1] * c[2]) + centre[2] * c[3];
        if (kernel_is_box(type)) middle[n] += 0.25 * ((c[4] + c[5]) + c[6]) + 0.125 * c[7];
        if (kernel_is_prism(type)) middle[n] += (1.0 / 6) * (c[5] + c[6]);
    }
    for (int i = 0; i < 3; i++) {
        const kernel_f64 offset =
            -(b->inverse[i][0] * middle[0] + b->inverse[i][1] * middle[1] + b->inverse[i][2] * middle[2]);
        kernel_f64_store_half(out->offset[i], half, offset);
        kernel_f64_shift_terms_to_middle(type, b->nonlinear_part[i], terms);
        for (int j = 0; j < kernel_nonlinear_count(type); j++) kernel_f64_store_half(out->terms[j][i], half, terms[j]);
    }
    kernel_f64_store_half(out->middle, half, middle[3]);
    kernel_f64_shift_terms_to_middle(type, b->e + 4, terms);
    for (int j = 0; j < kernel_nonlinear_count(type); j++) kernel_f64_store_half(out->field_terms[j], half, terms[j]);
    kernel_bounds_store_iteration_errors(b, type, half, out);
}

/* Returns an upper bound, over the extended reference domain, of the squared Frobenius norm of a polynomial's Hessian.
 * c: the polynomial's coefficients 4 to 7. For a pyramid the bound is one of this square times k^2: for a b / k, with a
 * / k and b / k in [-1/32, 33/32], the second derivatives are at most 1, 33/32, 33/32 and 2.13 over k, so their norm is
 * 3.29 / k. */
SIMD_INLINE kernel_f64 kernel_f64_bound_squared_hessian(int type, const kernel_f64 c[4])
{
    kernel_f64 sum = {0};
    if (kernel_has_apex(type)) return c[0] * c[0] * (3.29 * 3.29);
    for (int j = 0; j < 3; j++) {
        const kernel_f64 largest = kernel_f64_select_larger(kernel_f64_abs(c[j] - KERNEL_DOMAIN_RIM * c[3]),
                                                            kernel_f64_abs(c[j] + (1 + 2 * KERNEL_DOMAIN_RIM) * c[3]));
        sum += 2 * largest * largest;
    }
    return sum;
}

/* Stores the coefficients and bounds of the map and the field that the search for roots needs (kernel_roots.h). */
SIMD_INLINE void kernel_f64_store_search_bounds(const kernel_bounds_lanes *b, int type, kernel_f64 stretch, int half,
                                                kernel_bounds *out)
{
    kernel_f64 twist = {0}, field[4];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 4; j++) kernel_f64_store_half(out->nonlinear_part[i][j], half, b->nonlinear_part[i][j]);
        twist += kernel_f64_bound_squared_hessian(type, b->nonlinear_part[i]);
    }
    for (int j = 0; j < 4; j++) field[j] = kernel_f64_rounded(b->exact[3][4 + j]);
    kernel_f64_store_half(out->stretch, half, stretch);
    kernel_f64_store_half(out->slope, half, b->slope);
    kernel_f64_store_half(out->field_curvature, half, kernel_f64_sqrt(kernel_f64_bound_squared_hessian(type, field)));
    kernel_f64_store_half(out->map_curvature, half, kernel_f64_sqrt(twist));
}

static __attribute__((noinline)) void kernel_f64_store_contraction(const kernel_bounds_lanes *b, int half,
                                                                   kernel_bounds *out, int type)
{
    KERNEL_OF_TYPE(type, kernel_f64_store_contraction_of_type, b, half, out);
}

/* Computes all members of *out for half of the lanes. beam: bounds of the rays, whose directions are near (0, 0, 1);
 * at: x, y, z in tile space and values, by vertex and lane. The bounds state how far the field differs from the linear
 * function L, and how fast L rises along the rays. The bound `jump` states how much the value at a computed crossing of
 * a face can differ from the field on the ray, because the crossing lies beside the ray by the rounding of positions.
 *
 * To prove that F is monotone along the rays: with M = J0^-1 J - I, whose norm is at most theta, and w = J0^-1 d, E
 * changes the derivative of L by grad E . (I + M)^-1 w = grad E . (w - M w + M M (I + M)^-1 w). Each of the three terms
 * is bounded separately, by its maximum at the corners for the middle ray and by how far another ray's w may differ. */
SIMD_INLINE void kernel_f64_compute_bounds(const float at[4][8][SIMD_WIDTH], int half, const kernel_beam *beam,
                                           kernel_bounds *out, int type)
{
    const kernel_f64 zero = {0}, one = zero + 1, spread = zero + (double)beam->spread;
    kernel_bounds_lanes b;
    kernel_f64 w[3], length = zero, off = zero, gap = zero;
    kernel_bounds_fit_polynomials(&b, type, at, half);
    kernel_bounds_compute_nonlinear_map(&b, type);
    const kernel_f64 size = kernel_bounds_fit_linear_function(&b, type), *const g = b.gradient;
    kernel_bounds_compute_corner_derivatives(&b, type);
    b.across = 2e-6 * (b.reach[0] + b.reach[1] + (double)beam->offset + (double)beam->spread * b.reach[2]);
    for (int i = 0; i < 3; i++) {
        const kernel_f64 side = kernel_f64_abs(b.inverse[i][0]) + kernel_f64_abs(b.inverse[i][1]);
        const kernel_f64 term = spread * side;
        const kernel_f64 error_bound = b.across * side + 1e-6 * b.reach[2] * kernel_f64_abs(b.inverse[i][2]);
        w[i] = b.inverse[i][2];
        length += w[i] * w[i];
        off += term * term;
        gap += error_bound * error_bound;
        kernel_bounds_store_enclosing_planes(&b, type, i, error_bound + 1e-5, half, out);
    }
    kernel_bounds_maximize_over_corners(&b, type, w);
    const kernel_f64_mask bends_little = (kernel_f64_mask)(b.theta < 0.9);
    const kernel_f64 stretch =
        kernel_f64_select(bends_little, kernel_f64_rounded(1 / (1 - b.theta)), kernel_f64_set(10));
    b.is_regular = b.is_solid & bends_little;
    kernel_f64_store_search_bounds(&b, type, stretch, half, out);
    off = kernel_f64_sqrt(off);
    b.length = kernel_f64_sqrt(length) + off;
    b.gap = kernel_f64_sqrt(gap);
    const kernel_f64 whole = b.slant * stretch * b.length;
    const kernel_f64 apart =
        b.most_along + b.slant * (b.most_turn + b.theta * b.theta * stretch * b.length + (one + b.theta) * off);
    b.rise = kernel_f64_abs(g[2]) - spread * (kernel_f64_abs(g[0]) + kernel_f64_abs(g[1]));
    const kernel_f64 least = kernel_f64_select((kernel_f64_mask)(whole < apart), whole, apart);
    const kernel_f64_mask rises = b.is_regular & (kernel_f64_mask)(b.rise * 0.9999 > least);
    const kernel_f64_floats jump = kernel_f64_narrow(b.slope * stretch * b.gap) + KERNEL_FACE_BAND;
    kernel_f64_store_half(out->jump, half, kernel_f64_select(rises, kernel_f64_widen(jump), -one));
    const kernel_f64 level = kernel_f64_rounded(b.e[0]), endless = kernel_f64_set((double)INFINITY);
    b.e[0] -= level;
    const kernel_f64 thickness = kernel_f64_largest_error(type, b.e) + 1e-5 + 16 * 6e-8 * size;
    kernel_f64_store_half(out->level, half, level);
    for (int a = 0; a < 3; a++) kernel_f64_store_half(out->gradient[a], half, g[a]);
    kernel_f64_store_half(out->thickness, half, kernel_f64_select(b.is_regular, thickness, endless));
    kernel_f64_store_contraction(&b, half, out, type);
}

/* Computes the bounds for one cell of this type per lane, from vertex positions in tile space and vertex values
 * (`at`). */
static __attribute__((noinline)) void kernel_compute_bounds_of_cells(int type, const float at[4][8][SIMD_WIDTH],
                                                                     const kernel_beam *beam, kernel_bounds *out)
{
    for (int half = 0; half < 2; half++) KERNEL_OF_TYPE(type, kernel_f64_compute_bounds, at, half, beam, out);
}

/* Hexes, wedges or pyramids of one type, one per lane, in the form that the search for crossings of the isovalue reads
 * (kernel_roots.h). */
typedef struct kernel_curved {
    int type;
    int lane; /* the lane that holds the cell, if all rays of a packet are traced in one cell */
    /* at[n][vertex][lane]: x, y, z in tile space (n = 0, 1, 2), and the field minus the isovalue, scaled (n = 3) */
    float (*at)[8][SIMD_WIDTH];
    float (*colours)[SIMD_WIDTH]; /* colour field by vertex and lane (kernel_cell.g), set if the layer has one */
    kernel_bounds *bounds;
    /* set if kernel_contraction.h has been tried for these rays already, and could not decide whether they meet the
     * isosurface */
    bool is_contracted;
} kernel_curved;

/* Returns upper bounds of the slopes and origins of the tile's rays in tile space. */
SIMD_INLINE kernel_beam kernel_bound_rays_of_tile(const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const float shift = fabsf((float)f->depth_shift), radius = tile->radius;
    return (kernel_beam){.spread = flat ? 0 : radius, .offset = flat ? radius : radius * shift};
}

/* Computes the bounds of a single cell. All lanes of *out get the data of this cell. */
static __attribute__((noinline, unused)) void kernel_curved_single_bounds(const kernel_cell *c, const kernel_beam *beam,
                                                                          kernel_curved *out)
{
    const float *const numbers[4] = {c->x, c->y, c->z, c->f};
    for (int n = 0; n < 4; n++) kernel_broadcast_vertex_numbers(numbers[n], c->count, out->at[n]);
    kernel_broadcast_vertex_numbers(c->g, c->count, out->colours);
    kernel_compute_bounds_of_cells(c->type, (const float(*)[8][SIMD_WIDTH])out->at, beam, out->bounds);
    out->type = c->type;
    out->lane = 0;
}

#endif
