/* Messages about input that is sound, but hardly meant: warnings, the same on all ranks, given once; and errors, where
 * nothing useful could be drawn in any time. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_session_fixture.h"

enum { SIDE = 4 };

#define IMAGE(size, camera, layer, sampling)                                                                           \
    "images:\n  - name: a\n    size: " size "\n" camera "    layers: [" layer "]\n" sampling                           \
    "    outputs: [{path: \"a_{cycle}.exr\"}]\n"
#define SURFACE "{isosurface: {field: f, values: [0.1]}}"
#define VOLUME "{volume: {field: f}}"
#define CAMERA(text) "    camera: {" text "}\n"

static const char plain[] = IMAGE("[24, 16]", "", SURFACE, "");

/* ---- what is done to meshes ---------------------------------------------------------------------------------- */

static void exchange(int64_t *a, int64_t *b)
{
    const int64_t held = *a;
    *a = *b;
    *b = held;
}

/* Numbers quads row by row: VTK's vertex 2 comes fourth, its vertex 6 last. */
static void number_by_rows(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        int64_t *vertices = in->part.connectivity + in->part.offsets[cell];
        exchange(&vertices[2], &vertices[3]);
        if (in->part.types[cell] == INSITU_HEX) exchange(&vertices[6], &vertices[7]);
    }
}

/* Removes the jitter: then cells numbered by rows have exactly no volume. */
static void straighten(session_input *in)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        in->part.coordinates[i] = round((in->part.coordinates[i] + 1) * SIDE / 2) * 2 / SIDE - 1;
}

static void straighten_by_rows(session_input *in)
{
    straighten(in);
    number_by_rows(in);
}

static void flatten(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.coordinates[3 * v + 2] = 0;
}

static void mirror(session_input *in)
{
    test_mesh_mirror(&in->part, false);
}

/* A third of the tets; and another third are ghosts. */
static void mirror_some(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        in->part.ghosts[cell] = cell % 6 > 3;
        if (cell % 6 < 2 && cell % 4) exchange(&in->part.connectivity[4 * cell], &in->part.connectivity[4 * cell + 1]);
    }
}

static double cell_value;

static void centre_on_cells(session_input *in)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] = cell_value;
    in->field.centring = INSITU_CELL;
    in->field.count = in->part.cell_count; /* of hexes, which are fewer than their vertices */
}

static void make_negative(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] = -1 - fabs(in->part.values[v]);
}

static void make_nothing(session_input *in)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] = NAN;
}

/* ---- warnings ------------------------------------------------------------------------------------------------ */

