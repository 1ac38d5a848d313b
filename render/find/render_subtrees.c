#include "render_subtrees.h"
#include "kernel_types.h"

#include <string.h>

#include "memory.h"
#include "mmbvh.h"

/* SUBTREES: maximum number of subtrees of a tree. SUBTREE_CELLS: about the minimum number of cells of a subtree. Each
 * search of a subtree has a fixed cost and ends with vectors that are not full, so small trees, such as those of a mesh
 * that consists of many blocks, are not divided. */
enum { SUBTREES = 128, SUBTREE_CELLS = 512 };

/* Divides the tree of a mesh part into subtrees and stores them in `list`. Returns their number. */
static int64_t divide_tree(const mmbvh *tree, int surface, int part, kernel_subtree *list)
{
    const int64_t enough = 1 + tree->cell_count / SUBTREE_CELLS, most = enough < SUBTREES ? enough : SUBTREES;
    int64_t count = 1;
    list[0] = (kernel_subtree){.surface = surface, .part = part};
    for (int64_t next = 0; next < count && count < most;) {
        const int64_t node = list[next].node;
        if (mmbvh_node_count(tree, node)) {
            next++;
            continue;
        }
        const int64_t left = mmbvh_node_ref(tree, node);
        memmove(list + next, list + next + 1, (size_t)(count - next - 1) * sizeof *list);
        list[count - 1] = (kernel_subtree){.surface = surface, .part = part, .node = left};
        list[count++] = (kernel_subtree){.surface = surface, .part = part, .node = left + 1};
    }
    return count;
}

kernel_subtree *render_subtrees(const kernel_frame *frame, int first, int end, int64_t *count)
{
    const render_job *job = frame->job;
    kernel_subtree *list = base_alloc((size_t)((int64_t)(end - first) * job->part_count * SUBTREES + 1) * sizeof *list);
    *count = 0;
    for (int s = first; list && s < end; s++) {
        const render_field *field = s < 0 ? &job->volumes[0].field : &frame->surfaces[s].layer->field;
        for (int part = 0; part < job->part_count; part++)
            if (field->ranges[part].low && job->parts[part].tree->node_count)
                *count += divide_tree(job->parts[part].tree, s, part, list + *count);
    }
    return list;
}
