/* Compares the robust root finder with exact cubics in long double. Rays pass through a unit hex with random values, on
 * which the field is a cubic; some values are constructed so that the cubic has a double or a triple root. The kernels'
 * headers are compiled here for the scalar instruction set.
 *
 * Tolerance: the eight coefficients of the field are sums of up to 8 values of at most 1, rounded to float32 (by half a
 * unit in the last place of 1, of 2 for three, of 4 for three and of 8 for one coefficient: 27 · 6e-8 = 1.6e-6).
 * Evaluating the field rounds about ten times at the size of its terms (6e-7 · 2). Coordinates have an error of 2e-7,
 * at slopes of at most about 4. So float32 cannot decide the sign of F if |F| is below band = 4e-6. A crossing is
 * certain if the cubic passes from outside the band on one side to outside the band on the other side. The first hit
 * must not be farther than the first certain crossing, and |F| must be within the band at every hit. */
#include <math.h>

#include "kernel_cell.h"
#include "kernel_map.h"
#include "root_bundle.h"
#include "test_meshes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static const long double band = 4e-6L;
static int64_t cubics = 1000000;
static uint64_t drawn_numbers;

typedef struct cubic {
    long double c[4];
} cubic;

static double draw_uniform(double low, double high)
{
    return low + (high - low) * test_uniform(drawn_numbers++, 77);
}

static void get_hex_corner(int i, int corner[3])
{
    corner[0] = (i & 3) == 1 || (i & 3) == 2;
    corner[1] = (i & 3) >= 2;
    corner[2] = i >= 4;
}

/* Returns the coefficients of the field on the ray of a lane as a polynomial of t. */
static cubic expand_cubic(const bundle *b, int lane)
{
    const long double base[3] = {(long double)b->packet.origin_x[lane], (long double)b->packet.origin_y[lane], 0};
    const long double slope[3] = {(long double)b->packet.slope_x[lane], (long double)b->packet.slope_y[lane], 1};
    cubic sum = {{0, 0, 0, 0}};
    for (int i = 0; i < 8; i++) {
        int corner[3];
        cubic weight = {{(long double)b->values[i], 0, 0, 0}};
        get_hex_corner(i, corner);
        for (int a = 0; a < 3; a++) {
            const long double c0 = corner[a] ? base[a] : 1 - base[a], c1 = corner[a] ? slope[a] : -slope[a];
            for (int k = 3; k >= 0; k--) weight.c[k] = weight.c[k] * c0 + (k ? weight.c[k - 1] * c1 : 0);
        }
        for (int k = 0; k < 4; k++) sum.c[k] += weight.c[k];
    }
    return sum;
}

static long double evaluate_cubic(const cubic *g, long double t)
{
    return ((g->c[3] * t + g->c[2]) * t + g->c[1]) * t + g->c[0];
}

/* Returns the t at which g reaches v. g must be monotonic between low and high. */
static long double find_monotonic_root(const cubic *g, long double low, long double high, long double v)
{
    const bool rises = evaluate_cubic(g, high) > evaluate_cubic(g, low);
    for (int i = 0; i < 80; i++) {
        const long double middle = (low + high) / 2;
        if ((evaluate_cubic(g, middle) < v) == rises)
            low = middle;
        else
            high = middle;
    }
    return high;
}

/* Computes the ends of the intervals in which g is monotonic. Returns the number of ends, 2 to 4. */
static int find_monotonic_ends(const cubic *g, long double low, long double high, long double ends[4])
{
    const long double a = 3 * g->c[3], b = g->c[2], c = g->c[1], root = sqrtl(fmaxl(b * b - a * c, 0));
    const long double h = -(b + (b < 0 ? -root : root));
    long double turns[2] = {a != 0 ? h / a : high, h != 0 ? c / h : high};
    int n = 0;
    if (turns[0] > turns[1]) {
        const long double swap = turns[0];
        turns[0] = turns[1];
        turns[1] = swap;
    }
    ends[n++] = low;
    for (int i = 0; i < 2; i++)
        if (turns[i] > low && turns[i] < high) ends[n++] = turns[i];
    ends[n++] = high;
    return n;
}

typedef struct truth {
    bool certain;
    long double certain_t; /* end of the first certain crossing, which the first hit must not exceed */
    int count;
    long double roots[3];
} truth;

