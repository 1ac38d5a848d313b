/* Compares the integral of a segment with a reference of high precision, for random transfer functions, values and
 * lengths. The reference splits the segment at every control point of the function in long double, computes the optical
 * depth in closed form (the integral of -ln u is u - u ln u) and the colour by adaptive Simpson quadrature. */
#include "integral_double.h"
#include "test_meshes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

/* Number of random cases in float for each range of opacities. */
static int floats = 300;

enum { MAX_POINTS = 9, MAX_COLOURS = 40, MAX_CUTS = MAX_POINTS + MAX_COLOURS + 2 };

typedef struct random_transfer {
    render_transfer transfer;
    double values[MAX_POINTS];
    float opacities[MAX_POINTS], colours[3 * MAX_COLOURS];
} random_transfer;

/* A part of a segment between two control points of the transfer function. Opacity and colour are linear in s in [0,
 * 1]. */
typedef struct piece {
    long double a0, a1, c0[3], c1[3], length;
} piece;

/* Returns a random multiple of 1/1024, which is exact in float, so that the float and the double build use the same
 * function. */
static double draw_coarse_number(uint64_t index, uint64_t seed)
{
    return floor(1024 * test_uniform(index, seed)) / 1024;
}

static void make_transfer(random_transfer *r, uint64_t seed, double most)
{
    render_transfer *t = &r->transfer;
    *t = (render_transfer){.low = 0, .high = 1, .unit_distance = 1};
    t->colour_count = 2 + (int)(test_uniform(0, seed) * (MAX_COLOURS - 2));
    /* The colour table has 2^n + 1 entries, whose positions are exact in float. */
    t->colour_count = t->colour_count > 33 ? 33 : t->colour_count > 17 ? 17 : t->colour_count > 5 ? 5 : 2;
    for (int i = 0; i < 3 * t->colour_count; i++) r->colours[i] = (float)draw_coarse_number(10 + (uint64_t)i, seed);
    t->opacity_count = 1 + (int)(test_uniform(1, seed) * (MAX_POINTS - 1));
    double at = -0.25;
    for (int i = 0; i < t->opacity_count; i++) {
        const double gap = test_uniform(200 + (uint64_t)i, seed) < 0.2
                               ? 0
                               : 0.0625 + 0.25 * draw_coarse_number(300 + (uint64_t)i, seed);
        r->values[i] = at += gap;
        const bool is_clear = test_uniform(400 + (uint64_t)i, seed) < 0.2;
        r->opacities[i] = is_clear ? 0 : (float)(most * draw_coarse_number(500 + (uint64_t)i, seed));
    }
    t->colours = r->colours;
    t->opacity_values = r->values;
    t->opacities = r->opacities;
}

/* ---- the reference ---- */

static long double evaluate_opacity_near(const render_transfer *t, long double middle, long double x)
{
    int i = 0;
    while (i < t->opacity_count && (long double)t->opacity_values[i] <= middle) i++;
    if (i == 0) return (long double)t->opacities[0];
    if (i == t->opacity_count) return (long double)t->opacities[i - 1];
    const long double low = (long double)t->opacity_values[i - 1], high = (long double)t->opacity_values[i];
    const long double a = (long double)t->opacities[i - 1], b = (long double)t->opacities[i];
    return a + (x - low) / (high - low) * (b - a);
}

static long double evaluate_colour(const render_transfer *t, long double x, int c)
{
    const int last = t->colour_count - 1;
    const long double place = fminl(fmaxl(x, 0), 1) * last;
    const int i = place >= last ? last - 1 : (int)place;
    const long double low = (long double)t->colours[3 * i + c], high = (long double)t->colours[3 * i + 3 + c];
    return low + (place - i) * (high - low);
}

/* Returns the optical depth of a part from 0 to s. */
static long double compute_optical_depth(const piece *p, long double s)
{
    const long double u0 = 1 - p->a0, u1 = u0 - s * (p->a1 - p->a0), change = u0 - u1;
    if (fabsl(change) < 1e-4L * u0) {
        /* Gauss quadrature with three nodes: the error is of sixth order in `change`. */
        const long double r = sqrtl(0.15L), m = 0.5L;
        return -p->length * s *
               (5 * logl(u0 - (m - r) * change) + 8 * logl(u0 - m * change) + 5 * logl(u0 - (m + r) * change)) / 18;
    }
    const long double g0 = u0 > 0 ? u0 - u0 * logl(u0) : 0, g1 = u1 > 0 ? u1 - u1 * logl(u1) : 0;
    return p->length * s * (g0 - g1) / change;
}

