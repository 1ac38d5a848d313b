/* Builds the trees of occluders that kernels traverse. */
#ifndef RENDER_RENDER_OCCLUDER_TREE_H
#define RENDER_RENDER_OCCLUDER_TREE_H

#include <stddef.h>

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"

/* A list of triangles or slabs. Each piece's rows are consecutive floats; the next piece begins `stride` bytes
 * later. */
typedef struct occluder_pieces {
    const void *first;
    size_t stride;
    int64_t count;
    int rows; /* number of floats of a piece: KERNEL_TRIANGLE_ROWS or KERNEL_SLAB_ROWS */
} occluder_pieces;

/* Builds the tree for kernels with `width` lanes, at most 16. Its sources are the pieces' indices. The caller must free
 * it with occluder_tree_free(), even after an error. Parallel. */
insitu_status occluder_tree_build(const occluder_pieces *pieces, int width, int threads, kernel_occluder_tree *out,
                                  base_error *error);
void occluder_tree_free(kernel_occluder_tree *tree);

#endif
