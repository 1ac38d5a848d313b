/* Checks scenes that make many pictures: positions of the views of an orbit, variants of a sweep, camera paths, and
 * image databases. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene.h"

/* Error of the sine and cosine of an angle that is converted from degrees to radians: a few times 2^-53. */
#define ANGLE_TOLERANCE 1e-15

static void parse_valid_scene(const char *text, scene *s)
{
    base_error error = {.status = INSITU_OK};
    if (scene_parse(text, strlen(text), "scene.yaml", NULL, s, &error) != INSITU_OK) fail_msg("%s", error.message);
}

static void assert_nearly_equal(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.17g, expected %.17g within %g", value, expected, tolerance);
}

static void check_vector(const double v[3], double x, double y, double z)
{
    assert_nearly_equal(v[0], x, ANGLE_TOLERANCE);
    assert_nearly_equal(v[1], y, ANGLE_TOLERANCE);
    assert_nearly_equal(v[2], z, ANGLE_TOLERANCE);
}

static void parse_camera(const char *camera, scene *s)
{
    char text[2048];
    snprintf(text, sizeof text,
             "images: [{name: a, camera: {%s}, layers: [{volume: {field: p}}], outputs: [{cinema: a.cdb}]}]", camera);
    parse_valid_scene(text, s);
}

/* ---- orbits ---------------------------------------------------------------------------------------------------- */

static void orbits_go_around_coordinate_axes(void **state)
{
    (void)state;
    static const struct {
        const char *axis;
        double up[3], views[4][3]; /* eye positions at 0, 90, 180 and 270 degrees */
    } cases[] = {{"[0, 3, 0]", {0, 1, 0}, {{0, 0, 1}, {1, 0, 0}, {0, 0, -1}, {-1, 0, 0}}},
                 {"[0, 0, 1]", {0, 0, 1}, {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}}},
                 {"[-1, 0, 0]", {-1, 0, 0}, {{0, 1, 0}, {0, 0, -1}, {0, -1, 0}, {0, 0, 1}}}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        char camera[128];
        scene s;
        snprintf(camera, sizeof camera, "orbit: {views: 4, axis: %s, elevation: 0}", cases[c].axis);
        parse_camera(camera, &s);
        assert_int_equal(s.image_count, 4);
        for (int view = 0; view < 4; view++) {
            const scene_camera *k = &s.images[view].camera;
            const double *v = cases[c].views[view], *up = cases[c].up;
            check_vector(k->direction, v[0], v[1], v[2]);
            check_vector(k->up, up[0], up[1], up[2]);
            assert_true(k->is_automatic && k->phi == 90 * view && k->theta == 0);
            assert_int_equal(s.images[view].variant.view, view);
        }
        scene_free(&s);
    }
}

/* Checks, for an axis in any direction, the angles between the views and the angles between the views and the axis. */
static void orbits_are_circles_about_any_axis(void **state)
{
    (void)state;
    static const double degree = 3.14159265358979323846 / 180, elevations[] = {-70, 0, 89.9};
    scene s;
    parse_camera("projection: orthographic, automatic: {zoom: 2, fit: box}, orbit: {views: 7, axis: [1, -2, 0.5], "
                 "elevation: [-70, 0, 89.9], start: -30}",
                 &s);
    assert_int_equal(s.image_count, 21);
    for (int i = 0; i < 21; i++) {
        const scene_camera *k = &s.images[i].camera, *other = &s.images[i - i % 7].camera;
        double along = 0, between = 0;
        for (int a = 0; a < 3; a++)
            along += k->direction[a] * k->up[a], between += k->direction[a] * other->direction[a];
        const double theta = elevations[i / 7] * degree, phi = 360.0 / 7 * (i % 7) * degree;
        assert_nearly_equal(along, sin(theta), ANGLE_TOLERANCE);
        assert_nearly_equal(between, sin(theta) * sin(theta) + cos(theta) * cos(theta) * cos(phi), 2 * ANGLE_TOLERANCE);
        assert_nearly_equal(k->phi, 360.0 / 7 * (i % 7) - 30, 1e-12);
        assert_true(k->theta == elevations[i / 7] && k->zoom == 2 && k->fits_box && k->is_orthographic);
    }
    scene_free(&s);
}

