/* Checks that a session handles the failure of any allocation. Allocations fail one after the other, on one rank or on
 * all ranks, while the session is created, meshes and fields are set and drawn, and the scene is edited. The result
 * must be an error on all ranks, or a picture that is bit-identical to the one without failure. The next step must draw
 * the picture, whatever failed before. The failing heap is that of the whole process, which libyaml and the C library
 * also use. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "failing_heap.h"
#include "memory.h"
#include "test_session_fixture.h"
#include "text_file.h"

/* Distance between the numbers of the allocations that are tested, given on the command line; 0 selects the default. */
static int given_stride;
/* Number of the allocation that fails now or failed most recently. */
static int64_t allocation;

/* Returns the distance between the numbers of the allocations that are tested. Each case begins at a different
 * allocation. The distance is larger on several ranks, because their steps take longer. */
static int get_allocation_stride(void)
{
    return given_stride ? given_stride : rank_count > 1 ? 389 : 97;
}

/* ---- scenes and meshes ---------------------------------------------------------------------------------------- */

#define IMAGE(name, size, layers, sampling)                                                                            \
    "  - name: " name "\n    size: " size "\n    layers:\n" layers sampling "    outputs: [{path: " name               \
    ".exr, data: true}, {path: " name "_deep.exr, deep: true}]\n"
#define SURFACES                                                                                                       \
    "      - isosurface: {field: f, values: [0.1, -0.4]}\n"                                                            \
    "      - isosurface: {field: c, values: [0], colour_by: {field: f}, opacity: 0.5,\n"                               \
    "          lines: {field: c, count: 3}}\n"
#define VOLUME(field) "      - volume: {field: " field ", opacity: [[0, 0], [0.3, 0.4], [1, 0.9]]}\n"

/* The scene has surfaces with and without a volume behind them, volumes by samples and by segments, values at vertices
 * and at cells, several volumes, and pictures that average several frames. */
#define DECORATIONS                                                                                                    \
    "    decorations: {title: t, text: [{text: a}], colour_bar: {labels: x}, outline: ranks, axes: true}\n"

static const char full_scene[] =
    "threads: 1\nimages:\n" IMAGE("a", "[24, 16]", SURFACES VOLUME("f"), "    sampling: {step_cells: 0.5, frames: 3}\n")
        IMAGE("b", "[35, 21]", VOLUME("c"), "    sampling: {max_error: 0.01, reproducible: true}\n" DECORATIONS)
            IMAGE("d", "[16, 16]", VOLUME("f") VOLUME("c"), "    sampling: {max_error: 0.01}\n");

static const char edited_scene[] =
    "threads: 1\nmeshes: {m: {warp: {field: u, scale: 0.25}, mirror: {x: -1.25}}}\nfields: {l: {lambda2: [f, f, c]}, "
    "h: l * f + c}\nimages:\n" IMAGE(
        "e", "[24, 16]",
        "      - isosurface: {field: f, values: [0.2], normals: differences}\n"
        "      - slice: {field: c, planes: [{normal: [1, 2, 3]}], lines: {count: 2}, clip: {sphere: {centre: "
        "[0, 0, 0], radius: 0.5}}}\n"
        "      - surface: {opacity: 0.5, colour_by: {field: h, discrete: 4,\n"
        "          map: {colours: [[0, 0, 1], [1, 1, 1], [1, 0, 0]]},\n"
        "          range: run, below: [0, 0, 0]}, lines: {field: f, values: [0.2]}}\n"
        "      - volume: {field: f, discrete: 3, range: {percentile: [10, 90]}, scale: "
        "symlog,\n"
        "          threshold: 0.1, above: [1, 1, 1]}\n",
        "    sampling: {step_cells: 0.5}\n    shadows: true\n    ambient_occlusion: "
        "{samples: 2}\n") "  - name: k\n    size: [8, 8]\n    camera: {orbit: {views: 2}}\n"
                          "    sweep: {isovalues: true, fields: [f, c]}\n    layers:\n"
                          "      - isosurface: {field: f, values: [0.2, 0.5], colour_by: "
                          "{field: f}}\n"
                          "    outputs: [{cinema: memory.cdb}]\n"
                          "  - name: n\n    size: [8, 8]\n    layers: [{surface: {colour_by: f}}]\n"
                          "    decorations: {title: n, colour_bar: true, outline: true}\n"
                          "    outputs: [{path: n.png, grid: [1, 1]}, {path: o.png, grid: [2, 1], shared_bars: "
                          "true}]\n";

