/* The rows of the trade: libinsitu at each of its settings, and the peers. */
#ifndef ACCURACY_ROWS_H
#define ACCURACY_ROWS_H

#include "accuracy_truth.h"

/* How much work a run is. */
typedef struct accuracy_effort {
    int size, block;  /* pixels a side of the picture, and of the block of which one is compared */
    int runs;         /* frames timed for a row, at most */
    double seconds;   /* no more than 3 frames are timed when they have taken this, and no more when four times this */
    int frames;       /* accumulated at most */
    int resolution;   /* of the finest image that VTK samples */
    int peer_seconds; /* after which a peer is stopped */
    bool is_brief;    /* only segments and max_error, and no peer that takes minutes for such a picture */
} accuracy_effort;

typedef struct accuracy_context {
    const accuracy_effort *effort;
    const accuracy_truth *truth;
    accuracy_subject *subject;
    double build; /* seconds of building the tree: the median */
} accuracy_context;

/* Build the subject's tree, timed. */
void accuracy_build(accuracy_context *context);

void accuracy_surface_rows(const accuracy_context *context); /* none where brief */
void accuracy_volume_rows(const accuracy_context *context);
void accuracy_peer_rows(const accuracy_context *context);

/* One row. first: seconds to the first picture, from the mesh in memory; frames: of each further one. */
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
