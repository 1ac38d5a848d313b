/* A queue of cells of one type, surface layer and mesh part, one cell per lane. When SIMD_WIDTH cells are queued, the
 * layer's surface is traced in all of them together (kernel_batch.h, kernel_curved_batch.h). */
#ifndef RENDER_KERNEL_SURFACE_CELLS_H
#define RENDER_KERNEL_SURFACE_CELLS_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

typedef struct kernel_surface_cells {
    int type, count;      /* type of the cells; number of queued cells */
    int layer, part;      /* layer and mesh part of the queued cells; -1: no cell has been queued yet */
    kernel_arrays arrays; /* arrays of the layer's field on the mesh part */
    /* Set for tets that the batch reads by kernel_cell_fetch(): polyhedra that are tets, and tets whose vertex indices
     * do not fit in 32 bits. `vertex` is then not set. */
    bool is_fetched_singly;
    uint32_t cell[SIMD_WIDTH]; /* index of the cell in the mesh part */
    /* copies of the members of kernel_tile_candidate: the blocks and the box of pixels that the cell may meet, and its
     * least depth */
    uint16_t blocks[SIMD_WIDTH], box[SIMD_WIDTH];
    float near[SIMD_WIDTH];
    int value[SIMD_WIDTH]; /* index of the isovalue in the layer */
    /* reach of hits in the cell (kernel_difference_sample_distance()); set only if normals come from differences */
    float reach[SIMD_WIDTH];
    double isovalue[SIMD_WIDTH];
    int32_t vertex[8][SIMD_WIDTH]; /* indices of the vertices in the mesh part, by vertex and lane */
} kernel_surface_cells;

/* Adds a cell that the current layer's surface crosses; the queue must not be full. value: index of the isovalue in the
 * layer. */
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
    if (own->is_fetched_singly) return;
    kernel_arrays_vertices_of_any(&own->arrays, candidate->cell, grid_type_vertices(own->type), own->vertex[0] + n,
                                  SIMD_WIDTH);
}

/* Fills the unused lanes with the vertices and the isovalue of the first cell, so that all lanes can be transformed. */
SIMD_INLINE void kernel_surface_cells_close(kernel_surface_cells *own)
{
    for (int n = own->count; n < SIMD_WIDTH; n++) {
        for (int i = 0; i < 8; i++) own->vertex[i][n] = own->vertex[i][0];
        own->isovalue[n] = own->isovalue[0];
    }
}

#endif
