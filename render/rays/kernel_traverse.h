/* Packet traversal of the min-max BVH (thesis, section 4.3.1): all rays of a packet descend together as long as one of
 * them needs to (speculative descent), and a node's box is tested only if its range meets a visible value (the delayed
 * box test, section 4.3.2). The nearer child, by the rays' common direction, is visited first. */
#ifndef RENDER_KERNEL_TRAVERSE_H
#define RENDER_KERNEL_TRAVERSE_H

#include "kernel_visible_values.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* Callback for a leaf, with the rays that meet its box. */
typedef void kernel_leaf(kernel_packet *p, void *state, int part, const uint32_t *cells, int count, vm rays);

/* Returns whether the right child is nearer than the left one along the packet's direction. */
SIMD_INLINE bool kernel_right_child_first(const kernel_packet *p, const mmbvh *tree, int64_t left)
{
    float lower[2][4], upper[2][4], along = 0;
    for (int side = 0; side < 2; side++) mmbvh_node_box(tree, left + side, lower[side], upper[side]);
    for (int a = 0; a < 3; a++)
        along += p->centre_direction[a] * ((lower[1][a] + upper[1][a]) - (lower[0][a] + upper[0][a]));
    return along < 0;
}

/* Parameters of a traversal. leaf() is called for each visible leaf that a ray enters between t_low and *t_high; it may
 * lower *t_high. */
typedef struct kernel_descent {
    const kernel_visible_values *visible_values; /* intervals of visible values; NULL if all values are visible */
    vf t_low;
    const vf *t_high;
    kernel_leaf *leaf;
    void *state; /* argument that is passed to leaf() */
} kernel_descent;

SIMD_INLINE void kernel_traverse(kernel_packet *p, const mmbvh *tree, const mmbvh_ranges *ranges,
                                 const kernel_descent *d, vm rays, int part)
{
    const kernel_visible_values *visible_values = d->visible_values;
    int64_t stack[MMBVH_MAX_DEPTH];
    int top = 0;
    if (tree->node_count && (!visible_values || kernel_node_is_visible(visible_values, ranges, 0))) stack[top++] = 0;
    while (top) {
        const int64_t node = stack[--top];
        vf t_in = d->t_low, t_out = *d->t_high;
        const vm met = vm_and(rays, kernel_box(p, tree, node, &t_in, &t_out));
        if (!vm_any(met)) continue;
        const int count = mmbvh_node_count(tree, node);
        if (count) {
            d->leaf(p, d->state, part, tree->cells + mmbvh_node_ref(tree, node), count, met);
            continue;
        }
        const int64_t left = mmbvh_node_ref(tree, node);
        const bool swap = kernel_right_child_first(p, tree, left);
        const int64_t near = left + swap, far = left + !swap;
        if (!visible_values || kernel_node_is_visible(visible_values, ranges, far)) stack[top++] = far;
        if (!visible_values || kernel_node_is_visible(visible_values, ranges, near)) stack[top++] = near;
    }
}

/* State of the traversal of a tree over meshes: its leaves are meshes, whose own trees are then traversed. */
typedef struct kernel_parent_state {
    const render_field *field;
    kernel_descent descent;
} kernel_parent_state;

static void kernel_parent_leaf(kernel_packet *p, void *opaque_state, int unused, const uint32_t *parts, int count,
                               vm rays)
{
    const kernel_parent_state *s = opaque_state;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (s->field->ranges[part].low)
            kernel_traverse(p, p->frame->job->parts[part].tree, &s->field->ranges[part], &s->descent, rays, part);
    }
}

SIMD_INLINE void kernel_trace_parts(kernel_packet *p, const render_field *field, const kernel_descent *d)
{
    const render_job *job = p->frame->job;
    if (job->parent) {
        kernel_parent_state state = {field, *d};
        const kernel_descent parent = {NULL, d->t_low, d->t_high, kernel_parent_leaf, &state};
        kernel_traverse(p, job->parent, NULL, &parent, p->active, 0);
        return;
    }
    for (int part = 0; part < job->part_count; part++)
        if (field->ranges[part].low)
            kernel_traverse(p, job->parts[part].tree, &field->ranges[part], d, p->active, part);
}

#endif
