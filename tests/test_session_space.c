/* Checks that a scene's position and size do not change the picture: far from the origin, as in projected coordinates
 * of maps, and a million times smaller or larger, if the camera and all lengths of the scene file are changed in the
 * same way.
 *
 * An integer offset of coordinates that are multiples of 2^-24 is exact, so that only the rounding of the eye's
 * position can differ. A factor of 1e6 is not a power of two, so that all float32 numbers are rounded differently. In
 * double, this changes no pixel by 1e-12; if vertices are rounded to float32, it changes no pixel by 1e-7. Errors of
 * hits matter more: if the field at the hit is off by 3e-8, a pixel whose ray grazes a hex changes by 7e-7. Therefore
 * the robust hit finder computes the residuals of its last step in double. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { WIDTH = 48, HEIGHT = 40 };

typedef struct space_case {
    const char *name;
    test_mesh_kind kind;
    bool as_polyhedra;
    double allowed;
    const char *layers, *sampling; /* each contains at most one length, as a format */
} space_case;

#define FIELD "volume: {field: f, range: [-1.5, 1.5], opacity: [[0, 0.1], [0.5, 0.8], [1, 0.3]], unit_distance: %.17g}"

/* With max_error, rounding can decide whether an interval of a ray is divided once more. Both results are within
 * max_error; the allowed difference is a fiftieth of it (0.011 was measured). */
static const space_case cases[] = {
    {"isosurface of tets", TEST_TETS, false, 1e-6, "isosurface: {field: f, values: [-0.2, 0.3]}", ""},
    {"isosurface of hexes", TEST_HEXES, false, 1e-6, "isosurface: {field: f, values: [-0.2, 0.3], opacity: 0.5}", ""},
    {"isosurface of polyhedra", TEST_HEXES, true, 1e-6, "isosurface: {field: f, values: [-0.2, 0.3], opacity: 0.5}",
     ""},
    {"samples", TEST_MIXED, false, 1e-6, FIELD, "    sampling: {step: %.17g, jitter: true}\n"},
    {"samples of polyhedra", TEST_POLYHEDRA, false, 1e-6, FIELD, "    sampling: {step: %.17g}\n"},
    {"segments", TEST_TETS, false, 1e-6, FIELD, "    sampling: {method: segments, step: %.17g}\n"},
    {"segments of polyhedra", TEST_MIXED, true, 1e-6, FIELD, "    sampling: {method: segments, step: %.17g}\n"},
    {"max_error 1e-2", TEST_HEXES, false, 2e-4, FIELD, "    sampling: {max_error: 0.01}\n"},
    {"max_error 1e-3", TEST_HEXES, false, 2e-5, FIELD, "    sampling: {max_error: 0.001}\n"},
    {"max_error 1e-4", TEST_HEXES, false, 2e-6, FIELD, "    sampling: {max_error: 0.0001}\n"},
};
enum { CASES = sizeof cases / sizeof *cases };

static void make_scene_text(const space_case *c, double scale, const double offset[3], char *out, size_t size)
{
    static const double eye[3] = {2.5, 1.5, 3}, focal[3] = {0.125, 0, -0.0625};
    char layer[256], sampling[128];
    snprintf(layer, sizeof layer, c->layers, 0.3 * scale);
    snprintf(sampling, sizeof sampling, c->sampling, 0.1 * scale);
    snprintf(out, size,
             "images:\n  - name: a\n    size: [%d, %d]\n    background: [0.1, 0.2, 0.3, 1]\n"
             "    camera: {position: [%.17g, %.17g, %.17g], focal: [%.17g, %.17g, %.17g]}\n    layers:\n      - %s\n%s"
             "    outputs:\n      - path: a.exr\n",
             WIDTH, HEIGHT, eye[0] * scale + offset[0], eye[1] * scale + offset[1], eye[2] * scale + offset[2],
             focal[0] * scale + offset[0], focal[1] * scale + offset[1], focal[2] * scale + offset[2], layer, sampling);
}