static truth find_exact_root(const cubic *g, long double low, long double high)
{
    truth out = {.certain = false};
    long double ends[4];
    const int n = find_monotonic_ends(g, low, high, ends);
    int side = 0;
    for (int i = 0; i < n; i++) {
        const long double v = evaluate_cubic(g, ends[i]);
        if (i && (v < 0) != (evaluate_cubic(g, ends[i - 1]) < 0))
            out.roots[out.count++] = find_monotonic_root(g, ends[i - 1], ends[i], 0);
        if (fabsl(v) <= band || out.certain) continue;
        const int now = v < 0 ? -1 : 1;
        if (side && now != side) {
            out.certain = true;
            out.certain_t = find_monotonic_root(g, ends[i - 1], ends[i], now * band);
        }
        side = now;
    }
    return out;
}

/* Chooses two random points in the unit cube whose heights are not nearly equal. */
static void choose_two_points(double from[3], double to[3])
{
    do {
        for (int a = 0; a < 3; a++) {
            from[a] = draw_uniform(0.02, 0.98);
            to[a] = draw_uniform(0.02, 0.98);
        }
    } while (fabs(to[2] - from[2]) < 0.2);
}

/* Aims the rays of all lanes: near the first ray, from 1e-7 to 1e-1 off, or anywhere. Half of the near rays are almost
 * parallel to the depth axis, because the bounds of a cell are made for the rays of a tile, which are almost parallel
 * to this axis. */
static void aim_all_rays(bundle *b, bool is_near)
{
    const double lean = is_near && draw_uniform(0, 1) < 0.5 ? pow(10, draw_uniform(-3, -1)) : 1;
    double from[3], to[3];
    choose_two_points(from, to);
    for (int a = 0; a < 2; a++) to[a] = from[a] + lean * (to[a] - from[a]);
    bundle_aim_ray(b, 0, from, to);
    for (int lane = 1; lane < SIMD_WIDTH; lane++) {
        double p[3], q[3];
        choose_two_points(p, q);
        const double off = pow(10, draw_uniform(-7, -1));
        for (int a = 0; a < 3 && is_near; a++) {
            p[a] = from[a] + off * (p[a] - 0.5);
            q[a] = to[a] + off * (q[a] - 0.5);
        }
        bundle_aim_ray(b, lane, p, q);
    }
}

/* Rounds the values to float32 after scaling them to a maximum of 1, as kernel_cell_subtract_isovalue() does. */
static void scale_values_to_maximum_of_1(double values[8])
{
    double largest = 0;
    for (int i = 0; i < 8; i++) largest = fmax(largest, fabs(values[i]));
    for (int i = 0; i < 8; i++) values[i] = (double)(float)(values[i] / largest);
}

/* Shifts the values so that the cubic on ray 0 has an extreme with the value `miss`; 0 makes a double root. */
static void make_double_root(bundle *b, double miss)
{
    const cubic g = expand_cubic(b, 0);
    long double ends[4];
    const int n = find_monotonic_ends(&g, 0, 1, ends);
    const double v = (double)evaluate_cubic(&g, ends[n > 2 ? 1 : 0]);
    for (int i = 0; i < 8; i++) b->values[i] -= v + miss;
}

/* Adds a constant, a multiple of x and a multiple of x y to the values, so that the cubic on ray 0 has a triple root at
 * `place`, or three roots at distances of `spread`. */
static void make_triple_root(bundle *b, double place, double spread)
{
    const cubic g = expand_cubic(b, 0);
    const double x0 = (double)b->packet.origin_x[0], x1 = (double)b->packet.slope_x[0];
    const double y0 = (double)b->packet.origin_y[0], y1 = (double)b->packet.slope_y[0];
    const double lead = (double)g.c[3], bent = (-3 * lead * place - (double)g.c[2]) / (x1 * y1);
    const double want1 = lead * (3 * place * place - spread * spread);
    const double slope = (want1 - (double)g.c[1] - bent * (x0 * y1 + x1 * y0)) / x1;
    const double level =
        lead * place * (spread * spread - place * place) - (double)g.c[0] - bent * x0 * y0 - slope * x0;
    for (int i = 0; i < 8; i++) {
        int c[3];
        get_hex_corner(i, c);
        b->values[i] += level + slope * c[0] + bent * c[0] * c[1];
    }
}

