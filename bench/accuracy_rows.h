/* The rows of speed against error: libinsitu at each of its settings, and the peers. */
#ifndef ACCURACY_ROWS_H
#define ACCURACY_ROWS_H

#include "accuracy_truth.h"

/* The amount of work of a run. */
typedef struct accuracy_effort {
    int size, block;  /* pixels a side of the picture, and of the blocks of which one pixel each is compared */
    int runs;         /* frames timed for a row, at most */
    double seconds;   /* timing goes on for so long and for 3 frames, but ends after four times this */
    int frames;       /* accumulated at most */
    int resolution;   /* of the finest image that VTK samples */
    int peer_seconds; /* after which a peer is stopped */
    bool is_brief;    /* only segments and max_error, and no peer that takes minutes for such a picture */
} accuracy_effort;

typedef struct accuracy_context {
    const accuracy_effort *effort;
    const accuracy_truth *truth;
    accuracy_subject *subject;
    double build; /* median of the seconds that building the tree takes */
} accuracy_context;

/* Build the subject's tree, timed. */
void accuracy_build(accuracy_context *context);

void accuracy_surface_rows(const accuracy_context *context); /* none where brief */
void accuracy_volume_rows(const accuracy_context *context);
void accuracy_peer_rows(const accuracy_context *context);

/* One row. first is the seconds from the mesh in memory to the first picture, frames those of each further one. */
typedef struct accuracy_row {
    const char *layer, *method;
    char setting[32];
    const char *status; /* "ok", or why there are no figures */
    double first;
    int runs;
    double *frames; /* sorted by printing */
    accuracy_error error;
} accuracy_row;

void accuracy_print_head(void);
void accuracy_print(const accuracy_context *context, accuracy_row *row);

#endif
