#include "render_subtrees.h"
#include "kernel_types.h"

#include <string.h>

#include "memory.h"
#include "mmbvh.h"

/* SUBTREES is the maximum number of subtrees of a tree, SUBTREE_CELLS about the minimum number of cells of a subtree.
 * Each search of a subtree has a fixed cost and ends with vectors that are not full, so small trees, such as those of
 * blocks, are not divided. */
enum { SUBTREES = 128, SUBTREE_CELLS = 512 };

bool render_subtrees_begin(render_subtrees *list, int64_t trees)
{
    *list = (render_subtrees){base_alloc((size_t)(trees * SUBTREES) * sizeof *list->items), 0};
    return list->items;
}

void render_subtrees_add(render_subtrees *list, const kernel_frame *frame, int surface, int part)
{
    const mmbvh *tree = frame->job->parts[part].tree;
    const int64_t first = list->count, enough = 1 + tree->cell_count / SUBTREE_CELLS;
    const int64_t most = enough < SUBTREES ? enough : SUBTREES;
    list->items[list->count++] = (kernel_subtree){.surface = surface, .part = part};
    for (int64_t next = first; next < list->count && list->count - first < most;) {
        const int64_t node = list->items[next].node;
        if (mmbvh_node_count(tree, node)) {
            next++;
            continue;
        }
        const int64_t left = mmbvh_node_ref(tree, node);
        memmove(list->items + next, list->items + next + 1, (size_t)(list->count - next - 1) * sizeof *list->items);
        list->items[list->count - 1] = (kernel_subtree){.surface = surface, .part = part, .node = left};
        list->items[list->count++] = (kernel_subtree){.surface = surface, .part = part, .node = left + 1};
    }
}
