/* Checks the search for the single crossing of a ray by contraction (kernel_contraction.h) against brute force in
 * double. Cells are hexes, wedges and pyramids, from parallelepipeds to cells that are strongly bent, flat, tiny or far
 * from the origin, each with its own ray. The kernels' headers are compiled here for the scalar instruction set.
 *
 * Reference: reference_find_crossings() gives a ray's intervals in the cell. In each interval the field is sampled at
 * many depths; between two samples of different sign, bisection finds the root. If the kernel decides that there is one
 * crossing, there must be exactly one, at the same depth. If the kernel decides that there is none, there must be none.
 *
 * Depth: the last step of Newton's method begins at most KERNEL_CONTRACTION_END from the root, in the cell's
 * coordinates. The second derivative of f is at most about 4 K (the first derivative of the iteration is K at the
 * domain's corners, and 0 in the middle). So with K < 0.9 the error after the step is 2 K / (1 - K) (1e-4)^2 = 1.8e-7
 * of r, which is the same fraction of the cell's extent along the ray. t is rounded twice, each time by half a unit in
 * the last place.
 *
 * The test also checks quads of the same cells that kernel_curved_nonconvex_quads() classifies as convex along all rays
 * of a box. Seen along each of many rays in float32, all corners of such a quad must turn in one direction in double.
 * If the signs of the quad's edges are certain, its two triangles and its bilinear patch must give the same result for
 * the ray as the edges by themselves. */
#include "kernel_bounds.h"
#include "kernel_contraction.h"
#include "kernel_quad.h"
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

static double draw_uniform(double low, double high)
{
    return low + (high - low) * test_uniform(drawn_numbers++, 79);
}

typedef enum shape { AFFINE, JITTERED, BENT, FLAT, TINY, FAR, SHAPE_COUNT } shape;

static const char *const shape_names[SHAPE_COUNT] = {"affine", "jittered", "bent", "flat", "tiny", "far"};

/* One cell and one ray in each lane. at: coordinates x, y, z and values of the vertices. */
typedef struct batch {
    int type;
    float at[4][8][SIMD_WIDTH];
    kernel_rays rays;
    kernel_beam beam;
} batch;

/* ---- cells ---- */

static double choose_shape_size(shape s)
{
    return s == TINY ? 1e-4 : s == FAR ? 0.008 : pow(10, draw_uniform(-2.5, -0.5));
}

