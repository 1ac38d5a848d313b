/* Checks colours of values. Surfaces without lights show the map's own colours, which are compared with closed forms
 * for every scale, in bands of colour and outside of the range. Volumes with logarithmic scales are compared with the
 * reference integral. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "reference_base.h"
#include "reference_integral.h"
#include "test_effort.h"
#include "test_render_fixture.h"

static const float outside[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
static const float bands[] = {0.1F, 0.2F, 0.3F, 0.9F, 0.1F, 0.5F, 0.3F, 0.8F, 0.2F, 0.6F, 0.6F, 0.1F, 0.2F, 0.4F, 0.9F};

typedef struct scale_case {
    const char *name;
    double low, high;
    render_scale scale;
    double threshold;
    bool is_banded, has_outside;
} scale_case;

/* Cases of scales and ranges. The field that selects the colours ranges from -1.4 to 1.6. */
static const scale_case scale_cases[] = {
    {"linear", -0.4, 0.7, RENDER_LINEAR, 0, false, false},
    {"outside", -0.4, 0.7, RENDER_LINEAR, 0, false, true},
    {"bands", -0.4, 0.7, RENDER_LINEAR, 0, true, false},
    {"bands, outside", -0.4, 0.7, RENDER_LINEAR, 0, true, true},
    {"log", 1e-3, 1, RENDER_LOG, 0, false, false},
    {"log, outside", 1e-2, 1, RENDER_LOG, 0, false, true},
    {"log, bands", 0.02, 1.5, RENDER_LOG, 0, true, true},
    {"log, wide", 1e-30, 1, RENDER_LOG, 0, false, true},
    {"symlog", -1, 0.5, RENDER_SYMLOG, 1e-2, false, false},
    {"symlog, outside", -1, 0.5, RENDER_SYMLOG, 1e-3, false, true},
    {"symlog, positive", 0.1, 1, RENDER_SYMLOG, 0.3, true, true},
};
enum { LOOKS = sizeof scale_cases / sizeof *scale_cases };

static void set_scale_case(render_transfer *t, const scale_case *l)
{
    *t = (render_transfer){.low = l->low,
                           .high = l->high,
                           .colours = bands,
                           .colour_count = 5,
                           .scale = l->scale,
                           .threshold = l->threshold,
                           .is_banded = l->is_banded,
                           .outside = l->has_outside ? outside : NULL,
                           .unit_distance = 1};
    if (!l->is_banded) t->colours = colour_map_table("viridis", &t->colour_count);
}

/* value_error: error of the value at the hit by the rounding of depth, coordinates and values to float32. It is 4e-6
 * for lengths and values near 1; the fixture bounds depths by the same number. The colours at value - value_error and
 * value + value_error bound the error of the colour. A pixel is skipped if the colour jumps between these two values,
 * at the edge of a band or of the range. */
static const double value_error = 4e-6, colour_error = 3e-6;

/* Compares a pixel's colour with the reference. Returns false if the pixel is skipped. */
static bool check_pixel(const render_transfer *t, double value, const float drawn[3], const char *what)
{
    double at[3], low[3], high[3];
    reference_compute_colour(t, value, at);
    reference_compute_colour(t, value - value_error, low);
    reference_compute_colour(t, value + value_error, high);
    for (int c = 0; c < 3; c++) {
        const double moved = fmax(fabs(low[c] - at[c]), fabs(high[c] - at[c]));
        if (moved > 0.02) return false;
        if (!(fabs((double)drawn[c] - at[c]) <= moved + colour_error))
            fail_msg("%s: value %.9g: channel %d is %.9g, expected %.9g", what, value, c, (double)drawn[c], at[c]);
    }
    return true;
}

static void check_picture(const render_fixture *f, const render_transfer *t, const scale_case *l)
{
    drawn_frame drawn;
    const render_camera *camera = &f->job.camera;
    int hits = 0, counted = 0;
    fixture_draw(f, &drawn);
    for (int pixel = 0; pixel < camera->width * camera->height; pixel++) {
        double base[3], direction[3], p[3];
        if (drawn.first[pixel] == drawn.first[pixel + 1]) continue;
        const fragment *hit = &drawn.list.items[drawn.first[pixel]];
        const double depth = fixture_compute_scene_depth(f, hit->t_in);
        render_camera_ray(camera, pixel % camera->width, pixel / camera->width, base, direction);
        for (int a = 0; a < 3; a++) p[a] = base[a] + depth * direction[a];
        hits++;
        counted += check_pixel(t, test_linear_field(p), hit->colour, l->name);
    }
    assert_true(hits > 300 && counted > 0.9 * hits);
    drawn_frame_free(&drawn);
}