static void make_bundle(bundle *b, int64_t n)
{
    const int kind = (int)(n % 8);
    const double small = (draw_uniform(0, 1) < 0.5 ? -1 : 1) * pow(10, draw_uniform(-9, -1));
    memset(b, 0, sizeof *b);
    aim_all_rays(b, kind >= 4);
    /* The values of kind 3 mostly increase along the rays, so that the kernels find that many cells are monotonic. */
    for (int i = 0; i < 8; i++) b->values[i] = draw_uniform(-1, 1) + (kind == 1 ? 0.6 : 0);
    for (int i = 0; i < 8 && kind == 3; i++) b->values[i] = 0.2 * b->values[i] + (i < 4 ? -0.7 : 0.7);
    if (kind == 4 || kind == 5) make_double_root(b, kind == 4 ? small : 0);
    if (kind == 6 || kind == 7) make_triple_root(b, draw_uniform(0.2, 0.8), kind == 6 ? fabs(small) : 0);
    scale_values_to_maximum_of_1(b->values);
    bundle_initialize(b);
    b->cell.type = GRID_HEX;
    b->cell.count = 8;
    for (int i = 0; i < 8; i++) {
        int c[3];
        get_hex_corner(i, c);
        for (int a = 0; a < 3; a++) b->cell.world[i][a] = c[a];
        b->cell.values[i] = b->values[i];
    }
    bundle_transform_cell(b);
}

typedef struct count {
    int64_t rays, certain, missed, off, spurious;
    double worst; /* largest residual at a hit */
} count;

static void verify_first_root(count *c, const cubic *g, const truth *t, bool hit, long double at_t)
{
    c->rays++;
    c->certain += t->certain;
    /* t itself is rounded by half a unit in the last place of 2. */
    if (t->certain && (!hit || at_t > t->certain_t + 1.2e-7L)) c->missed++;
    if (!hit) return;
    const double residual = (double)fabsl(evaluate_cubic(g, at_t));
    c->worst = fmax(c->worst, residual);
    if (residual > (double)band) c->off++;
}

typedef struct rates {
    count robust;
    int64_t monotone; /* number of packets for which the kernels find that the field is monotonic along all rays */
    /* number of rays for which the number of further crossings is wrong */
    int64_t further_crossings;
} rates;

static void verify_bundle(bundle *b, rates *r)
{
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    float corners[4][8][SIMD_WIDTH], colours[8][SIMD_WIDTH];
    kernel_bounds bounds;
    kernel_curved curved = {.at = corners, .colours = colours, .bounds = &bounds};
    const int intervals = bundle_find_intervals(b, list, &curved);
    r->monotone += bounds.jump[0] >= 0;
    for (int n = 0; n < intervals; n++) {
        vf t, hits;
        const vm change = vm_xor(vf_lt(list[n].v_in, vf_set(0)), vf_lt(list[n].v_out, vf_set(0)));
        const unsigned hit = vm_bits(bundle_find_hits(b, &curved, &list[n], &t, &hits));
        for (int lane = 0; lane < SIMD_WIDTH; lane++) {
            if (!(vm_bits(list[n].mask) >> lane & 1)) continue;
            const cubic g = expand_cubic(b, lane);
            const truth truth = find_exact_root(&g, (long double)list[n].t_in[lane], (long double)list[n].t_out[lane]);
            verify_first_root(&r->robust, &g, &truth, hit >> lane & 1, (long double)t[lane]);
            /* Crossings alternate in direction, so their number is odd if the signs at both faces differ. */
            if (((int)hits[lane] & 1) != (int)(vm_bits(change) >> lane & 1)) r->further_crossings++;
        }
    }
}

static void robust_misses_no_first_root(void **state)
{
    (void)state;
    rates r = {.further_crossings = 0};
    bundle b;
    for (int64_t n = 0; r.robust.rays < cubics; n++) {
        make_bundle(&b, n);
        verify_bundle(&b, &r);
    }
    printf("robust: %lld cubics, %lld with a certain crossing, %lld missed, worst residual %.2g; monotone %lld cells\n",
           (long long)r.robust.rays, (long long)r.robust.certain, (long long)r.robust.missed, r.robust.worst,
           (long long)r.monotone);
    assert_true(r.robust.certain > cubics / 3);
    assert_true(r.monotone > cubics / 2000);
    assert_int_equal(r.robust.missed, 0);
    assert_int_equal(r.robust.off, 0);
    assert_int_equal(r.further_crossings, 0);
    assert_int_equal(b.thread.map_failures, 0);
}

/* The command's argument is the number of cubics to test. */
int main(int argc, char **argv)
{
    if (argc > 1) cubics = atoll(argv[1]);
    const struct CMUnitTest tests[] = {cmocka_unit_test(robust_misses_no_first_root)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