static long double compute_emission(const piece *p, int c, long double s)
{
    const long double a = p->a0 + s * (p->a1 - p->a0);
    if (a >= 1) return 0;
    return (p->c0[c] + s * (p->c1[c] - p->c0[c])) * -log1pl(-a) * p->length * expl(-compute_optical_depth(p, s));
}

static long double integrate_by_simpson(const piece *p, int c, long double from, long double to, const long double f[3],
                                        long double tolerance, int depth)
{
    const long double width = to - from, middle = 0.5L * (from + to);
    const long double q1 = compute_emission(p, c, from + 0.25L * width),
                      q3 = compute_emission(p, c, from + 0.75L * width);
    const long double whole = width / 6 * (f[0] + 4 * f[1] + f[2]);
    const long double halves = width / 12 * (f[0] + 4 * q1 + 2 * f[1] + 4 * q3 + f[2]);
    if ((depth > 5 && fabsl(whole - halves) < 15 * tolerance) || depth > 40) return halves + (halves - whole) / 15;
    const long double left[3] = {f[0], q1, f[1]}, right[3] = {f[1], q3, f[2]};
    return integrate_by_simpson(p, c, from, middle, left, tolerance / 2, depth + 1) +
           integrate_by_simpson(p, c, middle, to, right, tolerance / 2, depth + 1);
}

static int collect_cuts(const render_transfer *t, long double v0, long double v1, long double cuts[MAX_CUTS])
{
    int count = 0;
    cuts[count++] = 0;
    cuts[count++] = 1;
    for (int i = 0; i < t->opacity_count + t->colour_count; i++) {
        const long double x = i < t->opacity_count ? (long double)t->opacity_values[i]
                                                   : (long double)(i - t->opacity_count) / (t->colour_count - 1);
        const long double s = v1 != v0 ? (x - v0) / (v1 - v0) : -1;
        if (!(s > 0 && s < 1)) continue;
        int at = count++;
        for (; cuts[at - 1] > s; at--) cuts[at] = cuts[at - 1];
        cuts[at] = s;
    }
    return count;
}

/* Computes colour (rgb), transmittance and optical depth into out. The tolerance is relative to the optical depth. */
static void integrate_exactly(const render_transfer *t, double length, double v_in, double v_out, long double tolerance,
                              long double out[5])
{
    const long double v0 = (long double)v_in, v1 = (long double)v_out;
    long double cuts[MAX_CUTS];
    const int count = collect_cuts(t, v0, v1, cuts);
    for (int i = 0; i < 5; i++) out[i] = 0;
    for (int i = 0; i + 1 < count; i++) {
        /* at a control point with infinite extinction the integrand is not defined */
        if (cuts[i] == cuts[i + 1]) continue;
        const long double x0 = v0 + cuts[i] * (v1 - v0), x1 = v0 + cuts[i + 1] * (v1 - v0), m = 0.5L * (x0 + x1);
        piece p = {.a0 = evaluate_opacity_near(t, m, x0), .a1 = evaluate_opacity_near(t, m, x1)};
        p.length = (long double)length * (cuts[i + 1] - cuts[i]);
        for (int c = 0; c < 3; c++) {
            p.c0[c] = evaluate_colour(t, x0, c);
            p.c1[c] = evaluate_colour(t, x1, c);
            const long double f[3] = {compute_emission(&p, c, 0), compute_emission(&p, c, 0.5L),
                                      compute_emission(&p, c, 1)};
            const long double depth = compute_optical_depth(&p, 1);
            if (depth > 0)
                out[c] += expl(-out[4]) * integrate_by_simpson(&p, c, 0, 1, f, tolerance * fminl(depth, 1), 0);
        }
        out[4] += compute_optical_depth(&p, 1);
    }
    out[3] = expl(-out[4]);
}

/* Computes how the light depends on the field's value x, in front of a background of colour b; s is the extinction and
 * c the colour. out: the derivatives (s (c - b))' for the three channels, s' for alpha, then s and |s'|. */
static void differentiate_by_brute_force(const render_transfer *t, long double x, long double b, long double out[6])
{
    const long double step = 1e-6L, a = evaluate_opacity_near(t, x, x), clear = 1 - a;
    const long double slope = (evaluate_opacity_near(t, x, x + step) - a) / step / clear, extinction = -log1pl(-a);
    for (int c = 0; c < 3; c++) {
        const long double place = fminl(fmaxl(x, 0), 1) * (t->colour_count - 1);
        const int i = (int)fminl(place, t->colour_count - 2);
        const long double rise = (long double)t->colours[3 * i + 3 + c] - (long double)t->colours[3 * i + c];
        const long double colour_slope = x > 0 && x < 1 ? rise * (t->colour_count - 1) : 0;
        out[c] = slope * (evaluate_colour(t, x, c) - b) + extinction * colour_slope;
    }
    out[3] = slope;
    out[4] = extinction;
    out[5] = fabsl(slope);
}

