/* Checks fields whose values are computed by a fill function of the caller. The function is called once in a step that
 * needs the field for a picture, a statistic or a condition, and in no other step. It may communicate. The pictures
 * equal those of values that are passed directly. Errors that the function returns are reported on all ranks. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mpi.h>

#include "test_session_fixture.h"

enum { SIDE = 4, PIXELS = 24 * 16, STEPS = 13 };

#define IMAGE(name, every, layer)                                                                                      \
    "  - name: " name "\n    size: [24, 16]\n    every: " every "\n    layers: [" layer                                \
    "]\n    outputs: [{path: " name ".exr}]\n"

static const char scene_text[] =
    "statistics: [{field: h, every: 5, path: filled.csv}]\nimages:\n" IMAGE("a", "2", "{volume: {field: f}}")
        IMAGE("b", "4", "{isosurface: {field: f, values: [0.1], colour_by: {field: g}}}")
            IMAGE("c", "3", "{surface: {colour_by: {field: g}}}");

/* The data of a fill function: its input, the values that it computes, and what it does to the field. */
typedef struct maker {
    const session_input *in;
    double *values, scale;
    int calls;
    insitu_status status;
    void (*corrupt)(insitu_field *field);
    unsigned changed;
} maker;

static insitu_status fill_field(void *data, insitu_field *field)
{
    maker *m = data;
    int one = 1, ranks = 0;
    /* This call completes only if all ranks call the fill function. */
    MPI_Allreduce(&one, &ranks, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    const int64_t count = m->in->part.vertex_count;
    for (int64_t i = 0; i < count; i++) m->values[i] = ranks == rank_count ? m->scale * m->in->part.values[i] : 0;
    m->calls++;
    field->count = count;
    field->values = (insitu_array){m->values, INSITU_FLOAT64, 0};
    field->changed = m->changed;
    if (m->corrupt) m->corrupt(field);
    return m->status;
}

static maker make_maker(const session_input *in, double scale)
{
    double *values = calloc((size_t)in->part.vertex_count + 1, sizeof *values);
    assert_non_null(values);
    return (maker){.in = in, .values = values, .scale = scale, .changed = INSITU_CHANGED_ALL};
}

static insitu_field describe_field(const char *name, maker *m, bool is_filled)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = name;
    if (is_filled) {
        field.fill = fill_field;
        field.fill_data = m;
        return field;
    }
    field.count = m->in->part.vertex_count;
    field.values = (insitu_array){m->values, INSITU_FLOAT64, 0};
    return field;
}

/* Consecutive pictures, intercepted on rank 0. */
typedef struct album {
    int count;
    float *pixels;
} album;

static void append_caught_pictures(album *out)
{
    out->pixels = realloc(out->pixels, (size_t)(out->count + caught_count + 1) * PIXELS * 4 * sizeof(float));
    assert_non_null(out->pixels);
    for (int i = 0; i < caught_count; i++)
        memcpy(out->pixels + (size_t)out->count++ * PIXELS * 4, caught[i].rgba, PIXELS * 4 * sizeof(float));
}

/* Draws all steps, with values that change at each step. */
static album draw_steps(const session_input *in, bool is_filled)
{
    static const char *const names[] = {"f", "g", "h"};
    album out = {0};
    maker makers[3];
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    everywhere(insitu_set_mesh(session, "m", &in->mesh) == INSITU_OK);
    for (int i = 0; i < 3; i++) {
        const int k = own_rank % 2 ? 2 - i : i; /* ranks set the fields in different orders */
        makers[k] = make_maker(in, k + 1);
        const insitu_field field = describe_field(names[k], &makers[k], is_filled);
        everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
    }
    for (int step = 0; step < STEPS; step++) {
        const int needs[3] = {step % 2 == 0, step % 4 == 0 || step % 3 == 0, step % 5 == 0};
        for (int k = 0; k < 3; k++) {
            makers[k].scale = 1 + 0.1 * step + k;
            makers[k].calls = 0;
            for (int64_t i = 0; i < in->part.vertex_count && !is_filled; i++)
                makers[k].values[i] = makers[k].scale * in->part.values[i];
            const insitu_field field = describe_field(names[k], &makers[k], is_filled);
            if (!is_filled) everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
        }
        discard_pictures();
        const insitu_status status = insitu_step(session, step, 0);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
        for (int k = 0; k < 3; k++) everywhere(makers[k].calls == (is_filled ? needs[k] : 0));
        if (own_rank == 0) append_caught_pictures(&out);
    }
    insitu_destroy(&session);
    for (int k = 0; k < 3; k++) free(makers[k].values);
    return out;
}

