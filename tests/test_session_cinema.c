/* Checks Cinema databases. Every byte of a table must be as expected, on any number of ranks, also if runs are
 * restarted or killed. Pictures of orbits, sweeps and paths must equal those of scenes that define each picture
 * explicitly. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory.h"
#include "session_cinema.h"
#include "test_session_fixture.h"

enum { SIDE = 4, MOST = 1 << 16 };

#define IMAGE(name, keys, layers, outputs)                                                                             \
    "  - name: " name "\n    size: [16, 12]\n" keys "    layers: [" layers "]\n    outputs: [" outputs "]\n"
#define SURFACE "{isosurface: {field: f, values: [0.25, -0.5]}}"
#define SLICE "{slice: {field: f, planes: [{normal: [0, 0, 1]}]}}"

static const char swept[] = "images:\n" IMAGE(
    "a", "    camera: {orbit: {views: 2, elevation: [-20, 10.5]}}\n    sweep: {isovalues: true}\n    every: 2\n",
    SURFACE, "{cinema: out/a.cdb}");

/* ---- inputs and files ------------------------------------------------------------------------------------------ */

static void make_input(session_input *in)
{
    input_create(in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
}

static void remove_files(void)
{
    if (own_rank != 0) return;
    unlink("out/a.cdb/data.csv");
    unlink("out/a.cdb/data.js");
    unlink("out/a.cdb/index.html");
}

/* Sets a second field with values that differ from the first. */
static void set_second_field(insitu_session *session, const session_input *in, double *values)
{
    insitu_field g = in->field;
    for (int64_t v = 0; v < in->part.vertex_count; v++) values[v] = 0.3 - in->part.values[v];
    g.name = "g";
    g.values.data = values;
    assert_int_equal(insitu_set_field(session, "m", &g), INSITU_OK);
}

static void run_steps(const char *scene, const session_input *in, int first, int end)
{
    double *values = calloc((size_t)in->part.vertex_count + 1, sizeof *values);
    assert_non_null(values);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    discard_pictures();
    for (int cycle = first; cycle < end; cycle++) {
        assert_int_equal(submit_input(session, in), INSITU_OK);
        set_second_field(session, in, values);
        const insitu_status status = insitu_step(session, cycle, 0.5 * cycle);
        if (status) fprintf(stderr, "%s\n", insitu_error(session));
        everywhere(status == INSITU_OK);
    }
    insitu_destroy(&session);
    free(values);
}

/* ---- tables ---------------------------------------------------------------------------------------------------- */

/* Makes the table that is expected from the scene `swept` for cycles first to end - 1. */
static void make_expected_table(int first, int end, char text[MOST])
{
    static const double values[] = {0.25, -0.5}, elevations[] = {-20, 10.5};
    size_t size = (size_t)snprintf(text, MOST, "cycle,time,phi,theta,isovalue,FILE\n");
    for (int cycle = first; cycle < end; cycle++)
        for (int i = 0; i < 8 && cycle % 2 == 0; i++)
            size += (size_t)snprintf(text + size, MOST - size, "%d,%d,%d,%g,%g,a_%06d_%03d_%g.png\n", cycle, cycle / 2,
                                     i % 2 * 180, elevations[i / 2 % 2], values[i / 4], cycle, i % 4, values[i / 4]);
}

/* Converts the table's lines to the list that is expected in the database's script. */
static void make_expected_script(const char *table, char text[MOST])
{
    size_t size = (size_t)snprintf(text, MOST, "cinemaTable([\n");
    for (const char *line = table; *line; line = strchr(line, '\n') + 1)
        size += (size_t)snprintf(text + size, MOST - size, "\"%.*s\",\n", (int)strcspn(line, "\n"), line);
    snprintf(text + size, MOST - size, "]);\n");
}

static bool page_exists(void)
{
    static char page[MOST];
    read_file("out/a.cdb/index.html", MOST, page);
    return strlen(page) == session_cinema_page_size && memcmp(page, session_cinema_page, strlen(page)) == 0;
}

static bool is_table(int first, int end)
{
    static char expected[MOST], found[MOST];
    if (own_rank != 0) return true;
    make_expected_table(first, end, expected);
    read_file("out/a.cdb/data.csv", MOST, found);
    if (strcmp(found, expected) != 0) {
        fprintf(stderr, "%s\nexpected\n%s\n", found, expected);
        return false;
    }
    static char script[MOST];
    make_expected_script(expected, script);
    read_file("out/a.cdb/data.js", MOST, found);
    return strcmp(found, script) == 0 && page_exists();
}

static void tables_have_one_line_per_picture(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    remove_files();
    run_steps(swept, &in, 0, 5);
    everywhere(is_table(0, 5));
    everywhere(caught_count == (own_rank == 0 ? 24 : 0));
    everywhere(own_rank != 0 || strcmp(caught[9].path, "out/a.cdb/a_000002_001_0.25.png") == 0);
    input_free(&in);
}

/* Checks a table of several images: an image without an orbit or a sweep has empty cells in their columns; names that
 * contain commas are quoted, and one that a spreadsheet would interpret as a formula is changed. */
static void tables_of_several_images_have_all_columns(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_input(&in);
    if (own_rank == 0) unlink("two.cdb/data.csv");
    run_steps("images:\n" IMAGE("'x, \"y\"'", "    sweep: {fields: [f, g]}\n", SLICE, "{cinema: two.cdb}")
                  IMAGE("z", "    camera: {orbit: {views: 1, start: 0.1}}\n", SURFACE,
                        "{cinema: two.cdb, path: \"{cycle}/{name}.png\"}")
                      IMAGE("'=cmd'", "", SURFACE, "{cinema: two.cdb}"),
              &in, 3, 4);
    read_file("two.cdb/data.csv", MOST, text);
    everywhere(own_rank != 0 || strcmp(text, "cycle,time,image,phi,theta,field,FILE\n"
                                             "3,1.5,\"x, \"\"y\"\"\",,,f,\"x, \"\"y\"\"_000003_f.png\"\n"
                                             "3,1.5,\"x, \"\"y\"\"\",,,g,\"x, \"\"y\"\"_000003_g.png\"\n"
                                             "3,1.5,z,0.1,30,,3/z.png\n"
                                             "3,1.5,'=cmd,,,,./=cmd_000003.png\n") == 0);
    read_file("two.cdb/data.js", MOST, text);
    everywhere(own_rank != 0 || strstr(text, "\n\"3,1.5,\\x22x, \\x22\\x22y\\x22\\x22\\x22,,,f,\\x22x, ") != NULL);
    input_free(&in);
}

/* ---- restarts -------------------------------------------------------------------------------------------------- */

static void restarted_runs_continue_the_table(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_input(&in);
    remove_files();
    run_steps(swept, &in, 0, 7);
    run_steps(swept, &in, 3, 7); /* draws cycles 4 and 6 a second time */
    everywhere(is_table(0, 7));
    read_file("out/a.cdb/data.csv", MOST, text);
    if (own_rank == 0) text[strlen(text) - 9] = '\0'; /* truncates the last line */
    write_text_file("out/a.cdb/data.csv", text);
    run_steps(swept, &in, 7, 9);
    make_expected_table(0, 9, text);
    static char found[MOST];
    read_file("out/a.cdb/data.csv", MOST, found);
    if (own_rank == 0) { /* all lines except the truncated one */
        char *torn = strstr(text, "\n6,3,180,10.5,-0.5") + 1, *after = strchr(torn, '\n') + 1;
        memmove(torn, after, strlen(after) + 1);
    }
    everywhere(own_rank != 0 || strcmp(text, found) == 0);
    run_steps(swept, &in, 1, 2); /* a run that draws nothing writes nothing */
    read_file("out/a.cdb/data.csv", MOST, found);
    everywhere(own_rank != 0 || strcmp(text, found) == 0);
    run_steps(swept, &in, 2, 5);
    everywhere(is_table(0, 5));
    input_free(&in);
}

/* Checks that lines from an earlier run are removed if their cycle is between the session's first cycle and its first
 * picture. */
static void table_lines_begin_at_the_first_step(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    remove_files();
    run_steps(swept, &in, 0, 5);
    static const char late[] = "images:\n" IMAGE(
        "a", "    camera: {orbit: {views: 2, elevation: [-20, 10.5]}}\n    sweep: {isovalues: true}\n    every: 6\n",
        SURFACE, "{cinema: out/a.cdb}");
    static char text[MOST], expected[MOST], last[MOST];
    run_steps(late, &in, 3, 7);
    read_file("out/a.cdb/data.csv", MOST, text);
    make_expected_table(0, 3, expected);
    make_expected_table(6, 7, last);
    strcat(expected, strchr(last, '\n') + 1);
    everywhere(own_rank != 0 || strcmp(text, expected) == 0);
    input_free(&in);
}

/* Checks a simulation that returns to an earlier cycle, and one that draws a cycle twice. */
static void earlier_cycle_removes_later_table_lines(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    remove_files();
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(swept));
    static const int cycles[] = {0, 2, 4, 6, 2, 2};
    for (int i = 0; i < 6; i++) {
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        everywhere(insitu_step(session, cycles[i], 0.5 * cycles[i]) == INSITU_OK);
        everywhere(is_table(0, cycles[i] + 1));
    }
    insitu_destroy(&session);
    input_free(&in);
}

