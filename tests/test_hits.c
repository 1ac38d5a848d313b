/* Checks the positions and normals of hits that the robust root finder computes in whole frames: on warped lattices of
 * hexes, wedges and pyramids, in ill-shaped single cells, and against closed forms. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double three_values[3] = {-0.6, 0.3, 0.95};
static const double depth_allowed = 1e-5; /* largest error of depth, in cells */
static const test_mesh_kind kinds[4] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_TETS};

/* Counts and largest errors over the rays and hits of a test. */
typedef struct tally {
    bool is_opaque; /* set if only the first hit of each ray is drawn */
    int64_t rays, hits, excluded, folded, different, beyond, tangent;
    /* residual: largest residual of a hit; depth: largest error of depth in cells, minus what an error of the field of
     * 1e-6 explains */
    double residual, depth;
    double raw;   /* largest error of depth of hits that are not tangent, in cells */
    double moved; /* largest error of depth of all hits, relative to compute_depth_uncertainty() */
} tally;

static int list_hits(const drawn_frame *drawn, int64_t pixel, const fragment *hits[REFERENCE_MAX_HITS])
{
    int count = 0;
    for (int64_t i = drawn->first[pixel]; i < drawn->first[pixel + 1] && count < REFERENCE_MAX_HITS; i++)
        if (drawn->list.items[i].kind >= FRAGMENT_SURFACE) hits[count++] = &drawn->list.items[i];
    return count;
}

/* Returns the residual (the field minus the isovalue, relative to the cell's range) that is allowed at a hit. t in
 * float32 has an error of half a unit in the last place of 1 in scaled units, and so has the depth of each vertex. The
 * field's slope turns these errors into values. */
static double compute_allowed_residual(const render_fixture *f, double slope)
{
    return 1e-6 + (3e-8 + 3e-8) / f->job.space.scale * fabs(slope);
}

/* Returns the distance in cells by which float32 may move a hit along its ray. Along the ray, t and the cell's vertices
 * each have an error of half a unit in the last place of 1 in scaled units, 3e-8. Across the ray, a vertex has an error
 * of 3e-8 along both axes, 4.2e-8 together, which the angle between ray and surface turns into depth. The field has an
 * error of half a unit in the last place of its values and as much in their sum, 6e-8 of their range, which the slope
 * turns into depth. */
static double compute_depth_uncertainty(const render_fixture *f, const reference_hit *truth, double slope)
{
    const double scaled_cell = f->cell_size * f->job.space.scale;
    return (6e-8 + 4.2e-8 * truth->conditioning) / scaled_cell + 6e-8 / (fabs(slope) * f->cell_size);
}

/* Checks that a hit is within 1e-5 cells of the reference. Rays that are so nearly tangent to the surface that rounding
 * may move the hit farther are only counted; this happens if the slope of the field is below about 0.03 ranges per
 * cell. */
static void verify_depth(const render_fixture *f, const reference_hit *truth, double depth, double slope, tally *t)
{
    const double off = fabs(depth - truth->depth) / f->cell_size, moved = compute_depth_uncertainty(f, truth, slope);
    t->moved = fmax(t->moved, off / moved);
    if (moved > depth_allowed)
        t->tangent++;
    else
        t->raw = fmax(t->raw, off);
}

static void verify_hit(const render_fixture *f, const reference_scene *scene, int x, int y, const reference_hit *truth,
                       const fragment *hit, tally *t)
{
    double slope;
    const double depth = fixture_compute_scene_depth(f, hit->t_in);
    const double residual = fabs(reference_compute_residual(scene, x, y, truth, depth, &slope, NULL));
    t->hits++;
    t->beyond += residual > 1e-6;
    t->residual = fmax(t->residual, residual - compute_allowed_residual(f, slope) + 1e-6);
    /* Error of depth that an error of the field of 1e-6 ranges causes at this slope. */
    const double grazing = 1e-6 / fabs(slope) / f->cell_size;
    t->depth = fmax(t->depth, fabs(depth - truth->depth) / f->cell_size - grazing);
    verify_depth(f, truth, depth, slope, t);
}

