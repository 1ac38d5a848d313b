/* Checks the pictures that a thread of rank 0 writes while the simulation continues. The pictures and their order must
 * be the same as if they were written in the step. Errors are returned by a later step on all ranks, the number of
 * pending pictures is limited, and pending pictures can outlive their scene. */
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "session_image.h"
#include "test_session_fixture.h"

enum { SIDE = 4, MIB = 1 << 20 };

#define SCENE(keys, size)                                                                                              \
    keys "images:\n  - name: a\n    size: " size                                                                       \
         "\n    every: 2\n    layers: [{isosurface: {field: f, values: [0.25]}"                                        \
         "}]\n    decorations: {title: '{cycle}'}\n    outputs: [{path: 'a{cycle}.png'}, {path: 'a{cycle}.exr'}]\n"    \
         "  - name: b\n    size: [8, 12]\n    layers: [{volume: {field: f}}]\n    outputs: [{path: 'b{cycle}.exr'}]\n"

/* A gate for tests: while is_closed is set, rank 0's writer thread waits at the gate before each picture. passed:
 * number of pictures that have passed the gate. */
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t has_changed = PTHREAD_COND_INITIALIZER;
static bool is_closed;
static int passed;

static void wait_at_gate(void)
{
    pthread_mutex_lock(&mutex);
    while (is_closed) pthread_cond_wait(&has_changed, &mutex);
    passed++;
    pthread_cond_broadcast(&has_changed);
    pthread_mutex_unlock(&mutex);
}

static void set_gate(bool closed)
{
    pthread_mutex_lock(&mutex);
    is_closed = closed;
    pthread_cond_broadcast(&has_changed);
    pthread_mutex_unlock(&mutex);
}

static void wait_before_picture(void)
{
    usleep(20000);
}

static insitu_session *open_session_with_gate(const char *scene, const session_input *in, void (*gate)(void))
{
    before_writing = gate;
    session_writes_behind = true;
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    everywhere(submit_input(session, in) == INSITU_OK);
    return session;
}