/* ---- failures -------------------------------------------------------------------------------------------------- */

static void tables_that_cannot_be_written_are_reported_and_written_later(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    remove_files();
    if (own_rank == 0) mkdir("out/a.cdb/data.csv", 0777);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(swept));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    discard_pictures();
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_IO, "cinema: out/a.cdb/data.csv",
                              "cannot be");
    everywhere(caught_count == (own_rank == 0 ? 8 : 0));
    if (own_rank == 0) rmdir("out/a.cdb/data.csv");
    write_text_file("out/a.cdb/data.csv", "a,b\n1,2\n");
    check_reported_everywhere(session, insitu_step(session, 2, 1), INSITU_ERROR_IO, "out/a.cdb/data.csv",
                              "other columns", "\"cycle,time,phi,theta,isovalue,FILE\"");
    remove_files();
    if (own_rank == 0) mkdir("out/a.cdb/data.js", 0777);
    discard_pictures();
    check_reported_everywhere(session, insitu_step(session, 4, 2), INSITU_ERROR_IO, "cinema: out/a.cdb/data.js",
                              "written");
    if (own_rank == 0) rmdir("out/a.cdb/data.js");
    everywhere(insitu_step(session, 6, 3) == INSITU_OK);
    everywhere(is_table(4, 7)); /* the lines that could not be written at cycle 4 are included */
    insitu_destroy(&session);
    input_free(&in);
}

