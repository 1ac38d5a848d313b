/* Queues the cells that a tile's search has found until they are traced. Tets, hexes, wedges and pyramids are collected
 * in a queue per type (kernel_surface_cells), until it holds SIMD_WIDTH cells, which are traced together as a batch.
 * Polyhedra are collected in a list, and are traced one by one by the packets of the blocks that they may meet. */
#ifndef RENDER_KERNEL_TILE_QUEUE_H
#define RENDER_KERNEL_TILE_QUEUE_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_batch.h"
#include "kernel_cell.h"
#include "kernel_curved_batch.h"
#include "kernel_single_cells.h"
#include "kernel_surface_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Makes the surface layer to which a candidate belongs the tile's current layer. source: kernel_candidate.source.
 * Stores the candidate's mesh part in *part, and returns the index of its isovalue in the layer. */
SIMD_INLINE int kernel_tile_set_layer_of_source(kernel_tile_trace *t, uint32_t source, int *part)
{
    *part = (int)(source / RENDER_MAX_ISOVALUES);
    kernel_tile_set_layer(t, t->frame->isovalue_surface[source % RENDER_MAX_ISOVALUES]);
    return t->frame->isovalue_number[source % RENDER_MAX_ISOVALUES];
}

/* Returns the blocks in which the candidate may be visible: traced blocks that it may meet, with a ray that has no
 * nearer hit. */
SIMD_INLINE unsigned kernel_candidate_blocks(const kernel_tile_trace *t, const kernel_tile_candidate *candidate)
{
    return candidate->blocks & t->traced_blocks & kernel_blocks_not_hidden_at(t, candidate->near);
}

/* maximum number of polyhedra in kernel_tile_search.polyhedra */
enum { KERNEL_POLYHEDRA = SIMD_WIDTH };

/* A tile's cells that are queued for tracing, and the state of the tile's search for cells in trees
 * (kernel_tile_surface.h). A thread keeps the struct from tile to tile. */
typedef struct kernel_tile_search {
    /* surface layer and mesh part of the cells that are queued next; -1: no cell has been queued yet */
    int layer, part;
    kernel_arrays arrays; /* coordinates, connectivity and field values of the mesh part `part` */
    kernel_surface_cells pending[KERNEL_LANE_TYPES]; /* one queue per type */
    kernel_batch batch;
    kernel_curved_batch curved_batch;
    int polyhedron_count; /* number of elements of `polyhedra` that are in use */
    kernel_tile_candidate polyhedra[KERNEL_POLYHEDRA];
    /* candidates from the tile's bin whose cells' vertex indices are being prefetched */
    int prefetched_count;
    const kernel_tile_candidate *prefetched[SIMD_WIDTH];
    /* The following members are used by the tile's search for cells in trees. */
    kernel_tile_trace *tile;
    kernel_candidate_list list; /* the cells that have been found and are not queued yet */
    kernel_candidate items[2 * SIMD_WIDTH];
    /* number of pixels per unit of slope or, if the camera is orthographic, per scaled unit */
    float column_scale, row_scale;
    float pad[2]; /* margins, in pixels, by which a node's box of pixels is extended: columns, rows */
} kernel_tile_search;

static void kernel_tile_queue_begin(kernel_tile_search *m)
{
    m->layer = m->part = -1;
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) {
        m->pending[i].type = kernel_lane_types[i];
        m->pending[i].count = 0;
        m->pending[i].layer = m->pending[i].part = -1;
    }
    kernel_curved_batch_begin(&m->curved_batch);
    m->polyhedron_count = m->prefetched_count = 0;
}

/* Sets the mesh part of the cells that are queued next; their layer is the current one. */
SIMD_INLINE void kernel_tile_queue_set_part(const kernel_tile_trace *t, kernel_tile_search *m, int part)
{
    if (m->layer == t->layer && m->part == part) return;
    m->layer = t->layer;
    m->part = part;
    kernel_arrays_begin(&m->arrays, t->frame->job->parts[part].cells, &t->surface->layer->field.fields[part]);
}

