/* Checks errors of the ends of segments, which steep transfer functions and dense media magnify. Cells are tets so thin
 * that both ends of a segment are equal in float32, and cells of every kind with random functions, with and without
 * surfaces that cut the segments. */
#include "comp.h"
#include "reference_integral.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = 9, PIXELS = SIDE * SIDE, LAYERS = 8 };

/* Computes the colours of the reference picture. They are NaN in pixels whose result may depend on rounding. */
static void compute_reference(const render_fixture *f, double rgba[4 * PIXELS])
{
    reference_integral *scene = reference_integral_create(&f->job, 1e-9);
    reference_scene *surfaces = f->job.surface_count ? reference_create(&f->job) : NULL;
    for (int p = 0; p < PIXELS; p++) {
        reference_ray ray = {.hit_count = 0, .edge_margin = 1, .value_margin = 1};
        if (surfaces) reference_trace(surfaces, p % SIDE, p / SIDE, fixture_background, &ray);
        reference_integral_trace(scene, p % SIDE, p / SIDE, fixture_background, ray.hits, ray.hit_count, rgba + 4 * p);
        const bool is_close = ray.ambiguous || ray.edge_margin < 1e-6 || ray.value_margin < 1e-6;
        for (int c = 0; c < 4 && is_close; c++) rgba[4 * p + c] = (double)NAN;
    }
    reference_free(surfaces);
    reference_integral_free(scene);
}

static double find_largest_error(const render_fixture *f, const double truth[4 * PIXELS])
{
    drawn_frame drawn;
    double worst = 0;
    fixture_draw(f, &drawn);
    for (int i = 0; i < 4 * PIXELS; i++)
        if (!isnan(truth[i])) worst = test_larger_error(worst, fabs((double)drawn.picture.rgba[i] - truth[i]));
    drawn_frame_free(&drawn);
    return worst;
}

static void set_segments(render_fixture *f, double max_error)
{
    fixture_set_volume(f, 1);
    f->job.integration = RENDER_SEGMENTS;
    f->job.extent = 3.5; /* any length not below the scene's diagonal */
    f->job.max_error = max_error;
}

/* ---- thin tets ---- */

/* Makes a slab of several layers of tets, seen from above. Its coordinates are near 0.7 and are rounded by 6e-8. */
static void make_layers(double thickness, test_mesh *out)
{
    test_mesh_make_lattice(TEST_TETS, LAYERS, 0, test_wave_field, out);
    for (int64_t v = 0; v < out->vertex_count; v++) {
        double *p = out->coordinates + 3 * v;
        out->values[v] = 0.3 * test_wave_field((const double[]){p[0], p[1], 3 * p[2]});
        p[2] = 0.7 + 0.5 * thickness * p[2];
    }
}

/* Checks that thin tets are not lost. Positions on a ray are distinct only if they differ by at least 6e-8, and cells
 * at the same position are blended in any order. So the light of one cell may be attenuated by the optical depth of the
 * others at the same position, instead of attenuating their light. This optical depth is 6e-8 / thickness of the whole
 * depth, which is about 1. The error is this fraction times the difference of the colours, at most a tenth. If segments
 * whose ends are equal were left out, the slab would lose a few percent of layers with a thickness of 1e-6, and half of
 * those of 1e-7. */
static void thin_tets_are_not_lost(void **state)
{
    (void)state;
    for (double thickness = 1e-5; thickness > 5e-7; thickness /= 4) {
        test_mesh mesh;
        render_fixture f;
        double truth[4 * PIXELS];
        make_layers(thickness, &mesh);
        fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / LAYERS, 1,
                       (const double[]){0, 0, 0});
        fixture_set_camera(&f, CAMERA_ORTHOGRAPHIC, SIDE, SIDE);
        assert_true(render_camera_look_at(&f.job.camera, (const double[]){0.03, 0.02, 4},
                                          (const double[]){0.03, 0.02, 0}, (const double[]){0, 1, 0}, 30, SIDE, SIDE));
        set_segments(&f, 0);
        f.transfer.unit_distance = thickness;
        compute_reference(&f, truth);
        const double worst = find_largest_error(&f, truth);
        fprintf(stderr, "layers of %.2g: %.2g\n", thickness / LAYERS, worst);
        assert_true(worst <= 0.1 * 6e-8 / thickness);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

/* ---- cells of every kind ---- */

static double quadratic_field(const double p[3])
{
    return 0.5 + 0.35 * sin(2.1 * p[0] + 0.3) * cos(1.7 * p[1]) + 0.3 * sin(2.3 * p[2] + p[0]);
}

/* Finds the largest errors for max_error 1e-2, 1e-3 and 1e-4, for one mesh and one function. Returns whether the
 * function has a step. */
static bool verify_mesh(const test_mesh *mesh, uint64_t seed, bool step, float opacity, double worst[3])
{
    static const double values[2] = {0.35, 0.6};
    render_fixture f;
    fixture_function function;
    double truth[4 * PIXELS];
    fixture_create(&f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(&f, seed % 2 ? CAMERA_OUTSIDE : CAMERA_ORTHOGRAPHIC, SIDE, SIDE);
    set_segments(&f, 0);
    fixture_set_function(&f, &function, 100 * seed + 9, step, seed % 3 ? 0.5 : 0.9,
                         pow(10, test_uniform_between(0, 100 * seed + 10, -2, 4)));
    if (opacity > 0) fixture_add_surface(&f, values, 2, opacity);
    compute_reference(&f, truth);
    for (int i = 0; i < 3; i++) {
        f.job.max_error = pow(10, -2 - i);
        worst[i] = test_larger_error(worst[i], find_largest_error(&f, truth));
    }
    fixture_free(&f);
    return function.values[1] == function.values[2];
}

/* Checks max_error in dense media. At the border of a medium, positions in float32 have an error of 1.2e-7, and light
 * has this error times the extinction: the measured error is 5e-8 of the optical depth across the scene, which is at
 * most 800 here. On tets, whose ends are exact, and inside media, the error is far below max_error. */
static void max_error_is_kept_in_dense_media(void **state)
{
    static const float opacities[3] = {0, 0.4f, 1};
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int surface = 0; surface < 3; surface++) {
            double worst[3] = {0};
            int steps = 0;
            for (uint64_t seed = 0; seed < 6; seed++) {
                test_mesh mesh;
                test_mesh_make_lattice(kind, 2, 0.2, quadratic_field, &mesh);
                /* The two densest media have a step, one for each camera. */
                steps += verify_mesh(&mesh, seed, seed % 5 == 0, opacities[surface], worst);
                test_mesh_free(&mesh);
            }
            fprintf(stderr, "%s, surfaces of opacity %g: %.2g, %.2g, %.2g\n", test_mesh_kind_name(kind),
                    (double)opacities[surface], worst[0], worst[1], worst[2]);
            for (int i = 0; i < 3; i++) assert_true(worst[i] <= pow(10, -2 - i));
            assert_int_equal(steps, 2);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thin_tets_are_not_lost),
        cmocka_unit_test(max_error_is_kept_in_dense_media),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
