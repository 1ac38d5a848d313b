/* Checks contour lines in sessions, on every layer that supports them and for fields at vertices, at cells and derived
 * ones. Lines must be visible, and the picture of all ranks must be bit-identical to that of one rank. On outer
 * surfaces the lines' positions are compared with the field's formula. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 64, HEIGHT = 48 };

#define SCENE(more, layer, lines)                                                                                      \
    "fields: {g: f^2 - 0.3, slope: {gradient: f, component: magnitude}}\nimages:\n  - name: a\n    size: [64, 48]\n"   \
    "    background: [0, 0, 0, 0]\n" more "    layers:\n      - " layer lines "}\n    outputs: [{path: a.exr}]\n"
#define WITH(more, layer, lines)                                                                                       \
    {                                                                                                                  \
        SCENE(more, layer, ", lines: {" lines "}"), SCENE(more, layer, "")                                             \
    }

static const struct lines_case {
    const char *with, *without;
} cases[] = {
    WITH("", "slice: {field: f, planes: [{normal: [1, 2, 3]}]", "count: 5"),
    WITH("", "slice: {field: c, planes: [{normal: [1, 2, 3]}]", "values: [-0.1, 0.2]"),
    WITH("    antialias: 4\n", "slice: {field: g, scale: symlog, threshold: 0.1, range: [-1, 1]", "count: 4, width: 2"),
    WITH("", "isosurface: {field: f, values: [0.1, -0.3], normals: vertex", "field: g, count: 6, colour: white"),
    WITH("", "isosurface: {field: f, values: [0.1], normals: differences, colour_by: {field: slope}", "count: 3"),
    WITH("", "isosurface: {field: f, values: [0.1, 0.4], opacity: 0.5", "field: c, count: 4"),
    WITH("    shadows: true\n", "surface: {colour_by: {field: f}", "field: slope, count: 4"),
    WITH("", "surface: {colour_by: {field: c}, edges: true, opacity: 0.7", "count: 4"),
    WITH("", "surface: {threshold: {field: c, from: -0.5}", "field: f, values: [0.2]"),
};
enum { CASES = sizeof cases / sizeof *cases };

/* Returns values at cells: the mean of x and y over the first four vertices (of a polyhedron: one vertex of each of the
 * first four faces). */
static double *make_cell_values(const test_mesh *mesh)
{
    double *values = malloc((size_t)(mesh->cell_count + 1) * sizeof *values);
    assert_non_null(values);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        values[cell] = 0;
        for (int i = 0; i < 4; i++) {
            int64_t vertex = mesh->connectivity[mesh->offsets[cell] + i];
            if (mesh->face_offsets) vertex = mesh->face_connectivity[mesh->face_offsets[vertex]];
            values[cell] += (mesh->coordinates[3 * vertex] + mesh->coordinates[3 * vertex + 1]) / 4;
        }
    }
    return values;
}

static caught_picture draw_lines(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = open_session(comm, scene);
    double *values = make_cell_values(&in->part);
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "c";
    field.centring = INSITU_CELL;
    field.count = in->part.cell_count;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    discard_pictures();
    assert_int_equal(submit_input(session, in), INSITU_OK);
    if (in->part.cell_count) assert_int_equal(insitu_set_field(session, "m", &field), INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    free(values);
    return picture;
}

/* Returns the number of pixels in which two pictures differ. */
static int count_differing_pixels(const caught_picture *a, const caught_picture *b)
{
    int count = 0;
    for (int p = 0; p < WIDTH * HEIGHT; p++) count += memcmp(a->rgba + 4 * p, b->rgba + 4 * p, 4 * sizeof(float)) != 0;
    return count;
}

static void lines_are_the_same_on_all_ranks(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_TETS, TEST_POLYHEDRA, TEST_MIXED};
    for (int i = 0; i < CASES; i++)
        for (int k = i % 2; k < 4; k += 2) {
            session_input part, whole;
            input_create(&part, kinds[k], SIDE, TEST_RANDOM, own_rank, rank_count);
            input_create(&whole, kinds[k], SIDE, TEST_BLOCK, 0, 1);
            const char *scene = write_scene(cases[i].with);
            caught_picture ours = draw_lines(MPI_COMM_WORLD, scene, &part), alone = {0}, without = {0};
            bool is_well = true;
            if (own_rank == 0) alone = draw_lines(MPI_COMM_SELF, scene, &whole);
            scene = write_scene(cases[i].without);
            if (own_rank == 0) {
                without = draw_lines(MPI_COMM_SELF, scene, &whole);
                const int lines = count_differing_pixels(&alone, &without);
                is_well = are_same_pictures(&ours, &alone) && lines > 40 && lines < WIDTH * HEIGHT / 2;
                if (!is_well)
                    fprintf(stderr, "case %d, %s: %d pixels with lines, %d differ\n", i, test_mesh_kind_name(kinds[k]),
                            lines, count_differing_pixels(&ours, &alone));
            }
            everywhere(is_well);
            free_caught(&ours);
            free_caught(&alone);
            free_caught(&without);
            input_free(&part);
            input_free(&whole);
        }
}

