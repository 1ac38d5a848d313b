/* Builds trees of triangles or slabs, the pieces of surfaces in cells that may block rays from hits
 * (kernel_occluders.h). */
#ifndef RENDER_RENDER_OCCLUDER_TREE_H
#define RENDER_RENDER_OCCLUDER_TREE_H

#include <stdint.h>

#include "error.h"
#include "insitu/status.h"
#include "kernel_occluders.h"

/* A piece of a surface: a triangle in a tet, or in another cell the slab (the space between two parallel planes that
 * contains the surface in the cell). rows[i]: the number that is stored for the piece in row i of its leaf
 * (kernel_occluders.h). Triangles use only the first KERNEL_TRIANGLE_ROWS elements. */
typedef struct occluder_piece {
    float rows[KERNEL_SLAB_ROWS];
    int32_t surface; /* index of the surface in the frame */
} occluder_piece;

/* Builds a tree of `count` pieces, which must all be triangles or all be slabs, for kernels with `width` lanes, at most
 * 16. rows: KERNEL_TRIANGLE_ROWS or KERNEL_SLAB_ROWS. out->sources are the pieces' indices. The caller must free the
 * tree with occluder_tree_free(), even after an error. Uses `threads` threads. */
insitu_status occluder_tree_build(const occluder_piece *pieces, int64_t count, int rows, int width, int threads,
                                  kernel_occluder_tree *out, base_error *error);
void occluder_tree_free(kernel_occluder_tree *tree);

#endif