static void surfaces_without_light_have_the_maps_colours(void **state)
{
    (void)state;
    static const double values[] = {-0.2, 0.4};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_view colours;
        render_fixture f;
        test_mesh_make_lattice(kind, 4, 0.2, test_linear_field, &mesh);
        test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &colours);
        fixture_create_lattice(&f, kind, 4, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_add_surface(&f, values, 2, 1);
        f.surfaces[0].colour_field = (render_field){&colours.field, f.ranges};
        f.surfaces[0].colour_map = &f.transfer;
        f.surfaces[0].material = (render_material){.ambient = 1};
        for (int i = 0; i < LOOKS; i++) {
            set_scale_case(&f.transfer, &scale_cases[i]);
            for (int set = 0; set < fixture_isa_count(); set++) {
                fixture_select_isa(set);
                check_picture(&f, &f.transfer, &scale_cases[i]);
            }
        }
        test_view_free(&colours);
        test_mesh_free(&mesh);
        fixture_free(&f);
    }
}

static double undefined_field(const double p[3])
{
    (void)p;
    return (double)NAN;
}

static void nan_has_its_colour(void **state)
{
    (void)state;
    static const double values[] = {0.3};
    test_mesh mesh;
    test_view colours;
    render_fixture f;
    test_mesh_make_lattice(TEST_TETS, 4, 0.2, undefined_field, &mesh);
    test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &colours);
    fixture_create_lattice(&f, TEST_TETS, 4, 0.2, test_wave_field);
    fixture_add_surface(&f, values, 1, 1);
    f.surfaces[0].colour_field = (render_field){&colours.field, f.ranges};
    f.surfaces[0].colour_map = &f.transfer;
    f.surfaces[0].material = (render_material){.ambient = 1};
    for (int i = 0; i < LOOKS; i++) {
        drawn_frame drawn;
        const float grey[3] = {RENDER_NO_COLOUR, RENDER_NO_COLOUR, RENDER_NO_COLOUR};
        set_scale_case(&f.transfer, &scale_cases[i]);
        fixture_draw(&f, &drawn);
        assert_true(drawn.list.count > 100);
        for (int64_t n = 0; n < drawn.list.count; n++)
            assert_memory_equal(drawn.list.items[n].colour, scale_cases[i].has_outside ? outside + 6 : grey,
                                sizeof grey);
        drawn_frame_free(&drawn);
    }
    test_view_free(&colours);
    test_mesh_free(&mesh);
    fixture_free(&f);
}

static void scales_and_their_inverses_agree(void **state)
{
    (void)state;
    static const double values[] = {-1e6, -1, -1e-3, 0, 1e-9, 1e-3, 0.5, 2, 1e12};
    for (int i = 0; i < 9; i++) {
        const double v = values[i], s = render_scaled(RENDER_SYMLOG, 1e-3, v);
        assert_true(fabs(render_unscaled(RENDER_SYMLOG, 1e-3, s) - v) <= 1e-14 * fabs(v));
        assert_true(render_scaled(RENDER_SYMLOG, 1e-3, -v) == -s && render_scaled(RENDER_LINEAR, 0, v) == v);
        if (v > 0) assert_true(fabs(render_unscaled(RENDER_LOG, 0, render_scaled(RENDER_LOG, 0, v)) - v) <= 1e-14 * v);
    }
    assert_true(render_scaled(RENDER_SYMLOG, 1e-3, 1e-3) == 1);
    assert_true(render_scaled(RENDER_LOG, 0, 0) == (double)-INFINITY);
}

/* ---- volumes ---- */

static double growing_field(const double p[3])
{
    return pow(10, 2 * test_linear_field(p)); /* values from 1.6e-3 to 1600 */
}

static void set_volume(render_fixture *f, const scale_case *l, double values[3], render_transfer *t)
{
    static const float opacities[3] = {0, 0.7F, 0.2F};
    fixture_set_volume(f, 0.4);
    const double unit = f->transfer.unit_distance;
    set_scale_case(t, l);
    t->opacity_count = 3;
    t->opacity_values = values;
    t->opacities = opacities;
    t->unit_distance = unit;
    f->volume.transfer = t;
}