/* Computes the four numbers that kernel_look_up_light_error_bounds() bounds, by brute force from many values in the
 * range and several background colours. */
static void find_variation_by_brute_force(const render_transfer *t, double low, double high, double out[4])
{
    enum { VALUES = 300, BEHIND = 4 };
    double swing = 0, cost = 0;
    out[2] = out[3] = 0;
    for (int n = 0; n <= BEHIND; n++) {
        double least[4], most[4];
        for (int k = 0; k < 4; k++) least[k] = INFINITY, most[k] = -INFINITY;
        for (int i = 0; i <= VALUES; i++) {
            long double slopes[6];
            differentiate_by_brute_force(t, low + (high - low) * (long double)i / VALUES, (long double)n / BEHIND,
                                         slopes);
            for (int k = 0; k < 4; k++) {
                least[k] = fmin(least[k], (double)slopes[k]);
                most[k] = fmax(most[k], (double)slopes[k]);
            }
            out[2] = fmax(out[2], (double)slopes[4]);
            out[3] = fmax(out[3], (double)slopes[5]);
        }
        for (int k = 0; k < 4; k++) {
            swing = fmax(swing, most[k] - least[k]);
            cost = fmax(cost, fmax(-least[k], most[k]));
        }
    }
    out[0] = swing;
    out[1] = cost;
}

/* ---- tests ---- */

typedef void integral(const render_transfer *t, double length, double v_in, double v_out, double out[4]);

/* Compares an integral with the reference for `count` random cases. Returns the largest error, relative to the optical
 * depth if that is below 1. deepest and shallowest receive the largest and the smallest optical depth. */
static double find_largest_error(integral *of, int count, double most, double tolerance, double *deepest,
                                 double *shallowest)
{
    double worst = 0;
    *deepest = 0;
    *shallowest = 1;
    for (int n = 0; n < count; n++) {
        random_transfer r;
        const uint64_t seed = 1000 + (uint64_t)n;
        make_transfer(&r, seed, most);
        const double v_in = 1.5 * draw_coarse_number(1, seed + 7) - 0.25;
        const bool is_level = n % 11 == 0;
        const double interval = n % 3 == 0 ? 1 / 64.0 : 1.5,
                     v_out = is_level ? v_in : v_in + interval * (draw_coarse_number(2, seed + 7) - 0.5);
        const double length = ldexp(1, (int)(38 * test_uniform(3, seed)) - 28);
        long double truth[5];
        double found[4];
        integrate_exactly(&r.transfer, length, v_in, v_out, (long double)tolerance, truth);
        of(&r.transfer, length, v_in, v_out, found);
        const double depth = (double)truth[4], scale = fmin(1, depth);
        for (int c = 0; c < 4; c++) {
            const double off = fabs(found[c] - (double)truth[c]);
            assert_true(found[c] == found[c]);
            if (depth == 0) {
                assert_true(off == 0);
                continue;
            }
            /* A transmittance near 1 cannot be more accurate than its own rounding. */
            const double excess = c < 3 ? off / scale : off;
            if (excess > worst) worst = excess;
        }
        if (depth > 0) *deepest = fmax(*deepest, depth), *shallowest = fmin(*shallowest, depth);
    }
    return worst;
}

static void integral_is_exact_in_double(void **state)
{
    (void)state;
    double deep, shallow;
    const double worst = find_largest_error(integrate_in_double, 200, 0.999, 1e-15, &deep, &shallow);
    fprintf(stderr, "double: %.2g, depths %.2g to %.2g\n", worst, shallow, deep);
    assert_true(shallow < 1e-8 && deep > 1e3);
    assert_true(worst < 1e-12);
}

static void float_integral_is_within_the_bound(void **state)
{
    static const double most[4] = {0.25, 0.9, 0.99, 0.9999};
    (void)state;
    for (int i = 0; i < 4; i++) {
        double deep, shallow;
        const double worst = find_largest_error(integrate_in_float, floats, most[i], 1e-9, &deep, &shallow);
        fprintf(stderr, "float, opacities to %g: %.2g, depths %.2g to %.2g\n", most[i], worst, shallow, deep);
        assert_true(shallow < 1e-8 && deep > (i ? 500 : 100));
        assert_true(worst < 1e-6);
    }
}

