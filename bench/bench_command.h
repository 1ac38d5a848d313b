/* Parses the command line that the benchmarks share: [--runs N] [--shrink N] [--no-head] [--depths FOLDER] MESH:N
 * ... */
#ifndef BENCH_COMMAND_H
#define BENCH_COMMAND_H

#include <stdbool.h>

#include "test_meshes.h"

enum { BENCH_MAX_MESHES = 16 };

typedef struct bench_command {
    int runs;           /* number of runs of each measure; 5 by default */
    int shrink;         /* divides the width and height of pictures; 1 by default */
    const char *depths; /* folder for pictures of depths; NULL: none are written */
    int mesh_count;
    struct {
        test_mesh_kind kind;
        int n;
    } meshes[BENCH_MAX_MESHES];
    int status; /* status for main() to return if nothing is to be measured */
} bench_command;

/* Parses the command line, and prints the head of the CSV unless --no-head is given. `about` describes the program for
 * --help. The program supports the kinds of meshes from 0 to `last`. Returns false and sets the status if help is
 * requested or the command line is invalid. */
bool bench_command_parse(int argc, char **argv, const char *about, test_mesh_kind last, bench_command *command);

typedef void bench_measure(const bench_command *command, test_mesh_kind kind, int n);

/* Parses the command line, and measures each of its meshes. Returns the status for main() to return. */
int bench_measure_meshes(int argc, char **argv, const char *about, test_mesh_kind last, bench_measure *measure);

#endif
