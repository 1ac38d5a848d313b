/* Checks the files that the library reads, appends to or replaces, if something else is at their path (a pipe, a
 * device, a directory, a socket, a link or a huge file) before the first step or between two steps. Also checks
 * directories that are missing, are removed or cannot be created. No call may block; every failure must be reported on
 * all ranks with the file and the reason; links are replaced, as they are for pictures; and the step must succeed after
 * the obstacle is removed. */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "test_session_fixture.h"

enum { SIDE = 3, MOST = 1 << 14, SECONDS = 20 };

static session_input input;

/* ---- a limit of time ------------------------------------------------------------------------------------------- */

static char under_way[200];

static void stop_on_timeout(int signal_number)
{
    static const char words[] = " took longer than 20 s\n";
    (void)signal_number;
    if (write(2, under_way, strlen(under_way)) > 0 && write(2, words, sizeof words - 1) > 0) _exit(1);
    _exit(1);
}

static void start_time_limit(const char *what, const char *plant, const char *when)
{
    snprintf(under_way, sizeof under_way, "%s, %s, %s", what, plant, when);
    signal(SIGALRM, stop_on_timeout);
    alarm(SECONDS);
}

/* ---- what replaces a file -------------------------------------------------------------------------------------- */

typedef enum plant {
    PIPE,
    FOLDER,
    SOCKET,
    HUGE_FILE,
    LINK_TO_DEVICE,
    LINK_TO_PIPE,
    LINK_TO_ITSELF,
    DANGLING_LINK,
    LINK_TO_FILE,
    PLANT_COUNT
} plant;

static const char *const plant_names[] = {"pipe",           "folder",         "socket",
                                          "huge file",      "link to device", "link to pipe",
                                          "link to itself", "dangling link",  "link to file"};

static void make_socket(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const int file = socket(AF_UNIX, SOCK_STREAM, 0);
    snprintf(address.sun_path, sizeof address.sun_path, "%s", path);
    assert_true(file >= 0 && bind(file, (const struct sockaddr *)&address, sizeof address) == 0);
    close(file);
}

/* Puts the obstacle at the path, on rank 0. A file that is already there is renamed to "victim"; links can point to
 * it. */
static void place_obstacle(plant p, const char *path)
{
    unlink("victim");
    if (rename(path, "victim") != 0) assert_int_equal(access(path, F_OK), -1);
    char victim[600];
    const char *slash = strrchr(path, '/');
    assert_non_null(getcwd(victim, 500));
    strcat(victim, "/victim");
    unlink("pipe");
    switch (p) {
    case PIPE: assert_int_equal(mkfifo(path, 0600), 0); break;
    case FOLDER: assert_int_equal(mkdir(path, 0700), 0); break;
    case SOCKET: make_socket(path); break;
    case HUGE_FILE: {
        const int file = open(path, O_WRONLY | O_CREAT, 0600);
        assert_true(file >= 0 && ftruncate(file, (off_t)3 << 30) == 0 && close(file) == 0);
        break;
    }
    case LINK_TO_DEVICE: assert_int_equal(symlink("/dev/zero", path), 0); break;
    case LINK_TO_PIPE:
        assert_true(mkfifo("pipe", 0600) == 0 && getcwd(victim, 500));
        assert_int_equal(symlink(strcat(victim, "/pipe"), path), 0);
        break;
    case LINK_TO_ITSELF: assert_int_equal(symlink(slash ? slash + 1 : path, path), 0); break;
    case DANGLING_LINK: assert_int_equal(symlink("nowhere", path), 0); break;
    default: assert_int_equal(symlink(victim, path), 0);
    }
}

static void remove_obstacle(const char *path)
{
    if (unlink(path) != 0) rmdir(path);
}

/* Removes any file or directory of these names. */
static void remove_recursively(const char *name)
{
    char command[100];
    snprintf(command, sizeof command, "rm -rf %s", name);
    if (own_rank == 0) assert_int_equal(system(command), 0);
    MPI_Barrier(MPI_COMM_WORLD);
}

/* ---- files that a user names ----------------------------------------------------------------------------------- */

#define IMAGE "images:\n  - name: a\n    size: [8, 6]\n    layers: [{%s}]\n    outputs: [{%s}]\n"
#define SURFACE "isosurface: {field: f, values: [0.1]}"

static const char *const refusals[] = {"is a named pipe (FIFO)", "is a directory", "is a socket",
                                       "has more than",          "is a device",    "is a named pipe (FIFO)",
                                       "Too many levels",        "No such file",   NULL};

static void check_read(const char *what, const char *path)
{
    for (plant p = 0; p < PLANT_COUNT; p++) {
        insitu_session *session = NULL;
        start_time_limit(what, plant_names[p], "at the beginning");
        if (own_rank == 0) place_obstacle(p, path);
        const insitu_status status = insitu_create(MPI_COMM_WORLD, "scene.yaml", &session);
        if (refusals[p])
            check_reported_everywhere(NULL, status, INSITU_ERROR_SCENE, path, refusals[p]);
        else
            everywhere(status == INSITU_OK);
        insitu_destroy(&session);
        if (own_rank == 0) remove_obstacle(path), assert_int_equal(rename("victim", path), 0);
    }
}