typedef struct memory_case {
    const char *name;
    test_mesh_kind kinds[2];
    int mesh_count; /* two meshes fill the same space */
} memory_case;

static const memory_case cases[] = {{"tets", {TEST_TETS}, 1},
                                    {"hexes", {TEST_HEXES}, 1},
                                    {"polyhedra", {TEST_POLYHEDRA}, 1},
                                    {"mixed cells", {TEST_MIXED}, 1},
                                    {"overlapping meshes", {TEST_HEXES, TEST_TETS}, 2},
                                    {"overlapping polyhedra", {TEST_POLYHEDRA, TEST_HEXES}, 2}};

typedef struct scenery {
    const memory_case *of;
    session_input inputs[2];
    double *cell_values[2];
} scenery;

static void scenery_create(scenery *s, const memory_case *of)
{
    s->of = of;
    for (int i = 0; i < of->mesh_count; i++) {
        input_create(&s->inputs[i], of->kinds[i], 3, TEST_RANDOM, own_rank, rank_count);
        const int64_t cells = s->inputs[i].part.cell_count;
        s->cell_values[i] = calloc((size_t)cells + 1, sizeof(double));
        assert_non_null(s->cell_values[i]);
        for (int64_t k = 0; k < cells; k++) s->cell_values[i][k] = test_uniform_between((uint64_t)k, 3, -1, 1);
    }
}

static void scenery_free(scenery *s)
{
    for (int i = 0; i < s->of->mesh_count; i++) {
        input_free(&s->inputs[i]);
        free(s->cell_values[i]);
    }
}

/* Sets the meshes and fields. Continues after an error, and returns the first status that is not INSITU_OK. */
static insitu_status submit_scenery(insitu_session *session, const scenery *s)
{
    insitu_status first = INSITU_OK;
    for (int i = 0; i < s->of->mesh_count; i++) {
        const char *name = i ? "n" : "m";
        const session_input *in = &s->inputs[i];
        insitu_field cells = in->field;
        cells.name = "c", cells.centring = INSITU_CELL, cells.count = in->part.cell_count;
        cells.values.data = s->cell_values[i];
        insitu_status status = insitu_set_mesh(session, name, &in->mesh);
        if (!status) status = insitu_set_field(session, name, &in->field);
        if (!status) status = insitu_set_field(session, name, &cells);
        insitu_field u = in->field;
        u.name = "u", u.component_count = 3;
        u.values.data = in->part.coordinates;
        if (!status) status = insitu_set_field(session, name, &u);
        if (!first) first = status;
    }
    return first;
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

typedef struct picture_set {
    int count;
    caught_picture pictures[MAX_CAUGHT];
} picture_set;

/* Removes the caught pictures from the list of caught pictures and returns them. Only rank 0 has any. */
static picture_set pop_pictures(void)
{
    picture_set set = {.count = caught_count};
    memcpy(set.pictures, caught, (size_t)caught_count * sizeof *caught);
    caught_count = 0;
    return set;
}

static void free_pictures(picture_set *set)
{
    for (int i = 0; i < set->count; i++) free_caught(&set->pictures[i]);
}

/* Returns whether each caught picture is in the set. Only rank 0 has pictures. */
static bool are_pictures_in_set(const picture_set *set)
{
    bool are_all = true;
    for (int i = 0; i < caught_count; i++) {
        bool is_one = false;
        for (int k = 0; k < set->count; k++)
            is_one = is_one || (are_same_pictures(&caught[i], &set->pictures[k]) &&
                                !strcmp(caught[i].path, set->pictures[k].path));
        are_all = are_all && is_one;
    }
    return are_all;
}

/* Checks the condition on all ranks. If it is false, prints the number of the allocation that failed. */
#define at_allocation(condition) everywhere(report_failed_allocation((condition)))
static bool report_failed_allocation(bool is_well)
{
    if (!is_well) fprintf(stderr, "allocation %lld:\n", (long long)allocation);
    return is_well;
}

static void check_step_draws(insitu_session *session, const picture_set *expected)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, 1, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    at_allocation(own_rank != 0 || (are_pictures_in_set(expected) && caught_count == expected->count));
}