static void verify_ray(const render_fixture *f, const drawn_frame *drawn, const reference_scene *scene, int x, int y,
                       double margin, tally *t)
{
    const fragment *hits[REFERENCE_MAX_HITS];
    reference_ray ray;
    reference_trace(scene, x, y, fixture_background, &ray);
    t->rays++;
    if (ray.edge_margin < margin || ray.value_margin < margin || ray.eye_margin < margin) {
        t->excluded++;
        return;
    }
    if (ray.ambiguous || ray.map_failed) {
        t->folded++;
        return;
    }
    const int count = list_hits(drawn, (int64_t)y * f->job.camera.width + x, hits);
    if (t->is_opaque && ray.hit_count > 1) ray.hit_count = 1;
    bool same = count == ray.hit_count;
    for (int i = 0; same && i < count; i++) same = hits[i]->kind - FRAGMENT_SURFACE == (uint32_t)ray.hits[i].surface;
    if (!same) {
        t->different++;
        fprintf(stderr, "pixel %d, %d: %d hits, reference %d\n", x, y, count, ray.hit_count);
        return;
    }
    for (int i = 0; i < count; i++) verify_hit(f, scene, x, y, &ray.hits[i], hits[i], t);
}

static void verify_frame(const render_fixture *f, double margin, tally *t)
{
    drawn_frame drawn;
    reference_scene *scene = reference_create(&f->job);
    fixture_draw(f, &drawn);
    for (int y = 0; y < f->job.camera.height; y++)
        for (int x = 0; x < f->job.camera.width; x++) verify_ray(f, &drawn, scene, x, y, margin, t);
    reference_free(scene);
    drawn_frame_free(&drawn);
}

static void print_tally(const char *what, const tally *t)
{
    printf("%s: %d rays, %d hits, %d excluded, %d folded, %d different; residual %.2g (%d beyond 1e-6), depth off by "
           "%.2g cells, %.2g of what rounding may, %d tangent\n",
           what, (int)t->rays, (int)t->hits, (int)t->excluded, (int)t->folded, (int)t->different, t->residual,
           (int)t->beyond, t->raw, t->moved, (int)t->tangent);
}

/* Adds 16 surfaces, to have many silhouettes, where rays meet a surface twice at nearly the same depth. */
static void add_many_surfaces(render_fixture *f)
{
    static const float black[48];
    static double values[16];
    for (int i = 0; i < 16; i++) values[i] = -1.17 + 0.171 * i;
    fixture_add_surface(f, values, 16, 0.4f);
    f->surfaces[0].colours = black;
}

static void add_robust_surface(render_fixture *f, float opacity)
{
    fixture_add_surface(f, three_values, 3, opacity);
}

/* Checks that at most 0.2 % of the rays are excluded because rounding could change their result, the same fraction as
 * in test_render_fixture.c. Checks that no cell is folded: the lattices are jittered by 0.2, so that corners stay on
 * their side of the opposite faces. */
static void assert_few_excluded(const tally *t)
{
    if (500 * t->excluded > t->rays) fail_msg("%d of %d rays excluded", (int)t->excluded, (int)t->rays);
    assert_int_equal(t->folded, 0);
}

/* Checks the errors of depth. At most one hit in `one_in` may be tangent. */
static void assert_depths(const tally *t, int64_t one_in)
{
    assert_true(t->depth <= depth_allowed);
    if (!(t->raw <= depth_allowed && t->moved <= 1))
        fail_msg("depths off by %g cells, %g of what rounding may", t->raw, t->moved);
    if (one_in * t->tangent > t->hits) fail_msg("%d of %d hits tangent", (int)t->tangent, (int)t->hits);
}

static void robust_hits_are_on_the_surface(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++) {
            render_fixture f;
            tally t = {.rays = 0};
            /* the usual run draws every second camera for each kind of cell */
            if (!test_is_long_run() && (k + (int)camera) % 2) continue;
            fixture_create_lattice(&f, kinds[k], kinds[k] == TEST_PYRAMIDS ? 3 : 4, 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 53, 45);
            add_robust_surface(
                &f, 0.4f); /* surfaces are transparent, so that all crossings are drawn, not only the first */
            verify_frame(&f, 1e-6, &t);
            print_tally(test_mesh_kind_name(kinds[k]), &t);
            assert_true(t.hits > 600);
            assert_int_equal(t.different, 0);
            assert_depths(&t, 250);
            assert_true(t.residual <= 1e-6);
            assert_few_excluded(&t);
            fixture_free(&f);
        }
}

