/* Checks regions: several meshes in one picture, each with fields of its own. Tests on which meshes a layer is drawn,
 * by its field or by a mesh's name, which surfaces are grey, and which scenes are refused, on any number of ranks, some
 * of which have no cells of a region. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { WIDTH = 40, HEIGHT = 30, SIDE = 4 };

#define GREY "0.6, 0.6, 0.6"
#define IMAGE(layers)                                                                                                  \
    "images:\n  - name: a\n    size: [40, 30]\n    background: [0, 0, 0, 0]\n    layers:\n" layers                     \
    "    outputs: [{path: a.exr}]\n"

/* Two adjacent cubes of hexes: the meshes "air" and "sea/0". Both are partitioned over all ranks, except that the last
 * of several ranks has no cells of the sea. Both have the field f; the air also has the field t, and the sea also has
 * s. */
static session_input air, sea;

static void regions_create(void)
{
    input_create(&air, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    input_create(&sea, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count > 1 ? rank_count - 1 : 1);
    for (int64_t v = 0; v < sea.part.vertex_count; v++) sea.part.coordinates[3 * v] += 2.5;
}

static void regions_free(void)
{
    input_free(&air);
    input_free(&sea);
}

static bool has_cells_of_sea(void)
{
    return rank_count == 1 || own_rank < rank_count - 1;
}

static insitu_status set_field_with_name(insitu_session *session, const char *mesh, const session_input *in,
                                         const char *name)
{
    insitu_field field = in->field;
    field.name = name;
    return insitu_set_field(session, mesh, &field);
}

static insitu_session *open_regions(const char *scene)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    insitu_status status = insitu_set_mesh(session, "air", &air.mesh);
    if (!status) status = set_field_with_name(session, "air", &air, "f");
    if (!status) status = set_field_with_name(session, "air", &air, "t");
    if (!status && has_cells_of_sea()) status = insitu_set_mesh(session, "sea/0", &sea.mesh);
    if (!status && has_cells_of_sea()) status = set_field_with_name(session, "sea/0", &sea, "f");
    if (!status && has_cells_of_sea()) status = set_field_with_name(session, "sea/0", &sea, "s");
    everywhere(status == INSITU_OK);
    return session;
}

/* Draws a scene and checks that its warnings contain `warning` or, if that is NULL, that there are none. Returns the
 * picture on rank 0. */
