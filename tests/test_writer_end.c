/* Checks runs that end immediately after the last step, while pictures are still pending, by each method by which a
 * process can end. Each run is a process of its own. A killed run may lack pictures that were pending, but must not
 * leave an incomplete file. */
#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "insitu/insitu.h"

enum { PICTURES = 6 };

static const char scene_words[] = "images:\n  - {name: a, size: [1280, 720], background: [0, 0, 1], layers: "
                                  "[isosurface: {field: x, values: [0.4]}],\n"
                                  "     outputs: [{path: '%s/{cycle}.png'}]}\n";

static insitu_status draw_two_steps(const char *folder, insitu_session **session)
{
    static const float corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    static const float values[8] = {0, 1, 1, 0, 0, 1, 1, 0};
    static const int32_t indices[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    char text[4096];
    snprintf(text, sizeof text, scene_words, folder);
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = 8;
    insitu_mesh_interleaved(&mesh, corners, INSITU_FLOAT32);
    mesh.cell_count = 1;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = 8;
    mesh.connectivity = (insitu_array){indices, INSITU_INT32, 0};
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "x";
    field.count = 8;
    field.values = (insitu_array){values, INSITU_FLOAT32, 0};
    insitu_status status = insitu_create_from_text(MPI_COMM_SELF, text, session);
    if (!status) status = insitu_set_mesh(*session, "m", &mesh);
    if (!status) status = insitu_set_field(*session, "m", &field);
    for (int cycle = 0; cycle < PICTURES && !status; cycle++) status = insitu_step(*session, cycle, 0);
    return status;
}

/* Runs a simulation, and then ends the process by the method with the name `end`. */
static int run_and_end(const char *end, const char *folder)
{
    static insitu_session *session; /* static, so that a run without insitu_destroy() is not reported as a leak */
    MPI_Init(NULL, NULL);
    if (draw_two_steps(folder, &session) != INSITU_OK) {
        fprintf(stderr, "%s: %s\n", end, insitu_error(session));
        return 1;
    }
    if (strcmp(end, "killed") == 0) raise(SIGKILL);
    if (strcmp(end, "exit") == 0) exit(0);
    if (strcmp(end, "destroy") == 0 && insitu_destroy(&session) != INSITU_OK) return 1;
    MPI_Finalize();
    if (strcmp(end, "finalize") == 0) _exit(0); /* all pictures must have been written by MPI_Finalize() */
    return 0;
}

/* Returns whether a PNG is complete, judged by its first bytes and its last chunk. */
static int is_complete_png(const char *path)
{
    static const unsigned char begin[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, end[4] = {'I', 'E', 'N', 'D'};
    unsigned char first[8], last[8];
    FILE *file = fopen(path, "rb");
    const int is_whole = file && fread(first, 1, 8, file) == 8 && fseek(file, -8, SEEK_END) == 0 &&
                         fread(last, 1, 8, file) == 8 && memcmp(first, begin, 8) == 0 && memcmp(last, end, 4) == 0;
    if (file) fclose(file);
    return is_whole;
}

/* Counts complete pictures and removes them; returns -1 if a file with a picture's name is not a complete PNG. */
static int count_pictures(const char *folder)
{
    int count = 0;
    for (int cycle = 0; cycle < PICTURES; cycle++) {
        char path[4096];
        struct stat found;
        snprintf(path, sizeof path, "%s/%d.png", folder, cycle);
        if (stat(path, &found) != 0) continue;
        count = count < 0 || !is_complete_png(path) ? -1 : count + 1;
        unlink(path);
    }
    return count;
}

static int get_exit_status(const char *program, const char *end, const char *folder)
{
    const pid_t child = fork();
    int status = -1;
    if (child == 0) {
        execl(program, program, end, folder, (char *)NULL);
        _exit(127);
    }
    if (child > 0) waitpid(child, &status, 0);
    return status;
}

int main(int argc, char **argv)
{
    static const char *const ends[] = {"destroy", "finalize", "return", "exit", "killed"};
    if (argc == 3 && strchr(argv[2], '/')) return run_and_end(argv[1], argv[2]);
    char folder[2048];
    int failed = 0;
    snprintf(folder, sizeof folder, "%s/writer_end", argc > 1 ? argv[1] : ".");
    mkdir(folder, 0777);
    count_pictures(folder);
    for (int i = 0; i < 5; i++) {
        const int is_killed = strcmp(ends[i], "killed") == 0;
        const int status = get_exit_status(argv[0], ends[i], folder), count = count_pictures(folder);
        const int is_well = is_killed ? WIFSIGNALED(status) && count >= 0 : status == 0 && count == PICTURES;
        /* Open MPI's handler replaces the exit status of an exit() without MPI_Finalize(). */
        const int is_exit_well = strcmp(ends[i], "exit") == 0 && WIFEXITED(status) && count == PICTURES;
        printf("%s: status %d, %d of %d pictures\n", ends[i], status, count, PICTURES);
        if (!is_well && !is_exit_well) failed = 1;
    }
    return failed;
}
