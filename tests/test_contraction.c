/* A ray's one crossing by contraction (kernel_contraction.h): hexes, wedges and pyramids from parallelepipeds to cells
 * that are strongly bent, flat, tiny, and far from the origin, each with a ray of its own, against brute force in
 * double. The kernels' headers are compiled here, plain.
 *
 * The truth: a ray's intervals in the cell are reference_crossings(), and in each the field is looked at at many
 * depths; where its sign changes from one to the next, bisection finds the root. A crossing that is decided must be the
 * only one, at its depth, and where none is decided there must be none.
 *
 * Depth: the last step of Newton's method begins at most KERNEL_CONTRACTION_END from the root, in the cell's
 * coordinates. f's second derivative is no more than some 4 K (its first one is K at the domain's corners, and 0 in the
 * middle), so with K < 0.9 the step leaves 2 K / (1 - K) (1e-4)^2 = 1.8e-7 of r, which is as much of the cell's extent
 * along the ray; t is rounded to half a unit, twice. */
#include "kernel_bounds_curved.h"
#include "kernel_contraction.h"
#include "kernel_roots.h"
#include "kernel_shapes.h"
#include "reference_cell.h"
#include "test_meshes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

enum { LOOKS = 64 };

static int64_t rays_wanted = 240000;
static uint64_t drawn_numbers;

static double uniform(double low, double high)
{
    return low + (high - low) * test_uniform(drawn_numbers++, 79);
}

typedef enum shape { AFFINE, JITTERED, BENT, FLAT, TINY, FAR, SHAPE_COUNT } shape;

static const char *const shape_names[SHAPE_COUNT] = {"affine", "jittered", "bent", "flat", "tiny", "far"};

/* Cells in lanes, each with a ray. */
typedef struct batch {
    int type;
    float at[4][8][SIMD_WIDTH];
    kernel_rays rays;
    kernel_beam beam;
} batch;

/* ---- cells ---- */

static double shape_size(shape s)
{
    return s == TINY ? 1e-4 : s == FAR ? 0.008 : pow(10, uniform(-2.5, -0.5));
}

/* A random rotation's columns, with the extents of the cell. */
static void random_axes(const double extent[3], double axes[3][3])
{
    double q[4], sum = 0;
    for (int i = 0; i < 4; i++) {
        q[i] = uniform(-1, 1);
        sum += q[i] * q[i];
    }
    for (int i = 0; i < 4; i++) q[i] /= sqrt(sum);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double m[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                            {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                            {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; i++)
        for (int a = 0; a < 3; a++) axes[i][a] = m[a][i] * extent[i];
}

static void place_cell(batch *b, shape s, int lane)
{
    static const float apex[3] = {0.5f, 0.5f, 1};
    const double size = shape_size(s), flat = s == FLAT ? pow(10, uniform(-4, -1)) : 1;
    const double jitter = s == AFFINE || s == FLAT ? 0 : s == BENT ? uniform(0.2, 0.5) : uniform(0, 0.2);
    const double extent[3] = {size, size * uniform(0.5, 1), size * flat};
    const double middle[3] = {uniform(-0.02, 0.02), uniform(-0.02, 0.02), uniform(-0.5, 0.5) * (s != TINY)};
    double axes[3][3];
    random_axes(extent, axes);
    for (int i = 0; i < grid_type_vertices(b->type); i++) {
        static const float base[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
        const float *corner = b->type != GRID_PYRAMID ? kernel_cell_shape(b->type)->corners[i]
                              : i == 4                ? apex
                                                      : base[i];
        double r[3];
        for (int k = 0; k < 3; k++) r[k] = (double)corner[k] - 0.5 + jitter * uniform(-1, 1);
        for (int a = 0; a < 3; a++) {
            const double x = middle[a] + r[0] * axes[0][a] + r[1] * axes[1][a] + r[2] * axes[2][a];
            b->at[a][i][lane] = (float)x;
        }
    }
}

/* A field that is nearly linear, or not at all; relative to an isovalue among the vertices', as in
 * kernel_cell_relative(). */
static void place_values(batch *b, int lane)
{
    const int count = grid_type_vertices(b->type);
    const double noise = pow(10, uniform(-3, 0.3)), g[3] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
    double v[8], low = INFINITY, high = -INFINITY, most = 0, size = 0;
    for (int i = 1; i < count; i++)
        for (int a = 0; a < 3; a++) size = fmax(size, fabs((double)(b->at[a][i][lane] - b->at[a][0][lane])));
    for (int i = 0; i < count; i++) {
        v[i] = noise * uniform(-1, 1);
        for (int a = 0; a < 3; a++) v[i] += g[a] * ((double)b->at[a][i][lane] - (double)b->at[a][0][lane]) / size;
        low = fmin(low, v[i]);
        high = fmax(high, v[i]);
    }
    const double isovalue = uniform(low, high);
    for (int i = 0; i < count; i++) most = fmax(most, fabs(v[i] -= isovalue));
    for (int i = 0; i < count; i++) b->at[3][i][lane] = (float)(v[i] / most);
}

/* A ray of the beam by a point in the vertices' box, or somewhat beside. */
static void aim(batch *b, int lane)
{
    double point[3];
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < grid_type_vertices(b->type); i++) {
            low = fmin(low, (double)b->at[a][i][lane]);
            high = fmax(high, (double)b->at[a][i][lane]);
        }
        point[a] = low + (high - low) * uniform(-0.1, 1.1);
    }
    b->rays.slope_x[lane] = (float)(uniform(-1, 1) * (double)b->beam.spread);
    b->rays.slope_y[lane] = (float)(uniform(-1, 1) * (double)b->beam.spread);
    b->rays.origin_x[lane] = (float)(point[0] - (double)b->rays.slope_x[lane] * point[2]);
    b->rays.origin_y[lane] = (float)(point[1] - (double)b->rays.slope_y[lane] * point[2]);
}

static void make_batch(batch *b, int type, shape s)
{
    *b = (batch){.type = type};
    b->beam = (kernel_beam){.spread = uniform(0, 1) < 0.3 ? 0 : (float)pow(10, uniform(-4, -1.5)), .offset = 0};
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        place_cell(b, s, lane);
        place_values(b, lane);
        aim(b, lane);
        b->beam.offset = fmaxf(b->beam.offset, fmaxf(fabsf(b->rays.origin_x[lane]), fabsf(b->rays.origin_y[lane])));
    }
}

