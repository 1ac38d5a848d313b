/* A packet's hits on surfaces: the nearest opaque ones, and the crossings of transparent ones. */
#ifndef RENDER_KERNEL_HITS_H
#define RENDER_KERNEL_HITS_H

#include <math.h>

#include "simd.h"

/* Nearest opaque hits so far; and the crossings of transparent surfaces, by which volume fragments are cut. */
enum { KERNEL_MAX_CUTS = 32 };

/* The cells that rays hit. part is -1 where the cell is not needed again. */
typedef struct kernel_hit_cells {
    vi part, index;
} kernel_hit_cells;

typedef struct kernel_hits {
    vm found;
    vf normal[3];           /* along the gradient, camera axes, any length; of RENDER_VERTEX until the end: the place
                               in the cell, its own coordinates */
    kernel_hit_cells cells; /* only of RENDER_VERTEX */
    vf colour[3];           /* unlit */
    vf reach;               /* how far samples for differences lie; only if they are wanted */
    vf kind;
    int cut_count;           /* rows: the n-th that was found of each ray, +inf where it has fewer */
    vf cut[KERNEL_MAX_CUTS]; /* in the order in which they were found */
    vm crowded;              /* rays that have more */
} kernel_hits;

static inline void kernel_hits_begin(kernel_hits *hits)
{
    hits->found = hits->crowded = vm_none();
    hits->cut_count = 0;
    hits->kind = hits->reach = vf_set(0);
    hits->cells.part = hits->cells.index = vi_set(-1);
    for (int a = 0; a < 3; a++) hits->normal[a] = hits->colour[a] = vf_set(0);
}

/* A row holds each ray's own n-th crossing, whichever rays met their cells together: where fragments are cut depends
 * neither on the traversal nor on the other rays of the packet. */
SIMD_INLINE void kernel_hits_cut(kernel_hits *hits, vm hit, vf t)
{
    for (int n = 0; vm_any(hit); n++) {
        if (n == KERNEL_MAX_CUTS) {
            hits->crowded = vm_or(hits->crowded, hit);
            return;
        }
        if (n == hits->cut_count) hits->cut[hits->cut_count++] = vf_set(INFINITY);
        const vm room = vm_andnot(hit, vf_lt(hits->cut[n], vf_set(INFINITY)));
        hits->cut[n] = vf_select(room, t, hits->cut[n]);
        hit = vm_andnot(hit, room);
    }
}

#endif