static void scenes_are_regular_files(void **state)
{
    (void)state;
    char text[512];
    snprintf(text, sizeof text, IMAGE, SURFACE, "path: a.png");
    write_text_file("scene.yaml", text);
    check_read("scene", "scene.yaml");
}

static void colour_maps_are_regular_files(void **state)
{
    (void)state;
    char text[512];
    snprintf(text, sizeof text, IMAGE, "slice: {field: f, planes: [{normal: [0, 0, 1]}], map: {file: map.json}}",
             "path: a.png");
    write_text_file("scene.yaml", text);
    write_text_file("map.json", "[{\"Name\": \"m\", \"RGBPoints\": [0, 0, 0, 0, 1, 1, 1, 1]}]");
    check_read("colour map", "map.json");
}

/* ---- files that the library writes ----------------------------------------------------------------------------- */

/* A file of the library that later steps read again or append to. */
typedef struct own_file {
    const char *name, *path, *header;
    char scene[512];
    bool is_appended; /* false: the file is replaced at each step */
} own_file;

enum { OWN_COUNT = 3 };

static own_file own_files[OWN_COUNT] = {
    {.name = "statistics", .path = "own.cdb/s.csv", .header = "cycle,time,cells", .is_appended = true},
    {.name = "ranges", .path = "own.cdb/a.ranges", .header = "# The widest"},
    {.name = "table", .path = "own.cdb/data.csv", .header = "cycle,time,FILE"}};

static void write_scenes_for_folder(const char *folder)
{
    const char *ranges = "surface: {colour_by: {field: f, range: run}}";
    char output[200];
    snprintf(own_files[0].scene, 512, IMAGE "statistics: [{field: f, path: %s/s.csv}]\n", SURFACE, "path: a.png",
             folder);
    snprintf(output, sizeof output, "path: %s/a.png", folder);
    snprintf(own_files[1].scene, 512, IMAGE, ranges, output);
    snprintf(output, sizeof output, "cinema: %s", folder);
    snprintf(own_files[2].scene, 512, IMAGE, SURFACE, output);
}

/* Makes a step whose values are larger than those of the previous step, so that ranges widen. */
static insitu_status step_with_larger_values(insitu_session *session, int cycle)
{
    input_restore(&input);
    for (int64_t v = 0; v < input.part.vertex_count; v++) input.part.values[v] *= 1 + cycle;
    discard_pictures();
    everywhere(submit_input(session, &input) == INSITU_OK);
    return insitu_step(session, cycle, cycle);
}

/* Checks that the file is a regular one, begins with its header and ends with a complete line. */
static void assert_written(const own_file *file)
{
    char text[MOST];
    struct stat found;
    everywhere(own_rank != 0 || (lstat(file->path, &found) == 0 && S_ISREG(found.st_mode)));
    read_file(file->path, MOST, text);
    everywhere(own_rank != 0 || strncmp(text, file->header, strlen(file->header)) == 0);
    everywhere(own_rank != 0 || (strchr(text, '\n')[1] && text[strlen(text) - 1] == '\n'));
}

/* Returns the text of the expected error, or NULL. A pipe, a directory and a socket are refused at any step, a huge
 * file only at the first step, which reads it. Links are replaced when the file is next written. */
static const char *get_expected_refusal(const own_file *file, plant p, bool is_later)
{
    if (p == HUGE_FILE) return is_later ? NULL : "has more than";
    (void)file;
    return p < HUGE_FILE ? (p == FOLDER ? "directory" : refusals[p]) : NULL;
}

static void run_with_obstacle(const own_file *file, plant p, bool is_later)
{
    static char before[MOST], after[MOST];
    start_time_limit(file->name, plant_names[p], is_later ? "between two steps" : "before the first step");
    remove_recursively("own.cdb");
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(file->scene));
    everywhere(step_with_larger_values(session, 0) == INSITU_OK);
    if (!is_later) insitu_destroy(&session);
    if (own_rank == 0) place_obstacle(p, file->path);
    MPI_Barrier(MPI_COMM_WORLD);
    if (!is_later) session = open_session(MPI_COMM_WORLD, write_scene(file->scene));
    read_file("victim", MOST, before);
    const char *refusal = get_expected_refusal(file, p, is_later);
    insitu_status status = step_with_larger_values(session, 1);
    if (refusal) {
        check_reported_everywhere(session, status, INSITU_ERROR_IO, file->path, refusal);
        if (own_rank == 0) remove_obstacle(file->path);
        MPI_Barrier(MPI_COMM_WORLD);
        status = step_with_larger_values(session, 2);
    }
    if (status) fprintf(stderr, "%s: %s\n", under_way, insitu_error(session));
    everywhere(status == INSITU_OK);
    if (p != HUGE_FILE || !file->is_appended || !is_later) assert_written(file);
    read_file("victim", MOST, after);
    everywhere(strcmp(before, after) == 0 && (own_rank != 0 || access("own.cdb/nowhere", F_OK) != 0));
    read_file(file->path, MOST, after); /* the lines of a file behind a link are kept and continued */
    const bool has_first = strstr(after, "\n0,0,") != NULL;
    everywhere(own_rank != 0 || p != LINK_TO_FILE || file == &own_files[1] || has_first);
    insitu_destroy(&session);
}