/* ---- contraction ---- */

static void sight_of(const batch *b, const kernel_curved_batch_bounds *bounds, kernel_sight *out)
{
    vf origin[3], normal[3][3], gradient[3];
    for (int a = 0; a < 3; a++) {
        origin[a] = vf_load(b->at[a][0]);
        gradient[a] = vf_load(bounds->gradient[a]);
        for (int i = 0; i < 3; i++) normal[i][a] = vf_load(bounds->normal[i][a]);
    }
    kernel_sight_of(&b->rays, origin, (const vf(*)[3])normal, gradient, vf_load(bounds->level), out);
}

static void contraction_of(const kernel_contractions *c, kernel_contraction *out)
{
    for (int i = 0; i < 3; i++) out->offset[i] = vf_load(c->offset[i]);
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 3; i++) out->bent[k][i] = vf_load(c->bent[k][i]);
        out->field[k] = vf_load(c->field[k]);
    }
    out->middle = vf_load(c->middle);
    out->grow = vf_load(c->grow);
    out->blur = vf_load(c->blur);
    out->rim = vf_load(c->rim);
}

/* The batch's map, fitted a lane at a time. */
static void map_of(const batch *b, kernel_map_lanes *out)
{
    const int count = grid_type_vertices(b->type);
    out->is_pyramid = b->type == GRID_PYRAMID;
    out->tolerance = KERNEL_MAP_TOLERANCE;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        kernel_cell cell = {.type = b->type, .count = count};
        kernel_map map;
        for (int i = 0; i < count; i++) {
            cell.x[i] = b->at[0][i][lane];
            cell.y[i] = b->at[1][i][lane];
            cell.z[i] = b->at[2][i][lane];
            cell.f[i] = b->at[3][i][lane];
        }
        kernel_map_setup(&map, &cell);
        for (int n = 0; n < 4; n++)
            for (int i = 0; i < 8; i++) {
                vf *const c = n < 3 ? out->position[n] : out->field;
                c[i][lane] = n < 3 ? map.position[n].c[i] : map.field.c[i];
                out->exact[lane / KERNEL_HALF][n][i][lane % KERNEL_HALF] = map.exact[n][i];
            }
        for (int a = 0; a < 3; a++) out->origin[a][lane] = map.origin[a];
    }
}

static void contract(const batch *b, kernel_contracted *out, kernel_curved_batch_bounds *bounds)
{
    kernel_contraction c;
    kernel_sight ray;
    kernel_map_lanes map;
    kernel_point at;
    kernel_curved_batch_bound(b->type, b->at, &b->beam, bounds);
    sight_of(b, bounds, &ray);
    contraction_of(&bounds->contractions, &c);
    KERNEL_OF_TYPE(b->type, kernel_contract, &c, &ray, vm_all_lanes(), out);
    map_of(b, &map);
    at.t = out->t + vf_load(b->at[2][0]);
    memcpy(at.r, out->r, sizeof at.r);
    kernel_polish_near(&b->rays, &map, out->one, KERNEL_CONTRACTION_END, &at);
    out->t = at.t;
    memcpy(out->r, at.r, sizeof at.r);
}

/* ---- truth ---- */

