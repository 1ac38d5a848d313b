/* Measures the time and the error of libinsitu at each of its settings, and of its peers (VTK's volume mappers). */
#ifndef ACCURACY_ROWS_H
#define ACCURACY_ROWS_H

#include "accuracy_reference.h"

/* The amount of work of a run. */
typedef struct accuracy_effort {
    /* size: width and height of the picture in pixels; block: width and height of a block in pixels. One pixel of each
     * block is compared. */
    int size, block;
    int runs; /* largest number of timed frames of a row */
    /* minimum time of a row's timed frames; a row has at least 3 frames, unless they take four times this time */
    double seconds;
    int frames;       /* largest number of frames to average */
    int resolution;   /* points along the longest axis of the finest image that VTK samples */
    int peer_seconds; /* time after which a peer is stopped, in seconds */
    bool is_brief;    /* only segments and max_error, and no peer that takes minutes for a picture of this kind */
} accuracy_effort;

typedef struct accuracy_context {
    const accuracy_effort *effort;
    const accuracy_reference *truth;
    accuracy_subject *subject;
    double build; /* median of the seconds for building the tree */
} accuracy_context;

/* Builds the subject's tree and measures the time. */
void accuracy_measure_build(accuracy_context *context);

void accuracy_measure_surface_rows(const accuracy_context *context); /* prints no rows if is_brief */
void accuracy_measure_volume_rows(const accuracy_context *context);
void accuracy_measure_peer_rows(const accuracy_context *context);

/* One row. `first` is the time from the mesh in memory to the first picture; `frames` are the times of further frames.
 * Both are in seconds. */
typedef struct accuracy_row {
    const char *layer, *method;
    char setting[32];
    const char *status; /* "ok", or why there are no figures */
    double first;
    int runs;
    double *frames; /* printing sorts the times */
    accuracy_error error;
} accuracy_row;

void accuracy_print_head(void);
void accuracy_print_row(const accuracy_context *context, accuracy_row *row);

#endif
