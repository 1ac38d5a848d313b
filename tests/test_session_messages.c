/* Checks messages about input that is valid but probably a mistake. A warning is given once and is the same on all
 * ranks. An error is returned if no useful picture could be drawn in an acceptable time. */
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
#define IMAGE_OF_PNG(keys)                                                                                             \
    "images:\n  - name: a\n    size: [24, 16]\n    layers: [" SURFACE "]\n" keys                                       \
    "    outputs: [{path: \"a_{cycle}.png\"}]\n"
#define ERROR "    sampling: {max_error: 0.01}\n"
#define SAMPLES "    sampling: {step_cells: 0.5}\n"
#define CAMERA(text) "    camera: {" text "}\n"

static const char plain[] = IMAGE("[24, 16]", "", SURFACE, "");

/* ---- changes made to meshes ----------------------------------------------------------------------------------- */

static void swap_integers(int64_t *a, int64_t *b)
{
    const int64_t held = *a;
    *a = *b;
    *b = held;
}

/* Changes the order of vertices of quads and hexes from VTK's to rows: VTK's vertices 2 and 3 are exchanged, and for
 * hexes also 6 and 7. */
static void reorder_quads_by_rows(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        int64_t *vertices = in->part.connectivity + in->part.offsets[cell];
        swap_integers(&vertices[2], &vertices[3]);
        if (in->part.types[cell] == INSITU_HEX) swap_integers(&vertices[6], &vertices[7]);
    }
}

/* Removes the jitter of the vertices, so that the volume of a cell whose vertices are numbered by rows is exactly 0. */
static void remove_jitter(session_input *in)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        in->part.coordinates[i] = round((in->part.coordinates[i] + 1) * SIDE / 2) * 2 / SIDE - 1;
}

static void remove_jitter_and_reorder(session_input *in)
{
    remove_jitter(in);
    reorder_quads_by_rows(in);
}

static void flatten_cells(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.coordinates[3 * v + 2] = 0;
}

static void mirror_cells(session_input *in)
{
    test_mesh_mirror_cells(&in->part, false);
}

/* Mirrors a third of the tets and marks another third as ghosts. */
static void mirror_some_cells(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        in->part.ghosts[cell] = cell % 6 > 3;
        if (cell % 6 < 2 && cell % 4)
            swap_integers(&in->part.connectivity[4 * cell], &in->part.connectivity[4 * cell + 1]);
    }
}

static double cell_value;

static void make_cell_field(session_input *in)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] = cell_value;
    in->field.centring = INSITU_CELL;
    in->field.count = in->part.cell_count; /* cells are hexes, which are fewer than the vertices */
}

static void make_values_negative(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] = -1 - fabs(in->part.values[v]);
}

static void set_all_values_to_nan(session_input *in)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] = NAN;
}

static void set_nan_value_on_last_rank(session_input *in)
{
    if (own_rank == rank_count - 1 && in->part.cell_count) in->part.values[in->part.connectivity[0]] = NAN;
}

/* Replaces each hex by its first face, a quad. */
static void make_shells(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        for (int i = 0; i < 4; i++) in->part.connectivity[4 * cell + i] = in->part.connectivity[8 * cell + i];
        in->part.types[cell] = INSITU_QUAD;
        in->part.offsets[cell + 1] = 4 * (cell + 1);
    }
    in->part.connectivity_count = 4 * in->part.cell_count;
    input_describe(in);
}

/* Sets the values to x. Keeps hexes whose values are all negative, and replaces every other hex by its first face. */
static void replace_some_hexes_by_quads(session_input *in)
{
    int64_t at = 0;
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] = in->part.coordinates[3 * v];
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) {
        const int64_t *vertices = in->part.connectivity + 8 * cell;
        bool is_low = true;
        for (int i = 0; i < 8; i++) is_low = is_low && in->part.values[vertices[i]] < 0;
        const int count = is_low ? 8 : 4;
        for (int i = 0; i < count; i++) in->part.connectivity[at + i] = vertices[i];
        if (!is_low) in->part.types[cell] = INSITU_QUAD;
        in->part.offsets[cell] = at;
        at += count;
    }
    in->part.offsets[in->part.cell_count] = at;
    in->part.connectivity_count = at;
    input_describe(in);
}

/* Raises all values to at least 0.1, which float32 cannot represent exactly. */
static void raise_values_to_a_tenth(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] = fmax(in->part.values[v], 0.1);
}