static caught_picture draw_and_check_warnings(const char *scene, const char *warning)
{
    insitu_session *session = open_regions(scene);
    check_step_succeeds(session, 0);
    const char *warnings = insitu_last_report(session)->warnings;
    if (warning ? !strstr(warnings, warning) : *warnings) fprintf(stderr, "warnings: %s\n", warnings);
    everywhere(warning ? strstr(warnings, warning) != NULL : !*warnings);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

static bool has_colour(const caught_picture *picture, int p)
{
    return picture->rgba[4 * p + 3] > 0;
}

/* Counts the covered pixels on rank 0: counts[0] in the left half, which shows only the air, and counts[1] in the right
 * half. */
static void count_covered_pixels(const caught_picture *picture, int counts[2])
{
    counts[0] = counts[1] = 0;
    for (int p = 0; own_rank == 0 && p < WIDTH * HEIGHT; p++) counts[p % WIDTH >= WIDTH / 2] += has_colour(picture, p);
}

static void assert_scenes_draw_same(const char *scene, const char *warning, const char *other)
{
    caught_picture a = draw_and_check_warnings(scene, warning), b = draw_and_check_warnings(other, NULL);
    bool is_same = true;
    for (int i = 0; own_rank == 0 && i < WIDTH * HEIGHT * 4; i++) is_same = is_same && a.rgba[i] == b.rgba[i];
    for (int i = 0; own_rank == 0 && i < WIDTH * HEIGHT; i++) is_same = is_same && a.depth[i] == b.depth[i];
    int counts[2];
    count_covered_pixels(&a, counts);
    everywhere(own_rank != 0 || counts[0] + counts[1] > 100);
    everywhere(is_same);
    free_caught(&a);
    free_caught(&b);
}

#define FRONT "    camera: {automatic: {direction: [0, 0, 1]}}\n"
#define FRONT_IMAGE(layers)                                                                                            \
    "images:\n  - name: a\n    size: [40, 30]\n    background: [0, 0, 0, 0]\n" FRONT "    layers:\n" layers            \
    "    outputs: [{path: a.exr}]\n"

/* Checks that a layer that names no mesh is drawn on all meshes that have its field, and that a layer that names a mesh
 * or a pattern of names is drawn on the matching meshes. */
static void layers_draw_only_meshes_with_the_field(void **context)
{
    (void)context;
    static const struct {
        const char *scene;
        bool is_on[2]; /* whether the layer is drawn on the air, and on the sea */
    } cases[] = {
        {FRONT_IMAGE("      - isosurface: {field: f, values: [0.1]}\n"), {true, true}},
        {FRONT_IMAGE("      - isosurface: {field: t, values: [0.1]}\n"), {true, false}},
        {FRONT_IMAGE("      - isosurface: {field: s, values: [0.1]}\n"), {false, true}},
        {FRONT_IMAGE("      - isosurface: {field: f, values: [0.1], mesh: air}\n"), {true, false}},
        {FRONT_IMAGE("      - isosurface: {field: f, values: [0.1], mesh: sea}\n"), {false, true}},
        {FRONT_IMAGE("      - isosurface: {field: f, values: [0.1], mesh: [sea/0, air]}\n"), {true, true}},
        {FRONT_IMAGE("      - volume: {field: f}\n"), {true, true}},
        {FRONT_IMAGE("      - volume: {field: t}\n"), {true, false}},
        {FRONT_IMAGE("      - volume: {field: s}\n"), {false, true}},
        {FRONT_IMAGE("      - volume: {field: f, mesh: air}\n"), {true, false}},
        {FRONT_IMAGE("      - volume: {field: f, mesh: [sea]}\n"), {false, true}},
        {FRONT_IMAGE("      - volume: {field: f, mesh: [air, sea/0]}\n"), {true, true}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        caught_picture picture = draw_and_check_warnings(cases[i].scene, NULL);
        int counts[2];
        count_covered_pixels(&picture, counts);
        if (own_rank == 0) fprintf(stderr, "case %zu: %d and %d pixels\n", i, counts[0], counts[1]);
        everywhere(own_rank != 0 || ((counts[0] > 50) == cases[i].is_on[0] && (counts[1] > 50) == cases[i].is_on[1]));
        free_caught(&picture);
    }
}

/* Checks that two layers, one on each region, draw the same picture as one layer on both regions. */
static void separate_meshes_draw_same_picture_as_one_mesh(void **context)
{
    (void)context;
    assert_scenes_draw_same(IMAGE("      - isosurface: {field: f, values: [0.1], colours: [[1, 0, 0]]}\n"), NULL,
                            IMAGE("      - isosurface: {field: f, values: [0.1], colours: [[1, 0, 0]], mesh: air}\n"
                                  "      - isosurface: {field: f, values: [0.1], colours: [[1, 0, 0]], mesh: sea}\n"));
}

/* Checks that meshes without the field of the colours are drawn grey, and that the range of the colours is that of the
 * meshes that have the field. */
static void surfaces_without_the_colour_field_are_grey(void **context)
{
    (void)context;
    assert_scenes_draw_same(
        IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t}}\n"),
        "image \"a\": mesh \"sea/0\" does not have the field \"t\": its isosurface of \"f\" is grey",
        IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t}, mesh: air}\n"
              "      - isosurface: {field: f, values: [0.1], colours: [[" GREY "]], mesh: sea}\n"));
    assert_scenes_draw_same(
        IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t, nan: [1, 0, 0]}}\n"),
        "mesh \"sea/0\" does not have the field \"t\": its isosurface of \"f\" is of the colour nan",
        IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t}, mesh: air}\n"
              "      - isosurface: {field: f, values: [0.1], colours: [[1, 0, 0]], mesh: sea}\n"));
    assert_scenes_draw_same(IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t}, mesh: sea}\n"),
                            "mesh \"sea/0\" does not have the field \"t\"",
                            IMAGE("      - isosurface: {field: f, values: [0.1], colours: [[" GREY "]], mesh: sea}\n"));
}

