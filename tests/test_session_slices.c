/* Checks slices in a session. On cells of every type, a plane must be at the position of its closed form and have the
 * colours of a linear field there; for any partition, with and without ghosts, it must be bit-identical to that of one
 * rank. A plane that coincides with faces of cells must be drawn once, without holes. A plane on the boundary of the
 * data must be drawn for either direction of its normal. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "render.h"
#include "session.h"
#include "test_session_fixture.h"
#include "test_session_view.h"

enum { SIDE = 4 };

#define SLICE(keys, planes) "      - slice: {field: f, map: turbo, range: [-1.5, 1.7], planes: [" planes "]" keys "}\n"

static const double low = -1.5, high = 1.7;

typedef struct plane {
    double normal[3], distance;
} plane;

/* Returns the depth at which the ray intersects the plane, and stores the position in at. */
static double intersect_plane(const ray *r, const plane *p, double at[3])
{
    double along = 0, from = p->distance;
    for (int a = 0; a < 3; a++) {
        along += p->normal[a] * r->direction[a];
        from -= p->normal[a] * r->base[a];
    }
    for (int a = 0; a < 3; a++) at[a] = r->base[a] + from / along * r->direction[a];
    return from / along;
}

static double compute_distance_outside_cube(const double at[3])
{
    return fmax(fabs(at[0]), fmax(fabs(at[1]), fabs(at[2]))) - 1;
}

static void get_table_colour(double value, double out[3])
{
    int count = 0;
    const float *table = colour_map_table("turbo", &count);
    const double place = fmin(fmax((value - low) / (high - low), 0), 1) * (count - 1);
    const int entry = (int)fmin(place, count - 2);
    for (int c = 0; c < 3; c++) {
        const double a = (double)table[3 * entry + c], b = (double)table[3 * entry + 3 + c];
        out[c] = a + (place - entry) * (b - a);
    }
}

/* ---- pictures ------------------------------------------------------------------------------------------------ */