static void reference_of(const batch *b, int lane, reference_cell *cell, reference_line *line, double values[8])
{
    *cell = (reference_cell){.type = b->type, .count = grid_type_vertices(b->type)};
    for (int i = 0; i < cell->count; i++) {
        values[i] = (double)b->at[3][i][lane];
        for (int a = 0; a < 3; a++) cell->world[i][a] = cell->position[i][a] = (double)b->at[a][i][lane];
    }
    *line = (reference_line){{(double)b->rays.origin_x[lane], (double)b->rays.origin_y[lane]},
                             {(double)b->rays.slope_x[lane], (double)b->rays.slope_y[lane]}};
}

typedef struct truth {
    const reference_cell *cell;
    const reference_line *line;
    const double *values;
    bool has_failed; /* the map could not be inverted somewhere, near a pyramid's apex: the ray is not judged */
    int roots;
    double t; /* of the last one */
} truth;

static double truth_at(truth *r, double t)
{
    const double point[3] = {r->line->base[0] + r->line->slope[0] * t, r->line->base[1] + r->line->slope[1] * t, t};
    double value;
    if (!reference_interpolate(r->cell, point, r->values, &value, NULL)) r->has_failed = true;
    return value;
}

static double truth_bisect(truth *r, double low, double high, bool rises)
{
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        if ((truth_at(r, middle) < 0) == rises)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

/* All roots in the cell. */
static void truth_find(truth *r)
{
    reference_crossing ends[REFERENCE_MAX_CROSSINGS];
    const int count = reference_crossings(r->cell, r->line, ends);
    for (int i = 0; i + 1 < count; i += 2) {
        const double low = ends[i].z, step = (ends[i + 1].z - low) / LOOKS;
        double before = truth_at(r, low);
        for (int n = 1; n <= LOOKS; n++) {
            const double now = truth_at(r, low + n * step);
            if ((now < 0) != (before < 0)) {
                r->roots++;
                r->t = truth_bisect(r, low + (n - 1) * step, low + n * step, before < 0);
            }
            before = now;
        }
    }
}

/* ---- the comparison ---- */

typedef struct count {
    int64_t rays, contracting, one, none, wrong, off, failed;
    double worst; /* depth, in bounds */
} count;

static double depth_bound(const batch *b, int lane, double t)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < grid_type_vertices(b->type); i++) {
        low = fmin(low, (double)b->at[2][i][lane]);
        high = fmax(high, (double)b->at[2][i][lane]);
    }
    return 6e-8 * fabs(t) + 1.8e-7 * (high - low);
}

static void judge(const batch *b, int lane, const kernel_contracted *at, count *n)
{
    reference_cell cell;
    reference_line line;
    double values[8];
    const bool one = vm_bits(at->one) >> lane & 1, none = vm_bits(at->none) >> lane & 1;
    n->rays++;
    n->one += one;
    n->none += none;
    if (!one && !none) return;
    reference_of(b, lane, &cell, &line, values);
    truth r = {.cell = &cell, .line = &line, .values = values};
    truth_find(&r);
    if (r.has_failed) {
        n->failed++;
        return;
    }
    n->wrong += (one && none) || r.roots != one;
    if (!one || r.roots != 1) return;
    const double off = fabs((double)at->t[lane] - r.t) / depth_bound(b, lane, r.t);
    n->worst = fmax(n->worst, off);
    n->off += !(off <= 1);
}

static void decided_crossings_are_right(void **state)
{
    (void)state;
    static const int types[3] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};
    static const char *const names[3] = {"hexes", "wedges", "pyramids"};
    int64_t decided = 0;
    for (int k = 0; k < 3; k++)
        for (shape s = 0; s < SHAPE_COUNT; s++) {
            count n = {.rays = 0};
            while (n.rays < rays_wanted / (3 * SHAPE_COUNT)) {
                batch b;
                kernel_curved_batch_bounds bounds;
                kernel_contracted at;
                make_batch(&b, types[k], s);
                contract(&b, &at, &bounds);
                for (int lane = 0; lane < SIMD_WIDTH; lane++) {
                    n.contracting += bounds.contractions.grow[lane] < INFINITY;
                    judge(&b, lane, &at, &n);
                }
            }
            printf("%s %s: %lld rays, %lld in cells that contract, %lld with one crossing, %lld with none, %lld wrong, "
                   "%lld off, at most %.2g of the bound\n",
                   shape_names[s], names[k], (long long)n.rays, (long long)n.contracting, (long long)n.one,
                   (long long)n.none, (long long)n.wrong, (long long)n.off, n.worst);
            decided += n.one + n.none;
            assert_true(n.failed <= n.rays / 1000);
            assert_int_equal(n.wrong, 0);
            assert_int_equal(n.off, 0);
            if (s <= BENT) assert_true(n.one > 0);
        }
    printf("%lld of %lld rays are decided\n", (long long)decided, (long long)rays_wanted);
    assert_true(decided > rays_wanted / 3);
}

/* The argument is the number of rays. */
int main(int argc, char **argv)
{
    if (argc > 1) rays_wanted = atoll(argv[1]);
    const struct CMUnitTest tests[] = {cmocka_unit_test(decided_crossings_are_right)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
