/* The command line. */
#ifndef WAVE_OPTIONS_H
#define WAVE_OPTIONS_H

#include "wave_partition.h"

typedef struct wave_options {
    wave_cells cells;
    int size[3];
    int steps;
    int real_bytes, index_bytes;
    bool apart; /* SoA */
    wave_partition_kind partition;
    bool reflecting;
    int order;
    double jitter;
    bool moving;
    double swell;
    bool ghosts;
    bool ids;
    bool at_vertices;  /* pressure and velocity are handed over at vertices */
    const char *scene; /* NULL: no pictures */
    bool help;
} wave_options;

/* Every rank has the same arguments, and so gets the same result. False with a message (one line, no newline). */
bool wave_options_parse(int argc, char **argv, wave_options *options, char *message, int message_size);

const char *wave_options_help(void);

#endif
