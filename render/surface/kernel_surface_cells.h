/* A queue of cells of one type, surface layer and mesh part, one cell per lane. When SIMD_WIDTH cells are queued, the
 * layer's surface is traced in all of them together (kernel_batch.h, kernel_curved_batch.h). */
#ifndef RENDER_KERNEL_SURFACE_CELLS_H
#define RENDER_KERNEL_SURFACE_CELLS_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell_values.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "simd.h"

typedef struct kernel_surface_cells {
    int type, count; /* type of the cells; number of queued cells */
    int layer, part; /* layer and mesh part of the queued cells; -1: no cell has been queued yet */
    /* the arrays from which the vertices' coordinates and values are read: those of the mesh part and of the layer's
     * field or, if the part's indices do not fit in 32 bits, those in `copied` */
    kernel_arrays arrays;
    uint32_t cell[SIMD_WIDTH]; /* index of the cell in the mesh part */
    /* copies of the members of kernel_tile_candidate: mask of the tile's blocks and box of the tile's pixels in which
     * the cell may be visible, and the cell's least depth */
    uint16_t blocks[SIMD_WIDTH], box[SIMD_WIDTH];
    float near[SIMD_WIDTH];
    int value[SIMD_WIDTH]; /* index of the isovalue in the layer */
    /* distance from hits in the cell to the samples of central differences (kernel_difference_sample_distance()); set
     * only if normals come from differences */
    float reach[SIMD_WIDTH];
    double isovalue[SIMD_WIDTH];
    /* by vertex and lane: index of the vertex in `arrays` (kernel_surface_cells_get_mesh_index()) */
    int32_t vertex[8][SIMD_WIDTH];
    /* The following members are used only if the mesh part's indices do not fit in 32 bits. index: indices of the
     * vertices in the mesh part, by vertex and lane; copied: their three coordinates and their values. */
    int64_t index[8 * SIMD_WIDTH];
    double copied[4][8 * SIMD_WIDTH];
} kernel_surface_cells;

/* Sets the layer and the mesh part of the cells that are queued next; the queue must be empty. If the part's indices do
 * not fit in 32 bits, own->arrays refers to the copies in own->copied instead of to the part's arrays. */
static inline void kernel_surface_cells_set_part(kernel_surface_cells *own, int layer, int part,
                                                 const kernel_arrays *arrays)
{
    own->layer = layer;
    own->part = part;
    own->arrays = *arrays;
    for (int n = 0; !arrays->has_lanes && n < 4; n++) {
        const grid_array copy = {.data = (const char *)own->copied[n], .stride = sizeof(double), .is_wide = true};
        *(n < 3 ? &own->arrays.coordinates[n] : &own->arrays.values) =
            kernel_numbers_describe_array(&copy, 8 * SIMD_WIDTH);
    }
}

/* Returns the index in the mesh part of the vertex that has the index `vertex` in own->arrays. */
SIMD_INLINE int64_t kernel_surface_cells_get_mesh_index(const kernel_surface_cells *own, int32_t vertex)
{
    return own->arrays.has_lanes ? vertex : own->index[vertex];
}

/* Sets the vertices of the cell in lane n, given by their indices in the mesh part, and prefetches their coordinates
 * and values. */
static __attribute__((noinline)) void kernel_surface_cells_set_vertices(kernel_surface_cells *own, int n,
                                                                        const int64_t *vertices)
{
    for (int i = 0; i < grid_type_vertex_count(own->type); i++) {
        const int at = i * SIMD_WIDTH + n;
        own->vertex[i][n] = own->arrays.has_lanes ? (int32_t)vertices[i] : at;
        own->index[at] = vertices[i];
        for (int k = 0; k < 4; k++)
            __builtin_prefetch(own->arrays.prefetched[k].data + vertices[i] * own->arrays.prefetched[k].stride);
    }
}

