#include "bench_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_stats.h"
#include "render.h"

static bool usage(const char *program, const char *about, bench_command *command, int status)
{
    const char *slash = strrchr(program, '/');
    fprintf(status ? stderr : stdout,
            "Usage: %s [--runs N] [--shrink N] [--no-head] [--depths FOLDER] MESH:N ...\n\n%s\nPrints CSV.\n\n"
            "  --runs N         runs of each measure (5)\n"
            "  --shrink N       pictures of so many times fewer pixels a side (1)\n"
            "  --no-head        without the line of column names\n"
            "  --depths FOLDER  write the depths of isosurfaces there as PNG, ours and the peers'\n\n"
            "OMP_NUM_THREADS sets the threads, the peers' too (Mesa's: LP_NUM_THREADS); INSITU_ISA the instruction\n"
            "set. Without an X server (xvfb-run) nothing is drawn by OpenGL.\n",
            slash ? slash + 1 : program, about);
    command->status = status;
    return false;
}

/* "tets:31" */
static bool add_mesh(const char *text, test_mesh_kind last, bench_command *command)
{
    const char *colon = strchr(text, ':');
    const int n = colon ? atoi(colon + 1) : 0;
    if (n < 1 || command->mesh_count == BENCH_MAX_MESHES) return false;
    for (test_mesh_kind kind = 0; kind <= last; kind++) {
        const char *name = test_mesh_kind_name(kind);
        if (strlen(name) != (size_t)(colon - text) || strncmp(name, text, strlen(name)) != 0) continue;
        command->meshes[command->mesh_count].kind = kind;
        command->meshes[command->mesh_count++].n = n;
        return true;
    }
    return false;
}

bool bench_command_parse(int argc, char **argv, const char *about, test_mesh_kind last, bench_command *command)
{
    bool head = true;
    *command = (bench_command){.runs = 5, .shrink = 1};
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--help")) return usage(argv[0], about, command, 0);
        if (!strcmp(argv[i], "--no-head"))
            head = false;
        else if (!strcmp(argv[i], "--runs") && i + 1 < argc)
            command->runs = atoi(argv[++i]);
        else if (!strcmp(argv[i], "--shrink") && i + 1 < argc)
            command->shrink = atoi(argv[++i]);
        else if (!strcmp(argv[i], "--depths") && i + 1 < argc)
            command->depths = argv[++i];
        else if (!add_mesh(argv[i], last, command))
            return usage(argv[0], about, command, 2);
    }
    if (!command->mesh_count || command->runs < 1 || command->runs > BENCH_MAX_RUNS || command->shrink < 1 ||
        command->shrink > 16)
        return usage(argv[0], about, command, 2);
    if (render_isa_warning() && *render_isa_warning()) fprintf(stderr, "%s: %s\n", argv[0], render_isa_warning());
    if (head) bench_print_head();
    return true;
}
