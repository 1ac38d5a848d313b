/* What is found of a picture, by tile. Each thread that looks for cells has a bin a tile, a chain of chunks that takes
 * what comes without knowing how much will; tiles take their cells out of the bins of all threads. */
#ifndef RENDER_KERNEL_BINS_H
#define RENDER_KERNEL_BINS_H

#include <string.h>

#include "kernel_types.h"
#include "simd.h"

SIMD_INLINE int kernel_tiles_across(const kernel_frame *f)
{
    return (f->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
}

/* ---- cells are put into bins ---- */

/* Pixels first .. last of a row or column, within its n-th tile. */
typedef struct kernel_within {
    unsigned first, last;
} kernel_within;

SIMD_INLINE kernel_within kernel_within_tile(int first, int last, int from)
{
    first -= from;
    last -= from;
    return (kernel_within){(unsigned)(first > 0 ? first : 0),
                           (unsigned)(last < KERNEL_TILE - 1 ? last : KERNEL_TILE - 1)};
}

/* Their blocks, as bits. */
SIMD_INLINE unsigned kernel_within_bits(kernel_within w)
{
    return ~0u << w.first / KERNEL_BLOCK & ((2u << w.last / KERNEL_BLOCK) - 1);
}

SIMD_INLINE kernel_tile_shown kernel_shown_within(const kernel_shown *s, int x0, int y0)
{
    /* A tile's rows of blocks, a bit each in the column of the first blocks. */
    static const uint16_t spread[1 << KERNEL_TILE / KERNEL_BLOCK] = {0x0000, 0x0001, 0x0010, 0x0011, 0x0100, 0x0101,
                                                                     0x0110, 0x0111, 0x1000, 0x1001, 0x1010, 0x1011,
                                                                     0x1100, 0x1101, 0x1110, 0x1111};
    const kernel_within columns = kernel_within_tile(s->x0, s->x1, x0), rows = kernel_within_tile(s->y0, s->y1, y0);
    return (kernel_tile_shown){.near = s->near,
                               .far = s->far,
                               .cell = s->cell,
                               .source = s->source,
                               .blocks = (uint16_t)(kernel_within_bits(columns) * spread[kernel_within_bits(rows)]),
                               .box =
                                   (uint16_t)(columns.first | columns.last << 4 | rows.first << 8 | rows.last << 12)};
}

SIMD_INLINE kernel_tile_shown *kernel_bin_next(kernel_shown_list *list, int64_t tile)
{
    kernel_bin *bin = &list->bins[tile];
    if (!bin->chunk || bin->count == KERNEL_CHUNK) {
        if (list->free == list->end && !list->grow(list)) return NULL;
        list->free->before = bin->chunk;
        bin->chunk = list->free++;
        bin->count = 0;
    }
    return &bin->chunk->items[bin->count++];
}

/* vertices: NULL where they are nobody's to ask for. */
SIMD_INLINE void kernel_bins_add(kernel_shown_list *list, int across, const kernel_shown *s, const int32_t vertices[4])
{
    const int x0 = s->x0 / KERNEL_TILE, x1 = s->x1 / KERNEL_TILE;
    for (int y = s->y0 / KERNEL_TILE; y <= s->y1 / KERNEL_TILE; y++)
        for (int x = x0; x <= x1; x++) {
            kernel_tile_shown *out = kernel_bin_next(list, (int64_t)y * across + x);
            if (!out) return;
            *out = kernel_shown_within(s, x * KERNEL_TILE, y * KERNEL_TILE);
            if (vertices) memcpy(out->vertices, vertices, sizeof out->vertices);
        }
}

/* ---- and taken out of them ---- */

SIMD_INLINE bool kernel_bins_have(const kernel_frame *f, const kernel_shown_bins *bins, int x0, int y0)
{
    const int64_t tile = (int64_t)(y0 / KERNEL_TILE) * kernel_tiles_across(f) + x0 / KERNEL_TILE;
    bool has = false;
    for (int n = 0; n < bins->count; n++) has = has || bins->lists[n].bins[tile].chunk;
    return has;
}

/* The tile's cells, in the thread's memory for them; returns how many they are. */
static inline int kernel_bins_take(const kernel_frame *f, kernel_thread *thread, const kernel_shown_bins *bins, int x0,
                                   int y0)
{
    const int64_t tile = (int64_t)(y0 / KERNEL_TILE) * kernel_tiles_across(f) + x0 / KERNEL_TILE;
    int count = 0;
    for (int n = 0; n < bins->count; n++) {
        const kernel_bin *bin = &bins->lists[n].bins[tile];
        int64_t filled = bin->count;
        for (const kernel_bin_chunk *chunk = bin->chunk; chunk; chunk = chunk->before, filled = KERNEL_CHUNK) {
            if (count + KERNEL_CHUNK > thread->room && !thread->make_room(thread)) return 0;
            memcpy(thread->items + count, chunk->items, (size_t)filled * sizeof *chunk->items);
            count += (int)filled;
        }
    }
    return count;
}

#endif