/* ---- cuboids ---- */

/* Makes a mesh of cuboids, or of cuboids, wedges, pyramids and tets, between planes at uneven distances; some distances
 * are a thousandth of others. If `random` is set, the value of each vertex is random, so that many rays meet a surface
 * twice or three times in a cell. */
static void make_cuboids(test_mesh_kind kind, bool random, uint64_t seed, test_mesh *out)
{
    static const double planes[5] = {-1, -0.3, -0.2995, 0.4, 1};
    test_mesh_make_lattice(kind, 4, 0, test_wave_field, out);
    for (int64_t v = 0; v < out->vertex_count; v++) {
        for (int a = 0; a < 3; a++) {
            double *x = &out->coordinates[3 * v + a];
            const int i = (int)fmin(2 * (*x + 1), 3);
            *x = planes[i] + (2 * (*x + 1) - i) * (planes[i + 1] - planes[i]);
            *x = *x * (1 - 0.1 * a) + 0.001 * a;
        }
        out->values[v] = random ? 2 * test_uniform((uint64_t)v, seed) - 1 : test_wave_field(out->coordinates + 3 * v);
    }
}

static void verify_cuboids(test_mesh_kind kind, bool random, tally *t)
{
    for (uint64_t seed = 0; seed < (test_is_long_run() ? 12 : 3); seed++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++) {
            const test_layout layout = {.wide_coordinates = seed % 2, .wide_values = seed % 3 == 0};
            test_mesh mesh;
            render_fixture f;
            make_cuboids(kind, random, seed, &mesh);
            fixture_create(&f, &mesh, 1, layout, 0.5, 1, (const double[]){0, 0, 0});
            fixture_set_camera(&f, camera, 53, 45);
            fixture_add_surface(&f, &three_values[seed % 3], 1, 1);
            verify_frame(&f, 1e-6, t);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
}

/* Checks opaque surfaces in cuboids, for which the kernels have special code (kernel_cuboids.h). */
static void opaque_hits_in_cuboids_match_the_reference(void **state)
{
    (void)state;
    for (int turn = 0; turn < 4; turn++) {
        const test_mesh_kind kind = turn / 2 ? TEST_MIXED : TEST_HEXES;
        const bool random = turn % 2;
        tally t = {.is_opaque = true};
        verify_cuboids(kind, random, &t);
        printf("%s values, ", random ? "random" : "smooth");
        print_tally(test_mesh_kind_name(kind), &t);
        assert_true(t.hits > 3500);
        assert_int_equal(t.different, 0);
        assert_depths(&t, 250);
        /* With random values the residual is not checked: across thin cells, values change so fast that the rounding of
         * a vertex changes them by up to 1e-3. */
        if (turn == 0) assert_true(t.residual <= 1e-6);
        assert_few_excluded(&t);
    }
}

/* ---- ill-shaped cells ---- */

typedef enum ill_shaped {
    ILL_SHAPED_WARPED,
    ILL_SHAPED_CONCAVE,
    ILL_SHAPED_WEDGE,
    ILL_SHAPED_APEX,
    ILL_SHAPED_COUNT
} ill_shaped;

static void make_ill_shaped(ill_shaped kind, uint64_t seed, test_mesh *out)
{
    static const test_cell_shape shapes[ILL_SHAPED_COUNT] = {TEST_UNIT_HEX, TEST_UNIT_HEX, TEST_UNIT_WEDGE,
                                                             TEST_UNIT_PYRAMID};
    test_mesh_make_single_cell(shapes[kind], test_linear_field, out);
    for (uint64_t i = 0; i < (uint64_t)out->vertex_count; i++) {
        double *p = out->coordinates + 3 * i;
        const double amount = kind == ILL_SHAPED_WARPED || kind == ILL_SHAPED_APEX ? 0.2 : 0.1;
        for (uint64_t a = 0; a < 3; a++) p[a] += test_uniform_between(3 * i + a, seed, -amount, amount);
        out->values[i] = test_uniform_between(i, seed + 1000, -1, 1.5);
        /* Moves a corner inwards almost into the plane of its three neighbours, which dents the three faces at the
         * corner. Beyond this plane the hex's map would fold, and a point would have several values. */
        if (kind == ILL_SHAPED_CONCAVE && i == 6)
            for (uint64_t a = 0; a < 3; a++) p[a] = test_uniform_between(a, seed + 2000, 0.24, 0.3);
        if (kind == ILL_SHAPED_WEDGE && i >= 3) {
            const double angle = test_uniform_between(0, seed + 3000, -0.8, 0.8), x = p[0], y = p[1];
            p[0] = cos(angle) * x - sin(angle) * y;
            p[1] = sin(angle) * x + cos(angle) * y;
        }
    }
}

static void robust_hits_in_ill_shaped_cells_match_the_reference(void **state)
{
    (void)state;
    static const char *const names[ILL_SHAPED_COUNT] = {"warped hexes", "concave hexes", "twisted wedges",
                                                        "pyramid apexes"};
    for (ill_shaped kind = 0; kind < ILL_SHAPED_COUNT; kind++) {
        tally t = {.rays = 0};
        for (uint64_t seed = 0; seed < 24; seed++) {
            test_mesh mesh;
            render_fixture f;
            make_ill_shaped(kind, seed, &mesh);
            fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                           (const double[]){0, 0, 0});
            fixture_set_camera(&f, seed % 2 ? CAMERA_ORTHOGRAPHIC : CAMERA_OUTSIDE, 31, 29);
            /* The camera is close to the apex, so that the cell near the apex fills the picture's middle. */
            if (kind == ILL_SHAPED_APEX)
                assert_true(render_camera_look_at(&f.job.camera, (const double[]){2.4, 1.6, 3.0},
                                                  mesh.coordinates + 3 * 4, (const double[]){0, 1, 0}, 2, 31, 29));
            add_many_surfaces(&f);
            verify_frame(&f, 1e-6, &t);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
        print_tally(names[kind], &t);
        assert_few_excluded(&t);
        assert_true(t.hits > 800);
        assert_int_equal(t.different, 0);
        assert_depths(&t, 1000);
        assert_true(t.residual <= 1e-6);
    }
}

/* ---- normals ---- */

/* Sets white diffuse surfaces and a red, a green and a blue light from three sides of the eye. The colour of a hit is
 * then its normal in the axes of the lights, without negative components. */
static void set_axis_lights(render_fixture *f, render_light lights[3])
{
    static const float white[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    const double inner = sqrt(1.0 / 3), outer = sqrt(2.0 / 3);
    for (int i = 0; i < 3; i++) {
        const double angle = i * 2 * 3.14159265358979323846 / 3;
        lights[i] = (render_light){.colour = {i == 0, i == 1, i == 2}};
        for (int a = 0; a < 3; a++) {
            const double side = cos(angle) * f->job.camera.right[a] + sin(angle) * f->job.camera.up[a];
            lights[i].direction[a] = outer * side - inner * f->job.camera.forward[a];
        }
    }
    f->job.lights = lights;
    f->job.light_count = 3;
    f->surfaces[0].colours = white;
    f->surfaces[0].material = (render_material){.ambient = 0, .diffuse = 1, .specular = 0, .shininess = 1};
}

/* Returns the largest difference between the fragment's colour and the colour that the gradient's direction, oriented
 * towards the eye, has in these lights. */
static double compute_normal_error(const render_fixture *f, const fragment *hit, const double gradient[3])
{
    const int width = f->job.camera.width;
    double base[3], direction[3], length = 0, facing = 0, off = 0;
    render_camera_ray(&f->job.camera, (int)hit->pixel % width, (int)hit->pixel / width, base, direction);
    for (int a = 0; a < 3; a++) {
        length += gradient[a] * gradient[a];
        facing += gradient[a] * direction[a];
    }
    length = facing > 0 ? -sqrt(length) : sqrt(length);
    for (int i = 0; i < 3; i++) {
        double shade = 0;
        for (int a = 0; a < 3; a++) shade += f->job.lights[i].direction[a] * gradient[a] / length;
        off = fmax(off, fabs((double)hit->colour[i] - (double)f->surfaces[0].opacity * fmax(shade, 0)));
    }
    return off;
}

/* Compares the normal of a hit with the field's gradient. The kernels compute the gradient from differences of float32
 * values and positions. Each has an error of half a unit in the last place, 6e-8 of the cell's range and size. Eight
 * such errors and the cell's distortion make 2e-6 of range / size, relative to the gradient's length. The position has
 * an error of 1e-6 cells, and second derivatives of one or two ranges turn it into an equal error of the gradient. If
 * the surface is seen edge-on, either side may face the eye. */
static void verify_normal(const render_fixture *f, const reference_scene *scene, const reference_hit *truth,
                          const fragment *hit, int64_t *checked)
{
    const int x = (int)hit->pixel % f->job.camera.width, y = (int)hit->pixel / f->job.camera.width;
    double slope, gradient[3];
    reference_compute_residual(scene, x, y, truth, fixture_compute_scene_depth(f, hit->t_in), &slope, gradient);
    const double length = sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]);
    if (fabs(slope) < 1e-4 * length) return;
    const double off = compute_normal_error(f, hit, gradient), allowed = 4e-6 / (length * f->cell_size) + 1e-6;
    if (!(off <= allowed)) fail_msg("pixel %d, %d: normal off by %g, allowed %g", x, y, off, allowed);
    ++*checked;
}