static insitu_session *open_and_draw(const char *scene, const scenery *s, picture_set *out)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    everywhere(submit_scenery(session, s) == INSITU_OK);
    discard_pictures();
    const insitu_status status = insitu_step(session, 1, 0);
    check_reported_everywhere(session, status, INSITU_OK, "");
    *out = pop_pictures();
    return session;
}

/* ---- one allocation fails -------------------------------------------------------------------------------------- */

typedef struct failure {
    int64_t n;
    bool is_armed; /* whether the allocation fails on this rank */
} failure;

static void start_failing(const failure *f)
{
    if (f->is_armed) heap_start_failing(f->n, false);
}

/* Ends the failing of allocations. Returns whether every rank made fewer allocations than the number of the one that
 * was to fail. */
static bool stop_failing(const failure *f)
{
    int is_over = !f->is_armed || heap_stop_failing() < f->n;
    MPI_Allreduce(MPI_IN_PLACE, &is_over, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    return is_over;
}

/* Checks that the status is the same on all ranks, and that an error concerns memory or the field of a mesh that was
 * refused. */
static void check_reported(const insitu_session *session, insitu_status status)
{
    if (status == INSITU_OK || status == INSITU_ERROR_FIELD) {
        check_reported_everywhere(session, status, status, "");
        return;
    }
    if (status != INSITU_ERROR_MEMORY) fprintf(stderr, "allocation %lld: ", (long long)allocation);
    check_reported_everywhere(session, status, INSITU_ERROR_MEMORY, "memory");
}

static void run_failures(bool (*fails_cleanly)(const scenery *s, const failure *f, void *state), const scenery *s,
                         int first, void *state)
{
    for (int with_all = 0; with_all < (rank_count > 1 ? 2 : 1); with_all++) {
        failure f = {.n = first, .is_armed = with_all || own_rank == rank_count - 1};
        for (allocation = f.n; !fails_cleanly(s, &f, state); allocation = f.n) f.n += get_allocation_stride();
        if (own_rank == 0) fprintf(stderr, "%s: to allocation %lld\n", s->of->name, (long long)f.n);
    }
}

/* ---- steps ----------------------------------------------------------------------------------------------------- */

typedef struct step_state {
    insitu_session *session;
    picture_set expected;
} step_state;

/* Sets the input and makes a step, both with a failing allocation, and checks the result and the next steps. Returns
 * whether there are no further allocations to test. */
static bool set_and_step_fail_cleanly(const scenery *s, const failure *f, void *state)
{
    step_state *t = state;
    discard_pictures();
    start_failing(f);
    const insitu_status set = submit_scenery(t->session, s);
    const insitu_status status = insitu_step(t->session, 1, 0);
    const bool is_over = stop_failing(f);
    check_reported(t->session, status);
    at_allocation(own_rank != 0 || are_pictures_in_set(&t->expected));
    at_allocation(own_rank != 0 || status != INSITU_OK || caught_count == t->expected.count);
    int is_set = set == INSITU_OK;
    MPI_Allreduce(MPI_IN_PLACE, &is_set, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    if (is_set) check_step_draws(t->session, &t->expected); /* input that was set successfully must not be lost */
    everywhere(submit_scenery(t->session, s) == INSITU_OK);
    check_step_draws(t->session, &t->expected);
    return is_over;
}

static void failed_allocation_in_a_step_gives_same_picture_or_error(void **context)
{
    (void)context;
    if (!heap_can_fail()) skip();
    for (int i = 0; i < (int)(sizeof cases / sizeof *cases); i++) {
        scenery s;
        step_state t;
        scenery_create(&s, &cases[i]);
        t.session = open_and_draw(full_scene, &s, &t.expected);
        run_failures(set_and_step_fail_cleanly, &s, 1 + i % get_allocation_stride(), &t);
        insitu_destroy(&t.session);
        free_pictures(&t.expected);
        scenery_free(&s);
    }
}

/* ---- first steps: a new session each --------------------------------------------------------------------------- */

static bool first_step_fails_cleanly(const scenery *s, const failure *f, void *state)
{
    step_state *t = state;
    t->session = open_session(MPI_COMM_WORLD, write_scene(full_scene));
    const bool is_over = set_and_step_fail_cleanly(s, f, t);
    insitu_destroy(&t->session);
    return is_over;
}

static void failed_allocation_in_first_step_gives_same_picture_or_error(void **context)
{
    (void)context;
    if (!heap_can_fail()) skip();
    for (int i = 2; i < (int)(sizeof cases / sizeof *cases); i += 2) {
        scenery s;
        step_state t;
        scenery_create(&s, &cases[i]);
        t.session = open_and_draw(full_scene, &s, &t.expected);
        insitu_destroy(&t.session);
        run_failures(first_step_fails_cleanly, &s, 1 + i % get_allocation_stride(), &t);
        free_pictures(&t.expected);
        scenery_free(&s);
    }
}

/* ---- sessions --------------------------------------------------------------------------------------------------- */

static bool creation_fails_cleanly(const scenery *s, const failure *f, void *state)
{
    step_state *t = state;
    const int64_t held = base_memory_held();
    const char *scene = write_scene(full_scene);
    insitu_session *session = NULL;
    start_failing(f);
    const insitu_status status = insitu_create(MPI_COMM_WORLD, scene, &session);
    const bool is_over = stop_failing(f);
    everywhere((status == INSITU_OK) == (session != NULL));
    check_reported(NULL, status);
    if (session) {
        everywhere(submit_scenery(session, s) == INSITU_OK);
        check_step_draws(session, &t->expected);
    }
    insitu_destroy(&session);
    everywhere(base_memory_held() == held);
    return is_over;
}

static void failed_allocation_in_creation_opens_a_session_or_none(void **context)
{
    (void)context;
    if (!heap_can_fail()) skip();
    scenery s;
    step_state t;
    scenery_create(&s, &cases[0]);
    t.session = open_and_draw(full_scene, &s, &t.expected);
    insitu_destroy(&t.session);
    run_failures(creation_fails_cleanly, &s, 1, &t);
    free_pictures(&t.expected);
    scenery_free(&s);
}

/* ---- edits ------------------------------------------------------------------------------------------------------ */

typedef struct edit_state {
    picture_set before, after;
} edit_state;

/* Checks that the next step draws. report.json is written after all ranks have agreed on the status of a step. If an
 * earlier step could not write report.json, the next step draws but returns this error, and only the step after it
 * returns no error. */
static void next_step_draws(insitu_session *session, const picture_set *expected)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, 1, 0);
    const char *words = status ? "cycle 1: cinema: memory.cdb/report.json: cannot be written" : "";
    check_reported_everywhere(session, status, status ? INSITU_ERROR_MEMORY : INSITU_OK, words);
    at_allocation(own_rank != 0 || (are_pictures_in_set(expected) && caught_count == expected->count));
    if (status) check_step_draws(session, expected);
}