static void unwritable_pictures_have_no_table_line(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_input(&in);
    remove_files();
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(swept));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    discard_pictures();
    unwritable = "_002_";
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_IO, "image \"a\"",
                              "a_000000_002_0.25.png");
    unwritable = NULL;
    read_file("out/a.cdb/data.csv", MOST, text);
    everywhere(own_rank != 0 || (!strstr(text, "_002_") && strstr(text, "_003_-0.5.png\n")));
    everywhere(caught_count == (own_rank == 0 ? 6 : 0));
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that the table has only complete lines of complete steps, whichever allocation of rank 0 fails, and that later
 * steps continue the table. */
static void tables_stay_complete_if_memory_runs_out(void **state)
{
    (void)state;
    static char text[MOST];
    session_input in = {0};
    make_input(&in);
    remove_files();
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(swept));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    int cycle = 0, failures = 0;
    for (int n = 1; n < 1500; n += 7, cycle += 2) {
        discard_pictures();
        if (own_rank == 0) base_memory_fail_nth(n);
        const insitu_status status = insitu_step(session, cycle, 0.5 * cycle);
        base_memory_fail_nth(0);
        everywhere(status == INSITU_OK || status == INSITU_ERROR_MEMORY);
        failures += status != INSITU_OK;
        read_file("out/a.cdb/data.csv", MOST, text);
        bool is_whole = true;
        for (const char *line = text, *end; *line && is_whole; line = end + 1) {
            end = strchr(line, '\n');
            is_whole = end && (line == text || strncmp(end - 4, ".png", 4) == 0);
            if (!end) break;
        }
        everywhere(is_whole);
        if (status == INSITU_OK && cycle > 40) break;
        if (cycle > 80) remove_files(), cycle = 0;
    }
    everywhere(failures > 3);
    discard_pictures();
    everywhere(insitu_step(session, 1000, 500) == INSITU_OK);
    read_file("out/a.cdb/data.csv", MOST, text);
    everywhere(own_rank != 0 || strstr(text, "a_001000_003_-0.5.png\n"));
    insitu_destroy(&session);
    input_free(&in);
}

