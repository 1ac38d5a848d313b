#include "bench_command.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_stats.h"
#include "render.h"

static bool print_usage(const char *program, const char *about, bench_command *command, int status)
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

/* Parses a mesh such as "tets:31", a kind of cells and a number of cubes along a side. */
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

static bool read_count(const char *name, int most, int *out)
{
    char *end;
    const long count = strtol(optarg, &end, 10);
    if (end == optarg || *end || count < 1 || count > most) {
        fprintf(stderr, "--%s: expected 1 to %d, got %s\n", name, most, optarg);
        return false;
    }
    *out = (int)count;
    return true;
}

bool bench_command_parse(int argc, char **argv, const char *about, test_mesh_kind last, bench_command *command)
{
    enum { HELP = 1, NO_HEAD, RUNS, SHRINK, DEPTHS };
    static const struct option list[] = {
        {"help", no_argument, NULL, HELP},           {"no-head", no_argument, NULL, NO_HEAD},
        {"runs", required_argument, NULL, RUNS},     {"shrink", required_argument, NULL, SHRINK},
        {"depths", required_argument, NULL, DEPTHS}, {0}};
    bool head = true, is_good = true;
    *command = (bench_command){.runs = 5, .shrink = 1};
    for (int found; is_good && (found = getopt_long(argc, argv, "", list, NULL)) != -1;) {
        if (found == HELP) return print_usage(argv[0], about, command, 0);
        if (found == NO_HEAD)
            head = false;
        else if (found == RUNS)
            is_good = read_count("runs", BENCH_MAX_RUNS, &command->runs);
        else if (found == SHRINK)
            is_good = read_count("shrink", 16, &command->shrink);
        else if (found == DEPTHS)
            command->depths = optarg;
        else
            is_good = false; /* getopt_long() has printed the reason */
    }
    for (; is_good && optind < argc; optind++) {
        is_good = add_mesh(argv[optind], last, command);
        if (!is_good) fprintf(stderr, "%s: expected a mesh as tets:31, at most %d\n", argv[optind], BENCH_MAX_MESHES);
    }
    if (!is_good || !command->mesh_count) return print_usage(argv[0], about, command, 2);
    if (render_isa_warning() && *render_isa_warning()) fprintf(stderr, "%s: %s\n", argv[0], render_isa_warning());
    if (head) bench_print_head();
    return true;
}

int bench_measure_meshes(int argc, char **argv, const char *about, test_mesh_kind last, bench_measure *measure)
{
    bench_command command;
    if (!bench_command_parse(argc, argv, about, last, &command)) return command.status;
    for (int i = 0; i < command.mesh_count; i++) measure(&command, command.meshes[i].kind, command.meshes[i].n);
    return 0;
}
