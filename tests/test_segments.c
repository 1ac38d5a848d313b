/* Compares volumes drawn by segments with the adaptive integral. Tets must be exact, other cells must converge with
 * second order, and max_error must be kept. Scenes include surfaces and parts of the mesh, and are drawn with every
 * instruction set. */
#include "comp.h"
#include "reference_integral.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

/* Returns the reference picture of a fixture: width * height * 4 numbers. In the usual run only every second pixel is
 * computed, and the others are NaN. */
static double *compute_reference(const render_fixture *f)
{
    const int width = f->job.camera.width, height = f->job.camera.height, every = test_case_count(2, 1);
    double *rgba = malloc((size_t)width * (size_t)height * 4 * sizeof *rgba);
    reference_integral *scene = reference_integral_create(&f->job, 1e-9);
    reference_scene *surfaces = f->job.surface_count ? reference_create(&f->job) : NULL;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            reference_ray ray = {.hit_count = 0, .ambiguous = (x + y) % every != 0};
            double *at = rgba + 4 * (y * width + x);
            if (surfaces && !ray.ambiguous) reference_trace(surfaces, x, y, fixture_background, &ray);
            for (int c = 0; c < 4 && ray.ambiguous; c++) at[c] = (double)NAN;
            if (ray.ambiguous) continue;
            reference_integral_trace(scene, x, y, fixture_background, ray.hits, ray.hit_count, at);
        }
    reference_free(surfaces);
    reference_integral_free(scene);
    return rgba;
}

/* Returns the largest difference of a channel and computes the mean of all differences. Pixels whose reference is NaN
 * do not count. */
static double find_largest_error_of_isa(const render_fixture *f, const double *truth, double *mean)
{
    drawn_frame drawn;
    const int pixels = f->job.camera.width * f->job.camera.height;
    double worst = 0, total = 0;
    fixture_draw(f, &drawn);
    for (int i = 0; i < 4 * pixels; i++) {
        const double off = fabs((double)drawn.picture.rgba[i] - truth[i]);
        if (isnan(truth[i])) continue;
        worst = test_larger_error(worst, off);
        total += off;
    }
    drawn_frame_free(&drawn);
    *mean = total / (4 * pixels);
    return worst;
}

/* Returns the largest error over all instruction sets, and computes the largest mean error. */
static double find_largest_error(const render_fixture *f, const double *truth, double *mean)
{
    double worst = 0, most = 0;
    for (int set = 0; set < fixture_isa_count(); set++) {
        double of_set;
        fixture_select_isa(set);
        worst = test_larger_error(worst, find_largest_error_of_isa(f, truth, &of_set));
        most = test_larger_error(most, of_set);
    }
    if (mean) *mean = most;
    return worst;
}

static void set_segments(render_fixture *f, double step, double max_error)
{
    fixture_set_volume(f, step);
    f->job.integration = RENDER_SEGMENTS;
    f->job.max_error = max_error;
}

/* Tolerance of exact segments. The integral of a segment has an error of 4.4e-7 of the light that it absorbs
 * (kernel_integral.h), and the absorbed light adds up to at most 1 over a ray. The ends of segments are exact
 * (kernel_exact.h), and sums of light are compensated. */
#define EXACT 1e-6

static void tets_are_exact_for_every_camera(void **state)
{
    (void)state;
    for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
        render_fixture f;
        fixture_create_lattice(&f, TEST_TETS, 4, camera == CAMERA_ALONG_X ? 0 : 0.2, test_wave_field);
        fixture_set_camera(&f, camera, 29, 23);
        set_segments(&f, 1, 0);
        double *truth = compute_reference(&f), worst = find_largest_error(&f, truth, NULL);
        fprintf(stderr, "tets, %s: %.2g\n", fixture_camera_name(camera), worst);
        assert_true(worst < EXACT);
        free(truth);
        fixture_free(&f);
    }
}

/* Returns the number of random tets. It is a multiple of 16 (in the usual run 32), so that all combinations of steps,
 * slivers and cameras occur. */
static uint64_t count_random_tets(void)
{
    return (uint64_t)test_case_count(32, 80);
}

/* Returns whether the opacity has a step. One of four groups of seeds has steps, so that steps occur with slivers and
 * with other tets and with every camera. */
static bool has_step(uint64_t seed)
{
    return seed / 4 % 4 == 0;
}