/* ---- reports --------------------------------------------------------------------------------------------------- */

/* Returns whether a database's report equals a pattern, in which # stands for a time stamp of the scene file. */
static bool report_matches(const char *path, const char *pattern)
{
    static char text[MOST];
    read_file(path, MOST, text);
    const char *at = text;
    for (; own_rank == 0 && *pattern; pattern++) {
        if (*pattern == '#')
            at += strspn(at, "0123456789.");
        else if (*at++ != *pattern)
            return false;
    }
    return !*at;
}

/* Checks report.json: it contains warnings, and errors of steps and of edits, which a program that watches the run
 * cannot find out otherwise. */
static void reports_have_warnings_and_edits(void **state)
{
    (void)state;
    static const char news[] = "out/n.cdb/report.json";
#define SCENE(keys, field)                                                                                             \
    keys "images:\n" IMAGE("a", "    every: 2\n", "{isosurface: {field: " field ", values: [7]}}",                     \
                           "{cinema: out/n.cdb}")
    session_input in = {0};
    make_input(&in);
    if (own_rank == 0) unlink(news);
    const char *scene = write_scene(SCENE("parameters: {a: 0.5, b: -2e+300}\n", "f"));
    char expected[4096];
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    everywhere(insitu_step(session, 0, -0.25) == INSITU_OK);
    const char *warning = insitu_last_report(session)->warnings;
    everywhere(strncmp(warning, "image \"a\": the isosurface", 24) == 0 && !strpbrk(warning, "\n\\"));
    char escaped[512];
    size_t size = 0;
    for (const char *c = warning; *c; c++) {
        if (*c == '"') escaped[size++] = '\\';
        escaped[size++] = *c;
    }
    escaped[size] = '\0';
    snprintf(expected, sizeof expected,
             "{\"cycle\": 0, \"time\": -0.25, \"error\": null,\n"
             " \"scene\": {\"path\": \"%s\", \"modified\": \"#\", \"error\": null},\n"
             " \"parameters\": {\"a\": 0.5, \"b\": -2.0000000000000001e+300},\n"
             " \"pieces\": null,\n"
             " \"warnings\": [\n  {\"cycle\": 0, \"text\": \"%s\"}]}\n",
             scene, escaped);
    everywhere(report_matches(news, expected));
    if (own_rank == 0) unlink(news);
    everywhere(insitu_step(session, 1, 0) ==
               INSITU_OK); /* no image is due and nothing has changed, but the report was removed */
    static char text[MOST];
    read_file(news, MOST, text);
    everywhere(own_rank != 0 ||
               (strstr(text, "{\"cycle\": 1,") && strstr(text, "parameter \\\"b\\\" of the scene changes nothing")));
    if (own_rank == 0) unlink(news);
    everywhere(insitu_step(session, 1, 0) == INSITU_OK);
    everywhere(own_rank != 0 || access(news, F_OK) != 0);
    write_scene("images:\n  - nmae: \"x\"\n");
    everywhere(insitu_step(session, 1, 0) == INSITU_OK); /* an edit is reported at once */
    read_file(news, MOST, text);
    everywhere(own_rank != 0 ||
               (strstr(text, "\"error\": \"") && strstr(text, ".yaml:2: images[0]: the key \\\"nmae\\\" is unknown") &&
                strstr(text, "\"a\": 0.5") && !strstr(text, "last edit was not taken")));
    write_scene(SCENE("", "g"));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 2, 0), INSITU_ERROR_FIELD, "\"g\"");
    read_file(news, MOST, text);
    everywhere(own_rank != 0 || (strstr(text, "\"error\": null}") && strstr(text, "\"g\\\"") &&
                                 strstr(text, "\"parameters\": {}") && strstr(text, "the scene file was edited")));
    insitu_destroy(&session);
    input_free(&in);
