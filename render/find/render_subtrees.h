/* Divides the search of a frame's trees into subtrees, which threads search independently. */
#ifndef RENDER_RENDER_SUBTREES_H
#define RENDER_RENDER_SUBTREES_H

#include "kernel_types.h"

/* Divides the trees of all mesh parts on which a layer's field exists into up to 128 subtrees each, for the surface
 * layers with indices first to end - 1; index -1 stands for the first volume. Returns an array of *count subtrees,
 * which the caller must free with base_free(), or NULL if there is no memory. */
kernel_subtree *render_subtrees(const kernel_frame *frame, int first, int end, int64_t *count);

#endif
