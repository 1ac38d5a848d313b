/* Checks max_error if the opacity has a step. The field of a cell is curved along a ray, and may barely reach the step
 * or pass it and return within the cell. Sampling would miss the small amount of light beyond the step, or find a wrong
 * length of it. Cells are single ones that are warped randomly, and ones whose rays pass the step by a given amount.
 * Functions have steps, or ramps almost as steep as steps. The usual run compares every second pixel of a picture, and
 * uses grazing rays in one cell type for each width of the ramps, alternately. */
#include "reference_cell.h"
#include "test_effort.h"
#include "test_step_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

/* ---- the field along a ray ---- */

enum { SAMPLES = 1000 };

/* Computes the field at samples on the ray of a picture of one pixel. Returns the number of samples inside the cell. */
static int sample_values_on_ray(const render_fixture *f, const test_mesh *mesh, int type, double values[SAMPLES])
{
    const render_camera *camera = &f->job.camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    reference_cell cell = {.type = type, .count = grid_type_vertex_count(type)};
    reference_crossing ends[REFERENCE_MAX_CROSSINGS];
    reference_line line;
    double base[3], direction[3];
    render_camera_ray(camera, 0, 0, base, direction);
    for (int axis = 0; axis < 2; axis++) {
        line.base[axis] = line.slope[axis] = 0;
        for (int a = 0; a < 3; a++) {
            line.base[axis] += axes[axis][a] * (base[a] - camera->eye[a]);
            line.slope[axis] += axes[axis][a] * direction[a];
        }
    }
    for (int i = 0; i < cell.count; i++)
        for (int axis = 0; axis < 3; axis++) {
            cell.position[i][axis] = 0;
            for (int a = 0; a < 3; a++) {
                cell.world[i][a] = mesh->coordinates[3 * i + a];
                cell.position[i][axis] += axes[axis][a] * (cell.world[i][a] - camera->eye[a]);
            }
        }
    if (reference_find_crossings(&cell, &line, ends) != 2) return 0;
    for (int i = 0; i < SAMPLES; i++) {
        const double z = ends[0].z + (ends[1].z - ends[0].z) * i / (SAMPLES - 1);
        const double point[3] = {line.base[0] + line.slope[0] * z, line.base[1] + line.slope[1] * z, z};
        if (!reference_interpolate(&cell, point, mesh->values, &values[i], NULL)) return 0;
    }
    return SAMPLES;
}

/* Computes the largest value (sign 1) or the smallest value (sign -1) on the ray, from the parabola through three
 * samples. Returns false if the extreme is at an end of the ray, or hardly differs from the value at an end. */
static bool find_extreme_value(const double values[SAMPLES], double sign, double *at)
{
    int best = 0;
    for (int i = 1; i < SAMPLES; i++)
        if (sign * values[i] > sign * values[best]) best = i;
    if (best == 0 || best == SAMPLES - 1) return false;
    const double before = values[best - 1], here = values[best], after = values[best + 1];
    const double bend = (before - here) + (after - here), rise = 0.5 * (after - before);
    *at = here - 0.5 * rise * rise / bend;
    return sign * (*at - values[0]) > 0.01 && sign * (*at - values[SAMPLES - 1]) > 0.01;
}

/* ---- a hex whose error was 2.8e-3 in the past ---- */

/* Compares pictures of this hex, for an opacity with a ramp of the given width at 0.6, or with a step if the width is
 * 0. */
static void verify_hex_near_step(step_function function, fixture_camera camera, double width, double unit)
{
    test_mesh mesh;
    render_fixture f;
    double worst[3] = {0};
    char what[80];
    step_make_hex(&mesh);
    step_fixture_create(&f, &mesh, camera, STEP_SIDE);
    step_set_function(&f, &function, 0.6, width, unit);
    step_measure_errors(&f, test_case_count(2, 1), 1e-7, worst);
    snprintf(what, sizeof what, "a ramp of %g, unit distance %g, %s", width, unit, fixture_camera_name(camera));
    step_assert_errors_within_bounds(worst, what);
    fixture_free(&f);
    test_mesh_free(&mesh);
}