#undef SCENE
}

/* Makes a step whose error names a field of this name, and reads report.json. */
static void read_report_of_wrong_field(insitu_session *session, const session_input *in, const char *name,
                                       char text[MOST])
{
    insitu_field field = in->field;
    field.name = name;
    field.count = -1;
    assert_int_equal(submit_input(session, in), INSITU_OK);
    everywhere(insitu_set_field(session, "m", &field) == INSITU_ERROR_FIELD);
    everywhere(insitu_step(session, 0, 0) == INSITU_ERROR_FIELD);
    read_file("out/n.cdb/report.json", MOST, text);
}

/* Checks that report.json is UTF-8 if an error names a field whose name is not, or ends inside a character because it
 * is too long. The first name has bytes that are no characters: a byte of Latin-1, a character without its last byte, a
 * form that is too long, a surrogate and a number above U+10FFFF. */
static void reports_are_utf8_whatever_names_contain(void **state)
{
    (void)state;
    static const char scene[] =
        "writing: step\nimages:\n" IMAGE("a", "", "{isosurface: {field: f, values: [7]}}", "{cinema: out/n.cdb}");
    static const char invalid[] = "<\xe9<\xe2\x82<\xc1\xbf<\xed\xa0\x80<\xf4\x90\x80\x80<";
    static const char replaced[] = "<\\ufffd<\\ufffd\\ufffd<\\ufffd\\ufffd<\\ufffd\\ufffd\\ufffd"
                                   "<\\ufffd\\ufffd\\ufffd\\ufffd<";
    static const char valid[] = "<\xc2\xa9<\xe2\x82\xac<\xf0\x9d\x84\x9e<";
    static char text[MOST], name[2001];
    session_input in = {0};
    make_input(&in);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    read_report_of_wrong_field(session, &in, invalid, text);
    everywhere(own_rank != 0 || strstr(text, replaced));
    read_report_of_wrong_field(session, &in, valid, text);
    everywhere(own_rank != 0 || (strstr(text, valid) && !strstr(text, "ufffd")));
    int cut_count = 0;
    for (int first = 0; first < 2; first++) { /* one of the two messages ends inside a character of two bytes */
        for (int i = 0; i < 2000; i++) name[i] = i < first ? 'a' : (i - first) % 2 ? '\xa9' : '\xc3';
        read_report_of_wrong_field(session, &in, name, text);
        cut_count += strstr(text, "\xa9\\ufffd\"") != NULL;
        everywhere(!strstr(text, "\xc3\""));
    }
    everywhere(own_rank != 0 || cut_count == 1);
    discard_pictures();
    insitu_destroy(&session);
    input_free(&in);
}

/* ---- pictures -------------------------------------------------------------------------------------------------- */

/* Rank 0's pictures of a scene at one cycle, kept while another scene is drawn. */
typedef struct picture_set {
    int count;
    caught_picture items[MAX_CAUGHT];
} picture_set;

static void take_picture_set(picture_set *set)
{
    set->count = caught_count;
    memcpy(set->items, caught, sizeof caught);
    caught_count = 0; /* the caught pictures now belong to the set */
}