static const struct warning_case {
    const char *name, *scene;
    test_mesh_kind kind;
    spoil_function *spoil;
    const char *words[3]; /* none: no warning */
} warnings[] = {
    {"hexes by rows",
     plain,
     TEST_HEXES,
     number_by_rows,
     {"mesh \"m\": ", "lexicographic order", "INSITU_ORDER_LEXICOGRAPHIC"}},
    {"straight hexes by rows",
     plain,
     TEST_HEXES,
     straighten_by_rows,
     {"lexicographic order", "little of them is seen"}},
    {"pyramids by rows", plain, TEST_PYRAMIDS, number_by_rows, {"mesh \"m\": ", "lexicographic order"}},
    {"flat tets", plain, TEST_TETS, flatten, {"mesh \"m\": 384 of 384 cells have no volume", "the order of their"}},
    {"mirrored hexes", plain, TEST_HEXES, mirror, {"mesh \"m\": 64 of 64 cells are left-handed", "the order of their"}},
    {"mirrored tets", plain, TEST_TETS, mirror, {"mesh \"m\": 384 of 384 cells are left-handed"}},
    {"good tets", plain, TEST_TETS, NULL, {NULL}},
    {"good hexes", plain, TEST_HEXES, NULL, {NULL}},
    {"good wedges", plain, TEST_WEDGES, NULL, {NULL}},
    {"pyramids, half of them left-handed", plain, TEST_PYRAMIDS, NULL, {NULL}},
    {"good mixed cells", plain, TEST_MIXED, NULL, {NULL}},
    {"good polyhedra", plain, TEST_POLYHEDRA, NULL, {NULL}},
    {"some tets mirrored, some ghosts", plain, TEST_TETS, mirror_some, {NULL}},
    {"an isovalue too high",
     IMAGE("[24, 16]", "", "{isosurface: {field: f, values: [0.1, 7e5]}}", ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": the isosurface of \"f\" at 700000 is empty: the field goes from -"}},
    {"an isovalue too low, of a full tree",
     "tree: full\n" IMAGE("[24, 16]", "", SURFACE ", {isosurface: {field: f, values: [-3]}}", ""),
     TEST_TETS,
     NULL,
     {"the isosurface of \"f\" at -3 is empty"}},
    {"an isovalue too low, of a partial tree",
     "tree: partial\n" IMAGE("[24, 16]", "", "{isosurface: {field: f, values: [-3]}}", ""),
     TEST_TETS,
     NULL,
     {"the isosurface of \"f\" at -3 is empty"}},
    {"cells of another value",
     plain,
     TEST_HEXES,
     centre_on_cells,
     {"\"f\" at 0.1 is empty: the field goes from 5 to 5"}},
    {"a logarithm of nothing",
     IMAGE("[24, 16]", "", "{surface: {colour_by: {field: f, scale: log}}}", ""),
     TEST_HEXES,
     make_negative,
     {"image \"a\": the field \"f\" has no value above 0", "scale: log"}},
    {"no value at all", plain, TEST_TETS, make_nothing, {"are not finite"}},
    {"a camera that looks away",
     IMAGE("[24, 16]", CAMERA("position: [0, 0, 9], focal: [0, 0, 12]"), SURFACE, ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": its camera does not see the cells", "(-1, -1, -1) and (1, 1, 1)", "they are behind it"}},
    {"a camera that looks aside",
     IMAGE("[24, 16]", CAMERA("position: [0, 0, 9], focal: [9, 0, 4]"), VOLUME, ""),
     TEST_HEXES,
     NULL,
     {"its camera does not see the cells", "they are beside the picture"}},
    {"a camera far away",
     IMAGE("[24, 16]", CAMERA("position: [0, 0, 9000], focal: [0, 0, 0]"), SURFACE, ""),
     TEST_HEXES,
     NULL,
     {"its camera does not see the cells", "smaller than a pixel"}},
    {"a camera that is nowhere",
     IMAGE("[24, 16]", CAMERA("position: [0, 1e300, 1e300], focal: [0, 0, 0]"), SURFACE ", " VOLUME, ""),
     TEST_HEXES,
     NULL,
     {"its camera does not see the cells", "smaller than a pixel"}},
    {"a camera that is nowhere, and an error that is asked for",
     IMAGE("[24, 16]", CAMERA("position: [0, 1e300, 1e300], focal: [0, 0, 0]"), SURFACE ", " VOLUME,
           "    sampling: {max_error: 0.01}\n"),
     TEST_HEXES,
     NULL,
     {"its camera does not see the cells", "smaller than a pixel"}},
    {"a camera within",
     IMAGE("[24, 16]", CAMERA("position: [0, 0, 0], focal: [1e-300, 0, 0]"), SURFACE ", " VOLUME, ""),
     TEST_HEXES,
     NULL,
     {NULL}},
    {"the smallest angle", IMAGE("[24, 16]", CAMERA("angle: 1e-6"), SURFACE ", " VOLUME, ""), TEST_HEXES, NULL, {NULL}},
    {"the smallest angle, and an error that is asked for",
     IMAGE("[24, 16]", CAMERA("angle: 1e-6"), SURFACE ", " VOLUME, "    sampling: {max_error: 0.01}\n"),
     TEST_HEXES,
     NULL,
     {NULL}},
    {"the smallest zoom",
     IMAGE("[24, 16]", CAMERA("automatic: {zoom: 1e-4}"), SURFACE ", " VOLUME, ""),
     TEST_HEXES,
     NULL,
     {"its camera does not see the cells", "smaller than a pixel"}},
};

static bool is_warned(const insitu_session *session, const char *const words[3])
{
    const char *text = insitu_last_report(session)->warnings;
    bool is_so = words[0] ? strchr(text, '\n') == NULL : !*text;
    for (int i = 0; i < 3 && words[i]; i++) is_so = is_so && strstr(text, words[i]);
    if (!is_so) fprintf(stderr, "rank %d: warnings: %s\n", own_rank, text);
    return is_so;
}

static bool is_told_alike(const char *text)
{
    char first[2048] = "";
    if (own_rank == 0) snprintf(first, sizeof first, "%s", text);
    MPI_Bcast(first, sizeof first, MPI_CHAR, 0, MPI_COMM_WORLD);
    return strcmp(first, text) == 0;
}

static void check_warning(const struct warning_case *c)
{
    static const char *const none[3] = {NULL};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(c->scene));
    session_input in;
    if (own_rank == 0) fprintf(stderr, "%s\n", c->name);
    input_create(&in, c->kind, SIDE, TEST_RANDOM, own_rank, rank_count);
    if (c->spoil) c->spoil(&in);
    for (int cycle = 0; cycle < 2; cycle++) {
        const bool is_each_step = c->words[0] && strcmp(c->words[0], "are not finite") == 0;
        everywhere(hand_over(session, &in) == INSITU_OK);
        step_is_good(session, cycle);
        everywhere(is_warned(session, cycle == 0 || is_each_step ? c->words : none));
        everywhere(is_each_step || is_told_alike(insitu_last_report(session)->warnings));
    }
    insitu_destroy(&session);
    input_free(&in);
}