/* Creates a random tet and its fixture. Every fifth tet is a sliver. */
static void begin_random_tet(uint64_t seed, test_mesh *mesh, render_fixture *f)
{
    const bool is_sliver = seed % 5 == 0;
    test_mesh_make_single_cell(is_sliver ? TEST_SLIVER_TET : TEST_UNIT_TET, test_linear_field, mesh);
    for (uint64_t i = 0; i < 12; i++)
        mesh->coordinates[i] += test_uniform_between(i, 100 * seed + 7, -0.25, 0.25) * (is_sliver ? 1e-5 : 1);
    for (uint64_t i = 0; i < 4; i++) mesh->values[i] = test_uniform_between(i, 100 * seed + 8, -0.1, 1.1);
    fixture_create(f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, 15, 13);
    set_segments(f, 1, 0);
}

/* Checks random tets, including slivers, with random functions and unit distances from 1e-3 to 1e4 of the tet's size.
 * Optical depths are from 1e-8 to more than 1e3, and opacities have steps or rise to 0.99 within a tenth of the range
 * of the tet's values. If the ends of segments were rounded to float32, their error of 1e-7 would be magnified to
 * 3.7e-6. */
static void random_tets_are_exact(void **state)
{
    static const double most[3] = {0.5, 0.9, 0.99};
    (void)state;
    for (int k = 0; k < 3; k++) {
        double worst = 0;
        int steps = 0;
        for (uint64_t seed = 0; seed < count_random_tets(); seed++) {
            test_mesh mesh;
            render_fixture f;
            fixture_function function;
            begin_random_tet(seed, &mesh, &f);
            fixture_set_function(&f, &function, 100 * seed + 9, has_step(seed), most[k],
                                 pow(10, test_uniform_between(0, 100 * seed + 10, -3, 4)));
            steps += function.values[1] == function.values[2];
            double *truth = compute_reference(&f);
            worst = test_larger_error(worst, find_largest_error(&f, truth, NULL));
            free(truth);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
        fprintf(stderr, "random tets, opacities to %g: %.2g\n", most[k], worst);
        assert_true(worst < EXACT);
        assert_int_equal(steps, count_random_tets() / 4);
    }
}

static void linear_fields_are_exact_on_every_kind(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        fixture_create_lattice(&f, kind, 4, 0.2, test_linear_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 29, 23);
        set_segments(&f, 100, 0);
        double *truth = compute_reference(&f), worst = find_largest_error(&f, truth, NULL);
        fprintf(stderr, "linear, %s: %.2g\n", test_mesh_kind_name(kind), worst);
        assert_true(worst < EXACT);
        free(truth);
        fixture_free(&f);
    }
}

static void surfaces_split_segments(void **state)
{
    static const double values[4] = {-0.4, -0.1, 0.2, 0.5};
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        fixture_create_lattice(&f, kind, 3, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 25, 21);
        set_segments(&f, 1, 1e-4);
        fixture_add_surface(&f, values, 3, 0.4f);
        fixture_add_surface(&f, values + 3, 1, 1);
        double *truth = compute_reference(&f);
        for (int alone = 0; alone < 2; alone++) {
            f.job.is_alone = alone;
            const double worst = find_largest_error(&f, truth, NULL);
            fprintf(stderr, "surfaces, %s: %.2g\n", test_mesh_kind_name(kind), worst);
            assert_true(worst <= 1e-4);
        }
        free(truth);
        fixture_free(&f);
    }
}

/* Computes the mean errors for steps of 1/4, 1/8 ... of a cell. Returns the order of convergence from the first to the
 * last step. */
static double measure_convergence_order(render_fixture *f, const double *truth, render_integration how, int halvings)
{
    double first = 0, last = 0;
    f->job.integration = how;
    for (int i = 0; i <= halvings; i++) {
        double mean;
        f->job.step = f->cell_size * ldexp(1, -i - 2);
        const double worst = find_largest_error(f, truth, &mean);
        fprintf(stderr, "%s, step of 1/%d cell: mean %.3g, worst %.3g\n", how ? "segments" : "samples", 4 << i, mean,
                worst);
        if (i == 0) first = mean;
        last = mean;
    }
    return log2(first / last) / halvings;
}

static void segments_converge_on_jittered_hexes(void **state)
{
    (void)state;
    render_fixture f;
    fixture_create_lattice(&f, TEST_HEXES, 5, 0.2, test_wave_field);
    fixture_set_camera(&f, CAMERA_OUTSIDE, 29, 23);
    set_segments(&f, 1, 0);
    double *truth = compute_reference(&f);
    const double segments = measure_convergence_order(&f, truth, RENDER_SEGMENTS, 4),
                 samples = measure_convergence_order(&f, truth, RENDER_SAMPLES, 5);
    fprintf(stderr, "observed orders: segments %.2f, samples %.2f\n", segments, samples);
    /* The order is 3 in segments that contain a control point of the transfer function, and 4 in the others. It is 1 in
     * intervals that are shorter than a step and are not divided; each halving of the step leaves half of these
     * intervals. */
    assert_true(segments >= 2.5);
    assert_true(samples >= 0.95);
    free(truth);
    fixture_free(&f);
}