/* Computes the columns of a random rotation, scaled by the extents of the cell. */
static void make_random_axes(const double extent[3], double axes[3][3])
{
    double q[4], sum = 0;
    for (int i = 0; i < 4; i++) {
        q[i] = draw_uniform(-1, 1);
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

static void place_cell_vertices(batch *b, shape s, int lane)
{
    static const float apex[3] = {0.5f, 0.5f, 1};
    const double size = choose_shape_size(s), flat = s == FLAT ? pow(10, draw_uniform(-4, -1)) : 1;
    const double jitter = s == AFFINE || s == FLAT ? 0 : s == BENT ? draw_uniform(0.2, 0.5) : draw_uniform(0, 0.2);
    const double extent[3] = {size, size * draw_uniform(0.5, 1), size * flat};
    const double middle[3] = {draw_uniform(-0.02, 0.02), draw_uniform(-0.02, 0.02),
                              draw_uniform(-0.5, 0.5) * (s != TINY)};
    double axes[3][3];
    make_random_axes(extent, axes);
    for (int i = 0; i < grid_type_vertex_count(b->type); i++) {
        static const float base[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
        const float *corner = b->type != GRID_PYRAMID ? kernel_cell_shape(b->type)->corners[i]
                              : i == 4                ? apex
                                                      : base[i];
        double r[3];
        for (int k = 0; k < 3; k++) r[k] = (double)corner[k] - 0.5 + jitter * draw_uniform(-1, 1);
        for (int a = 0; a < 3; a++) {
            const double x = middle[a] + r[0] * axes[0][a] + r[1] * axes[1][a] + r[2] * axes[2][a];
            b->at[a][i][lane] = (float)x;
        }
    }
}

/* Sets values that are nearly linear or far from linear in the position. The values are relative to a random isovalue
 * within their range and scaled to a maximum of 1, as by kernel_cell_subtract_isovalue(). */
static void place_cell_values(batch *b, int lane)
{
    const int count = grid_type_vertex_count(b->type);
    const double noise = pow(10, draw_uniform(-3, 0.3)),
                 g[3] = {draw_uniform(-1, 1), draw_uniform(-1, 1), draw_uniform(-1, 1)};
    double v[8], low = INFINITY, high = -INFINITY, most = 0, size = 0;
    for (int i = 1; i < count; i++)
        for (int a = 0; a < 3; a++) size = fmax(size, fabs((double)(b->at[a][i][lane] - b->at[a][0][lane])));
    for (int i = 0; i < count; i++) {
        v[i] = noise * draw_uniform(-1, 1);
        for (int a = 0; a < 3; a++) v[i] += g[a] * ((double)b->at[a][i][lane] - (double)b->at[a][0][lane]) / size;
        low = fmin(low, v[i]);
        high = fmax(high, v[i]);
    }
    const double isovalue = draw_uniform(low, high);
    for (int i = 0; i < count; i++) most = fmax(most, fabs(v[i] -= isovalue));
    for (int i = 0; i < count; i++) b->at[3][i][lane] = (float)(v[i] / most);
}

/* Chooses a point in the bounding box of the vertices, or slightly outside it. */
static void choose_point_near_cell(const batch *b, int lane, double point[3])
{
    for (int a = 0; a < 3; a++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < grid_type_vertex_count(b->type); i++) {
            low = fmin(low, (double)b->at[a][i][lane]);
            high = fmax(high, (double)b->at[a][i][lane]);
        }
        point[a] = low + (high - low) * draw_uniform(-0.1, 1.1);
    }
}

/* Makes a ray of the beam through a random point near the cell. */
static void aim_ray(batch *b, int lane)
{
    double point[3];
    choose_point_near_cell(b, lane, point);
    b->rays.slope_x[lane] = (float)(draw_uniform(-1, 1) * (double)b->beam.spread);
    b->rays.slope_y[lane] = (float)(draw_uniform(-1, 1) * (double)b->beam.spread);
    b->rays.origin_x[lane] = (float)(point[0] - (double)b->rays.slope_x[lane] * point[2]);
    b->rays.origin_y[lane] = (float)(point[1] - (double)b->rays.slope_y[lane] * point[2]);
}

static void make_batch(batch *b, int type, shape s)
{
    *b = (batch){.type = type};
    b->beam =
        (kernel_beam){.spread = draw_uniform(0, 1) < 0.3 ? 0 : (float)pow(10, draw_uniform(-4, -1.5)), .offset = 0};
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        place_cell_vertices(b, s, lane);
        place_cell_values(b, lane);
        aim_ray(b, lane);
        b->beam.offset = fmaxf(b->beam.offset, fmaxf(fabsf(b->rays.origin_x[lane]), fabsf(b->rays.origin_y[lane])));
    }
}

/* ---- contraction ---- */

static void run_contraction(batch *b, kernel_point *out, vm *none, kernel_bounds *bounds)
{
    const kernel_curved cells = {.type = b->type, .at = b->at, .bounds = bounds};
    int32_t own[SIMD_WIDTH];
    vi lanes;
    kernel_contraction c;
    kernel_map map;
    for (int lane = 0; lane < SIMD_WIDTH; lane++) own[lane] = lane;
    memcpy(&lanes, own, sizeof lanes);
    kernel_compute_bounds_of_cells(b->type, (const float(*)[8][SIMD_WIDTH])b->at, &b->beam, bounds);
    kernel_contraction_set_ray(&cells, &b->rays, lanes, &c);
    kernel_contraction_set_cell(bounds, lanes, b->type, &c);
    KERNEL_OF_TYPE(b->type, kernel_find_only_root_by_contraction, &c, vm_all_lanes(), out, none);
    kernel_compute_maps((const float(*)[8][SIMD_WIDTH])b->at, lanes, b->type, &map);
    out->t += vf_load(b->at[2][0]);
    kernel_refine_accurate_roots(&b->rays, &map, out->mask, out);
}

/* ---- reference ---- */

static void make_reference_cell(const batch *b, int lane, reference_cell *cell, reference_line *line, double values[8])
{
    *cell = (reference_cell){.type = b->type, .count = grid_type_vertex_count(b->type)};
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
    /* whether the map could not be inverted at some depth, near a pyramid's apex; such a ray is not compared */
    bool has_failed;
    int roots;
    double t; /* depth of the root found most recently */
} truth;

static double evaluate_reference(truth *r, double t)
{
    const double point[3] = {r->line->base[0] + r->line->slope[0] * t, r->line->base[1] + r->line->slope[1] * t, t};
    double value;
    if (!reference_interpolate(r->cell, point, r->values, &value, NULL)) r->has_failed = true;
    return value;
}

static double bisect_reference_root(truth *r, double low, double high, bool rises)
{
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        if ((evaluate_reference(r, middle) < 0) == rises)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

/* Finds all roots of the field on the ray in the cell. */
static void find_reference_roots(truth *r)
{
    reference_crossing ends[REFERENCE_MAX_CROSSINGS];
    const int count = reference_find_crossings(r->cell, r->line, ends);
    for (int i = 0; i + 1 < count; i += 2) {
        const double low = ends[i].z, step = (ends[i + 1].z - low) / LOOKS;
        double before = evaluate_reference(r, low);
        for (int n = 1; n <= LOOKS; n++) {
            const double now = evaluate_reference(r, low + n * step);
            if ((now < 0) != (before < 0)) {
                r->roots++;
                r->t = bisect_reference_root(r, low + (n - 1) * step, low + n * step, before < 0);
            }
            before = now;
        }
    }
}

/* ---- comparison of the kernel with the reference ---- */

typedef struct count {
    int64_t rays, contracting, one, none, wrong, off, failed;
    double worst; /* largest error of depth, divided by its bound */
} count;

static double compute_depth_bound(const batch *b, int lane, double t)
{
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < grid_type_vertex_count(b->type); i++) {
        low = fmin(low, (double)b->at[2][i][lane]);
        high = fmax(high, (double)b->at[2][i][lane]);
    }
    return 6e-8 * fabs(t) + 1.8e-7 * (high - low);
}

static void verify_ray(const batch *b, int lane, const kernel_point *at, vm without, count *n)
{
    reference_cell cell;
    reference_line line;
    double values[8];
    const bool one = vm_bits(at->mask) >> lane & 1, none = vm_bits(without) >> lane & 1;
    n->rays++;
    n->one += one;
    n->none += none;
    if (!one && !none) return;
    make_reference_cell(b, lane, &cell, &line, values);
    truth r = {.cell = &cell, .line = &line, .values = values};
    find_reference_roots(&r);
    if (r.has_failed) {
        n->failed++;
        return;
    }
    n->wrong += (one && none) || r.roots != one;
    if (!one || r.roots != 1) return;
    const double off = fabs((double)at->t[lane] - r.t) / compute_depth_bound(b, lane, r.t);
    n->worst = fmax(n->worst, off);
    n->off += !(off <= 1);
}

static void decided_crossings_match_the_reference(void **state)
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
                kernel_bounds bounds;
                kernel_point at;
                vm none;
                make_batch(&b, types[k], s);
                run_contraction(&b, &at, &none, &bounds);
                for (int lane = 0; lane < SIMD_WIDTH; lane++) {
                    n.contracting += bounds.error_growth[lane] < INFINITY;
                    verify_ray(&b, lane, &at, none, &n);
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

/* ---- quads that look convex ---- */

enum { BOX_RAYS = 12 };

typedef struct quad_counts {
    int64_t quads, convex, turned, wrong; /* counts of quads; each quad counts one time for each ray */
} quad_counts;

/* Computes slopes of a direction along which three consecutive vertices of a random quad are seen nearly collinear.
 * Returns false if the random face is a triangle or the slopes are not small. */
static bool aim_along_grazed_edge(const batch *b, int lane, double slope[2])
{
    const kernel_shape *shape = kernel_cell_shape(b->type);
    const int face = (int)draw_uniform(0, shape->face_count), first = (int)draw_uniform(0, 4);
    const signed char *loop = shape->faces[face].vertices;
    double edge[2][3], normal[3];
    if (shape->faces[face].count == 3) return false;
    for (int i = 0; i < 2; i++)
        for (int a = 0; a < 3; a++)
            edge[i][a] = (double)b->at[a][(int)loop[(first + i + 1) & 3]][lane] -
                         (double)b->at[a][(int)loop[(first + i) & 3]][lane];
    for (int a = 0; a < 3; a++)
        normal[a] = edge[0][(a + 1) % 3] * edge[1][(a + 2) % 3] - edge[0][(a + 2) % 3] * edge[1][(a + 1) % 3];
    const int own = fabs(normal[1]) > fabs(normal[0]), other = !own;
    slope[other] = draw_uniform(-1, 1);
    slope[own] =
        -(normal[2] + slope[other] * normal[other]) / normal[own] + pow(10, draw_uniform(-8, -2)) * draw_uniform(-1, 1);
    return fabs(slope[own]) < 1;
}

/* Makes rays whose slopes lie in a box, eight of them at its corners, and computes the bounds of their slopes and
 * origins. */
static void aim_box(batch *b, kernel_rays rays[BOX_RAYS], vf slope[2][2], vf origin[2][2])
{
    double middle[SIMD_WIDTH][2], half[SIMD_WIDTH];
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        const bool grazes = draw_uniform(0, 1) < 0.7 && aim_along_grazed_edge(b, lane, middle[lane]);
        if (!grazes) middle[lane][0] = middle[lane][1] = 0;
        half[lane] = !grazes ? (double)b->beam.spread : draw_uniform(0, 1) < 0.7 ? 0 : pow(10, draw_uniform(-8, -2));
    }
    for (int a = 0; a < 2; a++)
        for (int end = 0; end < 2; end++) slope[a][end] = origin[a][end] = vf_set(end ? -INFINITY : INFINITY);
    for (int n = 0; n < BOX_RAYS; n++) {
        vf own[2][2];
        for (int lane = 0; lane < SIMD_WIDTH; lane++) {
            double point[3];
            choose_point_near_cell(b, lane, point);
            for (int a = 0; a < 2; a++) {
                const double at = n >= 8 ? draw_uniform(-1, 1) : n >> a & 1 ? 1 : -1;
                own[0][a][lane] = (float)(middle[lane][a] + at * half[lane]);
                own[1][a][lane] = (float)(point[a] - (double)own[0][a][lane] * point[2]);
            }
        }
        rays[n] = (kernel_rays){own[1][0], own[1][1], own[0][0], own[0][1]};
        for (int a = 0; a < 2; a++) {
            slope[a][0] = vf_min(own[0][a], slope[a][0]);
            slope[a][1] = vf_max(own[0][a], slope[a][1]);
            origin[a][0] = vf_min(own[1][a], origin[a][0]);
            origin[a][1] = vf_max(own[1][a], origin[a][1]);
        }
    }
}

static bool is_convex_loop(const vf x[8], const vf y[8], const signed char *loop, int lane)
{
    int left = 0, right = 0;
    for (int i = 0; i < 4; i++) {
        const int a = loop[i], b = loop[(i + 1) & 3], c = loop[(i + 2) & 3];
        const double px = (double)x[b][lane] - (double)x[a][lane], py = (double)y[b][lane] - (double)y[a][lane];
        const double qx = (double)x[c][lane] - (double)x[b][lane], qy = (double)y[c][lane] - (double)y[b][lane];
        left += px * qy - py * qx > 0;
        right += px * qy - py * qx < 0;
    }
    return left == 4 || right == 4;
}

static vi evaluate_edge(const vf x[8], const vf y[8], int a, int b, vf *least)
{
    const vf e = vf_diff_of_products(x[a], y[b], x[b], y[a]);
    *least = vf_min(vf_abs(e), *least);
    return vi_from_bits(e);
}

/* Returns the rays on which the signs of all edges of the quad are certain but give another result than the quad's
 * triangles and patch. */
static vm find_wrong_quads(const vf x[8], const vf y[8], const signed char *loop)
{
    vf least = vf_set(INFINITY);
    vi around[4];
    vm side[4];
    for (int i = 0; i < 4; i++) {
        around[i] = evaluate_edge(x, y, loop[i], loop[(i + 1) & 3], &least);
        side[i] = vm_sign(around[i]);
    }
    const vm once =
        kernel_find_rays_crossing_one_triangle(side, vm_sign(evaluate_edge(x, y, loop[0], loop[2], &least)));
    const vm known = vf_lt(vf_set(KERNEL_EDGE_LEAST), least);
    const vm bends = kernel_curved_may_cross_twice(x, y, loop, vm_all_lanes(), side);
    return vm_and(known, vm_or(vm_xor(once, vm_sign(kernel_are_on_same_side_of_edges(around, 4))), bends));
}

static void verify_quads(const batch *b, const kernel_rays *rays, vi dents, quad_counts *n)
{
    const kernel_shape *shape = kernel_cell_shape(b->type);
    vf x[8], y[8];
    for (int i = 0; i < grid_type_vertex_count(b->type); i++) {
        const vf z = vf_load(b->at[2][i]);
        x[i] = (vf_load(b->at[0][i]) - rays->origin_x) - rays->slope_x * z;
        y[i] = (vf_load(b->at[1][i]) - rays->origin_y) - rays->slope_y * z;
    }
    for (int face = 0; face < shape->face_count; face++) {
        const signed char *loop = shape->faces[face].vertices;
        if (shape->faces[face].count == 3) continue;
        const unsigned wrong = vm_bits(find_wrong_quads(x, y, loop));
        for (int lane = 0; lane < SIMD_WIDTH; lane++) {
            n->quads++;
            if (dents[lane] >> face & 1) continue;
            n->convex++;
            n->turned += !is_convex_loop(x, y, loop, lane);
            n->wrong += wrong >> lane & 1;
        }
    }
}

static void quads_classified_as_convex_are_convex(void **state)
{
    (void)state;
    static const int types[3] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};
    for (int k = 0; k < 3; k++)
        for (shape s = 0; s < SHAPE_COUNT; s++) {
            quad_counts n = {.quads = 0};
            while (n.quads < 4 * rays_wanted) {
                batch b;
                kernel_rays rays[BOX_RAYS];
                vf at[3][8], slope[2][2], origin[2][2];
                make_batch(&b, types[k], s);
                aim_box(&b, rays, slope, origin);
                for (int a = 0; a < 3; a++)
                    for (int i = 0; i < 8; i++) at[a][i] = vf_load(b.at[a][i]);
                const vi dents = kernel_curved_nonconvex_quads(at, slope, origin, types[k]);
                for (int i = 0; i < BOX_RAYS; i++) verify_quads(&b, &rays[i], dents, &n);
            }
            printf("%s: of %lld quads seen %lld look convex, %lld do not, %lld are wrong\n", shape_names[s],
                   (long long)n.quads, (long long)n.convex, (long long)n.turned, (long long)n.wrong);
            assert_int_equal(n.turned, 0);
            assert_int_equal(n.wrong, 0);
            if (s <= JITTERED) assert_true(n.convex > n.quads / 2);
        }
}

/* The command's argument is the number of rays to trace. */
int main(int argc, char **argv)
{
    if (argc > 1) rays_wanted = atoll(argv[1]);
    const struct CMUnitTest tests[] = {cmocka_unit_test(decided_crossings_match_the_reference),
                                       cmocka_unit_test(quads_classified_as_convex_are_convex)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
