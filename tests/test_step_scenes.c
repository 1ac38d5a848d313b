/* Checks steps in the opacity in scenes of many cells: in lattices of cells with curved fields, where max_error bounds
 * the sum of the errors of all cells on a ray; and in a scene of several volumes, which are mixed. */
#include "test_effort.h"
#include "test_step_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

/* ---- lattices ---- */

enum { POINTS = 6, CELLS = 4, LATTICE_SIDE = 15, MIXED_SIDE = 7 };

/* Checks pictures of a lattice. With a unit distance of 0.02 the volume is so dense that rays end in the first cells
 * whose field is beyond a step. With 0.3, rays reach the cells behind them. */
static void verify_lattice(test_mesh_kind kind, fixture_camera camera, double unit)
{
    static const double values[POINTS] = {-0.7, -0.15, -0.15, 0.3, 0.3, 0.7};
    static const float opacities[POINTS] = {0.2f, 0.05f, 0.6f, 0.3f, 0, 0.1f};
    render_fixture f;
    test_mesh mesh;
    double worst[3] = {0};
    char what[80];
    test_mesh_make_lattice(kind, CELLS, 0.2, test_wave_field, &mesh);
    step_fixture_create(&f, &mesh, camera, LATTICE_SIDE);
    f.transfer.opacity_count = POINTS;
    f.transfer.opacity_values = values;
    f.transfer.opacities = opacities;
    f.transfer.unit_distance = unit;
    step_measure_errors(&f, 1, 1e-7, worst);
    snprintf(what, sizeof what, "steps in a lattice of %s, unit distance %g, %s", test_mesh_kind_name(kind), unit,
             fixture_camera_name(camera));
    step_assert_errors_within_bounds(worst, what);
    fixture_free(&f);
    test_mesh_free(&mesh);
}

/* By default each kind of cell is drawn with only one of the cameras, because all combinations would take long. */
static void lattices_of_curved_cells_keep_max_error(void **state)
{
    static const test_mesh_kind kinds[4] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    (void)state;
    for (int k = 0; k < 4; k++)
        for (fixture_camera camera = 0; camera <= CAMERA_INSIDE; camera++)
            if (test_is_long_run() || (int)camera == (k + 1) % 3)
                verify_lattice(kinds[k], camera, (k + (int)camera) % 2 ? 0.3 : 0.02);
}

/* ---- volumes that are mixed ---- */

/* Draws two volumes of one field, sampled with a step of the size of a cell. The opacity of the first volume is
 * constant except for a step; that of the second volume is constant. A curved field causes errors only at the step,
 * whose intervals are halved. Each interval is allowed a share of 0.4 RENDER_MIXING_ERROR in proportion to its length,
 * and another share in proportion to its absorption (kernel_bisection.h), in addition to the error of mixing
 * itself. */
static double verify_mixed(const test_mesh *mesh, fixture_camera camera, double unit)
{
    static const float colours[12] = {0.9f, 0.2f, 0.1f, 0.9f, 0.2f, 0.1f, 0.1f, 0.4f, 0.9f, 0.1f, 0.4f, 0.9f};
    static const double level_value = 0;
    static const float level_opacity = 0.3f;
    render_fixture f;
    step_function function = {.opacities = {0.02f, 0.02f, 0.9f, 0.9f}};
    step_fixture_create(&f, mesh, camera, MIXED_SIDE);
    step_set_function(&f, &function, 0.6, 0, unit);
    f.transfer.colours = colours;
    render_transfer level = f.transfer;
    level.colours = colours + 6;
    level.opacity_count = 1;
    level.opacity_values = &level_value;
    level.opacities = &level_opacity;
    level.unit_distance = 0.5;
    const render_volume_layer volumes[2] = {f.volume, {f.volume.field, &level}};
    f.job.volumes = volumes;
    f.job.volume_count = 2;
    f.job.separate_samples = true;
    double *truth = step_compute_reference(&f, 1, 1e-7);
    const double worst = step_largest_error_of_isas(&f, truth, 1);
    free(truth);
    fixture_free(&f);
    return worst;
}

static void mixed_volumes_with_steps_keep_max_error(void **state)
{
    enum { SEEDS = 4 };
    const double bound = (2 + 1) * 0.4 * RENDER_MIXING_ERROR;
    (void)state;
    for (int kind = 0; kind < STEP_SHAPES; kind++) {
        double worst = 0;
        for (uint64_t seed = 0; seed < SEEDS; seed++) {
            test_mesh mesh;
            if (kind == 0 && seed == 0)
                step_make_hex(&mesh);
            else
                step_make_cell(step_shapes[kind], 16 * seed + (uint64_t)kind, &mesh);
            worst = test_larger_error(
                worst, verify_mixed(&mesh, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, seed / 2 % 2 ? 0.2 : 0.02));
            test_mesh_free(&mesh);
        }
        fprintf(stderr, "a step in %s, mixed by step: %.2g\n", test_cell_shape_name(step_shapes[kind]), worst);
        assert_true(worst <= bound);
    }
}

/* An optional argument selects the tests to run, by a pattern of cmocka. */
int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lattices_of_curved_cells_keep_max_error),
        cmocka_unit_test(mixed_volumes_with_steps_keep_max_error),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