/* Checks the tets and functions of random_tets_are_exact() with an allowed error. They are integrated by
 * preintegration, in several intervals, and exactly, alternately. */
static void random_tets_keep_max_error(void **state)
{
    enum { DIGITS = 4 };
    double worst[DIGITS] = {0};
    (void)state;
    for (uint64_t seed = 0; seed < count_random_tets(); seed++) {
        test_mesh mesh;
        render_fixture f;
        fixture_function function;
        begin_random_tet(seed, &mesh, &f);
        fixture_set_function(&f, &function, 100 * seed + 9, has_step(seed), seed % 3 ? 0.5 : 1,
                             pow(10, test_uniform_between(0, 100 * seed + 10, -3, 4)));
        double *truth = compute_reference(&f);
        for (int i = 0; i < DIGITS; i++) {
            f.job.max_error = pow(10, -2 - i);
            worst[i] = test_larger_error(worst[i], find_largest_error(&f, truth, NULL));
        }
        free(truth);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
    for (int i = 0; i < DIGITS; i++) {
        fprintf(stderr, "random tets, max_error 1e-%d: %.2g\n", 2 + i, worst[i]);
        assert_true(worst[i] <= pow(10, -2 - i));
    }
}

/* Compares pictures whose cells are traced in tiles with those whose cells are traced one by one. Rays, cells and
 * segments are the same. Only the order of segments that begin at the same depth may differ. Pictures are smaller in
 * the usual run; they too have whole tiles and parts of tiles. */
static void verify_tiles(test_mesh_kind kind, int side, bool with_surface, double max_error)
{
    static const double value = 0.5, nowhere = 1e6;
    const int width = test_case_count(37, 61), height = test_case_count(29, 47);
    render_fixture f;
    drawn_frame drawn[2];
    double worst = 0;
    test_mesh mesh;
    test_mesh_make_lattice(kind, side, 0.2, test_wave_field, &mesh);
    /* Arrays have 4-byte elements, so that several tets are transformed at the same time. */
    fixture_create(&f, &mesh, 1, (test_layout){.is_interleaved = with_surface}, 2.0 / side, 1,
                   (const double[]){0, 0, 0});
    test_mesh_free(&mesh);
    fixture_set_camera(&f, CAMERA_OUTSIDE, width, height);
    set_segments(&f, 0.02, max_error); /* so many segments that a window cannot store them */
    if (with_surface) fixture_add_surface(&f, &value, 1, 1);
    /* Because of a transparent surface, which is invisible here, tets are traced one by one, and the depths at which
     * rays must be divided are searched in other cells. */
    fixture_add_surface(&f, &nowhere, 1, 0.5f);
    fixture_draw(&f, &drawn[0]);
    f.job.surface_count--;
    for (int tiles = 0; tiles < 2; tiles++) {
        f.job.traversal = tiles ? RENDER_TILES : RENDER_BINNED;
        fixture_draw(&f, &drawn[1]);
        for (int i = 0; i < 4 * width * height; i++) {
            const double off = fabs((double)drawn[0].picture.rgba[i] - (double)drawn[1].picture.rgba[i]);
            worst = test_larger_error(worst, off);
        }
        drawn_frame_free(&drawn[1]);
    }
    fprintf(stderr, "in lanes and alone, %s, max_error %g: %.2g\n", test_mesh_kind_name(kind), max_error, worst);
    assert_true(worst < 5e-7);
    drawn_frame_free(&drawn[0]);
    fixture_free(&f);
}

static void lanes_match_single_cells(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int with_surface = 0; with_surface < 2; with_surface++) verify_tiles(kind, 9, with_surface, 0);
}

/* Checks segments whose ends are in float32: tiles trace tets that cover few pixels with one pair of ray and tet per
 * lane (kernel_tile_segments.h). A ray crosses more tets than a window can store. */
static void small_tets_are_the_same_in_lanes(void **state)
{
    (void)state;
    for (int with_surface = 0; with_surface < 2; with_surface++) verify_tiles(TEST_TETS, 20, with_surface, 1e-2);
}