static void make_input(session_input *in)
{
    discard_pictures();
    session_writes_behind = false;
    before_writing = NULL;
    unwritable = NULL;
    set_gate(false);
    input_create(in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
}

static bool are_equal_pictures(const caught_picture *a, const caught_picture *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    return a->width == b->width && a->height == b->height && strcmp(a->path, b->path) == 0 &&
           memcmp(a->rgba, b->rgba, pixels * 4 * sizeof(float)) == 0 && !a->depth == !b->depth &&
           (!a->depth || memcmp(a->depth, b->depth, pixels * sizeof(float)) == 0);
}

/* Returns whether exactly 2 × count pictures were caught, and the first half equals the second half. */
static bool are_picture_halves_equal(int count)
{
    bool is_same = caught_count == 2 * count;
    for (int i = 0; i < count && is_same; i++) is_same = are_equal_pictures(&caught[i], &caught[count + i]);
    return is_same;
}

static void pictures_are_those_written_in_the_step(void **state)
{
    (void)state;
    enum { STEPS = 5, WRITTEN = 3 * 2 + 5 };
    session_input in;
    make_input(&in);
    const char *scene = write_scene(SCENE("writing: step\n", "[16, 12]"));
    for (int behind = 0; behind < 2; behind++) {
        insitu_session *session = open_session_with_gate(scene, &in, NULL);
        for (int cycle = 0; cycle < STEPS; cycle++) everywhere(insitu_step(session, cycle, 0.5) == INSITU_OK);
        everywhere(behind || own_rank || caught_count == WRITTEN);
        everywhere(insitu_destroy(&session) == INSITU_OK);
        scene = write_scene(SCENE("", "[16, 12]"));
    }
    everywhere(own_rank ? caught_count == 0 : are_picture_halves_equal(WRITTEN));
    input_free(&in);
}

/* Checks that steps end while no picture can be written. The report counts the pending pictures, and insitu_destroy()
 * reports all pictures that could not be written. */
static void simulation_continues_while_pictures_are_pending(void **state)
{
    (void)state;
    session_input in;
    make_input(&in);
    set_gate(true);
    insitu_session *session = open_session_with_gate(write_scene(SCENE("", "[16, 12]")), &in, wait_at_gate);
    for (int cycle = 0; cycle < 4; cycle++) {
        everywhere(insitu_step(session, cycle, 0.5) == INSITU_OK);
        const insitu_report *report = insitu_last_report(session);
        const int waiting = cycle + 1 + cycle / 2 + 1; /* image a is due every other cycle, b each cycle */
        everywhere(report->pictures_waiting == (own_rank ? 0 : waiting) && report->background_ms == 0);
    }
    everywhere(caught_count == 0);
    unwritable = "b";
    set_gate(false);
    check_reported_everywhere(NULL, insitu_destroy(&session), INSITU_ERROR_IO, "cycle 0: image \"b\": b0.exr",
                              "(and 3 more like it)");
    everywhere(caught_count == (own_rank ? 0 : 4));
    input_free(&in);
}

static void *open_gate_later(void *unused)
{
    usleep(200000);
    set_gate(false);
    return unused;
}

/* Checks that four pictures of 32 MiB may be pending, and that the fifth is not drawn before the gate is open. */
static void pending_pictures_are_bounded(void **state)
{
    (void)state;
    static const char scene[] = "images:\n  - name: a\n    size: [2048, 1024]\n    layers: [{isosurface: {field: f, "
                                "values: [0.25]}}]\n    outputs: [{path: 'a{cycle}.png'}]\n";
    session_input in;
    pthread_t opener;
    make_input(&in);
    set_gate(true);
    insitu_session *session = open_session_with_gate(write_scene(scene), &in, wait_at_gate);
    for (int cycle = 0; cycle < 8; cycle++) {
        const bool opens = cycle == 4;
        if (opens) assert_int_equal(pthread_create(&opener, NULL, open_gate_later, NULL), 0);
        everywhere(insitu_step(session, cycle, 0.5) == INSITU_OK);
        if (opens) assert_int_equal(pthread_join(opener, NULL), 0);
        const insitu_report *report = insitu_last_report(session);
        everywhere(report->pictures_waiting <= 4 && report->bytes_pictures <= (128 + 64) * (int64_t)MIB);
        everywhere(cycle != 3 || report->pictures_waiting == (own_rank ? 0 : 4));
        everywhere(cycle != 5 || strstr(report->warnings, " s for earlier pictures to be written") != NULL);
        everywhere(cycle > 4 || !*report->warnings);
    }
    everywhere(insitu_destroy(&session) == INSITU_OK);
    everywhere(own_rank ? caught_count == 0 : caught_count == 8);
    for (int i = 0; i < caught_count; i++) {
        char path[24];
        snprintf(path, sizeof path, "a%d.png", i);
        assert_string_equal(caught[i].path, path);
    }
    input_free(&in);
}

/* Waits until rank 0's writer thread has passed the gate `count` times. */
static void wait_for_passed(int count)
{
    pthread_mutex_lock(&mutex);
    while (own_rank == 0 && passed < count) pthread_cond_wait(&has_changed, &mutex);
    pthread_mutex_unlock(&mutex);
}

static void write_failure_is_reported_by_a_later_step_or_destroy(void **state)
{
    (void)state;
    session_input in;
    make_input(&in);
    passed = 0;
    unwritable = "2.png";
    insitu_session *session = open_session_with_gate(write_scene(SCENE("", "[16, 12]")), &in, wait_at_gate);
    everywhere(insitu_step(session, 2, 0.5) == INSITU_OK);
    wait_for_passed(3);
    /* The writer thread's progress decides which step returns the error: the last picture has passed the gate, but it
     * may not be written yet. */
    insitu_status status = INSITU_OK;
    for (int cycle = 3; cycle < 1000 && !status; cycle += 2) {
        status = insitu_step(session, cycle, 0.5);
        usleep(status ? 0 : 1000);
        discard_pictures();
    }
    check_reported_everywhere(session, status, INSITU_ERROR_IO, "cycle 2: image \"a\": a2.png: cannot be written");
    everywhere(insitu_last_report(session)->images == 1); /* the picture that is due is still drawn */
    everywhere(insitu_step(session, 1001, 0.5) == INSITU_OK);
    everywhere(insitu_step(session, 1002, 0.5) == INSITU_OK);
    status = insitu_destroy(&session);
    check_reported_everywhere(NULL, status, INSITU_ERROR_IO, "cycle 1002: image \"a\": a1002.png");
    everywhere(!session);
    input_free(&in);
}

/* Checks that the error of a step is returned first, and that the error of a picture is returned later and is not
 * lost. */
static void write_failure_is_reported_after_a_step_error(void **state)
{
    (void)state;
    session_input in;
    make_input(&in);
    unwritable = "a0.exr";
    insitu_session *session = open_session_with_gate(write_scene(SCENE("", "[16, 12]")), &in, NULL);
    everywhere(insitu_step(session, 0, 0.5) == INSITU_OK);
    insitu_mesh bad = in.mesh;
    bad.vertex_count = -1;
    for (int cycle = 1; cycle < 4; cycle++) {
        (void)insitu_set_mesh(session, "m", &bad);
        check_reported_everywhere(session, insitu_step(session, cycle, 0.5), INSITU_ERROR_ARGUMENT, "vertex_count");
        usleep(10000);
    }
    everywhere(submit_input(session, &in) == INSITU_OK);
    const insitu_status status = insitu_step(session, 4, 0.5);
    const insitu_status last = insitu_destroy(&session);
    everywhere((status == INSITU_ERROR_IO) != (last == INSITU_ERROR_IO));
    input_free(&in);
}

/* Checks that pending pictures keep the names, colours and positions of the scene that drew them. */
static void scene_is_kept_until_its_pictures_are_written(void **state)
{
    (void)state;
    session_input in;
    make_input(&in);
    insitu_session *session = open_session_with_gate(write_scene(SCENE("", "[16, 12]")), &in, wait_before_picture);
    everywhere(insitu_step(session, 0, 0.5) == INSITU_OK);
    everywhere(insitu_step(session, 2, 0.5) == INSITU_OK);
    write_scene("images:\n  - {name: other, size: [4, 4], layers: [{isosurface: {field: f, values: [0.25]}}], "
                "outputs: [{path: other.png}]}\n");
    everywhere(insitu_step(session, 4, 0.5) == INSITU_OK);
    write_scene(SCENE("writing: step\n", "[16, 12]"));
    everywhere(insitu_step(session, 6, 0.5) == INSITU_OK);
    everywhere(own_rank || caught_count == 6 + 1 + 3);
    everywhere(insitu_destroy(&session) == INSITU_OK);
    static const char *const paths[] = {"a0.png", "a0.exr",    "b0.exr", "a2.png", "a2.exr",
                                        "b2.exr", "other.png", "a6.png", "a6.exr", "b6.exr"};
    for (int i = 0; i < caught_count; i++) assert_string_equal(caught[i].path, paths[i]);
    input_free(&in);
}

static int count_lines(const char *path)
{
    int lines = 0;
    FILE *file = fopen(path, "r");
    for (int c; file && (c = fgetc(file)) != EOF;) lines += c == '\n';
    if (file) fclose(file);
    return lines;
}

static void tables_are_written_after_their_pictures(void **state)
{
    (void)state;
    static const char table[] = "writer.cdb/data.csv";
    session_input in;
    make_input(&in);
    if (own_rank == 0) unlink(table);
    set_gate(true);
    insitu_session *session = open_session_with_gate(
        write_scene("images:\n  - {name: a, size: [4, 4], layers: [{isosurface: {field: f, values: "
                    "[0.25]}}], outputs: [{cinema: writer.cdb}]}\n"),
        &in, wait_at_gate);
    for (int cycle = 0; cycle < 3; cycle++) everywhere(insitu_step(session, cycle, 0.5) == INSITU_OK);
    everywhere(own_rank || count_lines(table) == 0);
    set_gate(false);
    everywhere(insitu_destroy(&session) == INSITU_OK);
    everywhere(own_rank || count_lines(table) == 1 + 3);
    input_free(&in);
}

/* Checks that the calling thread loads the image library in insitu_create(). If it were loaded in parallel with a step,
 * the loader's lock would delay the start of OpenMP's threads. The next report includes the time for loading. */
static void image_library_is_loaded_before_the_first_step(void **state)
{
    (void)state;
    session_input in;
    make_input(&in);
    library_loaded = (library_loading){.ms = 1e6};
    insitu_session *session = open_session_with_gate(write_scene(SCENE("", "[16, 12]")), &in, NULL);
    const int wanted = own_rank == 0;
    everywhere(library_loaded.count == wanted && (!wanted || pthread_equal(library_loaded.by, pthread_self())));
    everywhere(insitu_step(session, 0, 0.5) == INSITU_OK);
    everywhere(insitu_last_report(session)->background_ms == wanted * 1e6);
    everywhere(insitu_step(session, 1, 0.5) == INSITU_OK);
    everywhere(insitu_last_report(session)->background_ms < 1e6 && library_loaded.count == wanted);
    insitu_destroy(&session);
    library_loaded = (library_loading){0};
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pictures_are_those_written_in_the_step),
        cmocka_unit_test(simulation_continues_while_pictures_are_pending),
        cmocka_unit_test(pending_pictures_are_bounded),
        cmocka_unit_test(write_failure_is_reported_by_a_later_step_or_destroy),
        cmocka_unit_test(write_failure_is_reported_after_a_step_error),
        cmocka_unit_test(scene_is_kept_until_its_pictures_are_written),
        cmocka_unit_test(tables_are_written_after_their_pictures),
        cmocka_unit_test(image_library_is_loaded_before_the_first_step),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
