/* Compares the robust root finder with the reference's inverse map in double, on rays that are curved in the cell's own
 * coordinates: through warped, concave and twisted hexes, twisted wedges, and pyramids near their apex. Some values are
 * constructed so that the field has a double or a triple root on a ray. The kernels' headers are compiled here for the
 * scalar instruction set.
 *
 * Reference: the field along a ray is not a polynomial, but smooth. The ray is bisected into intervals until, in each,
 * the cubic through the values and slopes at both ends agrees with the value and the slope in the middle to 1e-9;
 * everywhere else in the interval its error is smaller. Between the ends of the intervals and the extremes of the
 * cubics, the field is then monotonic to 1e-9, and bisection finds the depth at which it reaches a level.
 *
 * Tolerance: a polynomial with eight coefficients c at coordinates in [0, 1] is evaluated in float32 with one rounding
 * (6e-8) of each coefficient and up to six of the sums and products of each term, so its error is 7 * 6e-8 sum |c|. The
 * polynomials of the field and of the three coordinates have this error. The ray's point is also rounded three times at
 * a size of 1.5, and by the rounding of t. An error of the position changes the value by the field's gradient times
 * this error. (Newton's method ends below a step of 5e-5, after which the error is 1e-8.) The band is the sum of these
 * errors for each cell and ray: float32 cannot decide the sign of a field below it. A crossing is certain if the field
 * passes from outside the band on one side to outside the band on the other side. The first hit must not be farther
 * than the first certain crossing, and the field must be within the band at every hit. */
#include "reference_cell.h"
#include "root_bundle.h"
#include "test_meshes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

static int64_t rays_wanted = 150000;
static uint64_t drawn_numbers;

static double draw_uniform(double low, double high)
{
    return low + (high - low) * test_uniform(drawn_numbers++, 78);
}

/* ---- the field along a ray ---- */

typedef struct knot {
    double t, f, slope;
} knot;

enum { PROFILE_LEAST_HALVINGS = 3, PROFILE_MOST_HALVINGS = 10, PROFILE_MAX = (3 << PROFILE_MOST_HALVINGS) + 1 };

typedef struct ray_profile {
    const reference_cell *cell;
    const double *values;
    reference_line line;
    double steepest[3]; /* largest magnitude of each component of the gradient along the ray */
    bool has_failed;
    int count;
    knot knots[PROFILE_MAX]; /* the field is monotonic between two consecutive knots */
} ray_profile;

static knot ray_profile_evaluate(ray_profile *c, double t)
{
    const double point[3] = {c->line.base[0] + c->line.slope[0] * t, c->line.base[1] + c->line.slope[1] * t, t};
    double gradient[3];
    knot k = {.t = t};
    if (!reference_interpolate(c->cell, point, c->values, &k.f, gradient)) c->has_failed = true;
    for (int a = 0; a < 3; a++) c->steepest[a] = fmax(c->steepest[a], fabs(gradient[a]));
    k.slope = gradient[0] * c->line.slope[0] + gradient[1] * c->line.slope[1] + gradient[2];
    return k;
}

static void ray_profile_add(ray_profile *c, knot k)
{
    c->knots[c->count++] = k;
}

/* Adds the extremes of the cubic between the knots a and b, then adds b. */
static void ray_profile_add_piece(ray_profile *c, knot a, knot b)
{
    const double h = b.t - a.t, d0 = a.slope * h, d1 = b.slope * h, rise = b.f - a.f;
    /* The cubic's slope is d0 + 2 q u + 3 p u^2. */
    const double p = d0 + d1 - 2 * rise, q = 3 * rise - 2 * d0 - d1, square = q * q - 3 * p * d0;
    const double root = sqrt(fmax(square, 0)), w = -(q + (q < 0 ? -root : root));
    double turns[2] = {p != 0 ? w / (3 * p) : -1, w != 0 ? d0 / w : -1};
    if (turns[0] > turns[1]) {
        const double swap = turns[0];
        turns[0] = turns[1];
        turns[1] = swap;
    }
    for (int i = 0; i < 2 && square > 0; i++)
        if (turns[i] > 0 && turns[i] < 1) ray_profile_add(c, ray_profile_evaluate(c, a.t + turns[i] * h));
    ray_profile_add(c, b);
}

