/* Prefetches cells' vertex indices, coordinates and values, so that they are in the cache when they are read. */
#ifndef RENDER_KERNEL_PREFETCH_H
#define RENDER_KERNEL_PREFETCH_H

#include "grid.h"
#include "kernel_arrays.h"
#include "simd.h"

/* Prefetches a cell's vertex indices and its type. To find the indices, it reads the cell's offset into the
 * connectivity array, which has not been prefetched, so that it may wait for memory. */
SIMD_INLINE void kernel_prefetch_indices(const grid *g, uint32_t cell)
{
    if (g->lattice) return;
    const int64_t first = kernel_arrays_find_connectivity_entry(g, cell, grid_type_vertex_count(g->cell_type));
    __builtin_prefetch(g->connectivity.data + first * g->connectivity.stride);
    if (g->cell_types) __builtin_prefetch(g->cell_types + cell * g->cell_types_stride);
}

/* Prefetches the coordinates and values of a cell's vertices; polyhedra are skipped. */
SIMD_INLINE void kernel_prefetch_vertices(const grid *g, const grid_field *field, uint32_t cell)
{
    const int vertices = grid_type_vertex_count(grid_cell_type(g, cell));
    const int64_t first = kernel_arrays_find_connectivity_entry(g, cell, vertices);
    for (int i = 0; i < vertices; i++) {
        const int64_t v =
            g->lattice ? first + g->lattice->corner_offsets[i] : grid_read_index(&g->connectivity, first + i);
        __builtin_prefetch(field->values.data + v * field->values.stride);
        for (int a = 0; a < 3 && g->coordinates[a].data; a++)
            __builtin_prefetch(g->coordinates[a].data + v * g->coordinates[a].stride);
    }
}

/* Prefetches all data of the given cells: first all indices, then all vertices. */
SIMD_INLINE void kernel_prefetch(const grid *g, const grid_field *field, const uint32_t *cells, int count)
{
    for (int n = 0; n < count; n++) kernel_prefetch_indices(g, cells[n]);
    for (int n = 0; n < count; n++) kernel_prefetch_vertices(g, field, cells[n]);
}

#endif
