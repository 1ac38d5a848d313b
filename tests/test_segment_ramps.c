/* Checks max_error if the opacity has a very narrow ramp and the field stays within the ramp. Rounding a value or an
 * end of the ramp to float32, by 3e-8 of the function's domain, then changes the opacity a lot: by a tenth if the ramp
 * is a millionth of the domain wide. The test draws single cells whose field is within the ramp and slightly beyond it,
 * constant, or partly at the end of the ramp. */
#include "test_effort.h"
#include "test_step_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = 7, WIDTHS = 5, FIELDS = 3, SEEDS = 4 };
static const double widths[WIDTHS] = {9e-3, 1e-3, 1e-4, 1e-5, 1e-6};

/* Returns a vertex's value as a fraction of the ramp. field 0: from a third below the ramp to a third above it; 1: the
 * ramp's lower end for half of the vertices (the lower quad of a hex); 2: one value for all vertices. */
static double compute_ramp_fraction(int field, uint64_t vertex, uint64_t seed)
{
    const double share = test_uniform_between(vertex, 100 * seed + 5, -0.3, 1.3);
    if (field == 1) return vertex < 4 ? 0 : share;
    return field == 2 ? test_uniform_between(0, 100 * seed + 5, 0.1, 0.9) : share;
}

/* Returns a bound of the change of light if a value has an error of 4e-7 of the domain (the error of values of
 * polyhedra in float32). The error of the opacity a is this error times the ramp's slope, and that of the extinction,
 * -log(1 - a), is larger by at most 1 / (1 - a).
 *
 * * For light, let the extinction k have the error dk(s). With the transmittance T(s) up to s, the light L = int c k T
 * ds has the error int dk (c T - int_s c k T) ds, whose bracket is at most T for colours c in [0, 1]. So the error of
 * light is at most int dk T ds. This is at most dk times the length, and at most the largest dk / k, because int k T ds
 * <= 1. */
static double compute_rounding_bound(const step_function *function, double width, double unit)
{
    const double a = (double)function->opacities[1], b = (double)function->opacities[2], way = 1.8 * 1.24 * sqrt(3);
    const double off = 4e-7 * fabs(b - a) / width, seen = off / (1 - fmax(a, b)) * way / unit;
    /* (1 - a) -log(1 - a) has one maximum inside, so its minimum is at an end. */
    const double share = fmin((1 - a) * -log1p(-a), (1 - b) * -log1p(-b));
    return share > 0 ? fmin(seen, off / share) : seen;
}

/* The scenes: a cell by itself, a cell cut by a surface, a cell stored as a polyhedron. */
typedef enum ramp_scene { ALONE, CUT, POLYHEDRON } ramp_scene;

/* Fraction of the light that the surface absorbs which cuts the cell. */
#define FILM 1e-7f

/* Finds the largest error for each max_error, over the seeds first, first + every, and so on. The ends of the ramps are
 * numbers that are not exact in float32. */
static void verify_ramp(test_cell_shape shape, ramp_scene scene, double width, uint64_t first, uint64_t every,
                        double worst[3])
{
    double raw = 0;
    static const float opacities[3][4] = {{0, 0, 0.9f, 0.9f}, {0.8f, 0.8f, 0, 0.3f}, {0.1f, 0.2f, 0.6f, 0.1f}};
    for (uint64_t seed = first; seed < SEEDS * FIELDS; seed += every) {
        test_mesh mesh;
        render_fixture f;
        step_function function;
        double cell_worst[3] = {0};
        const double begin = 0.6 + 0.01 * test_uniform(seed, 77), middle = begin + 0.5 * width,
                     unit = seed / 2 % 2 ? 0.02 : 0.3;
        memcpy(function.opacities, opacities[seed / FIELDS % 3], sizeof function.opacities);
        step_make_cell(shape, seed, &mesh);
        for (int64_t i = 0; i < mesh.vertex_count; i++)
            mesh.values[i] = begin + width * compute_ramp_fraction((int)(seed % FIELDS), (uint64_t)i, seed);
        if (scene == POLYHEDRON) test_mesh_to_polyhedra(&mesh, 1);
        step_fixture_create(&f, &mesh, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, SIDE);
        step_set_function(&f, &function, begin, width, unit);
        if (scene == CUT) fixture_add_surface(&f, &middle, 1, FILM);
        step_measure_errors(&f, 1, 1e-7, cell_worst);
        for (int i = 0; i < 3; i++) {
            raw = fmax(raw, cell_worst[i]);
            if (scene == POLYHEDRON) cell_worst[i] -= compute_rounding_bound(&function, width, unit);
            worst[i] = test_larger_error(worst[i], cell_worst[i]);
        }
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
    if (scene == POLYHEDRON) fprintf(stderr, "%.2g off in all; beyond what rounding may do, ", raw);
}

/* Checks the ramps of all widths and cell types. The usual run draws a quarter of the seeds, with each kind of field;
 * it is another quarter for each width and cell type. */
static void verify_ramps(ramp_scene scene)
{
    static const char *const how[] = {"", " cut by a surface", " as polyhedron"};
    for (int kind = 0; kind < STEP_SHAPES; kind++)
        for (int k = 0; k < WIDTHS; k++) {
            double worst[3] = {0};
            char what[80];
            const int every = test_case_count(SEEDS, 1);
            verify_ramp(step_shapes[kind], scene, widths[k], (uint64_t)((kind + k) % every), (uint64_t)every, worst);
            snprintf(what, sizeof what, "%s%s within a ramp of %g", test_cell_shape_name(step_shapes[kind]), how[scene],
                     widths[k]);
            step_assert_errors_within_bounds(worst, what);
        }
}

static void fields_within_narrow_ramps_keep_max_error(void **state)
{
    (void)state;
    verify_ramps(ALONE);
}

/* Checks cells that are cut by a surface that absorbs only a ten-millionth of the light. The errors must be as small as
 * without the surface. */
static void clipped_fields_within_narrow_ramps_keep_max_error(void **state)
{
    (void)state;
    verify_ramps(CUT);
}

static void polyhedra_within_narrow_ramps_keep_max_error(void **state)
{
    (void)state;
    verify_ramps(POLYHEDRON);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fields_within_narrow_ramps_keep_max_error),
        cmocka_unit_test(clipped_fields_within_narrow_ramps_keep_max_error),
        cmocka_unit_test(polyhedra_within_narrow_ramps_keep_max_error),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