static void orbits_have_their_defaults(void **state)
{
    (void)state;
    scene s;
    parse_camera("orbit: {views: 1}", &s);
    assert_int_equal(s.image_count, 1);
    check_vector(s.images[0].camera.direction, 0, 0.5, sqrt(0.75));
    check_vector(s.images[0].camera.up, 0, 1, 0);
    assert_string_equal(s.images[0].outputs[0].path, "a.cdb/{name}_{cycle:06}_{view:03}.png");
    scene_free(&s);
}

/* ---- sweeps ---------------------------------------------------------------------------------------------------- */

static void sweeps_make_each_combination_once(void **state)
{
    (void)state;
    static const char *const fields[] = {"p", "r"};
    scene s;
    parse_valid_scene("images:\n- name: a\n  camera: {orbit: {views: 2}}\n  sweep: {isovalues: true, fields: [p, r]}\n"
                      "  layers:\n"
                      "  - isosurface: {field: q, values: [1, 2, 3], colours: [[1, 0, 0], [0, 1, 0]], opacity: 0.5}\n"
                      "  - slice: {field: x, planes: [{normal: [1, 0, 0]}]}\n"
                      "  - volume: {field: x}\n"
                      "  - surface: {colour_by: {field: x}}\n"
                      "  outputs: [{cinema: a.cdb}]\n"
                      "- name: b\n  layers: [{volume: {field: x}}]\n  outputs: [{path: b.png}]\n",
                      &s);
    assert_int_equal(s.image_count, 2 * 3 * 2 + 1);
    for (int i = 0; i < 12; i++) {
        const scene_image *image = &s.images[i];
        const int field = i / 6, value = i / 2 % 3;
        assert_true(image->variant.source == 0 && image->variant.view == i % 2 && image->variant.layers == i / 2);
        assert_string_equal(image->swept_field, fields[field]);
        assert_string_equal(image->slices[0].field.name, fields[field]);
        assert_string_equal(image->volumes[0].field.name, fields[field]);
        assert_string_equal(image->surfaces[0].colour_by.name, fields[field]);
        assert_string_equal(image->isosurfaces[0].field.name, "q");
        assert_int_equal(image->slices[0].field.line, 4);
        assert_int_equal(image->isosurfaces[0].value_count, 1);
        assert_true(image->isosurfaces[0].values[0] == value + 1 && image->isovalue == value + 1);
        assert_true(image->isosurfaces[0].colours[value == 0 ? 0 : 1] == 1);
        /* both views of a variant have the same layers */
        assert_true(image->isosurfaces == s.images[i - i % 2].isosurfaces);
        assert_true(scene_is_first_variant(image) == (i == 0));
        const scene_placeholder_values moment = scene_make_placeholder_values(image, 5, 0);
        char expected[64], *path = scene_expand_placeholders(image->outputs[0].path, &moment);
        snprintf(expected, sizeof expected, "a.cdb/a_000005_%03d_%d_%s.png", i % 2, value + 1, fields[field]);
        assert_string_equal(path, expected);
        base_free(path);
    }
    assert_true(s.images[12].variant.source == 1 && !s.images[12].swept_field && !s.images[12].has_isovalue);
    scene_free(&s);
}

static void sweeps_go_through_planes(void **state)
{
    (void)state;
    static const double shares[] = {-0.5, 0.5}, offsets[] = {-1, 0, 2};
    scene s;
    parse_valid_scene("images:\n- name: a\n  sweep: {isovalues: true, planes: true}\n  layers:\n"
                      "  - slice: {field: p, planes: [{normal: x, offsets: [-1, 0, 2]}, {normal: y, count: 2}]}\n"
                      "  - isosurface: {field: q, values: [3, 4]}\n"
                      "  outputs: [{cinema: a.cdb}, {path: \"{isovalue}_{plane}.png\"}]\n",
                      &s);
    assert_int_equal(s.image_count, 2 * 5);
    assert_true(s.databases[0].has_planes && s.databases[0].has_isovalues);
    for (int i = 0; i < 10; i++) {
        const scene_image *image = &s.images[i];
        const scene_slice *slice = &image->slices[0];
        const int plane = i % 5;
        assert_true(image->has_plane && image->variant.plane == plane && image->variant.isovalue == i / 5);
        assert_true(slice->plane_count == 1 && image->isosurfaces[0].values[0] == 3 + i / 5);
        assert_true(slice->planes[0].offset == (plane < 3 ? offsets[plane] : 0));
        assert_true(slice->planes[0].extent_fraction == (plane < 3 ? 0 : shares[plane - 3]));
        assert_true(scene_is_first_variant(image) == (i == 0));
        const scene_placeholder_values moment = scene_make_placeholder_values(image, 5, 0);
        char expected[64], *path = scene_expand_placeholders(image->outputs[0].path, &moment);
        snprintf(expected, sizeof expected, "a.cdb/a_000005_%d_%02d.png", 3 + i / 5, plane);
        assert_string_equal(path, expected);
        base_free(path);
    }
    scene_free(&s);
}