static void free_pictures(picture_set *set)
{
    for (int i = 0; i < set->count; i++) free(set->items[i].rgba), free(set->items[i].depth);
}

/* Checks that two scenes draw bit-identical pictures in the same order, and that not all pictures of a scene are
 * equal. */
static void check_scenes_draw_same(const char *one, const char *other, int cycle, int count)
{
    picture_set set;
    session_input in = {0};
    make_input(&in);
    run_steps(one, &in, cycle, cycle + 1);
    take_picture_set(&set);
    run_steps(other, &in, cycle, cycle + 1);
    bool is_same = caught_count == set.count && (own_rank != 0 || set.count == count), differ = count == 1;
    for (int i = 0; i < caught_count && is_same; i++) {
        is_same = are_same_pictures(&set.items[i], &caught[i]);
        differ = differ || !are_same_pictures(&caught[0], &caught[i]);
    }
    everywhere(is_same && (differ || own_rank != 0));
    free_pictures(&set);
    input_free(&in);
}

static void sweeps_draw_same_pictures_as_single_images(void **state)
{
    (void)state;
    check_scenes_draw_same(
        "images:\n" IMAGE("a", "    sweep: {isovalues: true}\n",
                          "{isosurface: {field: f, values: [0.25, -0.5], colours: [[1, 0, 0], [0, 0, 1]]}}",
                          "{path: \"{isovalue}.png\"}"),
        "images:\n" IMAGE("a", "", "{isosurface: {field: f, values: [0.25], colours: [[1, 0, 0]]}}", "{path: a.png}")
            IMAGE("b", "", "{isosurface: {field: f, values: [-0.5], colours: [[0, 0, 1]]}}", "{path: b.png}"),
        0, 2);
    check_scenes_draw_same("images:\n" IMAGE("a", "    sweep: {fields: [f, g]}\n", SLICE, "{path: \"{field}.png\"}"),
                           "images:\n" IMAGE("a", "", SLICE, "{path: a.png}")
                               IMAGE("b", "", "{slice: {field: g, planes: [{normal: [0, 0, 1]}]}}", "{path: b.png}"),
                           0, 2);
}

/* Compares orbits with single cameras. The pictures can be bit-identical because the sines and cosines of the
 * directions are exact, or are the same doubles. */
static void orbits_draw_same_pictures_as_single_cameras(void **state)
{
    (void)state;
#define FROM(name, direction, up)                                                                                      \
    IMAGE(name, "    camera: {automatic: {direction: " direction "}, up: " up "}\n", SURFACE, "{path: " name ".png}")
    check_scenes_draw_same(
        "images:\n" IMAGE("a", "    camera: {orbit: {views: 1, elevation: 0}}\n", SURFACE, "{path: \"{view}.png\"}")
            IMAGE("b", "    camera: {orbit: {views: 1, elevation: 0, axis: [0, 0, 5]}}\n", SURFACE, "{path: b.png}"),
        "images:\n" FROM("a", "[0, 0, 1]", "[0, 1, 0]") FROM("b", "[1, 0, 0]", "[0, 0, 1]"), 0, 2);
}

static void paths_draw_same_pictures_as_single_cameras(void **state)
{
    (void)state;
#define PATH                                                                                                           \
    "    camera: {path: [{cycle: 0, position: [4, 1, 2], focal: [0, 0, 0]}, "                                          \
    "{cycle: 10, position: [2, 3, 4], focal: [0, 1, 0]}]}\n"
#define STANDS(position, focal) "    camera: {position: " position ", focal: " focal "}\n"
    static const char path[] = "images:\n" IMAGE("a", PATH, SURFACE, "{path: \"{cycle}.png\"}");
    check_scenes_draw_same(path, "images:\n" IMAGE("a", STANDS("[4, 1, 2]", "[0, 0, 0]"), SURFACE, "{path: a.png}"), 0,
                           1);
    check_scenes_draw_same(path, "images:\n" IMAGE("a", STANDS("[3, 2, 3]", "[0, 0.5, 0]"), SURFACE, "{path: a.png}"),
                           5, 1);
    check_scenes_draw_same(path, "images:\n" IMAGE("a", STANDS("[2, 3, 4]", "[0, 1, 0]"), SURFACE, "{path: a.png}"), 70,
                           1);
}

