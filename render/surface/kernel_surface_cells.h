/* A queue of cells of one type, layer and mesh part, in which the layer's surface is to be traced when SIMD_WIDTH cells
 * are queued. */
#ifndef RENDER_KERNEL_SURFACE_CELLS_H
#define RENDER_KERNEL_SURFACE_CELLS_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

typedef struct kernel_surface_cells {
    int type, count;
    int layer, part;      /* layer and mesh part of the queued cells; -1: there are none yet */
    kernel_arrays arrays; /* arrays of the layer's field on the mesh part */
    uint32_t cell[SIMD_WIDTH];
    /* copies of the members of kernel_tile_candidate */
    uint16_t blocks[SIMD_WIDTH], box[SIMD_WIDTH];
    float near[SIMD_WIDTH];
    int value[SIMD_WIDTH]; /* index of the isovalue in the layer */
    double isovalue[SIMD_WIDTH];
    int32_t vertex[8][SIMD_WIDTH];
} kernel_surface_cells;

/* Adds a cell that the current layer's surface crosses; the queue must not be full. */
SIMD_INLINE void kernel_surface_cells_add(const kernel_tile_trace *t, kernel_surface_cells *own,
                                          const kernel_tile_candidate *candidate, int value)
{
    const int n = own->count++;
    own->cell[n] = candidate->cell;
    own->blocks[n] = candidate->blocks;
    own->box[n] = candidate->box;
    own->near[n] = candidate->near;
    own->value[n] = value;
    own->isovalue[n] = t->surface->layer->values[value];
    kernel_arrays_vertices_of_any(&own->arrays, candidate->cell, grid_type_vertices(own->type), own->vertex[0] + n,
                                  SIMD_WIDTH);
}

/* Fills the unused lanes with copies of the first cell. */
SIMD_INLINE void kernel_surface_cells_close(kernel_surface_cells *own)
{
    for (int n = own->count; n < SIMD_WIDTH; n++) {
        for (int i = 0; i < 8; i++) own->vertex[i][n] = own->vertex[i][0];
        own->isovalue[n] = own->isovalue[0];
    }
}

#endif
