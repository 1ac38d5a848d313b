/* Converts candidates (cells that may be visible) to the form in which a tile's bin stores them, and sorts a tile's bin
 * by depth (kernel_types.h). */
#ifndef RENDER_KERNEL_BINS_H
#define RENDER_KERNEL_BINS_H

#include "kernel_types.h"
#include "simd.h"

/* Converts a candidate (a cell that may be visible in some pixels of the picture) to its form in the bin of one tile,
 * with pixels counted from (x0, y0), the tile's upper left pixel. */
static inline kernel_tile_candidate kernel_convert_candidate_to_tile(const kernel_candidate *c, int x0, int y0)
{
    /* first and last column, first and last row of the cell's pixels in the tile, counted from the tile's upper left
     * pixel */
    const int ends[4] = {c->x0 > x0 ? c->x0 - x0 : 0, c->x1 - x0 < KERNEL_TILE - 1 ? c->x1 - x0 : KERNEL_TILE - 1,
                         c->y0 > y0 ? c->y0 - y0 : 0, c->y1 - y0 < KERNEL_TILE - 1 ? c->y1 - y0 : KERNEL_TILE - 1};
    unsigned blocks[2]; /* masks of the columns and of the rows of blocks that contain one of the pixels */
    for (int a = 0; a < 2; a++)
        blocks[a] = ~0u << ends[2 * a] / KERNEL_BLOCK & ((2u << ends[2 * a + 1] / KERNEL_BLOCK) - 1);
    return (kernel_tile_candidate){.near = c->near,
                                   .far = c->far,
                                   .cell = c->cell,
                                   .source = c->source,
                                   .blocks = (uint16_t)kernel_mask_blocks_in_columns_and_rows(blocks[0], blocks[1]),
                                   .box = (uint16_t)(ends[0] | ends[1] << 4 | ends[2] << 8 | ends[3] << 12)};
}

/* Returns the index of the depth bin for cells that begin at the depth `near`. The index never decreases as the depth
 * grows. */
SIMD_INLINE int kernel_depth_bin(const kernel_bin *q, float near)
{
    const float bin = (near - q->low) * q->scale;
    return bin > 0 ? bin < KERNEL_DEPTHS - 1 ? (int)bin : KERNEL_DEPTHS - 1 : 0;
}

static inline void kernel_sort_by_depth(kernel_bin *q)
{
    kernel_tile_candidate *items = q->items;
    const int count = q->count;
    float low = items[0].near, high = low;
    for (int i = 1; i < count; i++) {
        low = items[i].near < low ? items[i].near : low;
        high = items[i].near > high ? items[i].near : high;
    }
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
