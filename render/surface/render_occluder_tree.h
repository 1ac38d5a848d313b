/* A tree of occluders as kernels go down it. */
#ifndef RENDER_RENDER_OCCLUDER_TREE_H
#define RENDER_RENDER_OCCLUDER_TREE_H

#include <stddef.h>

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"

/* Triangles or slabs. Each has its rows one after the other; the next one is stride bytes on. */
typedef struct occluder_pieces {
    const void *first;
    size_t stride;
    int64_t count;
    int rows; /* KERNEL_TRIANGLE_ROWS or KERNEL_SLAB_ROWS */
} occluder_pieces;

/* Builds the tree for kernels of this many lanes, at most 16. Its sources are the pieces' numbers. The caller frees it,
 * after an error too. Parallel. */
insitu_status occluder_tree_build(const occluder_pieces *pieces, int width, int threads, kernel_occluder_tree *out,
                                  base_error *error);
void occluder_tree_free(kernel_occluder_tree *tree);

#endif
