/* Traces single cells that cannot be traced in lanes, by the packets of the blocks that they may meet: polyhedra, and
 * hexes, wedges and pyramids with an edge of length zero. */
#ifndef RENDER_KERNEL_SINGLE_CELLS_H
#define RENDER_KERNEL_SINGLE_CELLS_H

#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_polyhedron_surface.h"
#include "kernel_surface.h"
#include "kernel_tile_trace.h"

/* Traces a cell with the rays of each of the given blocks (squares of 4 × 4 pixels). If `cell` is not NULL, it and
 * `curved` hold a hex, wedge or pyramid in tile space, in which the surface of the isovalue with the index `value` is
 * traced. If it is NULL, the cell is the polyhedron with this part and index, in which the surfaces of all of the
 * layer's isovalues are traced. */
static __attribute__((noinline)) void kernel_trace_cell_in_blocks(kernel_tile_trace *t, unsigned blocks, int part,
                                                                  uint32_t index, const kernel_cell *cell,
                                                                  const kernel_curved *curved, int value)
{
    for (; blocks; blocks &= blocks - 1) {
        const int block = __builtin_ctz(blocks);
        bool is_nearer = false;
        kernel_block_set_up_packets(t, block);
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            kernel_packet *p = &t->packets[block * KERNEL_BLOCK_PACKETS + n];
            p->is_nearer = false;
            if (cell)
                kernel_curved_trace_isovalue(p, t->surface, cell, curved, value, p->active);
            else
                kernel_polyhedron_trace_layer(p, t->surface, part, index, p->active);
            is_nearer = is_nearer || p->is_nearer;
        }
        if (is_nearer) kernel_block_update_far(t, block);
    }
}

#endif