/* Lowers all values to at most 0.1. */
static void lower_values_to_a_tenth(session_input *in)
{
    for (int64_t v = 0; v < in->part.vertex_count; v++) in->part.values[v] = fmin(in->part.values[v], 0.1);
}

static void mark_all_cells_as_ghosts(session_input *in)
{
    for (int64_t cell = 0; cell < in->part.cell_count; cell++) in->part.ghosts[cell] = 1;
}

/* Moves the mesh to coordinates near 1e12, where doubles have a spacing of about 1e-4. */
static void move_mesh_far_from_origin(session_input *in)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        in->part.coordinates[i] = 1e12 + 1e-2 * in->part.coordinates[i];
}

/* Scales x and y so that half a cell's width is less than a millionth of the scene's size. */
static void scale_cells_to_needles(session_input *in)
{
    for (int64_t i = 0; i < 3 * in->part.vertex_count; i++)
        if (i % 3 < 2) in->part.coordinates[i] *= 1e-9;
}

/* ---- warnings ------------------------------------------------------------------------------------------------ */

static const struct warning_case {
    const char *name, *scene;
    test_mesh_kind kind;
    corrupt_function *corrupt;
    const char *words[3]; /* texts that the warning contains; the first is NULL if no warning is expected */
} warnings[] = {
    {"hexes by rows",
     plain,
     TEST_HEXES,
     reorder_quads_by_rows,
     {"mesh \"m\": ", "lexicographic order", "INSITU_ORDER_LEXICOGRAPHIC"}},
    {"straight hexes by rows",
     plain,
     TEST_HEXES,
     remove_jitter_and_reorder,
     {"lexicographic order", "little of them is seen"}},
    {"pyramids by rows", plain, TEST_PYRAMIDS, reorder_quads_by_rows, {"mesh \"m\": ", "lexicographic order"}},
    {"flat tets",
     plain,
     TEST_TETS,
     flatten_cells,
     {"mesh \"m\": 384 of 384 cells have no volume", "the order of their"}},
    {"mirrored hexes",
     plain,
     TEST_HEXES,
     mirror_cells,
     {"mesh \"m\": 64 of 64 cells are left-handed", "the order of their"}},
    {"mirrored tets", plain, TEST_TETS, mirror_cells, {"mesh \"m\": 384 of 384 cells are left-handed"}},
    {"good tets", plain, TEST_TETS, NULL, {NULL}},
    {"good hexes", plain, TEST_HEXES, NULL, {NULL}},
    {"good wedges", plain, TEST_WEDGES, NULL, {NULL}},
    {"pyramids, half of them left-handed", plain, TEST_PYRAMIDS, NULL, {NULL}},
    {"good mixed cells", plain, TEST_MIXED, NULL, {NULL}},
    {"good polyhedra", plain, TEST_POLYHEDRA, NULL, {NULL}},
    {"some tets mirrored, some ghosts", plain, TEST_TETS, mirror_some_cells, {NULL}},
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
     make_cell_field,
     {"\"f\" at 0.1 is empty: the field goes from 5 to 5"}},
    {"an isovalue that is the least",
     plain,
     TEST_HEXES,
     raise_values_to_a_tenth,
     {"the isosurface of \"f\" at 0.1 is empty: the field goes from 0.1 to ", "nothing below it"}},
    {"an isovalue that is the least, of a full tree",
     "tree: full\n" IMAGE("[24, 16]", "", SURFACE ", {isosurface: {field: f, values: [0.2]}}", ""),
     TEST_TETS,
     raise_values_to_a_tenth,
     {"the isosurface of \"f\" at 0.1 is empty: the field goes from 0.1 to "}},
    {"an isovalue that is the greatest", plain, TEST_HEXES, lower_values_to_a_tenth, {NULL}},
    {"an isosurface of shells", plain, TEST_HEXES, make_shells, {NULL}},
    {"a volume of shells",
     IMAGE("[24, 16]", "", VOLUME, ""),
     TEST_HEXES,
     make_shells,
     {"the volume of \"f\" shows nothing: ", "a layer surface: {colour_by: {field: f}} draws"}},
    {"a slice of shells",
     IMAGE("[24, 16]", "", "{slice: {field: f, planes: [{normal: [1, 0, 0]}]}}", ""),
     TEST_HEXES,
     make_shells,
     {"the slice of \"f\" shows nothing: ", "a layer surface: {colour_by: {field: f}} draws"}},
    {"a surface of shells", IMAGE("[24, 16]", "", "{surface: {}}", ""), TEST_HEXES, make_shells, {NULL}},
    {"an isovalue that shells alone have",
     plain,
     TEST_HEXES,
     replace_some_hexes_by_quads,
     {"the isosurface of \"f\" at 0.1 is empty: the field goes from -"}},
    {"a volume whose range lies above the field",
     IMAGE("[24, 16]", "", "{volume: {field: f, range: [10, 20]}}", ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": the volume of \"f\" shows nothing: the field goes from -", "opacity is 0"}},
    {"a volume whose range lies above the field, of a full tree",
     "tree: full\n" IMAGE("[24, 16]", "", "{volume: {field: f, range: [10, 20]}}", ""),
     TEST_TETS,
     NULL,
     {"image \"a\": the volume of \"f\" shows nothing: the field goes from -", "opacity is 0"}},
    {"a volume without opacity",
     IMAGE("[24, 16]", "", "{volume: {field: f, opacity: [[0, 0], [1, 0]]}}", ""),
     TEST_HEXES,
     NULL,
     {"the volume of \"f\" shows nothing: the field goes from -", "opacity is 0"}},
    {"a volume whose range lies below the field",
     IMAGE("[24, 16]", "", "{volume: {field: f, range: [-20, -10]}}", ""),
     TEST_HEXES,
     NULL,
     {NULL}},
    {"a threshold that no cell is within",
     IMAGE("[24, 16]", "", "{surface: {threshold: {field: f, from: 10, to: 20}}}", ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": a surface is empty: no cell is within its threshold, from 10 to 20 of \"f\"", "goes from -"}},
    {"a threshold that cells are within",
     IMAGE("[24, 16]", "", "{surface: {threshold: {field: f, from: -20, to: 20}}}", ""),
     TEST_HEXES,
     NULL,
     {NULL}},
    {"a plane that cuts all away",
     IMAGE("[24, 16]", "    clip: {planes: [{normal: [1, 0, 0], point: [-3, 0, 0]}]}\n", SURFACE ", " VOLUME, ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": clip leaves nothing of the picture: the cells lie between (-1, -1, -1) and (1, 1, 1)"}},
    {"planes that cut all away together",
     IMAGE("[24, 16]", "",
           "{volume: {field: f, clip: {planes: [{normal: [1, 1, 0], point: [-0.4, -0.4, 0]}, "
           "{normal: [-1, -1, 0], point: [0.4, 0.4, 0]}]}}}, " SURFACE,
           ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": clip leaves nothing of the volume of \"f\": "}},
    {"a sphere beside the cells",
     IMAGE("[24, 16]", "", "{isosurface: {field: f, values: [0.1], clip: {sphere: {centre: [2, 2, 2], radius: 1.7}}}}",
           ""),
     TEST_HEXES,
     NULL,
     {"clip leaves nothing of the isosurface of \"f\": "}},
    {"a box around the cells, of which the outside is kept",
     IMAGE("[24, 16]", "", "{surface: {clip: {box: [[-1.1, -1.1, -1.1], [1.1, 1.1, 1.1]], keep: outside}}}, " SURFACE,
           ""),
     TEST_HEXES,
     NULL,
     {"clip leaves nothing of the surface: "}},
    {"clips that leave something",
     IMAGE("[24, 16]", "    clip: {planes: [{normal: [1, 0, 0]}], sphere: {centre: [0, 0, 0], radius: 0.9}}\n",
           "{isosurface: {field: f, values: [0.1], clip: {box: [[-1, -1, -1], [-0.1, 1, 1]], keep: inside}}}", ""),
     TEST_HEXES,
     NULL,
     {NULL}},
    {"a logarithm of nothing",
     IMAGE("[24, 16]", "", "{surface: {colour_by: {field: f, scale: log}}}", ""),
     TEST_HEXES,
     make_values_negative,
     {"image \"a\": the field \"f\" has no value above 0", "scale: log"}},
    {"no value at all",
     plain,
     TEST_TETS,
     set_all_values_to_nan,
     {"mesh \"m\": 384 cells are not drawn: values of field \"f\" are"}},
    {"no value on one rank",
     IMAGE("[24, 16]", "", VOLUME ", " SURFACE, SAMPLES),
     TEST_TETS,
     set_nan_value_on_last_rank,
     {"mesh \"m\": ", " cells are not drawn: values of field \"f\" are not finite"}},
    {"colours of no value at all",
     IMAGE("[24, 16]", "", "{surface: {colour_by: {field: f, range: [0, 1]}}}", ""),
     TEST_TETS,
     set_all_values_to_nan,
     {"mesh \"m\": values of field \"f\" are not finite in 384 cells: where the picture", "have the colour `nan`"}},
    {"colours of a slice without a value on one rank",
     IMAGE("[24, 16]", "", "{slice: {field: f, planes: [{normal: z}]}}", ""),
     TEST_TETS,
     set_nan_value_on_last_rank,
     {"mesh \"m\": values of field \"f\" are not finite in ", " cells: where the picture shows them"}},
    {"colours of the field that is shown",
     IMAGE("[24, 16]", "",
           "{surface: {colour_by: {field: f, range: [0, 1]}}}, {isosurface: {field: f, "
           "values: [0.1], colour_by: {field: f, range: [0, 1]}}}",
           ""),
     TEST_TETS,
     set_nan_value_on_last_rank,
     {" cells are not drawn: values of field \"f\" are not finite"}},
    {"colours that overflow",
     "fields: {g: exp(1000 + f)}\n" IMAGE("[24, 16]", "",
                                          "{isosurface: {field: f, values: [0.1], colour_by: {field: g}}}", ""),
     TEST_TETS,
     NULL,
     {"mesh \"m\": values of field \"g\" are not finite in 384 cells: where the picture", "have the colour `nan`"}},
    {"statistics of no value at all",
     "statistics: [{field: f, path: no_value.csv}]\n" IMAGE("[24, 16]", "", "{surface: {}}", ""),
     TEST_TETS,
     set_all_values_to_nan,
     {"statistics of \"f\": no cell counts (ghosts, no volume, or no finite value): no line is written"}},
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
    {"two volumes, by default",
     IMAGE("[24, 16]", "", VOLUME ", " VOLUME, ""),
     TEST_HEXES,
     NULL,
     {"image \"a\": its 2 volumes are sampled half a cell apart, to no known error",
      "{max_error: 0.01} bounds the error", "{step_cells: 0.5} asks for samples"}},
    {"two volumes to an error", IMAGE("[24, 16]", "", VOLUME ", " VOLUME, ERROR), TEST_HEXES, NULL, {NULL}},
    {"two volumes by samples", IMAGE("[24, 16]", "", VOLUME ", " VOLUME, SAMPLES), TEST_HEXES, NULL, {NULL}},
    {"one volume, by default", IMAGE("[24, 16]", "", VOLUME, ""), TEST_HEXES, NULL, {NULL}},
    {"ghosts alone",
     IMAGE("[24, 16]", "", SURFACE, ""),
     TEST_HEXES,
     mark_all_cells_as_ghosts,
     {"pictures show their background alone: no mesh has cells on any rank but ghosts"}},
    {"statistics of ghosts alone",
     "statistics: [{field: f, path: no_value.csv}]\n" IMAGE("[24, 16]", "", "{surface: {}}", ""),
     TEST_HEXES,
     mark_all_cells_as_ghosts,
     {"pictures show their background alone: no mesh has cells on any rank but ghosts"}},
    {"small cells far away",
     IMAGE("[24, 16]", "", SURFACE ", " VOLUME, ""),
     TEST_HEXES,
     move_mesh_far_from_origin,
     {NULL}},
    {"cells as thin as needles", IMAGE("[24, 16]", "", VOLUME, ""), TEST_HEXES, scale_cells_to_needles, {NULL}},
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

