/* Merges the fragments of the strips that a rank owns into finished pixels. A strip is a rectangle of pixels
 * (comp_grid.h). */
#ifndef COMP_COMP_OWNED_H
#define COMP_COMP_OWNED_H

#include "comp_messages.h"
#include "comp_pack.h"
#include "comp_pixels.h"
#include "comp_strips.h"

/* The input of one rank's merge: all fragments in the strips that it owns. */
typedef struct comp_owned {
    const comp_strips *traced_strips; /* fragments that this rank has traced, by strip */
    comp_received arrivals;           /* fragments received from other ranks for these strips */
    const comp_owners *owners;
    int place; /* this rank's number in the order of ranks by nodes, called its place (comp_route.h) */
} comp_owned;

/* Merges all fragments of the strips. If merged->out is not NULL, it receives the pixels, and the background in pixels
 * without fragments. Otherwise *finished receives messages with the pixels for rank `parent`. Local. On an error
 * *finished is empty, and out may contain some of the pixels. */
insitu_status comp_merge_owned_strips(const comp_owned *owned, const comp_merge_output *merged, int parent,
                                      comp_messages *finished, base_error *error);

#endif
