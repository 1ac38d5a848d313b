/* Caches cells that have been fetched from the mesh for a packet of rays, for the other packets of the same tile. */
#ifndef RENDER_KERNEL_CELL_CACHE_H
#define RENDER_KERNEL_CELL_CACHE_H

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_packet.h"
#include "simd.h"

/* The cache is a hash table with one cell per slot. So a cell is fetched, sorted and transformed into tile space only
 * once for all packets of a tile, and for all windows (the ranges of depth into which volumes are divided), unless
 * another cell replaces it in its slot. */
enum { KERNEL_CACHE_BITS = 8, KERNEL_CACHE_CELLS = 1 << KERNEL_CACHE_BITS };

/* Returns the cell from the cache; if it is missing, it is fetched first. A cached cell may already be in tile space
 * (is_transformed). layer is part of the key, because each layer fetches cells with its own field. */
SIMD_INLINE kernel_cell *kernel_cell_cache_find(const kernel_packet *p, int layer, int part, const grid_field *field,
                                                uint32_t index)
{
    const uint32_t key = index + 0x85ebca6bu * (uint32_t)part + 0xc2b2ae35u * (uint32_t)layer;
    kernel_cell *c = &p->thread->cells[(key * 0x9e3779b1u) >> (32 - KERNEL_CACHE_BITS)];
    if (c->serial == p->thread->serial && c->index == index && c->part == part && c->layer == layer) return c;
    c->serial = p->thread->serial;
    c->part = part;
    c->layer = layer;
    kernel_cell_fetch(c, p->frame->job->parts[part].cells, field, index);
    return c;
}

#endif