/* Checks max_error for every kind of cells. The usual run draws each kind from one of the cameras. */
static void max_error_is_kept_on_every_kind(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++) {
            render_fixture f;
            if (!test_is_long_run() && (int)camera != (int)kind % 3) continue;
            fixture_create_lattice(&f, kind, 4, 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 21, 17);
            set_segments(&f, 1, 0);
            double *truth = compute_reference(&f);
            for (int i = 2; i <= 4; i++) {
                f.job.max_error = pow(10, -i);
                const double worst = find_largest_error(&f, truth, NULL);
                fprintf(stderr, "max_error 1e-%d, %s, %s: %.2g\n", i, test_mesh_kind_name(kind),
                        fixture_camera_name(camera), worst);
                assert_true(worst <= f.job.max_error);
            }
            free(truth);
            fixture_free(&f);
        }
}

/* Checks cells that are distributed over ranks. Each rank is drawn by itself, and all fragments are merged. Only the
 * rounding of "over" may differ. */
static void parts_draw_the_whole_picture(void **state)
{
    static const double values[2] = {-0.2, 0.3};
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind distribute = 0; distribute < TEST_PARTITION_COUNT; distribute++)
            for (int surfaces = 0; surfaces < 2; surfaces++) {
                enum { N = 4, RANKS = 3 };
                test_mesh mesh;
                render_fixture whole, parts[RANKS];
                drawn_frame at_once, apart;
                test_mesh_make_lattice(kind, N, 0.2, test_wave_field, &mesh);
                int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
                test_partition_cells(&mesh, distribute, N, RANKS, owners);
                for (int i = 0; i <= RANKS; i++) {
                    render_fixture *f = i ? &parts[i - 1] : &whole;
                    test_mesh part = mesh;
                    if (i) test_mesh_extract_part(&mesh, owners, i - 1, &part);
                    fixture_create(f, &part, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / N,
                                   1, (const double[]){0, 0, 0});
                    if (i) test_mesh_free(&part);
                    fixture_set_camera(f, CAMERA_OUTSIDE, 37, 31);
                    set_segments(f, 0.3, distribute == TEST_RANDOM ? 1e-3 : 0);
                    f->job.extent = 3.5;
                    if (surfaces) fixture_add_surface(f, values, 2, 0.4f);
                    f->job.is_alone = i == 0;
                }
                fixture_draw(&whole, &at_once);
                fixture_draw_distributed(parts, RANKS, &apart);
                const double off = drawn_frame_find_largest_difference(&at_once, &apart);
                for (int p = 0; p < 37 * 31; p++)
                    assert_true(
                        !comp_pixel_overlaps(apart.list.items + apart.first[p], apart.first[p + 1] - apart.first[p]));
                if (!(off <= 1e-6))
                    fail_msg("%s, %s: %g", test_mesh_kind_name(kind), test_partition_kind_name(distribute), off);
                drawn_frame_free(&at_once);
                drawn_frame_free(&apart);
                for (int i = 0; i < RANKS; i++) fixture_free(&parts[i]);
                fixture_free(&whole);
                free(owners);
                test_mesh_free(&mesh);
            }
}

/* Checks values far outside of the function's domain, which some files contain in place of missing values. The kernels
 * clamp them to 1e18 times the width of the domain. */
static void values_of_any_magnitude_keep_max_error(void **state)
{
    static const double odd[] = {3e31, -3e31, 3e38, -3e38};
    (void)state;
    for (int wide = 0; wide < 2; wide++)
        for (int digits = 0; digits <= 4; digits += 2) {
            drawn_frame drawn[2];
            for (int held = 0; held < 2; held++) {
                render_fixture f;
                test_mesh mesh;
                test_mesh_make_lattice(TEST_TETS, 5, 0.2, test_wave_field, &mesh);
                for (int64_t v = 5; v < mesh.vertex_count; v += 23) {
                    const double value = odd[v / 23 % 4];
                    mesh.values[v] = !held ? value : value < 0 ? -1e30 : 1e30;
                }
                fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = wide, .wide_values = wide}, 0.4, 1,
                               (const double[]){0, 0, 0});
                fixture_set_camera(&f, CAMERA_OUTSIDE, 29, 23);
                set_segments(&f, 1, digits ? pow(10, -digits) : 0);
                fixture_draw(&f, &drawn[held]);
                fixture_free(&f);
                test_mesh_free(&mesh);
            }
            for (int i = 0; i < 4 * 29 * 23; i++) assert_true(isfinite(drawn[0].picture.rgba[i]));
            drawn_frame_assert_same(&drawn[0], &drawn[1]);
            for (int i = 0; i < 2; i++) drawn_frame_free(&drawn[i]);
        }
}