/* Checks that a condition and the key `once` apply to an image as a whole: a step draws all of its pictures or none. */
static void conditions_hold_for_all_pictures_of_an_image(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    insitu_session *session = open_session(
        MPI_COMM_WORLD,
        write_scene("images:\n" IMAGE("a",
                                      "    camera: {orbit: {views: 3}}\n    sweep: {isovalues: true}\n    once: true\n"
                                      "    when: {field: f, above: 50}\n",
                                      SURFACE, "{path: \"a{view}{isovalue}.png\"}")
                        IMAGE("b", "    when: {field: f, below: 50}\n", SURFACE, "{path: b.png}")));
    static const int drawn[] = {1, 6, 0, 1};
    for (int cycle = 0; cycle < 4; cycle++) {
        discard_pictures();
        for (int64_t v = 0; v < in.part.vertex_count; v++)
            in.part.values[v] = (cycle == 1 || cycle == 2 ? 100 : 1) * test_linear_field(in.part.coordinates + 3 * v);
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        everywhere(insitu_step(session, cycle, cycle) == INSITU_OK);
        everywhere(insitu_last_report(session)->images == drawn[cycle]);
        everywhere(own_rank != 0 || caught_count == drawn[cycle]);
    }
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that an isovalue which the field does not reach is reported only once, although each picture has its own
 * isovalue and is drawn at each step. */
static void warnings_of_swept_isovalues_are_reported_once(void **state)
{
    (void)state;
    session_input in = {0};
    make_input(&in);
    insitu_session *session =
        open_session(MPI_COMM_WORLD,
                     write_scene("images:\n" IMAGE(
                         "a", "    camera: {orbit: {views: 2}}\n    sweep: {isovalues: true}\n",
                         "{isosurface: {field: f, values: [0.25, 1e6, 2e6]}}", "{path: \"a{view}{isovalue}.png\"}")));
    for (int cycle = 0; cycle < 3; cycle++) {
        discard_pictures();
        assert_int_equal(submit_input(session, &in), INSITU_OK);
        everywhere(insitu_step(session, cycle, cycle) == INSITU_OK);
        const char *warnings = insitu_last_report(session)->warnings;
        everywhere((strstr(warnings, "at 1e+06 is empty") != NULL) == (cycle == 0));
        everywhere((strstr(warnings, "at 2e+06 is empty") != NULL) == (cycle == 0));
    }
    insitu_destroy(&session);
    input_free(&in);
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("cinema") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(tables_have_one_line_per_picture),
                                       cmocka_unit_test(tables_of_several_images_have_all_columns),
                                       cmocka_unit_test(restarted_runs_continue_the_table),
                                       cmocka_unit_test(table_lines_begin_at_the_first_step),
                                       cmocka_unit_test(earlier_cycle_removes_later_table_lines),
                                       cmocka_unit_test(tables_that_cannot_be_written_are_reported_and_written_later),
                                       cmocka_unit_test(unwritable_pictures_have_no_table_line),
                                       cmocka_unit_test(tables_stay_complete_if_memory_runs_out),
                                       cmocka_unit_test(reports_have_warnings_and_edits),
                                       cmocka_unit_test(reports_are_utf8_whatever_names_contain),
                                       cmocka_unit_test(sweeps_draw_same_pictures_as_single_images),
                                       cmocka_unit_test(orbits_draw_same_pictures_as_single_cameras),
                                       cmocka_unit_test(paths_draw_same_pictures_as_single_cameras),
                                       cmocka_unit_test(conditions_hold_for_all_pictures_of_an_image),
                                       cmocka_unit_test(warnings_of_swept_isovalues_are_reported_once)};
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