/* Adds a cell that the current layer's surface crosses to the queue, which must not be full. value: index of the
 * isovalue in the layer; vertices: indices of the cell's vertices in the mesh part, or NULL if they are to be read from
 * own->arrays. */
SIMD_INLINE void kernel_surface_cells_add(const kernel_tile_trace *t, kernel_surface_cells *own,
                                          const kernel_tile_candidate *candidate, int value, const int64_t *vertices)
{
    const int n = own->count++;
    own->cell[n] = candidate->cell;
    own->blocks[n] = candidate->blocks;
    own->box[n] = candidate->box;
    own->near[n] = candidate->near;
    own->value[n] = value;
    own->isovalue[n] = t->surface->layer->values[value];
    if (__builtin_expect(vertices != NULL, 0))
        kernel_surface_cells_set_vertices(own, n, vertices);
    else
        kernel_arrays_read_indices_of_any_type(&own->arrays, candidate->cell, grid_type_vertex_count(own->type),
                                               own->vertex[0] + n, SIMD_WIDTH);
}

/* Copies the coordinates and values of the queued cells' vertices to own->copied; used if the mesh part's indices do
 * not fit in 32 bits. */
static __attribute__((noinline)) void kernel_surface_cells_copy_vertices(const kernel_tile_trace *t,
                                                                         kernel_surface_cells *own)
{
    const grid_field *field = &t->surface->layer->field.fields[own->part];
    for (int i = 0; i < grid_type_vertex_count(own->type); i++)
        for (int at = i * SIMD_WIDTH; at < i * SIMD_WIDTH + own->count; at++) {
            double world[3];
            grid_read_vertex_position(own->arrays.cells, own->index[at], world);
            for (int a = 0; a < 3; a++) own->copied[a][at] = world[a];
            own->copied[3][at] = grid_field_value(field, own->index[at]);
        }
}

/* Reads the colour field at the vertices of the cells, in the domain of its transfer function. vertex: indices of the
 * vertices in the queue's arrays, by vertex and lane; out: the values, by vertex and lane. */
static __attribute__((noinline)) void kernel_surface_cells_read_colours(const kernel_surface *s,
                                                                        const kernel_surface_cells *own,
                                                                        const int32_t (*vertex)[SIMD_WIDTH],
                                                                        float (*out)[SIMD_WIDTH])
{
    const int count = grid_type_vertex_count(own->type);
    for (int n = 0; n < own->count; n++) {
        int64_t vertices[8];
        float values[8];
        for (int i = 0; i < count; i++) vertices[i] = kernel_surface_cells_get_mesh_index(own, vertex[i][n]);
        kernel_read_colour_values(s, own->part, own->cell[n], vertices, count, values);
        for (int i = 0; i < count; i++) out[i][n] = values[i];
    }
}

/* Returns the blocks in which the cell in lane n may be visible: traced blocks that it may meet, with a ray that has no
 * nearer hit. */
SIMD_INLINE unsigned kernel_surface_cells_visible_blocks(const kernel_tile_trace *t, const kernel_surface_cells *own,
                                                         int n)
{
    return own->blocks[n] & t->traced_blocks & kernel_blocks_not_hidden_at(t, own->near[n]);
}

/* Completes the queue before its cells are transformed: copies coordinates and values if the mesh part's indices do not
 * fit in 32 bits, and fills the unused lanes with the vertices and the isovalue of the first cell, so that all lanes
 * can be transformed. */
SIMD_INLINE void kernel_surface_cells_fill_lanes(const kernel_tile_trace *t, kernel_surface_cells *own)
{
    if (__builtin_expect(!own->arrays.has_lanes, 0)) kernel_surface_cells_copy_vertices(t, own);
    for (int n = own->count; n < SIMD_WIDTH; n++) {
        for (int i = 0; i < 8; i++) own->vertex[i][n] = own->vertex[i][0];
        own->isovalue[n] = own->isovalue[0];
    }
}

#endif