static void cell_gradients_match_the_reference(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++) {
        render_fixture f;
        drawn_frame drawn;
        render_light lights[3];
        int64_t checked = 0, rays = 0, left_out = 0;
        fixture_create_lattice(&f, kinds[k], 3, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 43, 37);
        add_robust_surface(&f, 0.5f);
        set_axis_lights(&f, lights);
        fixture_draw(&f, &drawn);
        reference_scene *scene = reference_create(&f.job);
        for (int p = 0; p < 43 * 37; p++) {
            const fragment *hits[REFERENCE_MAX_HITS];
            reference_ray ray;
            reference_trace(scene, p % 43, p / 43, fixture_background, &ray);
            const int count = list_hits(&drawn, p, hits);
            rays++;
            if (ray.ambiguous || ray.edge_margin < 1e-6 || ray.value_margin < 1e-6) {
                left_out++;
                continue;
            }
            assert_int_equal(count, ray.hit_count);
            for (int i = 0; i < count; i++) verify_normal(&f, scene, &ray.hits[i], hits[i], &checked);
        }
        printf("%s: %d normals, %d of %d rays left out\n", test_mesh_kind_name(kinds[k]), (int)checked, (int)left_out,
               (int)rays);
        assert_true(checked > 300);
        assert_true(500 * left_out <= rays);
        reference_free(scene);
        drawn_frame_free(&drawn);
        fixture_free(&f);
    }
}