static bool is_report_equal_on_ranks(const char *text)
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
    if (c->corrupt) c->corrupt(&in);
    for (int cycle = 0; cycle < 2; cycle++) {
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_succeeds(session, cycle);
        everywhere(is_warned(session, cycle == 0 ? c->words : none));
        everywhere(is_report_equal_on_ranks(insitu_last_report(session)->warnings));
    }
    insitu_destroy(&session);
    input_free(&in);
}

static void likely_mistakes_are_reported_once(void **context)
{
    (void)context;
    cell_value = 5;
    for (size_t i = 0; i < sizeof warnings / sizeof warnings[0]; i++) check_warning(&warnings[i]);
}

/* Checks that a warning is given once, is not repeated in the next step, and is given a second time if its cause
 * disappears and returns. Editing the scene also repeats it. */
static void warnings_recur_with_their_causes(void **context)
{
    (void)context;
    static const bool is_bad[] = {true, true, false, true, true}, is_reported[] = {true, false, false, true, false};
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
        everywhere(submit_input(session, &now) == INSITU_OK);
        check_step_succeeds(session, cycle);
        everywhere(is_warned(session, is_reported[cycle] ? words : none));
    }
    write_scene(IMAGE("[32, 16]", "", SURFACE, ""));
    check_step_succeeds(session, 5);
    const char *warnings = insitu_last_report(session)->warnings;
    everywhere(strstr(warnings, "the scene file was edited") && strstr(warnings, words[0]));
    insitu_destroy(&session);
    input_free(&in);
    test_free(values);
}