static void fill_functions_are_called_only_for_drawn_fields(void **state)
{
    (void)state;
    session_input in = {0};
    input_create(&in, TEST_MIXED, SIDE, TEST_RANDOM, own_rank, rank_count);
    album given = draw_steps(&in, false), filled = draw_steps(&in, true);
    const size_t bytes = (size_t)given.count * PIXELS * 4 * sizeof(float);
    everywhere(own_rank != 0 || given.count == 7 + 4 + 5);
    everywhere(given.count == filled.count && (bytes == 0 || memcmp(given.pixels, filled.pixels, bytes) == 0));
    everywhere(bytes == 0 || memcmp(given.pixels, given.pixels + (ptrdiff_t)(given.count - 1) * PIXELS * 4,
                                    PIXELS * 4 * sizeof(float)) != 0);
    free(given.pixels);
    free(filled.pixels);
    input_free(&in);
}

/* ---- errors --------------------------------------------------------------------------------------------------- */

static void set_too_few_values(insitu_field *field)
{
    field->count--;
}
static void remove_values(insitu_field *field)
{
    field->values.data = NULL;
}
static void set_other_components(insitu_field *field)
{
    field->component_count = 2;
}
static void set_other_centring(insitu_field *field)
{
    field->centring = INSITU_CELL;
}

static void errors_are_reported_on_all_ranks(void **state)
{
    (void)state;
    static const struct {
        insitu_status status;
        void (*corrupt)(insitu_field *field);
        const char *words;
    } cases[] = {{INSITU_ERROR_IO, NULL, "field \"f\": its fill returned 5 (INSITU_ERROR_IO)"},
                 {INSITU_OK, set_too_few_values, "field \"f\": has "},
                 {INSITU_OK, remove_values, "field \"f\": values are not given"},
                 {INSITU_OK, set_other_components, "field \"f\": its fill made centring 0 of 0, and 2 components of 1"},
                 {INSITU_OK, set_other_centring, "field \"f\": its fill made centring 1 of 0"}};
    static const char text[] = "statistics: [{field: f, path: filled.csv}]\nimages:\n" IMAGE(
        "a", "1", "{isosurface: {field: f, values: [0.1], colour_by: {field: g}}}");
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    maker f = make_maker(&in, 1), g = make_maker(&in, 2);
    const insitu_field fields[] = {describe_field("f", &f, true), describe_field("g", &g, true)};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    for (int i = 0; i < 2; i++) everywhere(insitu_set_field(session, "m", &fields[i]) == INSITU_OK);
    for (int i = 0; i < (int)(sizeof cases / sizeof cases[0]); i++) {
        f.calls = g.calls = 0;
        if (own_rank == rank_count - 1) f.status = cases[i].status, f.corrupt = cases[i].corrupt;
        discard_pictures();
        check_reported_everywhere(session, insitu_step(session, 2 * i, 0), INSITU_ERROR_FIELD, cases[i].words, "rank ");
        /* the statistics have read f before the image is planned, which then is left out and does not need g */
        everywhere(caught_count == 0 && f.calls == 1 && g.calls == 0);
        f.status = INSITU_OK;
        f.corrupt = NULL;
        check_step_succeeds(session, 2 * i + 1);
    }
    insitu_field both = fields[0];
    both.values = (insitu_array){f.values, INSITU_FLOAT64, 0};
    everywhere(insitu_set_field(session, "m", &both) == INSITU_ERROR_FIELD);
    check_reported_everywhere(session, insitu_step(session, 20, 0), INSITU_ERROR_FIELD, "values and fill are given");
    insitu_destroy(&session);
    free(f.values);
    free(g.values);
    input_free(&in);
}