static void add_differences(render_fixture *f, const double *values, int count, float opacity, double difference,
                            render_light lights[3])
{
    fixture_add_surface(f, values, count, opacity);
    f->surfaces[0].normal = RENDER_DIFFERENCES;
    f->surfaces[0].difference = difference;
    set_axis_lights(f, lights);
}

/* Checks normals by central differences of a linear field. Isoparametric cells represent it exactly, so all
 * differences, including one-sided ones at the border, give its gradient. A sample has an error of about 5e-7 of the
 * field's range of 3. A difference over half a cell, whose size is 2/3, at a slope of 0.9, therefore has an error of
 * about 1e-5 of the slope. Within half a cell of warped faces, a polyhedron's field is continued outside of its tets,
 * where it is linear too. */
static void differences_of_a_linear_field_are_exact(void **state)
{
    (void)state;
    static const double values[3] = {-0.6, 0.1, 0.5}, gradient[3] = {0.3, -0.7, 0.5};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++)
            for (int opaque = 0; opaque < 2; opaque++) {
                render_fixture f;
                drawn_frame drawn;
                render_light lights[3];
                double worst = 0;
                fixture_create_lattice(&f, kind, 3, 0.2, test_linear_field);
                fixture_set_camera(&f, camera, 35, 31);
                add_differences(&f, values, 3, opaque ? 1 : 0.5f, 0.5, lights);
                fixture_draw(&f, &drawn);
                for (int64_t i = 0; i < drawn.list.count; i++)
                    worst = test_larger_error(worst, compute_normal_error(&f, &drawn.list.items[i], gradient));
                assert_true(drawn.list.count > 100);
                if (!(worst <= 2e-5)) fail_msg("%s: normal off by %g", test_mesh_kind_name(kind), worst);
                drawn_frame_free(&drawn);
                fixture_free(&f);
            }
}