static bool is_parameter_value(insitu_session *session, const char *name, double expected)
{
    double value = -77;
    return insitu_parameter(session, name, &value) == INSITU_OK && fabs(value - expected) <= 0;
}

/* Returns whether insitu_parameter() refuses a name that the scene does not define, leaves the value unchanged, and
 * gives an error with these words, which list the names that the scene defines. */
static bool is_parameter_undefined(insitu_session *session, const char *name, const char *words)
{
    double value = -77;
    return insitu_parameter(session, name, &value) == INSITU_ERROR_ARGUMENT && fabs(value + 77) <= 0 &&
           strstr(insitu_error(session), words) != NULL;
}

static void parameters_change_with_the_scene_on_all_ranks(void **context)
{
    (void)context;
    static const char *const unread[3] = {"parameter \"outflw\" of the scene changes nothing", NULL};
    static const char *const none[3] = {NULL};
    char text[1024];
    insitu_session *session = open_session(
        MPI_COMM_WORLD, write_scene(IMAGE("[24, 16]", "", SURFACE, "") "parameters: {inflow: 2.5, outflw: 1}\n"));
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    everywhere(is_parameter_value(session, "inflow", 2.5)); /* before the first step */
    everywhere(
        is_parameter_undefined(session, "outflow", "\"outflow\" is no parameter of ") &&
        is_parameter_undefined(session, "outflow", " (did you mean \"outflw\"?), expected one of inflow, outflw"));
    everywhere(insitu_parameter(session, NULL, &(double){0}) == INSITU_ERROR_ARGUMENT &&
               insitu_parameter(session, "inflow", NULL) == INSITU_ERROR_ARGUMENT &&
               strcmp(insitu_error(session), "insitu_parameter: value is NULL") == 0);
    everywhere(insitu_parameter(NULL, "inflow", &(double){0}) == INSITU_ERROR_ARGUMENT);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_step_succeeds(session, 0);
    everywhere(is_warned(session, none)); /* no warning yet, because the simulation may still read the parameter */
    check_step_succeeds(session, 1);
    everywhere(is_warned(session, unread));
    for (int i = 0; i < 3; i++) {
        snprintf(text, sizeof text, "%sparameters: {outflow: 0, inflow: %d}\n", plain, 10 + i);
        write_scene(i == 1 ? "images: 7\n" : text);                      /* an invalid edit changes no parameter */
        everywhere(is_parameter_value(session, "inflow", i ? 10 : 2.5)); /* parameters change only in a step */
        check_step_succeeds(session, 2 + i);
        everywhere(is_parameter_value(session, "inflow", i == 2 ? 12 : 10) &&
                   is_parameter_value(session, "outflow", 0));
    }
    write_scene(plain);
    check_step_succeeds(session, 5);
    everywhere(is_parameter_undefined(session, "inflow", ": it has no parameters"));
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks the warning about vertex ids if two meshes have cell values. It is given for a layer drawn by means at
 * vertices, but not for a layer drawn by cell values. */
static void meshes_with_ids_among_others_are_reported(void **context)
{
    (void)context;
    static const struct {
        bool has_ids;
        const char *scene, *words[3];
    } cases[] = {{true, plain, {"the isosurface of \"f\" may have a step where mesh \"m\" meets others"}},
                 {false, plain, {NULL}},
                 {true, IMAGE("[32, 16]", "", "{surface: {colour_by: {field: f}}}", ""), {NULL}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        session_input in;
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(cases[i].scene));
        input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
        in.field.centring = INSITU_CELL;
        in.field.count = in.part.cell_count;
        int64_t *ids = test_calloc((size_t)in.part.vertex_count + 1, sizeof *ids);
        for (int64_t v = 0; v < in.part.vertex_count; v++) ids[v] = 1000000 * (int64_t)own_rank + v;
        everywhere(insitu_set_mesh(session, "n", &in.mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "n", &in.field) == INSITU_OK);
        if (cases[i].has_ids) in.mesh.vertex_ids = (insitu_array){ids, INSITU_INT64, 0};
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_step_succeeds(session, 0);
        everywhere(is_warned(session, cases[i].words));
        insitu_destroy(&session);
        input_free(&in);
        test_free(ids);
    }
}

/* Checks that all faults of a picture's text are reported in the step that draws it, although the text is rendered
 * later, and that no fault hides another. */
static void faults_of_words_are_reported_at_once(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 3; i++) {
        const bool has_words = i > 0, is_reported = i == 2;
        word_faults = (insitu_word_faults){.font = ""};
        if (is_reported)
            word_faults = (insitu_word_faults){"no font was found", "no glyphs for U+6E29", "no room for the axes"};
        insitu_session *session =
            open_session(MPI_COMM_WORLD,
                         write_scene(has_words ? IMAGE_OF_PNG("    decorations: {title: Words}\n") : IMAGE_OF_PNG("")));
        everywhere(submit_input(session, &in) == INSITU_OK);
        for (int cycle = 0; cycle < 2; cycle++) {
            check_step_succeeds(session, cycle);
            const char *warnings = insitu_last_report(session)->warnings;
            everywhere(is_reported && cycle == 0 ? strstr(warnings, "image \"a\": no font was found") &&
                                                       strstr(warnings, "image \"a\": no glyphs for U+6E29") &&
                                                       strstr(warnings, "image \"a\": no room for the axes")
                                                 : !*warnings);
        }
        insitu_destroy(&session);
    }
    word_faults = (insitu_word_faults){.font = ""};
    input_free(&in);
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

static void oversized_pictures_are_refused(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (size_t i = 0; i < sizeof refused / sizeof refused[0]; i++) {
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(refused[i].scene));
        everywhere(submit_input(session, &in) == INSITU_OK);
        const insitu_status status = insitu_step(session, 0, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_SCENE, refused[i].words[0], refused[i].words[1],
                                  refused[i].words[2] ? refused[i].words[2] : "");
        insitu_destroy(&session);
    }
    input_free(&in);
}