static void obstacles_at_file_paths_are_refused_or_replaced(void **state)
{
    (void)state;
    write_scenes_for_folder("own.cdb");
    for (int i = 0; i < OWN_COUNT; i++)
        for (plant p = 0; p < PLANT_COUNT; p++)
            for (int is_later = 0; is_later < 2; is_later++) run_with_obstacle(&own_files[i], p, is_later);
}

/* Checks that ranges of another run, to which a link points, are read before the link is replaced by a file. */
static void linked_ranges_are_read(void **state)
{
    (void)state;
    char text[MOST];
    write_scenes_for_folder("own.cdb");
    start_time_limit("ranges", "link to file", "of another run");
    remove_recursively("own.cdb");
    if (own_rank == 0) {
        assert_int_equal(mkdir("own.cdb", 0700), 0);
        place_obstacle(LINK_TO_FILE, own_files[1].path);
    }
    write_text_file("victim", "surface 0 -2 -100 0.5 f\n");
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(own_files[1].scene));
    everywhere(step_with_larger_values(session, 0) == INSITU_OK);
    assert_written(&own_files[1]);
    read_file(own_files[1].path, MOST, text);
    everywhere(own_rank != 0 || strstr(text, " -100 "));
    read_file("victim", MOST, text);
    everywhere(own_rank != 0 || strcmp(text, "surface 0 -2 -100 0.5 f\n") == 0);
    insitu_destroy(&session);
}

/* ---- directories ----------------------------------------------------------------------------------------------- */

static void missing_folders_are_created(void **state)
{
    (void)state;
    write_scenes_for_folder("own.cdb");
    for (int i = 0; i < OWN_COUNT; i++) {
        start_time_limit(own_files[i].name, "no folder", "at every step");
        remove_recursively("own.cdb");
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(own_files[i].scene));
        for (int cycle = 0; cycle < 3; cycle++) {
            remove_recursively("own.cdb");
            const insitu_status status = step_with_larger_values(session, cycle);
            if (status) fprintf(stderr, "%s: %s\n", under_way, insitu_error(session));
            everywhere(status == INSITU_OK);
            assert_written(&own_files[i]);
            everywhere(own_rank != 0 || i != 2 || access("own.cdb/index.html", F_OK) == 0);
        }
        insitu_destroy(&session);
    }
}

/* Checks directories that cannot be created: inside a regular file, inside /proc, and, unless the user has root's
 * rights, inside a directory without write permission. */
static void folders_that_cannot_be_created_are_reported(void **state)
{
    (void)state;
    struct folder {
        const char *name, *reason;
    } folders[] = {{"blocked/in.cdb", "Not a directory"},
                   {"/proc/in.cdb", "No such file"},
                   {"closed/in.cdb", "Permission denied"}};
    write_text_file("blocked", "a file");
    if (own_rank == 0) rmdir("closed/in.cdb"), rmdir("closed"), mkdir("closed", 0500);
    for (int f = 0; f < (geteuid() ? 3 : 2); f++)
        for (int i = 0; i < OWN_COUNT; i++) {
            start_time_limit(own_files[i].name, folders[f].name, folders[f].reason);
            write_scenes_for_folder(folders[f].name);
            insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(own_files[i].scene));
            for (int cycle = 0; cycle < 2; cycle++)
                check_reported_everywhere(session, step_with_larger_values(session, cycle), INSITU_ERROR_IO,
                                          folders[f].name, strrchr(own_files[i].path, '/'), folders[f].reason);
            insitu_destroy(&session);
        }
}

static int set_up_test_group(void **state)
{
    (void)state;
    if (!enter_test_folder("files")) return 1;
    /* files left over from an interrupted test */
    remove_recursively("scene.yaml map.json own.cdb pipe victim blocked");
    input_create(&input, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
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
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scenes_are_regular_files),
        cmocka_unit_test(colour_maps_are_regular_files),
        cmocka_unit_test(obstacles_at_file_paths_are_refused_or_replaced),
        cmocka_unit_test(linked_ranges_are_read),
        cmocka_unit_test(missing_folders_are_created),
        cmocka_unit_test(folders_that_cannot_be_created_are_reported),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
