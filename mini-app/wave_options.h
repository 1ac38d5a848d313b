/* Parses the command line. */
#ifndef WAVE_OPTIONS_H
#define WAVE_OPTIONS_H

#include "wave_partition.h"

typedef struct wave_options {
    wave_cells cells;
    int size[3];
    int steps;
    int real_bytes, index_bytes;
    bool is_soa; /* true if components are in separate arrays (SoA) */
    wave_partition_kind partition;
    bool reflecting;
    int order;
    double jitter;
    bool moving;
    double swell;
    bool ghosts;
    bool ids;
    bool at_vertices;  /* true if pressure and velocity are passed as fields at vertices */
    const char *scene; /* path of the scene; NULL if no pictures are drawn */
    bool help;
} wave_options;

/* Parses the arguments. They are the same on every rank, so that the result is the same too. Returns false and a
 * message (one line without newline) if an option is wrong. */
bool wave_options_parse(int argc, char **argv, wave_options *options, char *message, int message_size);

const char *wave_options_help(void);

#endif
