/* Processes small tets with one pixel-tet pair per lane, because most of a packet's rays would miss such a tet. Tets
 * are transformed SIMD_WIDTH at a time in any case (kernel_transformed_tets.h). The pixels of their bounding boxes are
 * listed, and their crossings computed by the operations of kernel_crossings.h, to the same bits (kernel_tets.h). */
#ifndef RENDER_KERNEL_SMALL_TETS_H
#define RENDER_KERNEL_SMALL_TETS_H

#include "kernel_local_queue.h"
#include "kernel_tets.h"
#include "kernel_tile_cells.h"
#include "kernel_tile_trace.h"
#include "simd.h"

/* Maximum number of pixels in the box of a tet that is processed in lanes. */
enum { KERNEL_TET_PIXELS = 48 };

_Static_assert(SIMD_WIDTH *(KERNEL_TET_PIXELS + 1) <= KERNEL_LIST_ROOM, "a vector of tets has room");

/* Lists the pixels of the given lanes' pending tets whose bounding boxes have at most `most` pixels; skips tets that
 * lie between pixels. Returns the lanes of the larger tets. */
static unsigned kernel_small_tets_list(const kernel_tile_trace *t, unsigned lanes, int most, kernel_local_lanes *l)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    vf places[3][8];
    unsigned others = 0;
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 4; i++) places[a][i] = cells->transformed.at[a][i];
    kernel_local_pixels(t, 4, (const vf(*)[8])places, l->ends);
    l->rays.count = 0;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = cells->tets.box[n];
        if (!kernel_local_clip_box(l->ends, n, &box)) continue;
        if (kernel_box_pixels(box) > most)
            others |= 1u << n;
        else
            kernel_pixel_list_add_box(&l->rays, box, n);
    }
    kernel_pixel_list_close(&l->rays);
    return others;
}

#endif