static caught_picture draw_slices(MPI_Comm comm, const char *scene, const session_input *in, const char *warning)
{
    insitu_session *session = open_session_and_draw(comm, scene, in);
    const char *warnings = insitu_last_report(session)->warnings;
    if (warning ? !strstr(warnings, warning) : *warnings) fail_msg("warnings: %s", warnings);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* Returns whether the picture shows the given planes: in each pixel, the nearest hit inside the cube must be visible.
 * Rays near the cube's border may hit or miss. Depths near 5 have rounding errors of single precision times the inverse
 * cosine of the angle of incidence, at most 10 here. Colours have the error of the depth times the field's slope, 1 in
 * 3.2, times the slope of the colour table, at most 12. */
static bool check_planes(const caught_picture *picture, const plane *planes, int count)
{
    const double depth_error = 10 * 5 * 3e-7, colour_error = depth_error / 3.2 * 12;
    int hits = 0;
    for (int pixel = 0; pixel < WIDTH * HEIGHT; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double nearest = INFINITY, where[3] = {0}, colour[3];
        bool is_near_border = false;
        for (int i = 0; i < count; i++) {
            double at[3];
            const double depth = intersect_plane(&r, &planes[i], at), outside = compute_distance_outside_cube(at);
            is_near_border = is_near_border || fabs(outside) < 1e-4;
            if (outside < 0 && depth < nearest) {
                nearest = depth;
                memcpy(where, at, sizeof where);
            }
        }
        if (is_near_border) continue;
        const float *rgba = picture->rgba + 4 * pixel;
        if (isinf(nearest) != isinf(picture->depth[pixel]) || (rgba[3] == 1) != isfinite(nearest)) {
            fprintf(stderr, "pixel %d: depth %g, expected %g\n", pixel, (double)picture->depth[pixel], nearest);
            return false;
        }
        if (isinf(nearest)) continue;
        hits++;
        get_table_colour(test_linear_field(where), colour);
        double off = 0;
        for (int c = 0; c < 3; c++) off = test_larger_error(off, fabs((double)rgba[c] - colour[c]));
        if (fabs((double)picture->depth[pixel] - nearest) > depth_error || off > colour_error) {
            fprintf(stderr, "pixel %d: depth %.9g, expected %.9g; colour off by %g\n", pixel,
                    (double)picture->depth[pixel], nearest, off);
            return false;
        }
    }
    return hits > WIDTH * HEIGHT / 20;
}

/* ---- inputs -------------------------------------------------------------------------------------------------- */

static void make_whole_mesh(test_mesh_kind kind, double jitter, session_input *out)
{
    test_mesh_make_lattice(kind, SIDE, jitter, test_linear_field, &out->part);
    input_describe(out);
}

/* Extracts this rank's cells or, if with_ghosts is set, all cells, of which those of other ranks are ghosts. */
static void extract_rank_cells(const session_input *whole, test_partition_kind distributed, bool with_ghosts,
                               session_input *out)
{
    extract_own_cells(&whole->part, distributed, SIDE, with_ghosts, &out->part);
    test_mesh_shuffle_cells(&out->part, 7 + (uint64_t)own_rank);
    input_describe(out);
}

static const char three_planes[] =
    IMAGE(SLICE("", "{normal: [1, 2, -2], offset: -0.4}, {normal: [1, 1, 4], point: [0.1, 0.3, 0.6]}")
              SLICE("", "{normal: [0, 3, 0], point: [0, -0.6, 0]}"));
static const plane three[3] = {{{1. / 3, 2. / 3, -2. / 3}, -0.4}, {{1, 1, 4}, 0.1 + 0.3 + 2.4}, {{0, 1, 0}, -0.6}};

/* Checks planes given by `count` and by `offsets`. Planes given by `count` are spread evenly over the cube's extent
 * along the normal, which is from -sqrt(3) to sqrt(3) along the diagonal. */
static void several_planes_are_exact(void **state)
{
    (void)state;
    static const char scene[] = IMAGE(
        SLICE("", "{normal: [1, 1, 1], count: 3}, {normal: [0, -2, 0], point: [9, 0.5, 9], offsets: [-0.25, 0.75]}"));
    const double n = 1 / sqrt(3);
    const plane planes[5] = {{{1, 1, 1}, -2},
                             {{1, 1, 1}, 0},
                             {{1, 1, 1}, 2},
                             {{0, -1, 0}, -0.75},
                             /* the first three planes are 2/3 sqrt(3) apart; the distances here are divided by n */
                             {{0, -1, 0}, 0.25}};
    session_input whole = {0};
    bool is_well = true;
    assert_true(fabs(2 * n - 2. / 3 * sqrt(3)) < 1e-15);
    make_whole_mesh(TEST_HEXES, 0, &whole);
    const char *file = write_scene(scene);
    if (own_rank == 0) {
        caught_picture picture = draw_slices(MPI_COMM_SELF, file, &whole, NULL);
        is_well = check_planes(&picture, planes, 5);
        free_caught(&picture);
    }
    everywhere(is_well);
    input_free(&whole);
}

static void check_planes_in_mesh(test_mesh_kind kind)
{
    session_input whole = {0};
    caught_picture alone = {0};
    bool is_well = true;
    make_whole_mesh(kind, 0.2, &whole);
    const char *scene = write_scene(three_planes);
    if (own_rank == 0) {
        alone = draw_slices(MPI_COMM_SELF, scene, &whole, NULL);
        is_well = check_planes(&alone, three, 3);
    }
    everywhere(is_well);
    for (int way = 0; way < 3; way++) {
        session_input part = {0};
        extract_rank_cells(&whole, way == 1 ? TEST_BLOCK : TEST_RANDOM, way == 2, &part);
        caught_picture picture = draw_slices(MPI_COMM_WORLD, scene, &part, NULL);
        everywhere(own_rank != 0 || are_same_pictures(&picture, &alone));
        free_caught(&picture);
        input_free(&part);
    }
    free_caught(&alone);
    input_free(&whole);
}

static void planes_are_exact_on_any_ranks(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) check_planes_in_mesh(kind);
}