static const scale_case volume_looks[] = {
    {"log", 1e-2, 1e2, RENDER_LOG, 0, false, false},
    {"log, more than the data", 1e-3, 1e4, RENDER_LOG, 0, false, false},
    {"symlog", -10, 1e3, RENDER_SYMLOG, 0.1, false, false},
};

/* Compares volumes integrated by samples with the reference. The tolerance is that of other transfer functions plus the
 * effect of rounding the position in the colour table: 3e-7 of the scale's value, which changes the colour by less than
 * 1e-5. */
static void sampled_volumes_match_the_reference(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        render_fixture f;
        render_transfer t;
        double values[3] = {0.05, 3, 90};
        fixture_bounds bounds = fixture_usual_bounds;
        bounds.colour += 1e-5;
        fixture_create_lattice(&f, TEST_TETS, 4, 0.2, growing_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        set_volume(&f, &volume_looks[i], values, &t);
        fixture_compare_with_reference(&f, &bounds, volume_looks[i].name);
        fixture_free(&f);
    }
}

/* Compares volumes integrated by segments with the reference. Colours are linear between 256 entries. Over 12 decades
 * an entry spans 0.11 in the natural logarithm of the value, and neighbouring colours differ by 0.03; linear
 * interpolation is off by 0.11 / 8 of this difference, 4e-4. The extinction, and therefore the light, has a relative
 * error of 1e-4. Apart from these errors, tets are exact and other cells keep max_error. */
static void integrated_volumes_keep_their_error(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++)
        for (int hexes = 0; hexes < 2; hexes++) {
            render_fixture f;
            render_transfer t;
            drawn_frame drawn;
            double values[3] = {0.05, 3, 90}, worst = 0;
            const double allowed = 4e-4 + (hexes ? 0.01 : 1.01e-4);
            fixture_create_lattice(&f, hexes ? TEST_HEXES : TEST_TETS, 4, 0.2, growing_field);
            fixture_set_camera(&f, CAMERA_OUTSIDE, 17, 15);
            set_volume(&f, &volume_looks[i], values, &t);
            f.job.integration = RENDER_SEGMENTS;
            f.job.max_error = hexes ? 0.01 : 0;
            reference_integral *scene = reference_integral_create(&f.job, 1e-8);
            fixture_draw(&f, &drawn);
            for (int pixel = 0; pixel < 17 * 15; pixel++) {
                double truth[4];
                reference_integral_trace(scene, pixel % 17, pixel / 17, fixture_background, NULL, 0, truth);
                for (int c = 0; c < 4; c++)
                    worst = test_larger_error(worst, fabs((double)drawn.picture.rgba[4 * pixel + c] - truth[c]));
            }
            fprintf(stderr, "%s, %s: off by %.2g\n", volume_looks[i].name, hexes ? "hexes" : "tets", worst);
            assert_true(worst <= allowed);
            reference_integral_free(scene);
            drawn_frame_free(&drawn);
            fixture_free(&f);
        }
}

/* ---- ramps along a scale ---- */

static double decades, constant;

/* A field whose values in [-1, 1]^3 span the given number of decades, up to 1. */
static double decades_field(const double p[3])
{
    return pow(10, decades * 0.5 * (test_linear_field(p) / 1.61 - 1)); /* 1.61 is the maximum of test_linear_field */
}

static double constant_field(const double p[3])
{
    (void)p;
    return constant;
}

enum { RAMP_POINTS = 6, RAMP_SIDE = 6 };

typedef struct random_ramp {
    double values[RAMP_POINTS];
    float opacities[RAMP_POINTS];
    render_transfer transfer;
} random_ramp;

/* Makes a random ramp of opacity with two to six control points. It is piecewise linear along the scale and usually has
 * an opacity of 0 or 1 at its ends. No cell is longer than 20 unit distances. */
