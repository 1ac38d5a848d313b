/* Divides the search of a frame's trees into subtrees, which threads search independently. */
#ifndef RENDER_RENDER_SUBTREES_H
#define RENDER_RENDER_SUBTREES_H

#include "kernel_types.h"

typedef struct render_subtrees {
    kernel_subtree *items; /* array allocated by base_alloc(), which the caller must free with base_free() */
    int64_t count;
} render_subtrees;

/* Creates an empty list with space for the subtrees of `trees` trees. Returns false if there is no memory. */
bool render_subtrees_begin(render_subtrees *list, int64_t trees);
/* Divides the tree of a mesh part into up to 128 subtrees and appends them to the list. surface: index of the surface
 * layer, or -1 for the volume. */
void render_subtrees_add(render_subtrees *list, const kernel_frame *frame, int surface, int part);

#endif