/* Checks that names are reported as they were given, except that control characters are escaped, because they could act
 * on a terminal or break a line. */
static void control_characters_are_escaped(void **context)
{
    (void)context;
    insitu_session *session = NULL;
    insitu_status status = insitu_create(MPI_COMM_WORLD, "/no\nwhere/\x1b[31mred\x7f.yaml", &session);
    check_reported_everywhere(NULL, status, INSITU_ERROR_SCENE, "/no\\x0awhere/\\x1b[31mred\\x7f.yaml: cannot be read");
    session = open_session(MPI_COMM_WORLD, write_scene(plain));
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "p\x9b\xc2\x9b\tq\xc3\xa9";
    everywhere(insitu_set_field(session, "no\rmesh", &field) == INSITU_ERROR_FIELD);
    status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "field \"p\x9b\\x9b\\x09q\xc3\xa9\"",
                              "\"no\\x0dmesh\"");
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    everywhere(submit_input(session, &in) == INSITU_OK);
    in.field.name = "two\nlines";
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    check_step_succeeds(session, 1);
    everywhere(strstr(insitu_last_report(session)->left_out, "field \"two\\x0alines\" is in no picture") != NULL);
    insitu_destroy(&session);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(likely_mistakes_are_reported_once),
        cmocka_unit_test(warnings_recur_with_their_causes),
        cmocka_unit_test(meshes_with_ids_among_others_are_reported),
        cmocka_unit_test(oversized_pictures_are_refused),
        cmocka_unit_test(control_characters_are_escaped),
        cmocka_unit_test(parameters_change_with_the_scene_on_all_ranks),
        cmocka_unit_test(faults_of_words_are_reported_at_once),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