static void databases_have_the_columns_of_their_images(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene("images:\n- name: a\n  camera: {orbit: {views: 3}}\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{cinema: a.cdb}, {cinema: ././out/b.cdb, path: \"x/{view}.png\", bits: 16}]\n"
                      "- name: b\n  sweep: {fields: [p]}\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: b.png}, {cinema: out/b.cdb}]\n",
                      &s);
    assert_int_equal(s.database_count, 2);
    const scene_database *a = s.databases, *b = a + 1;
    assert_string_equal(a->path, "a.cdb");
    assert_string_equal(b->path, "out/b.cdb");
    assert_true(!a->has_images && a->has_orbits && !a->has_isovalues && !a->has_fields);
    assert_true(b->has_images && b->has_orbits && !b->has_isovalues && b->has_fields);
    const scene_output *outputs = s.images[2].outputs;
    assert_true(outputs[0].database == 0 && outputs[1].database == 1 && outputs[1].format == SCENE_PNG16);
    assert_string_equal(outputs[1].path, "out/b.cdb/x/{view}.png");
    assert_int_equal(outputs[1].folder_bytes, strlen("out/b.cdb/"));
    assert_true(s.images[3].outputs[0].database == -1 && s.images[3].outputs[1].database == 1);
    scene_free(&s);
}

static void grid_cells_are_numbered(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene("images:\n- name: a\n  size: [8, 6]\n  camera: {orbit: {views: 2}}\n  sweep: {fields: [p, r]}\n"
                      "  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"all_{cycle:04}.png\", grid: [3, 2]}, {path: \"{field}_{view}.png\"}]\n"
                      "- name: b\n  size: [8, 6]\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"all_{cycle}.png\", grid: [3, 2]}, {path: \"{name}.png\", grid: [1, 1]}]\n",
                      &s);
    assert_int_equal(s.image_count, 5);
    assert_int_equal(s.montage_count, 2);
    assert_true(s.montages[0].columns == 3 && s.montages[0].rows == 2 && s.montages[0].panel_count == 5);
    assert_true(s.montages[0].width == 8 && s.montages[0].height == 6 && s.montages[1].panel_count == 1);
    for (int i = 0; i < 5; i++) {
        const scene_output *output = &s.images[i].outputs[0];
        assert_true(output->montage == 0 && output->first_panel + s.images[i].variant.view == i);
    }
    assert_true(s.images[0].outputs[1].montage == -1 && s.images[4].outputs[1].montage == 1);
    scene_free(&s);
}

/* Returns whether the montage has this inset and no others. */
static bool has_inset(const scene_montage *m, scene_anchor corner, int x, int y, int width, int height)
{
    int count = 0;
    for (int i = 0; i < SCENE_ANCHORS; i++) count += m->insets[i].width > 0;
    const scene_rectangle *r = &m->insets[corner];
    return count == 1 && r->x == x && r->y == y && r->width == width && r->height == height;
}

