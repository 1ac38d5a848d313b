/* Checks the warning that a picture has overwritten an earlier picture of the same run. The warning names the file, the
 * images, the cycles and the remedy, and is given only once, on every rank. Pictures with different names give no
 * warning. */
#include <stdio.h>
#include <string.h>

#include "test_session_fixture.h"

static session_input input;

#define IMAGE(name, keys, path)                                                                                        \
    "  - name: " name "\n    size: [8, 6]\n" keys                                                                      \
    "    layers: [{isosurface: {field: f, values: [0.1, 0.2]}}]\n    outputs: [{path: \"" path "\"}]\n"

enum { STEPS = 4 };

/* A scene and, for each step, the texts that its warning must contain; none if no warning is expected. */
typedef struct overwrite_case {
    const char *scene;
    const char *words[STEPS][4];
} overwrite_case;

static const overwrite_case cases[] = {
    {"images:\n" IMAGE("a", "", "x.png"), {{0}, {"image \"a\": x.png", "cycle 0", "cycle 1", "{cycle}"}}},
    {"images:\n" IMAGE("a", "", "x_{cycle}.png"), {{0}}},
    {"images:\n" IMAGE("a", "", "x_{time}.png"), {{0}}},
    {"images:\n" IMAGE("a", "", "x_{time:.0f}.png"), {{0}, {"x_0.png", "cycle 0", "cycle 1", "{cycle}"}}},
    {"images:\n" IMAGE("a", "    every: 2\n", "x.png"), {{0}, {0}, {"x.png", "cycle 0", "cycle 2", "{cycle}"}}},
    {"images:\n" IMAGE("a", "    once: true\n", "x.png"), {{0}}},
    {"images:\n" IMAGE("a", "", "out/x_{cycle}.png") IMAGE("b", "", "out/./x_{cycle}.png"),
     {{"out/./x_0.png", "image \"a\"", "image \"b\"", "{name}"}}},
    {"images:\n" IMAGE("a", "    once: true\n", "x_2.png") IMAGE("b", "", "x_{cycle}.png"),
     {{0}, {0}, {"x_2.png, written at cycle 0 by image \"a\"", "image \"b\"", "cycle 2", "{name}"}}},
    {"images:\n" IMAGE("a", "    once: true\n", "1x1.png") IMAGE("b", "", "{cycle}x{cycle}.png")
         IMAGE("c", "    every: 2\n", "{time:.0f}x1.png"),
     {{0},
      {"1x1.png, written at cycle 0 by image \"a\""},
      {"1x1.png, written at cycle 1 by image \"b\"", "image \"c\"", "cycle 2"}}},
    {"images:\n" IMAGE("a", "    camera: {orbit: {views: 2}}\n", "x_{view}.png"),
     {{0}, {"x_0.png", "cycle 0", "cycle 1", "{cycle}"}}},
    {"images:\n" IMAGE("a", "    camera: {orbit: {views: 2}}\n", "x_{view}_{cycle}.png"), {{0}}},
};

static void check_step(insitu_session *session, int cycle, const char *const *words)
{
    everywhere(submit_input(session, &input) == INSITU_OK);
    everywhere(insitu_step(session, cycle, 0.4 * cycle) == INSITU_OK);
    discard_pictures();
    const char *warnings = insitu_last_report(session)->warnings;
    bool is_well = words[0] || !strstr(warnings, "overwritten");
    for (int i = 0; i < 4 && words[i]; i++) is_well = is_well && strstr(warnings, words[i]);
    const char *line = strstr(warnings, "overwritten");
    is_well = is_well && !(line && strstr(line + 1, "overwritten")); /* the warning is given only once */
    if (!is_well) fprintf(stderr, "cycle %d, expected \"%s\": %s\n", cycle, words[0] ? words[0] : "", warnings);
    everywhere(is_well);
}

static void overwritten_pictures_are_reported(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(cases[i].scene));
        for (int cycle = 0; cycle < STEPS; cycle++) check_step(session, cycle, cases[i].words[cycle]);
        insitu_destroy(&session);
    }
}

/* Checks that no warning is given if a simulation repeats a step with the same cycle, because it then intends to
 * replace the pictures. */
static void repeated_steps_are_not_reported(void **state)
{
    (void)state;
    static const char *const none[4] = {NULL};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene("images:\n" IMAGE("a", "", "x_{cycle}.png")));
    for (int i = 0; i < 4; i++) check_step(session, i / 2, none);
    insitu_destroy(&session);
}

static int set_up_test_group(void **state)
{
    (void)state;
    if (!enter_test_folder("overwrites")) return 1;
    input_create(&input, TEST_HEXES, 2, TEST_RANDOM, own_rank, rank_count);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    input_free(&input);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(overwritten_pictures_are_reported),
                                       cmocka_unit_test(repeated_steps_are_not_reported)};
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