/* ---- many ---------------------------------------------------------------------------------------------------- */

enum { MANY_VALUES = 40, MANY_PLANES = 24 };

/* Returns an isovalue. The isovalues are in descending order, because those of a layer need not be sorted. */
static double get_isovalue(int i)
{
    return 1.2207 - 0.0613 * i;
}

static double get_plane_distance(int i)
{
    return -0.93 + 0.0817 * i;
}

/* Writes a scene with the maximum number of isovalues and of planes in an image, each with opacity 0.05. */
static const char *write_scene_of_many_surfaces(void)
{
    char text[8192];
    int at = snprintf(text, sizeof text, "%s      - isosurface: {field: f, opacity: 0.05, values: [", IMAGE_BEGIN(""));
    for (int i = 0; i < MANY_VALUES; i++)
        at += snprintf(text + at, sizeof text - (size_t)at, "%s%.4f", i ? ", " : "", get_isovalue(i));
    at += snprintf(text + at, sizeof text - (size_t)at, "]}\n      - slice: {field: f, opacity: 0.05, planes: [");
    for (int i = 0; i < MANY_PLANES; i++)
        at += snprintf(text + at, sizeof text - (size_t)at, "%s{normal: [1, 0, 0], offset: %.4f}", i ? ", " : "",
                       get_plane_distance(i));
    snprintf(text + at, sizeof text - (size_t)at, "]}\n" IMAGE_END);
    return write_scene(text);
}

/* Returns whether each surface is crossed by some ray, and each crossing leaves 0.95 of the light behind it. The
 * isosurfaces of a linear field are planes. Each of at most 64 products is rounded to single precision, which gives an
 * error of at most 64 × 2^-23 < 1e-5. */
static bool check_all_surfaces_crossed(const caught_picture *picture)
{
    bool is_crossed[MANY_VALUES + MANY_PLANES] = {false};
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        int crossings = 0;
        bool is_near_border = false;
        for (int i = 0; i < MANY_VALUES + MANY_PLANES; i++) {
            const plane p = i < MANY_VALUES ? (plane){{0.3, -0.7, 0.5}, get_isovalue(i) - 0.1}
                                            : (plane){{1, 0, 0}, get_plane_distance(i - MANY_VALUES)};
            double at[3];
            intersect_plane(&r, &p, at);
            const double outside = compute_distance_outside_cube(at);
            is_near_border = is_near_border || fabs(outside) < 1e-4;
            crossings += outside < 0;
            is_crossed[i] = is_crossed[i] || outside < -1e-4;
        }
        const double expected = 1 - pow(0.95, crossings), opacity = (double)picture->rgba[4 * pixel + 3];
        if (is_near_border || fabs(opacity - expected) < 1e-5) continue;
        fprintf(stderr, "pixel %d: opacity %g, expected %g\n", pixel, opacity, expected);
        return false;
    }
    for (int i = 0; i < MANY_VALUES + MANY_PLANES; i++) {
        if (is_crossed[i]) continue;
        fprintf(stderr, "surface %d is crossed by no ray\n", i);
        return false;
    }
    return true;
}

static void many_isovalues_and_planes_are_all_drawn(void **state)
{
    (void)state;
    const char *scene = write_scene_of_many_surfaces();
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input whole = {0}, part = {0};
        make_whole_mesh(kind, 0.2, &whole);
        extract_rank_cells(&whole, TEST_RANDOM, false, &part);
        caught_picture picture = draw_slices(MPI_COMM_WORLD, scene, &part, NULL);
        everywhere(own_rank != 0 || check_all_surfaces_crossed(&picture));
        free_caught(&picture);
        input_free(&part);
        input_free(&whole);
    }
}

/* ---- planes in faces ----------------------------------------------------------------------------------------- */

/* Returns whether every ray that intersects the plane inside the cube crosses the slice exactly once, so that the
 * opacity is 0.5. */
