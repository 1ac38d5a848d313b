/* The command line that the benchmarks have in common: [--runs N] [--shrink N] [--no-head] [--depths FOLDER] MESH:N ...
 */
#ifndef BENCH_COMMAND_H
#define BENCH_COMMAND_H

#include <stdbool.h>

#include "test_meshes.h"

enum { BENCH_MAX_MESHES = 16 };

typedef struct bench_command {
    int runs;           /* of each measure; 5 by default */
    int shrink;         /* pictures have 1/shrink of the pixels a side; 1 by default */
    const char *depths; /* where pictures of depths are to be written; NULL: nowhere */
    int mesh_count;
    struct {
        test_mesh_kind kind;
        int n;
    } meshes[BENCH_MAX_MESHES];
    int status; /* for main() to return where there is nothing to do */
} bench_command;

/* Reads the command line, and prints the CSV's head unless it says not to. about is what the program does, for --help;
 * last is the last kind of mesh that it knows. False with a status where help is asked for or the line is wrong. */
bool bench_command_parse(int argc, char **argv, const char *about, test_mesh_kind last, bench_command *command);

typedef void bench_measure(const bench_command *command, test_mesh_kind kind, int n);

/* Reads the command line as above, and measures each of its meshes. Returns the status for main() to return. */
int bench_measure_meshes(int argc, char **argv, const char *about, test_mesh_kind last, bench_measure *measure);

#endif