static void create_input(const space_case *c, double scale, const double offset[3], session_input *in)
{
    test_mesh whole;
    test_mesh_make_lattice(c->kind, 4, 0.1, test_wave_field, &whole);
    if (c->as_polyhedra) test_mesh_to_polyhedra(&whole, 0.6);
    for (int64_t i = 0; i < 3 * whole.vertex_count; i++)
        whole.coordinates[i] = ldexp(rint(ldexp(whole.coordinates[i], 24)), -24);
    int *owners = calloc((size_t)whole.cell_count, sizeof *owners);
    assert_non_null(owners);
    test_partition_cells(&whole, TEST_RANDOM, 4, rank_count, owners);
    test_mesh_transform(&whole, scale, offset);
    test_mesh_extract_part(&whole, owners, own_rank, &in->part);
    free(owners);
    test_mesh_free(&whole);
    input_describe(in);
}

static void draw_case(const space_case *c, double scale, const double offset[3], caught_picture *out)
{
    char text[2048];
    session_input in;
    make_scene_text(c, scale, offset, text, sizeof text);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    create_input(c, scale, offset, &in);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_OK, "");
    everywhere(caught_count == (own_rank == 0));
    if (own_rank == 0) *out = caught[0];
    caught_count = 0;
    insitu_destroy(&session);
    input_free(&in);
}

static int count_drawn_pixels(const caught_picture *p)
{
    int count = 0;
    for (int i = 1; i < WIDTH * HEIGHT; i++) count += memcmp(p->rgba, p->rgba + 4 * i, 4 * sizeof(float)) != 0;
    return count;
}

static void check_pictures_are_same(double scale, const double offset[3])
{
    static const double nowhere[3] = {0, 0, 0};
    bool is_same = true;
    for (int i = 0; i < CASES; i++) {
        caught_picture here = {0}, there = {0};
        draw_case(&cases[i], 1, nowhere, &here);
        draw_case(&cases[i], scale, offset, &there);
        if (own_rank == 0) {
            const double off = largest_colour_difference(&here, &there);
            printf("%s, times %g: off by %.2g\n", cases[i].name, scale, off);
            is_same = is_same && off <= cases[i].allowed && count_drawn_pixels(&here) > WIDTH * HEIGHT / 4;
            free(here.rgba), free(here.depth), free(there.rgba), free(there.depth);
        }
    }
    everywhere(is_same);
}

static void exact_offsets_change_no_pixel(void **context)
{
    (void)context;
    check_pictures_are_same(1, (const double[]){5e5, 5.8e6, 0});
}

static void scaling_by_a_millionth_changes_no_picture(void **context)
{
    (void)context;
    check_pictures_are_same(1e-6, (const double[]){0, 0, 0});
}

static void scaling_by_a_million_changes_no_picture(void **context)
{
    (void)context;
    check_pictures_are_same(1e6, (const double[]){0, 0, 0});
}

/* ---- depth --------------------------------------------------------------------------------------------------- */

/* Returns z. Cells of all types represent this field exactly, so that its isosurfaces are planes across the cube. */
static double return_height(const double position[3])
{
    return position[2];
}

static const struct {
    const char *layers;
    int count;
    double planes[2];
} depths[] = {
    {"      - isosurface: {field: f, values: [0.25]}\n", 1, {0.25}},
    {"      - isosurface: {field: f, values: [0.5], opacity: 0.3}\n      - isosurface: {field: f, values: [-0.5]}\n",
     2,
     {0.5, -0.5}},
    {"      - isosurface: {field: f, values: [0.5], opacity: 0}\n", 1, {0.5}},
    {"      - volume: {field: f, opacity: [[0, 0.9]]}\n", 0, {0}},
    {"      - volume: {field: f, opacity: [[0, 1]], unit_distance: 1e-3}\n"
     "      - isosurface: {field: f, values: [-0.9]}\n"
     "    sampling: {frames: 3}\n",
     1,
     {-0.9}},
};

static void normalize_vector(double v[3])
{
    const double length = sqrt(dot_product(v, v));
    for (int i = 0; i < 3; i++) v[i] /= length;
}

