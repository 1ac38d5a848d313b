/* Division of a frame's search into subtrees for threads. */
#ifndef RENDER_RENDER_SUBTREES_H
#define RENDER_RENDER_SUBTREES_H

#include "kernel_types.h"

typedef struct render_subtrees {
    kernel_subtree *items; /* to be freed with base_free() */
    int64_t count;
} render_subtrees;

/* Begins a list with space for `trees` trees. Returns false if there is no memory. */
bool render_subtrees_begin(render_subtrees *list, int64_t trees);
/* Divides a part's tree into up to 128 subtrees and adds them, for a surface (-1: the volume). */
void render_subtrees_add(render_subtrees *list, const kernel_frame *frame, int surface, int part);

#endif