static void ray_profile_refine(ray_profile *c, knot a, knot b, int halvings)
{
    const double h = b.t - a.t;
    const knot middle = ray_profile_evaluate(c, 0.5 * (a.t + b.t));
    const double f = 0.5 * (a.f + b.f) + 0.125 * h * (a.slope - b.slope);
    const double slope = 1.5 * (b.f - a.f) - 0.25 * h * (a.slope + b.slope);
    const bool is_cubic = fabs(middle.f - f) < 1e-9 && fabs(middle.slope * h - slope) < 1e-9;
    if (halvings >= PROFILE_LEAST_HALVINGS && (is_cubic || halvings == PROFILE_MOST_HALVINGS - 1)) {
        ray_profile_add_piece(c, a, middle);
        ray_profile_add_piece(c, middle, b);
        return;
    }
    ray_profile_refine(c, a, middle, halvings + 1);
    ray_profile_refine(c, middle, b, halvings + 1);
}

static void ray_profile_trace(ray_profile *c, double low, double high)
{
    const knot first = ray_profile_evaluate(c, low);
    c->count = 0;
    ray_profile_add(c, first);
    ray_profile_refine(c, first, ray_profile_evaluate(c, high), 0);
}

/* Returns the depth between two knots at which the field reaches v. */
static double ray_profile_find_crossing(ray_profile *c, const knot *from, const knot *to, double v)
{
    const bool rises = to->f > from->f;
    double low = from->t, high = to->t;
    for (int i = 0; i < 50; i++) {
        const double middle = 0.5 * (low + high);
        if ((ray_profile_evaluate(c, middle).f < v) == rises)
            low = middle;
        else
            high = middle;
    }
    return high;
}

/* Returns whether there is a certain crossing. *t receives the depth that the first hit must not exceed. */
static bool ray_profile_find_certain_crossing(ray_profile *c, double band, double *t)
{
    int side = 0;
    for (int i = 0; i < c->count; i++) {
        const double v = c->knots[i].f;
        if (fabs(v) <= band) continue;
        const int now = v < 0 ? -1 : 1;
        if (side && now != side) {
            *t = ray_profile_find_crossing(c, &c->knots[i - 1], &c->knots[i], now * band);
            return true;
        }
        side = now;
    }
    return false;
}

/* ---- cells ---- */

typedef enum bent { BENT_WARPED, BENT_CONCAVE, BENT_TWISTED, BENT_WEDGE, BENT_APEX, BENT_COUNT } bent;