static void hexes_that_barely_reach_a_step_keep_max_error(void **state)
{
    static const double units[2] = {0.005, 0.1};
    (void)state;
    for (int k = 0; k < 2; k++)
        for (fixture_camera camera = 0; camera <= CAMERA_ORTHOGRAPHIC; camera++)
            verify_hex_near_step((step_function){.opacities = {0, 0, 0.9f, 0.9f}}, camera, 0, units[k]);
}

/* Checks a cubic. On the middle ray, which is the hex's diagonal, the field is 0.2 - 0.4 s + 3 s^2 - 2 s^3: it falls to
 * 0.186 and rises to 0.8. At this minimum, the deviation of the field from the straight line between its ends is less
 * than a sixth of the deviation at the quarters and in the middle. */
static void cubics_that_dip_below_a_step_keep_max_error(void **state)
{
    static const double values[8] = {0.2, 0.2 / 3, 2.8 / 3, 0.2 / 3, 0.2 / 3, 2.8 / 3, 0.8, 2.8 / 3};
    test_mesh mesh;
    render_fixture f;
    step_function function = {.opacities = {0.9f, 0.9f, 0, 0}};
    double worst[3] = {0};
    (void)state;
    step_make_hex(&mesh);
    step_fixture_create(&f, &mesh, CAMERA_ORTHOGRAPHIC, 1);
    const render_camera camera = f.job.camera;
    fixture_free(&f);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) {
            const double edges[3][3] = {{1 / 3.0, 0.5, 0}, {1 / 3.0, -0.25, 0.43}, {1 / 3.0, -0.25, -0.43}};
            const int corner[3] = {i % 4 == 1 || i % 4 == 2, i % 4 / 2, i / 4};
            /* Shifts rays so that they do not pass exactly through corners. */
            double along[3] = {-0.5, 1e-4, 2e-4};
            for (int e = 0; e < 3; e++)
                for (int k = 0; k < 3; k++) along[k] += corner[e] * edges[e][k];
            mesh.coordinates[3 * i + a] =
                along[0] * camera.forward[a] + along[1] * camera.right[a] + along[2] * camera.up[a];
        }
    memcpy(mesh.values, values, sizeof values);
    step_fixture_create(&f, &mesh, CAMERA_ORTHOGRAPHIC, 1);
    step_set_function(&f, &function, 0.187, 0, 0.005); /* in another bin of the bounds than 0.2 */
    step_measure_errors(&f, 1, 1e-7, worst);
    step_assert_errors_within_bounds(worst, "a dip");
    fixture_free(&f);
    test_mesh_free(&mesh);
}

/* Returns the amount by which the field of the hex rises above 0.6 on the ray of a picture of one pixel, with the eye
 * moved sideways and up. Returns NaN if the maximum of the field is at an end of the ray. */
static double compute_rise_above_step(render_fixture *f, const test_mesh *mesh, double sideways, double up)
{
    static double values[SAMPLES];
    double most;
    fixture_set_camera(f, CAMERA_ORTHOGRAPHIC, 1, 1);
    render_camera *c = &f->job.camera;
    for (int a = 0; a < 3; a++) c->eye[a] += sideways * c->right[a] + up * c->up[a];
    if (!sample_values_on_ray(f, mesh, GRID_HEX, values) || !find_extreme_value(values, 1, &most)) return (double)NAN;
    return most - 0.6;
}

/* Moves the eye to a position at which the maximum of the field on the ray is 0.6 plus `past`. */
static void move_eye_past_step(render_fixture *f, const test_mesh *mesh, double past)
{
    const double step = 0.05;
    for (double up = -1; up < 1; up += step) {
        double after = compute_rise_above_step(f, mesh, -1, up);
        for (double low = -1; low < 1; low += step) {
            const double before = after;
            after = compute_rise_above_step(f, mesh, low + step, up);
            const bool rises = after > past;
            double from = low, to = low + step;
            if (isnan(before) || isnan(after) || (before > past) == rises) continue;
            for (int i = 0; i < 50; i++) {
                const double middle = 0.5 * (from + to);
                if ((compute_rise_above_step(f, mesh, middle, up) > past) == rises)
                    to = middle;
                else
                    from = middle;
            }
            assert_true(fabs(compute_rise_above_step(f, mesh, to, up) - past) < 0.01 * past);
            return;
        }
    }
    fail_msg("no ray comes to the step by %g", past);
}

