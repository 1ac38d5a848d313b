/* The cells that a tile has of a picture's, binned by render_candidates.c. */
#ifndef RENDER_KERNEL_BINS_H
#define RENDER_KERNEL_BINS_H

#include "kernel_types.h"
#include "simd.h"

/* The cells that the tile has of a picture's; returns how many they are. */
SIMD_INLINE int kernel_bin(const kernel_frame *f, kernel_tile_candidate *candidates, const uint32_t *starts, int x0,
                           int y0, kernel_tile_candidate **items)
{
    const int columns = (f->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
    starts += y0 / KERNEL_TILE * columns + x0 / KERNEL_TILE;
    *items = candidates + starts[0];
    return (int)(starts[1] - starts[0]);
}

SIMD_INLINE int kernel_candidates_in_tile(const kernel_frame *f, int x0, int y0, kernel_tile_candidate **items)
{
    return kernel_bin(f, f->candidates, f->candidate_starts, x0, y0, items);
}

/* A tile's cells by depth, as far as it takes to leave out what is hidden: in so many bins of the tile's depth, in any
 * order within each. */
enum { KERNEL_DEPTHS = 32 };

typedef struct kernel_by_depth {
    kernel_tile_candidate *items;
    float low, scale;
    int first[KERNEL_DEPTHS]; /* of each bin's items, the nearest bin first; each knows the next, -1 is none */
} kernel_by_depth;

/* The bin of a depth: no smaller than that of anything nearer. */
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