/* Traces the cells of one queue as a batch, and empties the queue. */
static void kernel_tile_queue_trace(kernel_tile_trace *t, kernel_tile_search *m, kernel_surface_cells *own)
{
    const int layer = t->layer;
    if (!own->count) return;
    kernel_tile_set_layer(t, own->layer);
    if (kernel_is_linear(own->type))
        kernel_batch_trace_queued_cells(t, &m->batch, own);
    else
        kernel_curved_batch_trace_queued_cells(t, &m->curved_batch, own);
    kernel_tile_set_layer(t, layer);
}

/* Adds a candidate to the queue of its type. If the queue is full, or its cells have another layer or part, its cells
 * are traced first. */
SIMD_INLINE void kernel_tile_queue_append(kernel_tile_trace *t, kernel_tile_search *m, kernel_surface_cells *own,
                                          const kernel_tile_candidate *candidate, int value, const int64_t *vertices)
{
    if (own->layer != m->layer || own->part != m->part) {
        kernel_tile_queue_trace(t, m, own);
        kernel_surface_cells_set_part(own, m->layer, m->part, &m->arrays);
    }
    if (own->count == SIMD_WIDTH) kernel_tile_queue_trace(t, m, own);
    kernel_surface_cells_add(t, own, candidate, value, vertices);
}

/* Traces the listed polyhedra one by one, in each the surfaces of all isovalues. All queued cells are traced first,
 * because they were found earlier and their hits may hide the polyhedra. */
static void kernel_tile_queue_trace_polyhedra(kernel_tile_trace *t, kernel_tile_search *m)
{
    if (!m->polyhedron_count) return;
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) kernel_tile_queue_trace(t, m, &m->pending[i]);
    for (int n = 0; n < m->polyhedron_count; n++) {
        int part;
        kernel_tile_set_layer_of_source(t, m->polyhedra[n].source, &part);
        kernel_trace_cell_in_blocks(t, kernel_candidate_blocks(t, &m->polyhedra[n]), part, m->polyhedra[n].cell, NULL,
                                    NULL, 0);
    }
    m->polyhedron_count = 0;
}

/* Adds a candidate of the current layer and the given part to the queue of its type or, if it is a polyhedron that is
 * not a tet, to the list of polyhedra. value: index of the isovalue in the layer. */
SIMD_INLINE void kernel_tile_queue_add(kernel_tile_trace *t, kernel_tile_search *m,
                                       const kernel_tile_candidate *candidate, int part, int value)
{
    const grid *g = t->frame->job->parts[part].cells;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    kernel_tile_queue_set_part(t, m, part);
    const int type = kernel_arrays_type(&m->arrays, candidate->cell);
    const bool is_polyhedron = kernel_has_own_faces(type);
    const bool is_tet = is_polyhedron ? kernel_is_tet(g, candidate->cell, vertices) : kernel_is_linear(type);
    if (is_polyhedron && !is_tet) {
        if (m->polyhedron_count == KERNEL_POLYHEDRA) kernel_tile_queue_trace_polyhedra(t, m);
        m->polyhedra[m->polyhedron_count++] = *candidate;
        return;
    }
    if (!is_polyhedron && !m->arrays.has_lanes) grid_cell_vertices(g, candidate->cell, vertices);
    kernel_tile_queue_append(t, m, &m->pending[kernel_lane_type_index(is_tet ? GRID_TET : type)], candidate, value,
                             is_polyhedron || !m->arrays.has_lanes ? vertices : NULL);
}

/* Traces all cells that are still queued or listed. */
static void kernel_tile_queue_finish(kernel_tile_trace *t, kernel_tile_search *m)
{
    kernel_tile_queue_trace_polyhedra(t, m);
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) kernel_tile_queue_trace(t, m, &m->pending[i]);
}

#endif