/* Checks that a step that fails to apply an edited scene returns an error, and that the next step applies the edit. */
static bool edit_fails_cleanly(const scenery *s, const failure *f, void *state)
{
    edit_state *t = state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(full_scene));
    everywhere(submit_scenery(session, s) == INSITU_OK);
    write_scene(edited_scene);
    discard_pictures();
    start_failing(f);
    const insitu_status status = insitu_step(session, 1, 0);
    const bool is_over = stop_failing(f);
    check_reported(session, status);
    const bool is_taken = are_pictures_in_set(&t->after);
    at_allocation(own_rank != 0 || is_taken || are_pictures_in_set(&t->before));
    at_allocation(own_rank != 0 || is_taken || status != INSITU_OK || *insitu_last_report(session)->warnings);
    next_step_draws(session, &t->after);
    insitu_destroy(&session);
    return is_over;
}

static void failed_allocation_in_an_edit_is_reported_and_retried(void **context)
{
    (void)context;
    if (!heap_can_fail()) skip();
    scenery s;
    edit_state t;
    scenery_create(&s, &cases[2]);
    insitu_session *session = open_and_draw(full_scene, &s, &t.before);
    insitu_destroy(&session);
    session = open_and_draw(edited_scene, &s, &t.after);
    insitu_destroy(&session);
    run_failures(edit_fails_cleanly, &s, 1, &t);
    free_pictures(&t.before);
    free_pictures(&t.after);
    scenery_free(&s);
}

