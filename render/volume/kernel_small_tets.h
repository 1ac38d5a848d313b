/* Tets of a few pixels, a pixel and its tet a lane: packets would be asked for rays most of which lie beside the tet.
 * Tets are placed many at once in any case (kernel_placed.h); the pixels of their boxes are put side by side, and each
 * has its crossings, by kernel_crossings.h's operations, to the same bits (kernel_tet_rays.h). */
#ifndef RENDER_KERNEL_SMALL_TETS_H
#define RENDER_KERNEL_SMALL_TETS_H

#include "kernel_local_queue.h"
#include "kernel_tet_rays.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "simd.h"

/* No tet has more listed. */
enum { KERNEL_TET_PIXELS = 48 };

_Static_assert(SIMD_WIDTH *(KERNEL_TET_PIXELS + 1) <= KERNEL_LIST_ROOM, "a vector of tets has room");

/* Lists the pixels of those of the tile's pending tets in the given lanes whose boxes have no more than most, and
 * leaves out those that lie between pixels. Returns the others. */
static unsigned kernel_small_tets_list(const kernel_tile_trace *t, unsigned lanes, int most, kernel_local_lanes *l,
                                       kernel_pixel_list *rays)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    vf places[3][8];
    unsigned others = 0;
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 4; i++) places[a][i] = cells->placed.at[a][i];
    kernel_local_pixels(t, 4, (const vf(*)[8])places, l->ends);
    rays->count = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = cells->wait_box[n];
        if (!kernel_local_cut(l->ends, n, &box)) continue;
        if (kernel_box_pixels(box) > most)
            others |= 1u << n;
        else
            kernel_pixel_list_add_box(rays, box, n);
    }
    kernel_pixel_list_close(rays);
    return others;
}

#endif