static bool is_drawn_once(const caught_picture *picture, const plane *p)
{
    int hits = 0;
    for (int pixel = 0; pixel < WIDTH * HEIGHT; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double at[3];
        intersect_plane(&r, p, at);
        const double outside = compute_distance_outside_cube((const double[3]){
            p->normal[0] != 0 ? 0 : at[0], p->normal[1] != 0 ? 0 : at[1], p->normal[2] != 0 ? 0 : at[2]});
        const float opacity = picture->rgba[4 * pixel + 3];
        if (fabs(outside) < 1e-5) continue;
        hits += outside < 0;
        if (opacity == (outside < 0 ? 0.5f : 0)) continue;
        fprintf(stderr, "pixel %d: opacity %g\n", pixel, (double)opacity);
        return false;
    }
    return hits > 50;
}

static void check_plane_in_faces(test_mesh_kind kind, const char *scene, const plane *p)
{
    session_input whole = {0}, part = {0};
    make_whole_mesh(kind, 0, &whole);
    extract_rank_cells(&whole, TEST_RANDOM, false, &part);
    caught_picture picture = draw_slices(MPI_COMM_WORLD, write_scene(scene), &part, NULL);
    everywhere(own_rank != 0 || is_drawn_once(&picture, p));
    free_caught(&picture);
    input_free(&part);
    input_free(&whole);
}

static void planes_in_faces_are_drawn_once(void **state)
{
    (void)state;
    const plane half = {{1, 0, 0}, 0.5};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [1, 0, 0], point: [0.5, 0, 0]}")), &half);
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [-7, 0, 0], point: [0.5, 0, 0]}")), &half);
    }
}

static void planes_on_the_border_are_drawn(void **state)
{
    (void)state;
    const plane lower = {{1, 0, 0}, -1}, upper = {{0, 0, 1}, 1};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [1, 0, 0], point: [-1, 5, 0]}")), &lower);
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [-1, 0, 0], offset: 1.0000001}")), &lower);
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [0, 0, 1], offset: 1}")), &upper);
        check_plane_in_faces(kind, IMAGE(SLICE(", opacity: 0.5", "{normal: [0, 0, -1], offset: -0.9999999}")), &upper);
    }
}

static void planes_outside_the_data_give_a_warning(void **state)
{
    (void)state;
    session_input part = {0};
    input_create(&part, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    caught_picture picture =
        draw_slices(MPI_COMM_WORLD, write_scene(IMAGE(SLICE("", "{normal: [0, 0, 2], offset: 1.5}"))), &part,
                    "a plane of its slices meets no cell: cells are -2.5 to -0.5 from it");
    free_caught(&picture);
    input_free(&part);
}

/* ---- values -------------------------------------------------------------------------------------------------- */

/* Returns whether each point has the colour of its hex, or is grey if the hex's value is NaN. */
static bool has_colours_of_cells(const caught_picture *picture)
{
    int hits = 0;
    for (int pixel = 0; pixel < WIDTH * HEIGHT; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double at[3], expected[3], off = 0;
        intersect_plane(&r, &(plane){{0, 0, 1}, 0.1}, at);
        const double x = (at[0] + 1) / 2 * SIDE, y = (at[1] + 1) / 2 * SIDE;
        if (compute_distance_outside_cube(at) > -1e-4 || fabs(x - rint(x)) < 1e-4 || fabs(y - rint(y)) < 1e-4) continue;
        const int cell = (int)x + SIDE * (int)y;
        get_table_colour(-1.5 + 0.2 * cell, expected);
        for (int c = 0; c < 3; c++) {
            const double wanted = cell == 5 ? (double)RENDER_NO_COLOUR : expected[c];
            off = test_larger_error(off, fabs((double)picture->rgba[4 * pixel + c] - wanted));
        }
        hits++;
        if (off > 1e-5) {
            fprintf(stderr, "pixel %d: off by %g\n", pixel, off);
            return false;
        }
    }
    return hits > 100;
}

static void cell_values_are_drawn_and_nan_is_grey(void **state)
{
    (void)state;
    session_input whole = {0}, part = {0};
    make_whole_mesh(TEST_HEXES, 0, &whole);
    extract_rank_cells(&whole, TEST_RANDOM, false, &part);
    double *values = test_calloc((size_t)part.part.cell_count + 1, sizeof *values);
    for (int64_t cell = 0; cell < part.part.cell_count; cell++) {
        double at[3] = {0};
        for (int i = 0; i < 8; i++)
            for (int a = 0; a < 3; a++)
                at[a] += part.part.coordinates[3 * part.part.connectivity[8 * cell + i] + a] / 8;
        const int column = (int)((at[0] + 1) / 2 * SIDE) + SIDE * (int)((at[1] + 1) / 2 * SIDE);
        values[cell] = column == 5 ? NAN : -1.5 + 0.2 * column;
    }
    part.field.centring = INSITU_CELL;
    part.field.count = part.part.cell_count;
    part.field.values.data = values;
    caught_picture picture =
        draw_slices(MPI_COMM_WORLD, write_scene(IMAGE(SLICE("", "{normal: [0, 0, 1], point: [0, 0, 0.1]}"))), &part,
                    "values of field \"f\" are not finite in 4 cells: where the picture shows them");
    everywhere(own_rank != 0 || has_colours_of_cells(&picture));
    free_caught(&picture);
    test_free(values);
    input_free(&part);
    input_free(&whole);
}

/* ---- recomputation ------------------------------------------------------------------------------------------- */

static session_scalar *find_distance_field(const insitu_session *session)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].distances) return &mesh->scalars[i];
    return NULL;
}