/* Checks insets. Their frames are 480 / 400 pixels wide, and the margins beside them 480 / 50, both rounded up. */
static void insets_cover_the_corners_of_grids(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene("images:\n- name: a\n  size: [320, 240]\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"all_{cycle:04}.png\", grid: [3, 2]}]\n"
                      "- name: b\n  size: [100, 80]\n  sweep: {fields: [p, r]}\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"b_{field}.png\", grid: [1, 1]}]\n"
                      "- name: c\n  size: [90, 70]\n  sweep: {fields: [p, r]}\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"b_{field}.png\", inset: bottom_left}]\n"
                      "- name: d\n  size: [90, 70]\n  layers: [{volume: {field: p}}]\n"
                      "  outputs: [{path: \"all_{cycle}.png\", inset: top_right}, {path: all_1.png}]\n",
                      &s);
    assert_int_equal(s.image_count, 6);
    assert_int_equal(s.montage_count, 3);
    assert_true(s.montages[0].frame_width == 2 && s.montages[0].inset_margin == 12);
    assert_true(s.montages[0].panel_count == 1 && has_inset(&s.montages[0], SCENE_TOP_RIGHT, 858, 12, 90, 70));
    for (int i = 1; i < 3; i++) {
        const scene_output *output = &s.images[i + 2].outputs[0];
        assert_true(s.montages[i].panel_count == 1 && has_inset(&s.montages[i], SCENE_BOTTOM_LEFT, 3, 7, 90, 70));
        assert_true(output->montage == i && output->is_inset && output->corner == SCENE_BOTTOM_LEFT);
        assert_int_equal(output->first_panel, 1);
    }
    assert_true(s.images[5].outputs[0].montage == 0 && s.images[5].outputs[0].first_panel == 6);
    assert_true(s.images[5].outputs[1].montage == -1 && !s.images[5].outputs[1].is_inset);
    scene_free(&s);
}

/* Checks the width of the strips with colour bars. Text whose size is 0.03 of the height needs 0.03 * 24 * 9 = 6.48
 * pixels; text of size 0.1 needs 21.6. */
static void colour_bar_strips_fit_their_labels(void **state)
{
    (void)state;
    static const struct {
        const char *decorations;
        int width;
        bool is_left;
    } cases[] = {{"colour_bar: true", 7, false}, {"size: 0.1, colour_bar: {at: left}", 22, true}};
    for (int i = 0; i < 2; i++) {
        char text[512];
        scene s;
        snprintf(text, sizeof text,
                 "images:\n- name: a\n  size: [32, 24]\n  layers: [{slice: {field: p}}]\n  decorations: {%s}\n"
                 "  outputs: [{path: a.png, grid: [1, 1], shared_bars: true}, {path: b.png, grid: [1, 1]}]\n",
                 cases[i].decorations);
        parse_valid_scene(text, &s);
        assert_true(s.montages[0].shares_bars && !s.montages[1].shares_bars);
        assert_true(s.montages[0].bar_width == cases[i].width && s.montages[1].bar_width == 0);
        assert_true(s.montages[0].are_bars_left == cases[i].is_left);
        scene_free(&s);
    }
}

/* ---- camera paths ------------------------------------------------------------------------------------------------ */

static const char moving[] = "angle: 30, path: [{time: 1, position: [0, 0, 8], focal: [0, 0, 0]}, "
                             "{time: 2, position: [4, 0, 8], focal: [0, 1, 0], angle: 50}, "
                             "{time: 5, position: [6, 3, 8], focal: [0, 0, 0], up: [0, 0, 1]}, "
                             "{time: 5.5, position: [0, 3, 8], focal: [0, 0, 1]}]";

static void camera_paths_interpolate_positions_and_stop_at_ends(void **state)
{
    (void)state;
    scene s;
    parse_camera(moving, &s);
    const scene_camera *c = &s.images[0].camera;
    assert_true(c->point_count == 4 && !c->is_automatic && !c->is_by_cycle);
    for (int i = 0; i < 4; i++) {
        const scene_camera_point *p = &c->points[i];
        const scene_camera at = scene_compute_camera_at_time(c, -7, p->at);
        assert_memory_equal(at.eye, p->eye, sizeof at.eye);
        assert_memory_equal(at.focal, p->focal, sizeof at.focal);
        assert_memory_equal(at.up, p->up, sizeof at.up);
        assert_true(at.angle == p->angle && at.angle == (i == 1 ? 50 : 30));
    }
    check_vector(c->points[2].up, 0, 0, 1);
    static const double beyond[] = {-1e300, 0.999, NAN, 5.5001, 1e300};
    for (int i = 0; i < 5; i++) {
        const scene_camera at = scene_compute_camera_at_time(c, 0, beyond[i]);
        assert_memory_equal(at.eye, c->points[i < 3 ? 0 : 3].eye, sizeof at.eye);
    }
    scene_free(&s);
}

