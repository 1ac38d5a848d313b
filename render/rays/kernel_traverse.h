/* Packet traversal of the min-max BVH (thesis, section 4.3.1): all rays of a packet go down together as long as one
 * of them needs to (speculative descent), and a node's box is tested only where its range meets a value that shows
 * (the delayed box test, section 4.3.2). The nearer child goes first, by the rays' common direction. */
#ifndef RENDER_KERNEL_TRAVERSE_H
#define RENDER_KERNEL_TRAVERSE_H

#include "kernel_interest.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* Called with the rays that meet a leaf's box. */
typedef void kernel_leaf(kernel_packet *p, void *state, int part, const uint32_t *cells, int count, vm rays);

/* Is the right child nearer than the left, seen along the packet? */
SIMD_INLINE bool kernel_right_first(const kernel_packet *p, const mmbvh *tree, int64_t left)
{
    float lower[2][4], upper[2][4], along = 0;
    for (int side = 0; side < 2; side++) mmbvh_node_box(tree, left + side, lower[side], upper[side]);
    for (int a = 0; a < 3; a++)
        along += p->centre_direction[a] * ((lower[1][a] + upper[1][a]) - (lower[0][a] + upper[0][a]));
    return along < 0;
}

/* Meet every leaf of the tree that shows and that a ray of rays enters between t_low and *t_high, which leaf() may
 * lower. interest NULL: everything shows (parent trees). */
SIMD_INLINE void kernel_traverse(kernel_packet *p, const mmbvh *tree, const mmbvh_ranges *ranges,
                                 const kernel_interest *interest, vm rays, vf t_low, const vf *t_high, int part,
                                 kernel_leaf *leaf, void *state)
{
    int64_t stack[MMBVH_MAX_DEPTH];
    int top = 0;
    if (tree->node_count && (!interest || kernel_node_shows(interest, ranges, 0))) stack[top++] = 0;
    while (top) {
        const int64_t node = stack[--top];
        vf t_in = t_low, t_out = *t_high;
        const vm met = vm_and(rays, kernel_box(p, tree, node, &t_in, &t_out));
        if (!vm_any(met)) continue;
        const int count = mmbvh_node_count(tree, node);
        if (count) {
            leaf(p, state, part, tree->cells + mmbvh_node_ref(tree, node), count, met);
            continue;
        }
        const int64_t left = mmbvh_node_ref(tree, node);
        const bool swap = kernel_right_first(p, tree, left);
        const int64_t near = left + swap, far = left + !swap;
        if (!interest || kernel_node_shows(interest, ranges, far)) stack[top++] = far;
        if (!interest || kernel_node_shows(interest, ranges, near)) stack[top++] = near;
    }
}

/* A tree over meshes: its leaves name meshes, which are traversed in their turn. */
typedef struct kernel_parent_state {
    const render_field *field;
    const kernel_interest *interest;
    vf t_low;
    const vf *t_high;
    kernel_leaf *leaf;
    void *state;
} kernel_parent_state;

static void kernel_parent_leaf(kernel_packet *p, void *opaque_state, int unused, const uint32_t *parts, int count,
                               vm rays)
{
    const kernel_parent_state *s = opaque_state;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (!s->field->ranges[part].low) continue;
        kernel_traverse(p, p->frame->job->parts[part].tree, &s->field->ranges[part], s->interest, rays, s->t_low,
                        s->t_high, part, s->leaf, s->state);
    }
}

SIMD_INLINE void kernel_trace_parts(kernel_packet *p, const render_field *field, const kernel_interest *interest,
                                    vf t_low, const vf *t_high, kernel_leaf *leaf, void *state)
{
    const render_job *job = p->frame->job;
    if (job->parent) {
        kernel_parent_state parent = {field, interest, t_low, t_high, leaf, state};
        kernel_traverse(p, job->parent, NULL, NULL, p->active, t_low, t_high, 0, kernel_parent_leaf, &parent);
        return;
    }
    for (int part = 0; part < job->part_count; part++)
        if (field->ranges[part].low)
            kernel_traverse(p, job->parts[part].tree, &field->ranges[part], interest, p->active, t_low, t_high, part,
                            leaf, state);
}

#endif
