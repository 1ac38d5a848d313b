#include "test_step_fixture.h"

#include "reference_integral.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const float colours[6] = {0.1f, 0.9f, 0.2f, 0.9f, 0.3f, 0.7f};

const test_cell_shape step_shapes[STEP_SHAPES] = {TEST_UNIT_HEX, TEST_UNIT_WEDGE, TEST_UNIT_PYRAMID, TEST_UNIT_TET};

void step_set_function(render_fixture *f, step_function *function, double at, double width, double unit)
{
    const double values[4] = {0, at, at + width, 1};
    memcpy(function->values, values, sizeof values);
    f->transfer = (render_transfer){.low = 0,
                                    .high = 1,
                                    .colour_count = 2,
                                    .colours = colours,
                                    .opacity_count = 4,
                                    .opacity_values = function->values,
                                    .opacities = function->opacities,
                                    .unit_distance = unit};
}

void step_fixture_create(render_fixture *f, const test_mesh *mesh, fixture_camera camera, int side)
{
    fixture_create(f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, side, side);
    fixture_set_volume(f, 1);
    f->job.integration = RENDER_SEGMENTS;
}

double *step_compute_reference(const render_fixture *f, int every, double tolerance)
{
    const int side = f->job.camera.width;
    double *truth = malloc((size_t)(side * side) * 4 * sizeof *truth);
    assert_non_null(truth);
    reference_integral *scene = reference_integral_create(&f->job, tolerance);
    for (int p = 0; p < side * side; p += every)
        reference_integral_trace(scene, p % side, p / side, fixture_background, NULL, 0, truth + 4 * p);
    reference_integral_free(scene);
    return truth;
}

static double step_find_largest_error(const drawn_frame *drawn, const double *truth, int every)
{
    double worst = 0;
    for (int p = 0; p < drawn->picture.width * drawn->picture.height; p += every)
        for (int c = 0; c < 4; c++)
            worst = test_larger_error(worst, fabs((double)drawn->picture.rgba[4 * p + c] - truth[4 * p + c]));
    return worst;
}

double step_largest_error_of_isas(const render_fixture *f, const double *truth, int every)
{
    double worst = 0;
    for (int set = 0; set < fixture_isa_count(); set++) {
        drawn_frame drawn;
        fixture_select_isa(set);
        fixture_draw(f, &drawn);
        worst = test_larger_error(worst, step_find_largest_error(&drawn, truth, every));
        drawn_frame_free(&drawn);
    }
    return worst;
}

void step_measure_errors(render_fixture *f, int every, double tolerance, double worst[3])
{
    double *truth = step_compute_reference(f, every, tolerance);
    for (int i = 0; i < 3; i++) {
        f->job.max_error = pow(10, -2 - i);
        worst[i] = test_larger_error(worst[i], step_largest_error_of_isas(f, truth, every));
    }
    free(truth);
}

void step_assert_errors_within_bounds(const double worst[3], const char *what)
{
    fprintf(stderr, "%s: %.2g, %.2g, %.2g\n", what, worst[0], worst[1], worst[2]);
    for (int i = 0; i < 3; i++) assert_true(worst[i] <= pow(10, -2 - i));
}

void step_make_hex(test_mesh *mesh)
{
    static const double values[8] = {0, 1, 0.2, 0.9, 0.8, 0.1, 1, 0};
    test_mesh_make_single_cell(TEST_UNIT_HEX, test_linear_field, mesh);
    for (int i = 0; i < 24; i++) mesh->coordinates[i] *= 2;
    memcpy(mesh->values, values, sizeof values);
}

void step_make_cell(test_cell_shape shape, uint64_t seed, test_mesh *mesh)
{
    test_mesh_make_single_cell(shape, test_linear_field, mesh);
    for (uint64_t i = 0; i < 3 * (uint64_t)mesh->vertex_count; i++)
        mesh->coordinates[i] = 1.8 * (mesh->coordinates[i] + test_uniform_between(i, 100 * seed + 1, -0.12, 0.12));
    for (uint64_t i = 0; i < (uint64_t)mesh->vertex_count; i++)
        mesh->values[i] = test_uniform_between(i, 100 * seed + 2, 0, 1);
}
