/* Prefetches: the vertices of cells are asked of memory before they are read. */
#ifndef RENDER_KERNEL_PREFETCH_H
#define RENDER_KERNEL_PREFETCH_H

#include "grid.h"
#include "simd.h"

SIMD_INLINE void kernel_prefetch_vertex(const grid *g, const grid_field *field, int64_t v)
{
    __builtin_prefetch(field->values.data + v * field->values.stride);
    for (int a = 0; a < 3; a++) __builtin_prefetch(g->coordinates[a].data + v * g->coordinates[a].stride);
}

/* Prefetches a cell's indices where all cells have one type; elsewhere their place is not known beforehand. */
SIMD_INLINE void kernel_prefetch_indices(const grid *g, uint32_t cell)
{
    const int vertices = grid_type_vertices(g->cell_type);
    if (!g->offsets.data && vertices)
        __builtin_prefetch(g->connectivity.data + (int64_t)cell * vertices * g->connectivity.stride);
}

SIMD_INLINE void kernel_prefetch_vertices(const grid *g, const grid_field *field, uint32_t cell)
{
    const int vertices = g->offsets.data ? 0 : grid_type_vertices(g->cell_type);
    for (int i = 0; i < vertices; i++)
        kernel_prefetch_vertex(g, field, grid_array_index(&g->connectivity, (int64_t)cell * vertices + i));
}

/* All that the cells are made of is on its way from memory before the first of it is looked at. */
SIMD_INLINE void kernel_prefetch(const grid *g, const grid_field *field, const uint32_t *cells, int count)
{
    for (int n = 0; n < count; n++) kernel_prefetch_indices(g, cells[n]);
    for (int n = 0; n < count; n++) kernel_prefetch_vertices(g, field, cells[n]);
}

#endif