static void what_is_hardly_meant_is_told_once(void **context)
{
    (void)context;
    cell_value = 5;
    for (size_t i = 0; i < sizeof warnings / sizeof warnings[0]; i++) check_warning(&warnings[i]);
}

/* Told, not told again, cured, told anew; and anew with an edited scene. */
static void warnings_come_back_with_what_they_are_about(void **context)
{
    (void)context;
    static const bool is_bad[] = {true, true, false, true, true}, is_told[] = {true, false, false, true, false};
    static const char *const words[3] = {"the isosurface of \"f\" at 0.1 is empty: the field goes from 5 to 5"};
    static const char *const none[3] = {NULL};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain));
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    double *values = test_calloc((size_t)in.part.vertex_count + 1, sizeof *values);
    for (int64_t v = 0; v < in.part.vertex_count; v++) values[v] = 5;
    for (int cycle = 0; cycle < 5; cycle++) {
        session_input now = in;
        if (is_bad[cycle]) now.field.values.data = values;
        everywhere(hand_over(session, &now) == INSITU_OK);
        step_is_good(session, cycle);
        everywhere(is_warned(session, is_told[cycle] ? words : none));
    }
    write_scene(IMAGE("[32, 16]", "", SURFACE, ""));
    step_is_good(session, 5);
    everywhere(is_warned(session, words));
    insitu_destroy(&session);
    input_free(&in);
    test_free(values);
}

/* ---- errors -------------------------------------------------------------------------------------------------- */

static const struct {
    const char *name, *scene;
    const char *words[3];
} refused[] = {
    {"days of samples",
     IMAGE("[1280, 720]", "", VOLUME, "    sampling: {method: samples, step_cells: 1e-6}\n"),
     {".yaml:2: image \"a\" would take some ", "samples at a step of", "max_seconds is 3600"}},
    {"minutes of samples, where seconds are allowed",
     IMAGE("[1280, 720]", "", VOLUME,
           "    sampling: {method: samples, step_cells: 1e-2, max_seconds: 1, frames: 100}\n"),
     {"would take some ", "max_seconds is 1:"}},
    {"many frames",
     IMAGE("[8192, 8192]", "", VOLUME ", " VOLUME, "    sampling: {method: samples, step: 1e-4, frames: 4096}\n"),
     {"would take some ", "samples at a step of 0.0001"}},
};

static void pictures_that_would_take_hours_are_refused(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(refused[i].scene));
        everywhere(hand_over(session, &in) == INSITU_OK);
        const insitu_status status = insitu_step(session, 0, 0);
        told_everywhere(session, status, INSITU_ERROR_SCENE, refused[i].words[0], refused[i].words[1],
                        refused[i].words[2] ? refused[i].words[2] : "");
        insitu_destroy(&session);
    }
    input_free(&in);
}

/* Names as they are given, with what could act on a terminal or make two lines of one made visible. */
static void control_characters_are_escaped(void **context)
{
    (void)context;
    insitu_session *session = NULL;
    insitu_status status = insitu_create(MPI_COMM_WORLD, "/no\nwhere/\x1b[31mred\x7f.yaml", &session);
    told_everywhere(NULL, status, INSITU_ERROR_SCENE, "/no\\x0awhere/\\x1b[31mred\\x7f.yaml: cannot be read");
    session = open_session(MPI_COMM_WORLD, write_scene(plain));
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "p\x9b\xc2\x9b\tq\xc3\xa9";
    everywhere(insitu_set_field(session, "no\rmesh", &field) == INSITU_ERROR_FIELD);
    status = insitu_step(session, 0, 0);
    told_everywhere(session, status, INSITU_ERROR_FIELD, "field \"p\x9b\\x9b\\x09q\xc3\xa9\"", "\"no\\x0dmesh\"");
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    everywhere(hand_over(session, &in) == INSITU_OK);
    in.field.name = "two\nlines";
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    step_is_good(session, 1);
    everywhere(strstr(insitu_last_report(session)->left_out, "field \"two\\x0alines\" is in no picture") != NULL);
    insitu_destroy(&session);
    input_free(&in);
}

static int run(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_hardly_meant_is_told_once),
        cmocka_unit_test(warnings_come_back_with_what_they_are_about),
        cmocka_unit_test(pictures_that_would_take_hours_are_refused),
        cmocka_unit_test(control_characters_are_escaped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}

int main(int argc, char **argv)
{
    return run_session_tests(argc, argv, run);
}