/* Checks more meshes at the same position than a window can store. None may be dropped. All have the same constant
 * opacity. */
static void all_overlapping_meshes_are_visible(void **state)
{
    static const float constant[1] = {0.001f};
    enum { COPIES = 100 };
    (void)state;
    test_mesh mesh;
    render_fixture f;
    drawn_frame drawn;
    test_mesh_make_single_cell(TEST_UNIT_TET, test_linear_field, &mesh);
    test_mesh many = {.vertex_count = 4, .cell_count = COPIES, .connectivity_count = 4 * COPIES};
    many.coordinates = mesh.coordinates;
    many.values = mesh.values;
    many.offsets = malloc((COPIES + 1) * sizeof *many.offsets);
    many.connectivity = malloc(4 * COPIES * sizeof *many.connectivity);
    many.types = malloc(COPIES);
    many.ghosts = calloc(COPIES, 1);
    for (int i = 0; i < 4 * COPIES; i++) many.connectivity[i] = mesh.connectivity[i % 4];
    for (int i = 0; i <= COPIES; i++) many.offsets[i] = 4 * i;
    for (int i = 0; i < COPIES; i++) many.types[i] = mesh.types[0];
    double clear[2][23 * 21];
    for (int all = 0; all < 2; all++) {
        fixture_create(&f, all ? &many : &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                       (const double[]){0, 0, 0});
        fixture_set_camera(&f, CAMERA_OUTSIDE, 23, 21);
        set_segments(&f, 1, 0);
        f.transfer.opacity_count = 1;
        f.transfer.opacities = constant;
        fixture_draw(&f, &drawn);
        for (int p = 0; p < 23 * 21; p++) clear[all][p] = 2 * (1 - (double)drawn.picture.rgba[4 * p + 3]);
        drawn_frame_free(&drawn);
        fixture_free(&f);
    }
    /* The tolerance is 100 times the error of the logarithm of a number that is rounded by 6e-8. */
    for (int p = 0; p < 23 * 21; p++) assert_true(fabs(COPIES * log(clear[0][p]) - log(clear[1][p])) < 3e-5);
    free(many.offsets);
    free(many.connectivity);
    free(many.types);
    free(many.ghosts);
    test_mesh_free(&mesh);
}

/* Checks that the result of a ray is bit-identical whatever other rays and cells are in its packet: pixels must depend
 * neither on the border of the picture nor on the order of cells (another order of cells gives another order of the
 * tree's leaves). */
static void pictures_do_not_depend_on_the_order_of_cells(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        drawn_frame drawn[2];
        for (int i = 0; i < 2; i++) {
            test_mesh mesh;
            render_fixture f;
            test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
            if (i) test_mesh_shuffle_cells(&mesh, 3);
            fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 0.5, 1,
                           (const double[]){0, 0, 0});
            fixture_set_camera(&f, CAMERA_OUTSIDE, 39, 33);
            set_segments(&f, 0.1, 0);
            fixture_draw(&f, &drawn[i]);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
        drawn_frame_assert_same(&drawn[0], &drawn[1]);
        for (int i = 0; i < 2; i++) drawn_frame_free(&drawn[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tets_are_exact_for_every_camera),
        cmocka_unit_test(random_tets_are_exact),
        cmocka_unit_test(linear_fields_are_exact_on_every_kind),
        cmocka_unit_test(surfaces_split_segments),
        cmocka_unit_test(segments_converge_on_jittered_hexes),
        cmocka_unit_test(max_error_is_kept_on_every_kind),
        cmocka_unit_test(random_tets_keep_max_error),
    };
    /* These tests draw without the comparison that uses all instruction sets, so they are run for each instruction
     * set. */
    const struct CMUnitTest of_a_set[] = {
        cmocka_unit_test(lanes_match_single_cells),
        cmocka_unit_test(small_tets_are_the_same_in_lanes),
        cmocka_unit_test(parts_draw_the_whole_picture),
        cmocka_unit_test(values_of_any_magnitude_keep_max_error),
        cmocka_unit_test(all_overlapping_meshes_are_visible),
        cmocka_unit_test(pictures_do_not_depend_on_the_order_of_cells),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int set = 0; set < fixture_isa_count(); set++) {
        fixture_select_isa(set);
        failed += cmocka_run_group_tests(of_a_set, NULL, NULL);
    }
    return failed;
}