static const double unit_hex[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                      {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
static const double unit_wedge[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
static const double unit_pyramid[5][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};

static void rotate_point(double *p, double angle)
{
    const double x = p[0] - 0.5, y = p[1] - 0.5;
    p[0] = 0.5 + cos(angle) * x - sin(angle) * y;
    p[1] = 0.5 + sin(angle) * x + cos(angle) * y;
}

static void place_vertices(bent kind, reference_cell *cell)
{
    static const double amounts[BENT_COUNT] = {0.15, 0.05, 0.05, 0.08, 0.15};
    const bool is_hex = kind <= BENT_TWISTED;
    const double(*unit)[3] = is_hex ? unit_hex : kind == BENT_WEDGE ? unit_wedge : unit_pyramid;
    const double angle = draw_uniform(-0.9, 0.9), dent = draw_uniform(0.55, 0.65);
    memset(cell, 0, sizeof *cell);
    cell->type = is_hex ? GRID_HEX : kind == BENT_WEDGE ? GRID_WEDGE : GRID_PYRAMID;
    cell->count = is_hex ? 8 : kind == BENT_WEDGE ? 6 : 5;
    for (int i = 0; i < cell->count; i++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = unit[i][a] + draw_uniform(-amounts[kind], amounts[kind]);
        if ((kind == BENT_TWISTED || kind == BENT_WEDGE) && unit[i][2] > 0) rotate_point(p, angle);
        /* Moves a corner almost into the plane of its three neighbours. */
        for (int a = 0; a < 3 && kind == BENT_CONCAVE && i == 6; a++) p[a] = dent + draw_uniform(0, 0.1);
        for (int a = 0; a < 3; a++) cell->position[i][a] = cell->world[i][a] = (double)(float)p[a];
    }
}

/* Computes the position of a point of a hex or wedge from its coordinates r. The map is linear in each coordinate. */
static void compute_cell_position(const reference_cell *cell, const double r[3], double out[3])
{
    const int base = cell->count / 2;
    for (int a = 0; a < 3; a++) {
        double level[2];
        for (int k = 0; k < 2; k++) {
            const double(*v)[3] = cell->position + k * base;
            level[k] = base == 4 ? (1 - r[1]) * ((1 - r[0]) * v[0][a] + r[0] * v[1][a]) +
                                       r[1] * ((1 - r[0]) * v[3][a] + r[0] * v[2][a])
                                 : (1 - r[0] - r[1]) * v[0][a] + r[0] * v[1][a] + r[1] * v[2][a];
        }
        out[a] = (1 - r[2]) * level[0] + r[2] * level[1];
    }
}

static double compute_jacobian_determinant(const reference_cell *cell, const double r[3])
{
    double column[3][3];
    for (int k = 0; k < 3; k++) {
        double low[3] = {r[0], r[1], r[2]}, high[3] = {r[0], r[1], r[2]}, p[3], q[3];
        low[k] = 0;
        high[k] = 1;
        compute_cell_position(cell, low, p);
        compute_cell_position(cell, high, q);
        for (int a = 0; a < 3; a++) column[k][a] = q[a] - p[a];
    }
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        sum += column[0][a] * (column[1][b] * column[2][c] - column[1][c] * column[2][b]);
    }
    return sum;
}

/* Returns whether the cell is neither folded nor nearly folded. In folded cells a point has several values or none. */
static bool is_solid(const reference_cell *cell)
{
    enum { STEPS = 5 };
    for (int n = 0; cell->type != GRID_PYRAMID && n < STEPS * STEPS * STEPS; n++) {
        const double r[3] = {n % STEPS / (STEPS - 1.0), n / STEPS % STEPS / (STEPS - 1.0),
                             n / STEPS / STEPS / (STEPS - 1.0)};
        if (cell->type == GRID_WEDGE && r[0] + r[1] > 1) continue;
        if (compute_jacobian_determinant(cell, r) < 0.08) return false;
    }
    return true;
}

/* ---- rays and values ---- */

/* Chooses two points at different heights. In a pyramid, the distance from the apex to the ray between the points is
 * 1e-4 to 1e-1. */
static void choose_two_points(const reference_cell *cell, double from[3], double to[3])
{
    do {
        for (int a = 0; a < 3; a++) {
            from[a] = draw_uniform(0.05, 0.95);
            to[a] = draw_uniform(0.05, 0.95);
        }
        if (cell->type != GRID_PYRAMID) continue;
        const double off = pow(10, draw_uniform(-4, -1));
        for (int a = 0; a < 3; a++) to[a] = cell->position[4][a] + off * draw_uniform(-1, 1);
        to[2] = cell->position[4][2] - off;
    } while (fabs(to[2] - from[2]) < 0.2);
}

/* Aims the rays of all lanes near the first ray, from 1e-7 to 1e-1 off, or anywhere. */
static void aim_all_rays(bundle *b, const reference_cell *cell, bool is_near)
{
    double from[3], to[3];
    choose_two_points(cell, from, to);
    bundle_aim_ray(b, 0, from, to);
    for (int lane = 1; lane < SIMD_WIDTH; lane++) {
        double p[3], q[3];
        choose_two_points(cell, p, q);
        const double off = pow(10, draw_uniform(-7, -1));
        for (int a = 0; a < 3 && is_near; a++) {
            p[a] = from[a] + off * (p[a] - 0.5);
            q[a] = to[a] + off * (q[a] - 0.5);
        }
        bundle_aim_ray(b, lane, p, q);
    }
}

static reference_line make_lane_line(const bundle *b, int lane)
{
    return (reference_line){{(double)b->packet.origin_x[lane], (double)b->packet.origin_y[lane]},
                            {(double)b->packet.slope_x[lane], (double)b->packet.slope_y[lane]}};
}

/* Traces ray 0 through the cell. Returns false if it misses the cell. */
static bool trace_first_ray(const bundle *b, const reference_cell *cell, ray_profile *c)
{
    reference_crossing ends[REFERENCE_MAX_CROSSINGS];
    *c = (ray_profile){.cell = cell, .values = b->values, .line = make_lane_line(b, 0)};
    if (reference_find_crossings(cell, &c->line, ends) < 2 || !(ends[1].z - ends[0].z > 0.01)) return false;
    ray_profile_trace(c, ends[0].z, ends[1].z);
    return true;
}

static void shift_values(bundle *b, const reference_cell *cell, double level, double slope)
{
    for (int i = 0; i < cell->count; i++) b->values[i] += level + slope * cell->position[i][2];
}

/* Shifts the values so that the field on ray 0 has an extreme with the value `miss`; 0 makes a double root. */
static void make_double_root(bundle *b, const reference_cell *cell, ray_profile *c, double miss)
{
    if (!trace_first_ray(b, cell, c)) return;
    for (int i = 1; i + 1 < c->count; i++)
        if ((c->knots[i].f < c->knots[i - 1].f) == (c->knots[i].f < c->knots[i + 1].f)) {
            shift_values(b, cell, miss - c->knots[i].f, 0);
            return;
        }
}

/* Makes a triple root or three close roots on ray 0. Every cell can represent t as a field. A constant and a multiple
 * of t are added to the values, so that the field is 0 and has the given slope at its steepest or flattest point on the
 * ray. */
static void make_triple_root(bundle *b, const reference_cell *cell, ray_profile *c, double slope)
{
    if (!trace_first_ray(b, cell, c)) return;
    for (int i = 1; i + 1 < c->count; i++) {
        const knot *k = &c->knots[i];
        if ((k->slope < k[-1].slope) != (k->slope < k[1].slope)) continue;
        double low = k[-1].t, high = k[1].t;
        const double side = k->slope < k[-1].slope ? 1 : -1;
        for (int step = 0; step < 60; step++) {
            const double x = low + (high - low) / 3, y = high - (high - low) / 3;
            if (side * ray_profile_evaluate(c, x).slope < side * ray_profile_evaluate(c, y).slope)
                high = y;
            else
                low = x;
        }
        const knot flat = ray_profile_evaluate(c, 0.5 * (low + high));
        shift_values(b, cell, (flat.slope - slope) * flat.t - flat.f, slope - flat.slope);
        return;
    }
}

/* Rounds the values to float32 after scaling them to a maximum of 1, as kernel_cell_subtract_isovalue() does. */
static void scale_values_to_maximum_of_1(double *values, int count)
{
    double largest = 0;
    for (int i = 0; i < count; i++) largest = fmax(largest, fabs(values[i]));
    for (int i = 0; i < count; i++) values[i] = (double)(float)(values[i] / largest);
}

static void make_bundle(bundle *b, reference_cell *cell, ray_profile *scratch, bent kind, int roots)
{
    const double small = (draw_uniform(0, 1) < 0.5 ? -1 : 1) * pow(10, draw_uniform(-9, -1));
    do place_vertices(kind, cell);
    while (!is_solid(cell));
    memset(b, 0, sizeof *b);
    aim_all_rays(b, cell, roots > 0);
    for (int i = 0; i < cell->count; i++) b->values[i] = draw_uniform(-1, 1);
    if (roots == 1 || roots == 2) make_double_root(b, cell, scratch, roots == 1 ? small : 0);
    if (roots == 3 || roots == 4) make_triple_root(b, cell, scratch, roots == 3 ? small : 0);
    scale_values_to_maximum_of_1(b->values, cell->count);
    bundle_initialize(b);
    b->cell.type = cell->type;
    b->cell.count = cell->count;
    memcpy(b->cell.world, cell->world, (size_t)cell->count * sizeof *cell->world);
    memcpy(b->cell.values, b->values, sizeof b->values);
    bundle_transform_cell(b);
}

/* ---- comparison of the kernels with the reference ---- */

typedef struct count {
    int64_t rays, certain, missed, off, differing, inverse_failures;
    double worst, worst_band; /* worst: largest residual relative to the band; worst_band: largest band */
} count;

static double sum_magnitudes_of_lane_0(const vf c[8])
{
    double sum = 0;
    for (int i = 0; i < 8; i++) sum += fabs((double)c[i][0]);
    return sum;
}

static double compute_error_band(const kernel_map *map, const ray_profile *c)
{
    double band = 7 * 6e-8 * sum_magnitudes_of_lane_0(map->field);
    for (int a = 0; a < 3; a++)
        band += c->steepest[a] * 6e-8 * (7 * sum_magnitudes_of_lane_0(map->position[a]) + 3 * 1.5 + 0.5);
    return band;
}

static void verify_ray(count *n, const kernel_map *map, ray_profile *c, double low, double high, bool hit, double hit_t)
{
    double certain_t = 0;
    ray_profile_trace(c, low, high);
    const double band = compute_error_band(map, c);
    const bool certain = ray_profile_find_certain_crossing(c, band, &certain_t);
    n->rays++;
    n->certain += certain;
    n->inverse_failures += c->has_failed;
    n->worst_band = fmax(n->worst_band, band);
    /* t itself is rounded by half a unit in the last place of 2. */
    if (certain && (!hit || hit_t > certain_t + 1.2e-7)) n->missed++;
    if (!hit) return;
    const double residual = fabs(ray_profile_evaluate(c, hit_t).f) / band;
    n->worst = fmax(n->worst, residual);
    n->off += residual > 1;
}

/* Returns the number of rays whose first crossing or number of crossings changes if each ray is traced without the
 * others: the result of a ray must not depend on the other rays of its packet. */
static int64_t count_differences_if_traced_alone(bundle *b, const kernel_curved *curved, const kernel_interval *i, vf t,
                                                 vf hits)
{
    int64_t differing = 0;
    for (unsigned rays = vm_bits(i->mask); rays; rays &= rays - 1) {
        const int lane = __builtin_ctz(rays);
        kernel_interval alone = *i;
        vf own_t, own_hits;
        alone.mask = vm_from_bits(1u << lane);
        bundle_find_hits(b, curved, &alone, &own_t, &own_hits);
        differing += own_t[lane] != t[lane] || own_hits[lane] != hits[lane];
    }
    return differing;
}

static void verify_bundle(bundle *b, const reference_cell *cell, ray_profile *c, count *n)
{
    kernel_interval list[KERNEL_MAX_CELL_INTERVALS];
    kernel_map map;
    float corners[4][8][SIMD_WIDTH], colours[8][SIMD_WIDTH];
    kernel_bounds bounds;
    kernel_curved curved = {.at = corners, .colours = colours, .bounds = &bounds};
    const int intervals = bundle_find_intervals(b, list, &curved);
    kernel_map_setup(&map, &b->cell);
    for (int i = 0; i < intervals; i++) {
        vf t, hits;
        const unsigned hit = vm_bits(bundle_find_hits(b, &curved, &list[i], &t, &hits));
        n->differing += count_differences_if_traced_alone(b, &curved, &list[i], t, hits);
        for (int lane = 0; lane < SIMD_WIDTH; lane++) {
            if (!(vm_bits(list[i].mask) >> lane & 1)) continue;
            *c = (ray_profile){.cell = cell, .values = b->values, .line = make_lane_line(b, lane)};
            verify_ray(n, &map, c, (double)list[i].t_in[lane], (double)list[i].t_out[lane], hit >> lane & 1,
                       (double)t[lane]);
        }
    }
}

static void curved_rays_miss_no_first_root(void **state)
{
    (void)state;
    static const char *const names[BENT_COUNT] = {"warped hexes", "concave hexes", "twisted hexes", "twisted wedges",
                                                  "pyramids near the apex"};
    static ray_profile c;
    static reference_cell cell;
    for (bent kind = 0; kind < BENT_COUNT; kind++) {
        count n = {.rays = 0};
        bundle b;
        int64_t map_failures = 0;
        for (int roots = 0; n.rays < rays_wanted / BENT_COUNT; roots = (roots + 1) % 5) {
            make_bundle(&b, &cell, &c, kind, roots);
            verify_bundle(&b, &cell, &c, &n);
            map_failures += b.thread.map_failures;
        }
        printf("%s: %lld rays, %lld with a certain crossing, %lld missed, %lld off; worst residual %.2g bands, of at "
               "most %.2g; %lld failed maps\n",
               names[kind], (long long)n.rays, (long long)n.certain, (long long)n.missed, (long long)n.off, n.worst,
               n.worst_band, (long long)map_failures);
        assert_true(n.certain > n.rays / 4);
        assert_int_equal(n.inverse_failures, 0);
        assert_int_equal(n.missed, 0);
        assert_int_equal(n.off, 0);
        assert_int_equal(n.differing, 0);
        assert_int_equal(map_failures, 0);
    }
}

/* The command's argument is the number of rays to trace. */
int main(int argc, char **argv)
{
    if (argc > 1) rays_wanted = atoll(argv[1]);
    const struct CMUnitTest tests[] = {cmocka_unit_test(curved_rays_miss_no_first_root)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