/* ---- outer surfaces ---------------------------------------------------------------------------------------------- */

/* Returns the fraction of a pixel that the contour line of the value `level` covers on the cube's face z = 1, seen from
 * the front. `size` is the width of a pixel; the field is linear. */
static double compute_front_coverage(double x, double y, double size, double level)
{
    const double at[3] = {x, y, 1}, right[3] = {x + 1, y, 1}, up[3] = {x, y + 1, 1};
    const double value = test_linear_field(at),
                 slope = hypot(test_linear_field(right) - value, test_linear_field(up) - value);
    return fmin(fmax(1.25 - fabs(value - level) / (slope * size), 0), 1);
}

/* Compares how much of each pixel the lines cover. Values in float have errors of 1e-7, while the field changes by 0.04
 * from one pixel to the next. */
static bool are_lines_exact_on_front(const caught_picture *picture)
{
    const double size = 2.4 / HEIGHT;
    int hits = 0;
    for (int p = 0; p < WIDTH * HEIGHT; p++) {
        const double x = (p % WIDTH + 0.5 - WIDTH / 2.0) * size, y = (HEIGHT / 2.0 - p / WIDTH - 0.5) * size;
        const double share = compute_front_coverage(x, y, size, 0.1) + compute_front_coverage(x, y, size, 0.9);
        if (fmax(fabs(x), fabs(y)) > 1) continue;
        hits += share > 0;
        if (fabs((double)picture->rgba[4 * p] - share) < 1e-4) continue;
        fprintf(stderr, "at (%g, %g): %g, expected %g\n", x, y, (double)picture->rgba[4 * p], share);
        return false;
    }
    return hits > 100;
}

static void lines_on_outer_surfaces_are_at_exact_positions(void **state)
{
    (void)state;
    const char *scene =
        write_scene("images:\n  - name: a\n    size: [64, 48]\n"
                    "    camera: {position: [0, 0, 5], focal: [0, 0, 0], projection: orthographic, "
                    "height: 2.4}\n    layers:\n"
                    "      - surface: {colour: black, material: {ambient: 1, diffuse: 0, specular: 0},\n"
                    "          lines: {field: f, values: [0.1, 0.9], colour: white}}\n"
                    "    outputs: [{path: a.exr}]\n");
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in;
        input_create(&in, kind, SIDE, TEST_RANDOM, own_rank, rank_count);
        for (int64_t v = 0; v < in.part.vertex_count; v++)
            in.part.values[v] = test_linear_field(in.part.coordinates + 3 * v);
        caught_picture picture = draw_lines(MPI_COMM_WORLD, scene, &in);
        const bool is_well = own_rank != 0 || are_lines_exact_on_front(&picture);
        if (!is_well) fprintf(stderr, "%s\n", test_mesh_kind_name(kind));
        everywhere(is_well);
        free_caught(&picture);
        input_free(&in);
    }
}

static void meshes_without_the_field_are_reported(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    const char *scene =
        write_scene("images:\n  - name: a\n    size: [64, 48]\n    layers: [{surface: {lines: {field: p, count: 3}}}]\n"
                    "    outputs: [{path: a.png}]\n");
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    test_mesh other;
    insitu_mesh mesh;
    test_mesh_make_lattice(TEST_HEXES, 1, 0, test_linear_field, &other);
    describe_part(&other, &mesh);
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "p";
    field.count = other.vertex_count;
    field.values = (insitu_array){other.values, INSITU_FLOAT64, 0};
    discard_pictures();
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    if (own_rank == 0) {
        assert_int_equal(insitu_set_mesh(session, "n", &mesh), INSITU_OK);
        assert_int_equal(insitu_set_field(session, "n", &field), INSITU_OK);
    }
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    everywhere(strstr(insitu_last_report(session)->warnings,
                      "mesh \"m\" does not have the field \"p\": a layer has no lines on it") != NULL);
    insitu_destroy(&session);
    test_mesh_free(&other);
    input_free(&in);
    discard_pictures();
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(lines_are_the_same_on_all_ranks),
                                       cmocka_unit_test(lines_on_outer_surfaces_are_at_exact_positions),
                                       cmocka_unit_test(meshes_without_the_field_are_reported)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
