/* A tile goes down a tree once for all its blocks, with a mask of those that a node may meet before what they already
 * know to be nearer. */
#ifndef RENDER_KERNEL_TILE_TRAVERSE_H
#define RENDER_KERNEL_TILE_TRAVERSE_H

#include "kernel_interest.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

typedef struct kernel_tile_entry {
    int64_t node;
    float near;
    unsigned blocks;
} kernel_tile_entry;

typedef void kernel_tile_visit(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks);

/* Where the node may be met, of blocks: none where it does not show. interest NULL: everything shows. */
SIMD_INLINE kernel_placement kernel_tile_look(const kernel_tile_trace *t, const mmbvh *tree, const mmbvh_ranges *ranges,
                                              const kernel_interest *interest, int64_t node, unsigned blocks)
{
    kernel_placement placement = {0};
    if (interest && !kernel_node_shows(interest, ranges, node)) return placement;
    placement = kernel_box_placement(&t->tree_planes, tree, node);
    placement.blocks &= placement.far < t->t_near ? 0 : blocks;
    if (placement.blocks) {
        /* Prefetches what an inner node or a leaf needs next. */
        const int64_t ref = mmbvh_node_ref(tree, node);
        if (mmbvh_node_count(tree, node))
            __builtin_prefetch(tree->cells + ref);
        else if (interest)
            __builtin_prefetch(ranges->low + ref * ranges->stride);
    }
    return placement;
}

SIMD_INLINE void kernel_tile_traverse(kernel_tile_trace *t, const mmbvh *tree, const mmbvh_ranges *ranges,
                                      const kernel_interest *interest, unsigned blocks, int part,
                                      kernel_tile_visit *visit)
{
    kernel_tile_entry stack[MMBVH_MAX_DEPTH + 1];
    int top = 0;
    if (!tree->node_count) return;
    const kernel_placement root = kernel_tile_look(t, tree, ranges, interest, 0, blocks);
    if (root.blocks) stack[top++] = (kernel_tile_entry){0, root.near, root.blocks};
    while (top) {
        const kernel_tile_entry e = stack[--top];
        blocks = e.blocks & kernel_blocks_beyond(t, e.near);
        if (!blocks) continue;
        const int count = mmbvh_node_count(tree, e.node);
        const int64_t ref = mmbvh_node_ref(tree, e.node);
        if (count) {
            visit(t, part, tree->cells + ref, count, blocks);
            continue;
        }
        const kernel_placement left = kernel_tile_look(t, tree, ranges, interest, ref, blocks);
        const kernel_placement right = kernel_tile_look(t, tree, ranges, interest, ref + 1, blocks);
        const kernel_tile_entry entries[2] = {{ref, left.near, left.blocks}, {ref + 1, right.near, right.blocks}};
        const int far = left.along < right.along;
        if (entries[far].blocks) stack[top++] = entries[far];
        if (entries[!far].blocks) stack[top++] = entries[!far];
    }
}

#endif