/* Checks that a point is drawn grey if its colour value is not a number. All values of one region are NaN. */
static void colours_that_are_not_numbers_are_grey(void **context)
{
    (void)context;
    static const char by_t[] =
        IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t, range: [0, 1]}, mesh: air}\n");
    static const char plain[] =
        IMAGE("      - isosurface: {field: f, values: [0.1], colours: [[" GREY "]], mesh: air}\n");
    for (int kind = TEST_TETS; kind < TEST_KIND_COUNT; kind++) {
        input_free(&air);
        input_create(&air, (test_mesh_kind)kind, SIDE, TEST_RANDOM, own_rank, rank_count);
        double *nothing = test_calloc((size_t)air.part.vertex_count + 1, sizeof *nothing);
        for (int64_t v = 0; v < air.part.vertex_count; v++) nothing[v] = NAN;
        caught_picture pictures[2] = {{0}};
        for (int i = 0; i < 2; i++) {
            insitu_session *session = open_regions(i ? plain : by_t);
            insitu_field field = air.field;
            field.name = "t";
            field.values.data = nothing;
            everywhere(insitu_set_field(session, "air", &field) == INSITU_OK);
            check_step_succeeds(session, 0);
            if (own_rank == 0) pictures[i] = caught[0];
            caught_count = 0;
            insitu_destroy(&session);
        }
        everywhere(own_rank != 0 ||
                   memcmp(pictures[0].rgba, pictures[1].rgba, sizeof(float) * WIDTH * HEIGHT * 4) == 0);
        free_caught(&pictures[0]);
        free_caught(&pictures[1]);
        test_free(nothing);
    }
    regions_free();
    regions_create();
}

static void warning_of_grey_is_reported_once(void **context)
{
    (void)context;
    insitu_session *session =
        open_regions(IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: t}}\n"));
    static const bool has_t[] = {false, false, true, false, false}, is_reported[] = {true, false, false, true, false};
    for (int cycle = 0; cycle < 5; cycle++) {
        if (has_cells_of_sea())
            everywhere(insitu_set_mesh(session, "sea/0", &sea.mesh) == INSITU_OK);
        else
            everywhere(true);
        everywhere(!has_cells_of_sea() || set_field_with_name(session, "sea/0", &sea, "f") == INSITU_OK);
        everywhere(!has_cells_of_sea() || !has_t[cycle] ||
                   set_field_with_name(session, "sea/0", &sea, "t") == INSITU_OK);
        check_step_succeeds(session, cycle);
        everywhere((strstr(insitu_last_report(session)->warnings, "is grey") != NULL) == is_reported[cycle]);
    }
    insitu_destroy(&session);
}

static void fields_missing_on_all_ranks_are_refused(void **context)
{
    (void)context;
    static const struct {
        const char *scene;
        insitu_status status;
        const char *words[2];
    } cases[] = {
        {IMAGE("      - isosurface: {field: q, values: [0.1]}\n"),
         INSITU_ERROR_FIELD,
         {".yaml:6: no mesh has the field \"q\"",
          "\"f\" (mesh \"air\"), \"t\" (mesh \"air\"), \"f\" (mesh \"sea/0\")"}},
        {IMAGE("      - isosurface: {field: f, values: [0.1], colour_by: {field: q}}\n"),
         INSITU_ERROR_FIELD,
         {".yaml:6: no mesh has the field \"q\"", "\"s\" (mesh \"sea/0\")"}},
        {IMAGE("      - volume: {field: f, mesh: land}\n"),
         INSITU_ERROR_MESH,
         {".yaml:6: there is no mesh \"land\"; there are: \"air\", \"sea/0\""}},
        {IMAGE("      - volume:\n          field: f\n          mesh: [air, se]\n"),
         INSITU_ERROR_MESH,
         {".yaml:8: there is no mesh \"se\""}},
        {IMAGE("      - volume: {field: t, mesh: [air, sea]}\n"),
         INSITU_ERROR_FIELD,
         {".yaml:6: mesh \"sea\" does not have the field \"t\"", "\"s\" (mesh \"sea/0\")"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        insitu_session *session = open_regions(cases[i].scene);
        const insitu_status status = insitu_step(session, 0, 0);
        check_reported_everywhere(session, status, cases[i].status, cases[i].words[0],
                                  cases[i].words[1] ? cases[i].words[1] : "");
        insitu_destroy(&session);
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    regions_create();
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    regions_free();
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(layers_draw_only_meshes_with_the_field),
        cmocka_unit_test(separate_meshes_draw_same_picture_as_one_mesh),
        cmocka_unit_test(surfaces_without_the_colour_field_are_grey),
        cmocka_unit_test(colours_that_are_not_numbers_are_grey),
        cmocka_unit_test(warning_of_grey_is_reported_once),
        cmocka_unit_test(fields_missing_on_all_ranks_are_refused),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