/* ---- calls that a fill function must not make ------------------------------------------------------------------- */

enum { CALLS = 9 };
static const char *const calls[CALLS] = {"insitu_set_mesh",      "insitu_set_mesh",    "insitu_set_field",
                                         "insitu_step",          "insitu_destroy",     "insitu_keep_pictures",
                                         "insitu_last_pictures", "insitu_last_report", "insitu_set_field"};

/* A fill function that calls the library with its own session, and nevertheless returns values. */
typedef struct caller {
    maker values;
    insitu_session *session;
    int call; /* index in calls; -1: no call */
    bool is_refused;
} caller;

static bool is_refused(caller *c)
{
    insitu_session *session = c->session;
    insitu_field another = describe_field("another", &c->values, false);
    int count = 7;
    switch (c->call) {
    case 0: return insitu_set_mesh(session, "m", &c->values.in->mesh) == INSITU_ERROR_ARGUMENT;
    case 1: return insitu_set_mesh(session, "m", NULL) == INSITU_ERROR_ARGUMENT;
    case 2: return insitu_set_field(session, "m", &another) == INSITU_ERROR_ARGUMENT;
    case 3: return insitu_step(session, 1, 0) == INSITU_ERROR_ARGUMENT;
    case 4: return insitu_destroy(&session) == INSITU_ERROR_ARGUMENT && session && strstr(insitu_error(NULL), calls[4]);
    case 5: return insitu_keep_pictures(session, 1) == INSITU_ERROR_ARGUMENT;
    case 6: return !insitu_last_pictures(session, &count) && count == 0;
    case 7: return insitu_last_report(session)->cycle == 0 && !*insitu_last_report(session)->warnings;
    default: another.name = "f"; return insitu_set_field(session, "m", &another) == INSITU_ERROR_ARGUMENT;
    }
}

static insitu_status make_and_call(void *data, insitu_field *field)
{
    caller *c = data;
    if (c->call >= 0) c->is_refused = is_refused(c) && strstr(insitu_error(c->session), calls[c->call]);
    return fill_field(&c->values, field);
}

static void library_calls_in_a_fill_function_are_refused(void **state)
{
    (void)state;
    static const char text[] = "statistics: [{field: f, path: filled.csv}]\nimages:\n" IMAGE(
        "a", "1", "{isosurface: {field: f, values: [0.1], colour_by: {field: g}}}");
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    caller f = {.values = make_maker(&in, 1), .call = -1};
    maker g = make_maker(&in, 2);
    insitu_field fields[] = {describe_field("f", &f.values, true), describe_field("g", &g, true)};
    fields[0].fill = make_and_call;
    fields[0].fill_data = &f;
    f.session = open_session(MPI_COMM_WORLD, write_scene(text));
    everywhere(insitu_set_mesh(f.session, "m", &in.mesh) == INSITU_OK);
    for (int i = 0; i < 2; i++) everywhere(insitu_set_field(f.session, "m", &fields[i]) == INSITU_OK);
    for (int i = 0; i < 2 * CALLS; i++) { /* first the last rank alone makes each call, then all ranks */
        char words[128];
        const bool calls_now = i >= CALLS || own_rank == rank_count - 1;
        snprintf(words, sizeof words, "field \"f\": its fill called %s() of its session", calls[i % CALLS]);
        f.call = calls_now ? i % CALLS : -1;
        f.is_refused = false;
        discard_pictures();
        check_reported_everywhere(f.session, insitu_step(f.session, 2 * i, 0), INSITU_ERROR_ARGUMENT, words, "rank ");
        everywhere(f.is_refused == calls_now && caught_count == 0 && insitu_last_report(f.session)->cycle == 2 * i);
        f.call = -1;
        check_step_succeeds(f.session, 2 * i + 1);
    }
    insitu_destroy(&f.session);
    free(f.values.values);
    free(g.values);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(fill_functions_are_called_only_for_drawn_fields),
                                       cmocka_unit_test(errors_are_reported_on_all_ranks),
                                       cmocka_unit_test(library_calls_in_a_fill_function_are_refused)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