static void rays_that_barely_reach_a_step_keep_max_error(void **state)
{
    static const double units[2] = {0.005, 0.1}, passes[4] = {3e-3, 1e-4, 1e-5, 1e-6};
    (void)state;
    for (int n = 0; n < 4; n++) {
        test_mesh mesh;
        render_fixture f;
        step_make_hex(&mesh);
        step_fixture_create(&f, &mesh, CAMERA_ORTHOGRAPHIC, 1);
        move_eye_past_step(&f, &mesh, passes[n]);
        for (int k = 0; k < 2; k++) {
            step_function function = {.opacities = {0, 0, 0.9f, 0.9f}};
            double worst[3] = {0};
            char what[64];
            step_set_function(&f, &function, 0.6, 0, units[k]);
            step_measure_errors(&f, 1, 1e-7, worst);
            snprintf(what, sizeof what, "unit distance %g, by %g", units[k], passes[n]);
            step_assert_errors_within_bounds(worst, what);
        }
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

/* ---- random cells and functions ---- */

enum { KINDS = 4, SEEDS = 12 };

/* Checks random cells and functions with steps. The usual run draws a sixth of the seeds; the selection changes with
 * the kind of cells. */
static void random_cells_with_steps_keep_max_error(void **state)
{
    const uint64_t every = (uint64_t)test_case_count(6, 1);
    (void)state;
    for (int polyhedra = 0; polyhedra < 2; polyhedra++)
        for (int kind = 0; kind < KINDS; kind++) {
            double worst[3] = {0};
            for (uint64_t seed = (uint64_t)(kind + polyhedra) % every; seed < SEEDS; seed += every) {
                test_mesh mesh;
                render_fixture f;
                fixture_function function;
                step_make_cell(step_shapes[kind], 16 * seed + (uint64_t)kind, &mesh);
                if (polyhedra) test_mesh_to_polyhedra(&mesh, 1);
                step_fixture_create(&f, &mesh, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, STEP_SIDE);
                /* The optical depth across the cell is between 2 and 900. */
                fixture_set_function(&f, &function, 100 * seed + 9, true, seed % 3 ? 0.5 : 0.9,
                                     pow(10, test_uniform_between(0, 100 * seed + 10, -2.2, 0)));
                assert_true(function.values[1] == function.values[2]);
                step_measure_errors(&f, test_case_count(2, 1), 1e-7, worst);
                fixture_free(&f);
                test_mesh_free(&mesh);
            }
            char what[64];
            snprintf(what, sizeof what, "steps in %s%s", test_cell_shape_name(step_shapes[kind]),
                     polyhedra ? " as polyhedron" : "");
            step_assert_errors_within_bounds(worst, what);
        }
}

/* ---- rays that graze a step ---- */

/* Amounts by which rays pass the step, from 1e-2 of the function's domain to less than float32 resolves. On the last
 * ray, the field does not reach the step. */
enum { PASSES = 9 };
static const double passes[PASSES] = {1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 3e-7, 1e-7, 1e-8, -1e-7};

/* Checks a field that passes a step by each of the amounts, upwards (sign 1) or downwards (-1). Returns false if the
 * field has no such extreme. */
static bool check_grazed_step(render_fixture *f, const double values[SAMPLES], double sign, double width,
                              double worst[PASSES][3])
{
    step_function function = {.opacities = {0, 0, 0.9f, 0.9f}};
    double at;
    if (sign < 0) memcpy(function.opacities, (const float[]){0.9f, 0.9f, 0, 0}, sizeof function.opacities);
    if (!find_extreme_value(values, sign, &at)) return false;
    for (int k = 0; k < PASSES; k++)
        for (int dense = 0; dense < 2; dense++) {
            step_set_function(f, &function, at - sign * passes[k], width, dense ? 0.005 : 0.1);
            step_measure_errors(f, 1, 1e-7, worst[k]);
        }
    return true;
}

enum { GRAZED = 3 }; /* hexes, wedges and pyramids; in a tet the field on a ray is linear */

static void check_grazing_rays(int kind, int rays, double width)
{
    static const int types[GRAZED] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};
    static double values[SAMPLES];
    double worst[PASSES][3] = {{0}};
    int count = 0;
    for (uint64_t seed = 0; count < rays && seed < 200; seed++) {
        test_mesh mesh;
        render_fixture f;
        step_make_cell(step_shapes[kind], seed, &mesh);
        step_fixture_create(&f, &mesh, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, 1);
        if (sample_values_on_ray(&f, &mesh, types[kind], values))
            for (int sign = -1; sign <= 1; sign += 2) count += check_grazed_step(&f, values, sign, width, worst);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
    for (int k = 0; k < PASSES; k++) {
        char what[80];
        snprintf(what, sizeof what, "%d rays in %s past a ramp of %g by %g", count,
                 test_cell_shape_name(step_shapes[kind]), width, passes[k]);
        step_assert_errors_within_bounds(worst[k], what);
    }
    assert_true(count >= rays);
}

static void rays_that_graze_a_step_keep_max_error(void **state)
{
    (void)state;
    for (int kind = 0; kind < GRAZED; kind++) check_grazing_rays(kind, test_case_count(2, 10), 0);
}

static void rays_that_graze_a_steep_ramp_keep_max_error(void **state)
{
    static const double widths[] = {1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 0.02, 0.1};
    (void)state;
    for (int i = 0; i < (int)(sizeof widths / sizeof *widths); i++)
        for (int kind = 0; kind < GRAZED; kind++)
            if (test_is_long_run() || kind == i % GRAZED) check_grazing_rays(kind, test_case_count(1, 2), widths[i]);
}

/* ---- ramps almost as steep as a step ---- */

static void steep_ramps_keep_max_error(void **state)
{
    static const double widths[] = {1e-2, 1e-3, 1e-4, 1e-6};
    (void)state;
    for (int k = 0; k < (int)(sizeof widths / sizeof *widths); k++)
        for (int dense = 0; dense < 2; dense++)
            if (test_is_long_run() || dense == k % 2)
                verify_hex_near_step((step_function){.opacities = {0, 0.02f, 0.9f, 0.5f}}, CAMERA_OUTSIDE, widths[k],
                                     dense ? 0.005 : 0.1);
}

/* ---- the same intervals of rays in lanes and in single cells ---- */

/* Checks that cells traced in lanes divide a ray at the same depths as cells traced one by one. Cells are traced one by
 * one if there is a transparent surface, which is invisible here. Only the order of segments that begin at the same
 * depth may differ. */
static void lanes_are_split_like_single_cells(void **state)
{
    static const double nowhere = 1e6;
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        test_mesh mesh;
        render_fixture f;
        drawn_frame drawn[3];
        step_function function = {.opacities = {0, 0.1f, 0.9f, 0.6f}};
        step_make_cell(step_shapes[kind], 3, &mesh);
        step_fixture_create(&f, &mesh, CAMERA_OUTSIDE, STEP_SIDE);
        step_set_function(&f, &function, 0.6, 0, 0.02);
        f.job.max_error = 1e-4;
        for (int i = 0; i < 3; i++) {
            f.job.traversal = i == 1 ? RENDER_TILES : RENDER_BINNED;
            if (i == 0) fixture_add_surface(&f, &nowhere, 1, 0.5f);
            fixture_draw(&f, &drawn[i]);
            f.job.surface_count = 0;
            assert_true(drawn_frame_find_largest_difference(&drawn[0], &drawn[i]) < 5e-7);
        }
        for (int i = 0; i < 3; i++) drawn_frame_free(&drawn[i]);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

/* The optional argument is cmocka's pattern of the tests to run. */
int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hexes_that_barely_reach_a_step_keep_max_error),
        cmocka_unit_test(rays_that_barely_reach_a_step_keep_max_error),
        cmocka_unit_test(cubics_that_dip_below_a_step_keep_max_error),
        cmocka_unit_test(random_cells_with_steps_keep_max_error),
        cmocka_unit_test(rays_that_graze_a_step_keep_max_error),
        cmocka_unit_test(rays_that_graze_a_steep_ramp_keep_max_error),
        cmocka_unit_test(steep_ramps_keep_max_error),
        cmocka_unit_test(lanes_are_split_like_single_cells),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
