/* Packet traversal of the min-max BVH (thesis, section 4.3.1): all rays of a packet go down together as long as one
 * of them needs to (speculative descent), and a node's box is tested only where its range meets a value that shows
 * (the delayed box test, section 4.3.2). The nearer child goes first, by the rays' common direction. */
#ifndef RENDER_KERNEL_TRAVERSE_H
#define RENDER_KERNEL_TRAVERSE_H

#include "kernel_packet.h"

/* mmbvh_build() keeps trees less deep than this. */
enum { KERNEL_STACK = 256 };

/* Called with the rays that meet a leaf's box. */
typedef void kernel_leaf(kernel_packet *p, void *state, int part, const uint32_t *cells, int count, vm rays);

SIMD_INLINE bool kernel_interest_meets(const kernel_interest *interest, float low, float high)
{
    for (int i = 0; i < interest->count; i++)
        if (low <= interest->high[i] && high >= interest->low[i]) return true;
    return false;
}

/* The same of cells, a lane each, of four values. */
SIMD_INLINE vm kernel_interest_meets_values(const kernel_interest *interest, const vf v[4])
{
    const vf low = vf_min(vf_min(v[0], v[1]), vf_min(v[2], v[3]));
    const vf high = vf_max(vf_max(v[0], v[1]), vf_max(v[2], v[3]));
    vm meets = vm_none();
    for (int i = 0; i < interest->count; i++)
        meets = vm_or(meets, vm_and(vf_le(low, vf_set(interest->high[i])), vf_le(vf_set(interest->low[i]), high)));
    return meets;
}

SIMD_INLINE bool kernel_node_shows(const kernel_interest *interest, const mmbvh_ranges *ranges, int64_t node)
{
    float low, high;
    memcpy(&low, ranges->low + node * ranges->stride, sizeof low);
    memcpy(&high, ranges->high + node * ranges->stride, sizeof high);
    return kernel_interest_meets(interest, low, high);
}

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
    int64_t stack[KERNEL_STACK];
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

#endif
