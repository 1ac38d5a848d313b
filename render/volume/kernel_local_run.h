/* Processes the queues of a volume's hexes, wedges and pyramids (kernel_local_queue.h): transforms a vector of cells,
 * lists the pixels in which they may be visible, and passes these to samples (kernel_local_samples.h) or segments
 * (kernel_local_segments.h). Cells that cannot be processed in lanes are passed to packets one by one. */
#ifndef RENDER_KERNEL_LOCAL_RUN_H
#define RENDER_KERNEL_LOCAL_RUN_H

#include "grid.h"
#include "kernel_local_queue.h"
#include "kernel_shapes.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

/* Processes the first vector of cells in a queue. */
static __attribute__((noinline)) void kernel_local_process_queue(kernel_tile_trace *t, kernel_local_lanes *l, int queue)
{
    const int type = kernel_curved_types[queue];
    const kernel_local_stages *stages = l->stages;
    kernel_local_queue *q = &l->queues[queue];
    unsigned transformed;
    const unsigned all = KERNEL_OF_TYPE(type, kernel_local_fetch_all, l, q);
    const unsigned showing = stages->transform(t, l, type, &transformed) & all;
    transformed &= all;
    t->thread->volume_cells += __builtin_popcount(all & ~(showing & ~transformed));
    l->rays.count = 0;
    for (unsigned lanes = transformed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = q->box[n];
        if (!kernel_local_clip_box(l->ends, n, &box)) continue;
        kernel_pixel_list_add_box(&l->rays, box, n);
        if (l->rays.count >= KERNEL_LIST_PIXELS) stages->process_pixels(t, l, type);
    }
    stages->process_pixels(t, l, type);
    stages->finish(t, l, type);
    for (unsigned lanes = showing & ~transformed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        kernel_tile_process_cell(t, l->volume, l->part, q->cell[n], stages->is_pencil, q->blocks[n], l->take);
    }
    kernel_local_pop(q);
}

SIMD_INLINE void kernel_local_end(kernel_tile_trace *t, kernel_local_lanes *l)
{
    for (int i = 0; i < KERNEL_CURVED_TYPES; i++)
        while (l->queues[i].count) kernel_local_process_queue(t, l, i);
}

/* Adds a hex, wedge or pyramid to the queue of its type. */
SIMD_INLINE void kernel_local_enqueue(kernel_tile_trace *t, kernel_local_lanes *l, int part, int type, uint32_t cell,
                                      unsigned blocks, unsigned box)
{
    const int queue = kernel_local_queue_of(type);
    if (part != l->part) {
        kernel_local_end(t, l);
        kernel_local_lanes_set_part(t, l, part);
    }
    if (KERNEL_OF_TYPE(type, kernel_local_push, &l->arrays, &l->queues[queue], cell, blocks, box))
        kernel_local_process_queue(t, l, queue);
}

#endif
