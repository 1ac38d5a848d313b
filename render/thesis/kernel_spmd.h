/* SPMD traversal (thesis, section 4.3.1): every ray goes down the tree on its own, with a stack and an order of its
 * own, all of a packet's rays at once but each at another node. Rays that are at one leaf meet its cells together.
 * It is here to be compared with: packets that stay together are faster (thesis, table 4.1;
 * docs/development/measurements.md). */
#ifndef RENDER_KERNEL_SPMD_H
#define RENDER_KERNEL_SPMD_H

#include "kernel_interest.h"
#include "kernel_packet.h"
#include "kernel_traverse.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* The rays' boxes and what they are at. */
typedef struct kernel_spmd {
    int depth[SIMD_WIDTH];
    int64_t node[SIMD_WIDTH], stack[SIMD_WIDTH][MMBVH_MAX_DEPTH];
    float lower[3][SIMD_WIDTH], upper[3][SIMD_WIDTH];
} kernel_spmd;

/* Pops each ray's next node; returns the rays that have one. */
SIMD_INLINE vm kernel_spmd_pop(kernel_spmd *s, const mmbvh *tree)
{
    unsigned bits = 0;
    for (int i = 0; i < SIMD_WIDTH; i++) {
        float lower[4] = {0}, upper[4] = {0};
        if (s->depth[i]) {
            bits |= 1u << i;
            s->node[i] = s->stack[i][--s->depth[i]];
            mmbvh_node_box(tree, s->node[i], lower, upper);
        }
        for (int a = 0; a < 3; a++) s->lower[a][i] = lower[a], s->upper[a][i] = upper[a];
    }
    return vm_from_bits(bits);
}

SIMD_INLINE vm kernel_spmd_boxes(const kernel_packet *p, const kernel_spmd *s)
{
    vf low = p->t_near, high = p->t_far;
    for (int a = 0; a < 3; a++) {
        const vf t1 = (vf_load(s->lower[a]) - p->pad) * p->inverse[a] - p->shift[a];
        const vf t2 = (vf_load(s->upper[a]) + p->pad) * p->inverse[a] - p->shift[a];
        low = vf_max(low, vf_min(t1, t2));
        high = vf_min(high, vf_max(t1, t2));
    }
    return vf_le(low, high);
}

/* Pushes the children of ray i's node that show, the nearer one on top. */
SIMD_INLINE void kernel_spmd_push(kernel_spmd *s, const kernel_packet *p, const mmbvh *tree, const mmbvh_ranges *ranges,
                                  const kernel_interest *interest, int i)
{
    const int64_t left = mmbvh_node_ref(tree, s->node[i]);
    const bool swap = kernel_right_first(p, tree, left);
    for (int side = 1; side >= 0; side--) {
        const int64_t child = left + (side ^ (int)swap);
        if (kernel_node_shows(interest, ranges, child)) s->stack[i][s->depth[i]++] = child;
    }
}

static void kernel_traverse_spmd(kernel_packet *p, const mmbvh *tree, const mmbvh_ranges *ranges,
                                 const kernel_descent *d, vm rays, int part)
{
    const kernel_interest *interest = d->interest;
    kernel_spmd s;
    if (!tree->node_count || !kernel_node_shows(interest, ranges, 0)) return;
    for (int i = 0; i < SIMD_WIDTH; i++) {
        s.depth[i] = vm_bits(rays) >> i & 1;
        s.stack[i][0] = 0;
    }
    for (vm open = kernel_spmd_pop(&s, tree); vm_any(open); open = kernel_spmd_pop(&s, tree)) {
        unsigned bits = vm_bits(vm_and(open, kernel_spmd_boxes(p, &s)));
        while (bits) {
            const int first = __builtin_ctz(bits);
            const int64_t node = s.node[first];
            const int count = mmbvh_node_count(tree, node);
            unsigned same = 1u << first;
            for (int i = first + 1; count && i < SIMD_WIDTH; i++) same |= (unsigned)(s.node[i] == node) << i & bits;
            bits &= ~same;
            if (count)
                d->leaf(p, d->state, part, tree->cells + mmbvh_node_ref(tree, node), count, vm_from_bits(same));
            else
                kernel_spmd_push(&s, p, tree, ranges, interest, first);
        }
    }
}

/* Parts are tried in turn: a tree over them is for packets. */
SIMD_INLINE void kernel_trace_parts_spmd(kernel_packet *p, const render_field *field, const kernel_descent *d)
{
    const render_job *job = p->frame->job;
    for (int part = 0; part < job->part_count; part++)
        if (field->ranges[part].low)
            kernel_traverse_spmd(p, job->parts[part].tree, &field->ranges[part], d, p->active, part);
}

#endif
