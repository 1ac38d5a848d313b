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

#endif