/* Checks a path with two positions that is interpolated by cycles. At the fraction s of the cycles, the camera must
 * have moved by 3 s^2 - 2 s^3 of the distance. */
static void camera_paths_of_two_positions_ease_in_and_out(void **state)
{
    (void)state;
    scene s;
    parse_camera("path: [{cycle: 10, position: [0, 0, 8], focal: [0, 0, 0]}, {cycle: 30, position: [1, 5, 8], "
                 "focal: [0, 0, -2]}]",
                 &s);
    for (int cycle = 0; cycle < 40; cycle++) {
        const double share = fmin(fmax((cycle - 10) / 20.0, 0), 1), way = share * share * (3 - 2 * share);
        const scene_camera at = scene_compute_camera_at_time(&s.images[0].camera, cycle, 1e9);
        check_vector(at.eye, way, 5 * way, 8); /* a coordinate that does not change must remain bitwise equal */
        check_vector(at.focal, 0, 0, -2 * way);
        assert_true(at.eye[2] == 8);
    }
    scene_free(&s);
}

/* Checks, by differences, that the slope is the same on both sides of each position, and that the path stays between
 * neighbouring positions. The second derivative of a cubic is below 12 times its rise, so a difference over h has an
 * error of less than 6 h times the rise. */
static void camera_paths_are_smooth_without_overshoot(void **state)
{
    (void)state;
    enum { STEPS = 4000 };
    scene s;
    parse_camera(moving, &s);
    const scene_camera *c = &s.images[0].camera;
    for (int i = 0; i < 4; i++) {
        const double h = 1e-5, at = c->points[i].at;
        const scene_camera before = scene_compute_camera_at_time(c, 0, at - h),
                           here = scene_compute_camera_at_time(c, 0, at),
                           after = scene_compute_camera_at_time(c, 0, at + h);
        for (int a = 0; a < 3; a++)
            assert_nearly_equal((after.eye[a] - here.eye[a]) / h, (here.eye[a] - before.eye[a]) / h,
                                2 * 6 * h * 6 / 0.25);
    }
    for (int n = 0; n <= STEPS; n++) {
        const double time = 1 + 4.5 * n / STEPS;
        const scene_camera at = scene_compute_camera_at_time(c, 0, time);
        int i = 0;
        while (i < 2 && time >= c->points[i + 1].at) i++;
        for (int a = 0; a < 3; a++) {
            const double from = c->points[i].eye[a], to = c->points[i + 1].eye[a];
            assert_true(at.eye[a] >= fmin(from, to) && at.eye[a] <= fmax(from, to));
        }
        assert_true(at.angle >= 30 && at.angle <= 50 && at.eye[2] == 8);
    }
    /* x rises by 4 in a time of 1, then by 2 in a time of 3. The slope at the position between them is 12 / (7 / 4 + 5
     * / (2 / 3)). */
    assert_nearly_equal(scene_compute_camera_at_time(c, 0, 1.5).eye[0], 2 - 12 / (1.75 + 7.5) / 8, 1e-14);
    scene_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(orbits_go_around_coordinate_axes),
        cmocka_unit_test(orbits_are_circles_about_any_axis),
        cmocka_unit_test(orbits_have_their_defaults),
        cmocka_unit_test(sweeps_make_each_combination_once),
        cmocka_unit_test(sweeps_go_through_planes),
        cmocka_unit_test(grid_cells_are_numbered),
        cmocka_unit_test(insets_cover_the_corners_of_grids),
        cmocka_unit_test(colour_bar_strips_fit_their_labels),
        cmocka_unit_test(databases_have_the_columns_of_their_images),
        cmocka_unit_test(camera_paths_interpolate_positions_and_stop_at_ends),
        cmocka_unit_test(camera_paths_of_two_positions_ease_in_and_out),
        cmocka_unit_test(camera_paths_are_smooth_without_overshoot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