/* Checks the distances of vertices from a plane: two images of one plane share them, new values do not cause them to be
 * recomputed, and new coordinates do. Also checks that a plane through the centre of the data moves with the data. */
static void distances_follow_the_geometry(void **state)
{
    (void)state;
    session_input part = {0};
    input_create(&part, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(
        MPI_COMM_WORLD, write_scene(IMAGE(SLICE("", "{normal: [0, 0, 1]}") SLICE("", "{normal: [0, 0, 1]}"))));
    part.mesh.changed = 0;
    everywhere(submit_input(session, &part) == INSITU_OK);
    check_step_succeeds(session, 0);
    const bool has_cells = part.part.cell_count > 0;
    const int64_t bytes = insitu_last_report(session)->bytes_copied;
    everywhere(bytes == part.part.vertex_count * (int64_t)sizeof(float));
    if (has_cells) find_distance_field(session)->distances[0] = 77;
    for (int64_t v = 0; v < part.part.vertex_count; v++) part.part.values[v] += 1;
    everywhere(insitu_set_field(session, "m", &part.field) == INSITU_OK);
    check_step_succeeds(session, 1);
    everywhere(!has_cells || find_distance_field(session)->distances[0] == 77);
    for (int64_t v = 0; v < part.part.vertex_count; v++) part.part.coordinates[3 * v + 2] += 3;
    part.mesh.changed = INSITU_CHANGED_GEOMETRY;
    everywhere(insitu_set_mesh(session, "m", &part.mesh) == INSITU_OK);
    check_step_succeeds(session, 2);
    bool is_right = true;
    for (int64_t v = 0; v < part.part.vertex_count && is_right; v++)
        is_right = find_distance_field(session)->distances[v] == (float)(part.part.coordinates[3 * v + 2] - 3);
    everywhere(is_right);
    insitu_destroy(&session);
    input_free(&part);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_are_exact_on_any_ranks),
        cmocka_unit_test(several_planes_are_exact),
        cmocka_unit_test(many_isovalues_and_planes_are_all_drawn),
        cmocka_unit_test(planes_in_faces_are_drawn_once),
        cmocka_unit_test(planes_on_the_border_are_drawn),
        cmocka_unit_test(planes_outside_the_data_give_a_warning),
        cmocka_unit_test(cell_values_are_drawn_and_nan_is_grey),
        cmocka_unit_test(distances_follow_the_geometry),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
