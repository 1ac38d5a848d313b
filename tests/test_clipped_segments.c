/* Checks segments of volumes under max_error that are clipped by spheres which rays only graze. The interval of a ray
 * that a sphere keeps or removes may be as short as 1e-4 of the sphere's radius, and it may begin and end anywhere in a
 * cell. The reference is the adaptive integral in double, cut at the intersections of line and sphere in closed
 * form. */
#include "reference_integral.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <cmocka.h>

enum { SIDE = 13 };

/* Makes a sphere that the pixel's ray grazes: the ray's greatest depth below the surface is a random fraction of the
 * radius, from 1e-11 to a half. Computes the depths at which the ray enters and leaves the sphere. */
static void make_grazed_sphere(const render_camera *camera, int pixel, uint64_t seed, render_clip *clip,
                               double depths[2])
{
    double base[3], d[3], square = 0, along = 0, across = 0;
    render_camera_ray(camera, pixel % SIDE, pixel / SIDE, base, d);
    for (int a = 0; a < 3; a++) {
        clip->centre[a] = test_uniform_between((uint64_t)a, seed, -0.6, 0.6);
        square += d[a] * d[a];
        along += d[a] * (clip->centre[a] - base[a]);
    }
    const double nearest = along / square;
    for (int a = 0; a < 3; a++) across += pow(clip->centre[a] - base[a] - nearest * d[a], 2);
    clip->kind = RENDER_CLIP_SPHERE;
    clip->is_outside = seed % 2;
    clip->radius = sqrt(across) * (1 + pow(10, -test_uniform_between(3, seed, 0.3, 11)));
    const double half = sqrt((clip->radius * clip->radius - across) / square);
    depths[0] = nearest - half;
    depths[1] = nearest + half;
}

/* Draws a random picture of the mesh. Returns the error at the pixel whose ray grazes the sphere. */
static double measure_error(test_mesh_kind kind, uint64_t seed, double max_error)
{
    render_fixture f;
    fixture_function function;
    render_clip clip = {0};
    reference_hit cuts[2];
    double depths[2], truth[4], worst = 0;
    drawn_frame drawn;
    const int pixel = (int)(test_uniform(1, seed) * SIDE * SIDE);
    fixture_create_lattice(&f, kind, 2 + (int)(seed % 3), 0.2, test_wave_field);
    fixture_set_camera(&f, (fixture_camera)(seed / 2 % 3), SIDE, SIDE);
    fixture_set_volume(&f, 1);
    fixture_set_function(&f, &function, seed, seed % 5 == 0, 0.9, pow(10, test_uniform_between(2, seed, -2.5, 0.5)));
    f.transfer.low = -1;
    f.job.integration = RENDER_SEGMENTS;
    f.job.max_error = max_error;
    f.job.extent = 3.5; /* any length not below the cube's diagonal, about 3.46 */
    make_grazed_sphere(&f.job.camera, pixel, seed, &clip, depths);
    f.job.clips = &clip;
    f.job.clip_count = 1;
    f.job.volume_clips = 1;
    fixture_draw(&f, &drawn);
    for (int i = 0; i < 2; i++) cuts[i] = (reference_hit){.depth = depths[i], .opacity = 0};
    reference_integral *scene = reference_integral_create(&f.job, 1e-9);
    reference_integral_trace(scene, pixel % SIDE, pixel / SIDE, fixture_background, cuts, 2, truth);
    for (int c = 0; c < 4; c++)
        worst = test_larger_error(worst, fabs((double)drawn.picture.rgba[4 * pixel + c] - truth[c]));
    reference_integral_free(scene);
    drawn_frame_free(&drawn);
    fixture_free(&f);
    return worst;
}

static void grazed_spheres_keep_max_error(void **state)
{
    static const double asked[3] = {1e-2, 1e-3, 1e-4};
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int i = 0; i < 3; i++) {
            double worst = 0;
            uint64_t at = 0;
            for (uint64_t seed = 0; seed < (uint64_t)test_case_count(20, 2000); seed++) {
                const double error = measure_error(kind, 3 * seed + (uint64_t)i, asked[i]);
                if (error > worst) at = 3 * seed + (uint64_t)i;
                worst = test_larger_error(worst, error);
            }
            fprintf(stderr, "%s, max_error %g: %.3g of it, seed %d\n", test_mesh_kind_name(kind), asked[i],
                    worst / asked[i], (int)at);
            assert_true(worst <= asked[i]);
        }
}

/* Returns the error in a medium of constant density. The medium is so dense that the short path inside a grazed sphere
 * absorbs between a tenth and nearly all of the light. If both ends of the path were rounded to float32, its length
 * would be off by as much as a hundredth. The reference is the exponential of the path's length in closed form. */
static double measure_error_in_fog(test_mesh_kind kind, uint64_t seed)
{
    static const float half[1] = {0.5f};
    render_fixture f;
    render_clip clip = {0};
    double depths[2], base[3], d[3];
    drawn_frame drawn;
    const int pixel = SIDE / 2 * SIDE + SIDE / 2;
    fixture_create_lattice(&f, kind, 3, 0.2, test_linear_field);
    fixture_set_camera(&f, (fixture_camera)(seed / 2 % 2), SIDE, SIDE);
    fixture_set_volume(&f, 1);
    make_grazed_sphere(&f.job.camera, pixel, 2 * seed, &clip, depths); /* the clip keeps the inside of the sphere */
    render_camera_ray(&f.job.camera, pixel % SIDE, pixel / SIDE, base, d);
    const double length = (depths[1] - depths[0]) * sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const double depth = test_uniform_between(4, seed, 0.1, 4);
    f.transfer.opacity_count = 1;
    f.transfer.opacities = half;
    f.transfer.unit_distance = length * log(2) / depth;
    f.job.integration = RENDER_SEGMENTS;
    f.job.max_error = 1e-3;
    f.job.extent = 3.5;
    f.job.clips = &clip;
    f.job.clip_count = 1;
    f.job.volume_clips = 1;
    fixture_draw(&f, &drawn);
    const double truth = 1 - exp(-depth) * (1 - (double)fixture_background[3]);
    const double error = fabs((double)drawn.picture.rgba[4 * pixel + 3] - truth);
    drawn_frame_free(&drawn);
    fixture_free(&f);
    return error;
}

static void short_paths_through_dense_media_keep_max_error(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        double worst = 0;
        for (uint64_t seed = 0; seed < (uint64_t)test_case_count(30, 2000); seed++)
            worst = test_larger_error(worst, measure_error_in_fog(kind, seed));
        fprintf(stderr, "%s, dense, max_error 0.001: %.3g of it\n", test_mesh_kind_name(kind), worst / 1e-3);
        assert_true(worst <= 1e-3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(grazed_spheres_keep_max_error),
                                       cmocka_unit_test(short_paths_through_dense_media_keep_max_error)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