static const double eye[3] = {0.9, 1.2, 4}, focal[3] = {0.1, -0.2, 0.1}, camera_angle = 35;

/* Computes the direction of pixel p's ray; its component along the camera's axis is 1. */
static void compute_pixel_direction(int p, double out[3])
{
    const double up[3] = {0, 1, 0}, pixel = 2 * tan(camera_angle * 3.14159265358979323846 / 360) / HEIGHT;
    double forward[3], right[3], above[3];
    for (int i = 0; i < 3; i++) forward[i] = focal[i] - eye[i];
    normalize_vector(forward);
    cross_product(forward, up, right);
    normalize_vector(right);
    cross_product(right, forward, above);
    const double x = (p % WIDTH + 0.5 - 0.5 * WIDTH) * pixel, y = (0.5 * HEIGHT - p / WIDTH - 0.5) * pixel;
    for (int i = 0; i < 3; i++) out[i] = forward[i] + x * right[i] + y * above[i];
}

/* Returns the depth of the plane on a ray: infinity if the ray meets the plane outside the cube, and 0 if it does so
 * within 1e-4 of the cube's border, where either a hit or a miss is accepted. */
static double compute_plane_depth(const double direction[3], double plane)
{
    const double depth = (plane - eye[2]) / direction[2];
    double farthest = 0;
    for (int i = 0; i < 2; i++) farthest = fmax(farthest, fabs(eye[i] + depth * direction[i]));
    if (fabs(farthest - 1) < 1e-4) return 0;
    return farthest < 1 ? depth : (double)INFINITY;
}

/* Returns whether a pixel has the depth of the nearest plane. A hit has an error of at most 1e-5 of the cell's size of
 * 0.5, and a depth of 5 in float32 one of 3e-7. */
static bool is_depth_of_nearest_plane(const caught_picture *picture, int p, int count, const double planes[2])
{
    double direction[3], expected = INFINITY;
    compute_pixel_direction(p, direction);
    for (int i = 0; i < count; i++) expected = fmin(expected, compute_plane_depth(direction, planes[i]));
    const double found = (double)picture->depth[p];
    if (expected == 0) return true;
    return isinf(expected) ? found == (double)INFINITY : fabs(found - expected) <= 1e-5 * 0.5 + 3e-7;
}

/* Checks that the depth in an EXR file is that of the nearest isosurface along the camera's axis, whatever its opacity,
 * even behind a volume, and that it is infinite in pixels without an isosurface. */
static void depth_is_that_of_the_nearest_surface(void **context)
{
    (void)context;
    for (size_t n = 0; n < sizeof depths / sizeof depths[0]; n++) {
        char scene[1024];
        session_input in;
        snprintf(scene, sizeof scene,
                 "images:\n  - name: a\n    size: [%d, %d]\n    camera: {position: [%g, %g, %g], focal: [%g, %g, %g], "
                 "angle: %g}\n    outputs: [{path: a.exr}]\n    layers:\n%s",
                 WIDTH, HEIGHT, eye[0], eye[1], eye[2], focal[0], focal[1], focal[2], camera_angle, depths[n].layers);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
        input_create(&in, TEST_MIXED, 4, TEST_RANDOM, own_rank, rank_count);
        test_mesh_set_values(&in.part, return_height);
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_succeeds(session, 0);
        int wrong = 0, finite = 0;
        for (int p = 0; own_rank == 0 && p < WIDTH * HEIGHT; p++) {
            wrong += !is_depth_of_nearest_plane(&caught[0], p, depths[n].count, depths[n].planes);
            finite += isfinite(caught[0].depth[p]);
        }
        everywhere(wrong == 0);
        everywhere(own_rank != 0 || depths[n].count == 0 || (finite > 300 && finite < WIDTH * HEIGHT - 300));
        insitu_destroy(&session);
        input_free(&in);
    }
    discard_pictures();
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(depth_is_that_of_the_nearest_surface),
        cmocka_unit_test(exact_offsets_change_no_pixel),
        cmocka_unit_test(scaling_by_a_millionth_changes_no_picture),
        cmocka_unit_test(scaling_by_a_million_changes_no_picture),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
