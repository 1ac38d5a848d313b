/* Defines how a tile reads the cells that render_candidates.c has binned for it, and sorts them by depth. */
#ifndef RENDER_KERNEL_BINS_H
#define RENDER_KERNEL_BINS_H

#include "kernel_types.h"
#include "simd.h"

/* Rows or columns of pixels from `first` to `last`, counted from the tile's first one. */
typedef struct kernel_tile_range {
    unsigned first, last;
} kernel_tile_range;

/* Clips the pixels from first to last to the tile whose first pixel is `begin`, and counts them from there. */
static inline kernel_tile_range kernel_range_in_tile(int first, int last, int begin)
{
    const int from = first - begin, to = last - begin;
    return (kernel_tile_range){(unsigned)(from > 0 ? from : 0),
                               (unsigned)(to < KERNEL_TILE - 1 ? to : KERNEL_TILE - 1)};
}

/* Returns a mask of the rows (or columns) of blocks that contain one of the pixels. */
static inline unsigned kernel_range_blocks(kernel_tile_range s)
{
    return ~0u << s.first / KERNEL_BLOCK & ((2u << s.last / KERNEL_BLOCK) - 1);
}

static inline kernel_tile_candidate kernel_candidate_in_tile(const kernel_candidate *c, kernel_tile_range columns,
                                                             kernel_tile_range rows)
{
    return (kernel_tile_candidate){
        .near = c->near,
        .far = c->far,
        .cell = c->cell,
        .source = c->source,
        .blocks = (uint16_t)kernel_blocks_at(kernel_range_blocks(columns), kernel_range_blocks(rows)),
        .box = (uint16_t)(columns.first | columns.last << 4 | rows.first << 8 | rows.last << 12)};
}

/* A tile's cells are sorted by depth into KERNEL_DEPTHS bins, without an order within a bin. That is accurate enough to
 * skip cells that are hidden. */
enum { KERNEL_DEPTHS = 32 };

typedef struct kernel_by_depth {
    kernel_tile_candidate *items;
    float low, scale;
    /* Index of each bin's first item; the nearest bin comes first. Items of a bin are linked by `next`, which is -1 at
     * the end. */
    int first[KERNEL_DEPTHS];
} kernel_by_depth;

/* Returns the number of the bin that contains a depth. It never decreases as the depth grows. */
SIMD_INLINE int kernel_depth_bin(const kernel_by_depth *q, float near)
{
    const float bin = (near - q->low) * q->scale;
    return bin > 0 ? bin < KERNEL_DEPTHS - 1 ? (int)bin : KERNEL_DEPTHS - 1 : 0;
}

static inline void kernel_sort_by_depth(kernel_by_depth *q, kernel_tile_candidate *items, int count)
{
    float low = items[0].near, high = low;
    for (int i = 1; i < count; i++) {
        low = items[i].near < low ? items[i].near : low;
        high = items[i].near > high ? items[i].near : high;
    }
    q->items = items;
    q->low = low;
    q->scale = high > low ? KERNEL_DEPTHS / (high - low) : 0;
    for (int bin = 0; bin < KERNEL_DEPTHS; bin++) q->first[bin] = -1;
    for (int i = count - 1; i >= 0; i--) {
        int *first = &q->first[kernel_depth_bin(q, items[i].near)];
        items[i].next = *first;
        *first = i;
    }
}

#endif