/* Checks opacity 1 at control points. The extinction is infinite there, but its integral is finite. */
static void opaque_points_are_integrated(void **state)
{
    (void)state;
    double worst = 0;
    for (int n = 0; n < 200; n++) {
        random_transfer r;
        make_transfer(&r, 5000 + (uint64_t)n, 0.9);
        r.transfer.opacity_count = 3;
        r.values[0] = 0.125, r.values[1] = 0.5, r.values[2] = 0.75;
        r.opacities[0] = 0.25f, r.opacities[1] = 1, r.opacities[2] = 0;
        /* A quarter of the segments begin or end exactly at the control point with opacity 1, and some segments stay
         * close to it. */
        const double near = 0.5 + (draw_coarse_number(2, (uint64_t)n + 9) - 0.5) * (n % 16 < 4 ? 1.0 / 4096 : 1);
        const double other = n % 4 ? draw_coarse_number(1, (uint64_t)n + 9) : 0.5;
        const double v_in = n % 8 ? other : near, v_out = n % 8 ? near : other;
        const double length = ldexp(1, n % 20 - 16);
        long double truth[5];
        double found[4];
        integrate_exactly(&r.transfer, length, v_in, v_out, 1e-10L, truth);
        integrate_in_float(&r.transfer, length, v_in, v_out, found);
        for (int c = 0; c < 4; c++) worst = test_larger_error(worst, fabs(found[c] - (double)truth[c]));
    }
    fprintf(stderr, "opaque points: %.2g\n", worst);
    assert_true(worst < 1e-6);
}

static void opacity_of_one_absorbs_all_light(void **state)
{
    (void)state;
    random_transfer r;
    double found[4];
    make_transfer(&r, 1, 1);
    r.transfer.opacity_count = 1;
    r.opacities[0] = 1;
    integrate_in_float(&r.transfer, 0.01, 0, 0, found);
    for (int c = 0; c < 3; c++) assert_true(fabs(found[c] - (double)r.colours[c]) < 1e-6);
    assert_true(found[3] < 1e-7);
}

/* Checks the bounds of the light's variation. No bound may be below the brute-force result over the range itself. The
 * bound of the variation may exceed the brute-force variation over a wider range by at most a quarter of the
 * derivative's maximum. The range is wider by two of 128 bins at either end, and at its upper end by another quarter.
 * Values beyond all bins belong to the bin at that end. */
static void light_variation_bounds_hold(void **state)
{
    enum { RANGES = 20 };
    (void)state;
    double loosest = 0;
    for (uint64_t n = 0; n < 60; n++) {
        random_transfer r;
        double ranges[RANGES][2], found[RANGES][4];
        make_transfer(&r, 9000 + n, 0.9);
        const double first = fmin(0, r.values[0]), last = fmax(1, r.values[r.transfer.opacity_count - 1]);
        const double bin = (last - first) / 128;
        for (uint64_t i = 0; i < RANGES; i++) {
            ranges[i][0] = test_uniform_between(i, 9000 + n, first - 0.1, last + 0.1);
            ranges[i][1] = ranges[i][0] + pow(10, test_uniform_between(RANGES + i, 9000 + n, -4, 0.2));
        }
        integral_compute_variations(&r.transfer, RANGES, (const double(*)[2])ranges, found);
        for (int i = 0; i < RANGES; i++) {
            double truth[4], wide[4];
            const double low = ranges[i][0], high = ranges[i][1], more = 2 * bin + 0.25 * (high - low);
            find_variation_by_brute_force(&r.transfer, low, high, truth);
            find_variation_by_brute_force(&r.transfer, fmin(low, last) - 2 * bin, fmax(high, first) + more, wide);
            for (int k = 0; k < 4; k++) assert_true(found[i][k] >= truth[k] * (1 - 1e-4) - 1e-6);
            loosest = fmax(loosest, (found[i][0] - wide[0]) / fmax(wide[1], 1e-9));
        }
    }
    fprintf(stderr, "swings above those of wider ranges by at most %.2g of the cost\n", loosest);
    assert_true(loosest < 0.25);
}

/* The command's argument is the number of cases in float for each range of opacities. */
int main(int argc, char **argv)
{
    if (argc > 1) floats = atoi(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(integral_is_exact_in_double),  cmocka_unit_test(float_integral_is_within_the_bound),
        cmocka_unit_test(opaque_points_are_integrated), cmocka_unit_test(opacity_of_one_absorbs_all_light),
        cmocka_unit_test(light_variation_bounds_hold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