static void make_ramp(random_ramp *r, uint64_t seed, double unit)
{
    const bool is_log = test_uniform(0, seed) < 0.5;
    const int count = 2 + (int)(test_uniform(1, seed) * (RAMP_POINTS - 1));
    decades = test_uniform_between(2, seed, 2, 12);
    const double least = pow(10, -decades);
    r->transfer = (render_transfer){.low = is_log ? least : -test_uniform(3, seed),
                                    .high = 1,
                                    .scale = is_log ? RENDER_LOG : RENDER_SYMLOG,
                                    .threshold = least,
                                    .opacity_count = count,
                                    .opacity_values = r->values,
                                    .opacities = r->opacities,
                                    .unit_distance = unit};
    render_transfer *t = &r->transfer;
    t->colours = colour_map_table("viridis", &t->colour_count);
    const double from = render_scaled(t->scale, least, t->low), to = render_scaled(t->scale, least, 1);
    const double most = pow(10, test_uniform_between(4, seed, -2, 0));
    for (int i = 0; i < count; i++) {
        const double along = (i + test_uniform_between((uint64_t)i, seed + 1, 0, 0.9)) / count;
        const double kind = test_uniform((uint64_t)i, seed + 2);
        r->values[i] = render_unscaled(t->scale, least, from + along * (to - from));
        r->opacities[i] = (float)(kind < 0.3 ? 0 : most * test_uniform((uint64_t)i, seed + 3));
    }
    if (test_uniform(5, seed) < 0.1) r->opacities[count / 2] = 1;
}

static double measure_ramp_error(test_mesh_kind kind, test_function *field, uint64_t seed, double max_error)
{
    render_fixture f;
    random_ramp ramp;
    drawn_frame drawn;
    double worst = 0;
    make_ramp(&ramp, seed, 0.1);
    constant = pow(10, -decades * test_uniform(6, seed));
    fixture_create_lattice(&f, kind, 1 + (field == decades_field), 0.2, field);
    fixture_set_camera(&f, CAMERA_OUTSIDE, RAMP_SIDE, RAMP_SIDE);
    fixture_set_volume(&f, 0.4);
    f.volume.transfer = &ramp.transfer;
    f.job.integration = RENDER_SEGMENTS;
    f.job.max_error = max_error;
    reference_integral *scene = reference_integral_create(&f.job, 1e-6);
    fixture_draw(&f, &drawn);
    for (int pixel = 0; pixel < RAMP_SIDE * RAMP_SIDE; pixel++) {
        double truth[4];
        reference_integral_trace(scene, pixel % RAMP_SIDE, pixel / RAMP_SIDE, fixture_background, NULL, 0, truth);
        for (int c = 0; c < 4; c++)
            worst = test_larger_error(worst, fabs((double)drawn.picture.rgba[4 * pixel + c] - truth[c]));
    }
    reference_integral_free(scene);
    drawn_frame_free(&drawn);
    fixture_free(&f);
    return worst;
}

/* Checks that random ramps keep max_error. Errors of a ramp add up along a ray, most of all in a cell with a single
 * value. Polyhedra have values in single precision (docs/development/error_budget.md, narrow ramps): at the foot of a
 * ramp that begins at 1e-6 of the range, their error was 1.6e-3 under a max_error of 1e-3. */
static void ramps_along_scales_keep_max_error(void **state)
{
    (void)state;
    const int ramps = test_case_count(40, 1000);
    double share[2] = {0, 0};
    for (int i = 0; i < ramps; i++) {
        const test_mesh_kind kind = (test_mesh_kind)(i % TEST_KIND_COUNT);
        for (int varies = 0; varies < 2; varies++) {
            const double max_error = i % 4 || (varies && kind == TEST_POLYHEDRA) ? 0.01 : 1e-3;
            const uint64_t seed = 7000 + 10 * (uint64_t)i;
            const double off = measure_ramp_error(kind, varies ? decades_field : constant_field, seed, max_error);
            share[varies] = test_larger_error(share[varies], off / max_error);
            if (!(off <= max_error))
                fail_msg("ramp %d, %s, %s, %.1f decades: off by %g of %g", i, test_mesh_kind_name(kind),
                         varies ? "all values" : "one value", decades, off, max_error);
        }
    }
    fprintf(stderr, "%d ramps: at most %.2g of max_error in cells of one value, %.2g in others\n", ramps, share[0],
            share[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scales_and_their_inverses_agree),
        cmocka_unit_test(surfaces_without_light_have_the_maps_colours),
        cmocka_unit_test(nan_has_its_colour),
        cmocka_unit_test(sampled_volumes_match_the_reference),
        cmocka_unit_test(integrated_volumes_keep_their_error),
        cmocka_unit_test(ramps_along_scales_keep_max_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