/* ---- files of text ---------------------------------------------------------------------------------------------- */

enum { TEXT_LINES = 1000, TEXT_BYTES = 9 * TEXT_LINES };

static void write_many_lines(text_output *out, const void *what)
{
    (void)what;
    for (int i = 0; i < TEXT_LINES; i++) {
        text_print(out, "%07.1f", i + 0.5);
        text_add(out, ",\n", 2);
    }
}

/* Returns whether the file consists of exactly the expected lines. */
static bool has_many_lines(const char *path)
{
    static char expected[TEXT_BYTES + 1], text[TEXT_BYTES + 2];
    for (int i = 0; i < TEXT_LINES; i++) snprintf(expected + (ptrdiff_t)9 * i, 10, "%07.1f,\n", i + 0.5);
    read_file(path, sizeof text, text);
    return strcmp(text, expected) == 0;
}

/* Checks that a file has either the complete new text or its previous contents. In the latter case the error must
 * concern memory. */
static void failed_allocation_writes_complete_texts_or_none(void **context)
{
    (void)context;
    static const char path[] = "text.csv", before[] = "before\n";
    char text[sizeof before + 1];
    bool is_well = true;
    if (!heap_can_fail()) skip();
    for (int64_t n = 1, asked = n; asked >= n && own_rank == 0; n++) {
        file_failure failure;
        write_text_file(path, before);
        heap_start_failing(n, false);
        const bool is_written = text_file_replace(path, write_many_lines, NULL, &failure);
        asked = heap_stop_failing();
        read_file(path, sizeof text, text);
        is_well =
            is_well && (is_written ? has_many_lines(path) : failure.is_out_of_memory && strcmp(text, before) == 0);
    }
    everywhere(is_well);
}

int main(int argc, char **argv)
{
    given_stride = argc > 2 ? atoi(argv[2]) : 0;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(failed_allocation_in_a_step_gives_same_picture_or_error),
        cmocka_unit_test(failed_allocation_in_first_step_gives_same_picture_or_error),
        cmocka_unit_test(failed_allocation_in_creation_opens_a_session_or_none),
        cmocka_unit_test(failed_allocation_in_an_edit_is_reported_and_retried),
        cmocka_unit_test(failed_allocation_writes_complete_texts_or_none),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