static double quadratic_field(const double p[3])
{
    return p[0] * p[0] + 0.5 * p[1] * p[1] + 0.7 * p[2] * p[2] + 0.3 * p[0] * p[1];
}

/* Returns the mean error of normals, compared with the exact gradient of the quadratic field at the hit. */
static double measure_quadratic_error(int n, render_normal normal, double difference)
{
    static const double value[1] = {0.3};
    render_fixture f;
    drawn_frame drawn;
    render_light lights[3];
    double sum = 0;
    fixture_create_lattice(&f, TEST_HEXES, n, 0, quadratic_field);
    fixture_set_camera(&f, CAMERA_OUTSIDE, 64, 64);
    add_differences(&f, value, 1, 1, difference, lights);
    f.surfaces[0].normal = normal;
    fixture_draw(&f, &drawn);
    for (int64_t i = 0; i < drawn.list.count; i++) {
        const fragment *hit = &drawn.list.items[i];
        double base[3], d[3], p[3];
        render_camera_ray(&f.job.camera, (int)hit->pixel % 64, (int)hit->pixel / 64, base, d);
        for (int a = 0; a < 3; a++) p[a] = base[a] + fixture_compute_scene_depth(&f, hit->t_in) * d[a];
        sum += compute_normal_error(&f, hit, (const double[]){2 * p[0] + 0.3 * p[1], p[1] + 0.3 * p[0], 1.4 * p[2]});
    }
    assert_true(drawn.list.count > 300);
    sum /= (double)drawn.list.count;
    drawn_frame_free(&drawn);
    fixture_free(&f);
    return sum;
}

/* Checks the order of accuracy of differences. The trilinear interpolant of a quadratic field has the same error in
 * every cell of a lattice. So differences over a whole cell equal those of the quadratic field itself, which are exact
 * up to rounding, far better than second order. Differences over half a cell have an error of the order of the cell's
 * size. So has the cell's own gradient, but its error is larger. */
static void differences_of_a_quadratic_field_are_of_second_order(void **state)
{
    (void)state;
    const double coarse = measure_quadratic_error(8, RENDER_DIFFERENCES, 1),
                 fine = measure_quadratic_error(16, RENDER_DIFFERENCES, 1);
    const double gradient = measure_quadratic_error(16, RENDER_GRADIENT, 1),
                 half = measure_quadratic_error(16, RENDER_DIFFERENCES, 0.5);
    printf("normals of a quadratic field: differences %.2g, on cells of half the size %.2g, over half of these %.2g; "
           "gradient %.2g\n",
           coarse, fine, half, gradient);
    assert_true(fine <= 0.3 * coarse || coarse < 1e-5);
    assert_true(half < gradient && fine < 0.1 * half);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(robust_hits_are_on_the_surface),
        cmocka_unit_test(opaque_hits_in_cuboids_match_the_reference),
        cmocka_unit_test(robust_hits_in_ill_shaped_cells_match_the_reference),
        cmocka_unit_test(cell_gradients_match_the_reference),
        cmocka_unit_test(differences_of_a_linear_field_are_exact),
        cmocka_unit_test(differences_of_a_quadratic_field_are_of_second_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
