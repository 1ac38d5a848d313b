/* Builds the trees of occluders that kernels traverse. */
#ifndef RENDER_RENDER_OCCLUDER_TREE_H
#define RENDER_RENDER_OCCLUDER_TREE_H

#include <stdint.h>

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"

/* A triangle or a slab. Triangles have fewer rows (KERNEL_TRIANGLE_ROWS). */
typedef struct occluder_piece {
    float rows[KERNEL_SLAB_ROWS];
    int32_t surface; /* index of the surface in the frame */
} occluder_piece;

/* Builds a tree of `count` pieces with the given number of rows, for kernels with `width` lanes, at most 16. Its
 * sources are the pieces' indices. The caller must free it with occluder_tree_free(), even after an error. Parallel. */
insitu_status occluder_tree_build(const occluder_piece *pieces, int64_t count, int rows, int width, int threads,
                                  kernel_occluder_tree *out, base_error *error);
void occluder_tree_free(kernel_occluder_tree *tree);

#endif
