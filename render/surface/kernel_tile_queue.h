/* Queues the cells that a tile's search has found until they are traced. Cells of a type that can be traced in lanes
 * are collected in a queue per type (kernel_surface_cells), until it holds SIMD_WIDTH cells, which are traced together
 * as a batch. Other cells are collected in a list, and are traced one by one by the packets of the blocks that they may
 * meet. */
#ifndef RENDER_KERNEL_TILE_QUEUE_H
#define RENDER_KERNEL_TILE_QUEUE_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_batch.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_curved_batch.h"
#include "kernel_surface.h"
#include "kernel_surface_cells.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Sorts the vertices of the tile's current cell, which is in tile space, and computes its edge functions and, if the
 * surface has a colour field, that field's values. */
SIMD_INLINE void kernel_tile_prepare_cell(kernel_tile_trace *t, int part)
{
    t->cell->part = part;
    kernel_cell_order(t->cell);
    kernel_cell_compute_lines(t->cell, t->frame, &t->tile);
    if (t->surface->layer->colour_map)
        kernel_read_colour_values(t->surface, part, t->cell->index, t->cell->vertices, t->cell->count, t->cell->g);
}

/* Traces one isovalue's surface (in a polyhedron those of all isovalues) in a candidate by the packets of the given
 * blocks. */
static void kernel_tile_process_candidate(kernel_tile_trace *t, const kernel_tile_candidate *candidate, int part,
                                          int value, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = t->cell;
    if (kernel_has_own_faces(grid_cell_type(g, candidate->cell))) {
        kernel_blocks_trace(t, blocks, part, candidate->cell, NULL, 0);
        return;
    }
    kernel_cell_fetch(c, g, &layer->field.fields[part], candidate->cell);
    kernel_cell_move_to_tile_space(c, t->frame, &t->tile, g);
    kernel_cell_subtract_isovalue(c, layer->values[value]);
    kernel_tile_prepare_cell(t, part);
    t->curved->is_ready = false;
    kernel_blocks_trace(t, blocks, part, c->index, c, value);
}

/* Makes the surface layer to which a candidate belongs the tile's current layer. source: kernel_candidate.source.
 * Stores the candidate's mesh part in *part, and returns the index of its isovalue in the layer. */
SIMD_INLINE int kernel_tile_set_source(kernel_tile_trace *t, uint32_t source, int *part)
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

/* Maximum number of cells in the list of those that are traced one by one. */
enum { KERNEL_ALONE = SIMD_WIDTH };

enum { KERNEL_SURFACE_QUEUES = KERNEL_LANE_TYPES + 1 };

/* A tile's cells that are queued for tracing, and the state of the tile's search for cells in trees
 * (kernel_tile_surface.h). A thread keeps the struct from tile to tile. */
typedef struct kernel_tile_search {
    int layer, part;      /* layer and mesh part of the cells that are being queued; -1: no cell has been queued yet */
    kernel_arrays arrays; /* arrays of the layer's field on the mesh part */
    /* one queue per type of cells that are read in lanes, and a queue of tets that are fetched one by one */
    kernel_surface_cells pending[KERNEL_SURFACE_QUEUES];
    kernel_batch batch;
    kernel_curved_batch curved_batch;
    /* candidates that are traced one by one, each alone in its vectors, and the number of these candidates */
    int alone_count;
    kernel_tile_candidate alone[KERNEL_ALONE];
    /* binned candidates whose cells' vertex indices are being prefetched */
    int prefetched_count;
    const kernel_tile_candidate *prefetched[SIMD_WIDTH];
    /* The following members are used by the search. */
    kernel_tile_trace *tile;
    kernel_candidate_list list; /* the cells that have been found and are not queued yet */
    kernel_candidate items[2 * SIMD_WIDTH];
    /* number of pixels per unit of slope or, if the camera is orthographic, per scaled unit */
    float column_scale, row_scale;
    float pad[2]; /* margins by which columns and rows are extended, in pixels */
} kernel_tile_search;

static void kernel_tile_queue_begin(kernel_tile_search *m)
{
    m->layer = m->part = -1;
    for (int i = 0; i < KERNEL_SURFACE_QUEUES; i++) {
        m->pending[i].type = i < KERNEL_LANE_TYPES ? kernel_lane_types[i] : GRID_TET;
        m->pending[i].is_fetched_singly = i == KERNEL_LANE_TYPES;
        m->pending[i].count = 0;
        m->pending[i].layer = m->pending[i].part = -1;
    }
    kernel_curved_batch_begin(&m->curved_batch);
    m->alone_count = m->prefetched_count = 0;
}

/* Sets the mesh part of the cells that are queued next; their layer is the current one. */
SIMD_INLINE void kernel_tile_queue_set_part(const kernel_tile_trace *t, kernel_tile_search *m, int part)
{
    if (m->layer == t->layer && m->part == part) return;
    m->layer = t->layer;
    m->part = part;
    kernel_arrays_begin(&m->arrays, t->frame->job->parts[part].cells, &t->surface->layer->field.fields[part]);
}

/* Returns whether a candidate of the current layer and part is queued for a batch of its type. Polyhedra never are. In
 * a mesh of mixed types a tile has few large wedges or pyramids of one type; these are traced one by one, because their
 * hits then hide other cells sooner. */
SIMD_INLINE bool kernel_is_traced_in_vectors(const kernel_tile_search *m, const kernel_tile_candidate *candidate,
                                             int type)
{
    if (!m->arrays.has_lanes || kernel_has_own_faces(type)) return false;
    return kernel_is_linear(type) || kernel_is_box(type) || m->arrays.type != GRID_NO_TYPE ||
           kernel_box_pixels(candidate->box) <= KERNEL_CURVED_PIXELS;
}

/* Traces the cells of one queue as a batch, and empties the queue. */
static void kernel_tile_queue_trace(kernel_tile_trace *t, kernel_tile_search *m, kernel_surface_cells *own)
{
    const int layer = t->layer;
    if (!own->count) return;
    kernel_tile_set_layer(t, own->layer);
    if (kernel_is_linear(own->type))
        kernel_batch_process(t, &m->batch, own);
    else
        kernel_curved_batch_process(t, &m->curved_batch, own);
    kernel_tile_set_layer(t, layer);
}

/* Adds a candidate to the queue of its type. If the queue is full, or its cells have another layer or part, its cells
 * are traced first. */
SIMD_INLINE void kernel_tile_queue_append(kernel_tile_trace *t, kernel_tile_search *m, kernel_surface_cells *own,
                                          const kernel_tile_candidate *candidate, int value)
{
    if (own->layer != m->layer || own->part != m->part) {
        kernel_tile_queue_trace(t, m, own);
        own->layer = m->layer;
        own->part = m->part;
        own->arrays = m->arrays;
    }
    if (own->count == SIMD_WIDTH) kernel_tile_queue_trace(t, m, own);
    kernel_surface_cells_add(t, own, candidate, value);
}

/* Traces the listed single cells one by one. All queued cells are traced first, because they were found earlier and
 * their hits may hide the single cells. */
static void kernel_tile_queue_trace_singly(kernel_tile_trace *t, kernel_tile_search *m)
{
    if (!m->alone_count) return;
    for (int i = 0; i < KERNEL_SURFACE_QUEUES; i++) kernel_tile_queue_trace(t, m, &m->pending[i]);
    for (int n = 0; n < m->alone_count; n++) {
        int part;
        const int value = kernel_tile_set_source(t, m->alone[n].source, &part);
        const unsigned blocks = kernel_candidate_blocks(t, &m->alone[n]);
        if (blocks) kernel_tile_process_candidate(t, &m->alone[n], part, value, blocks);
    }
    m->alone_count = 0;
}

/* Returns whether a candidate that is not read in lanes is a tet. */
SIMD_INLINE bool kernel_is_single_tet(const kernel_tile_search *m, const kernel_tile_candidate *candidate, int type)
{
    int64_t vertices[4];
    return kernel_has_own_faces(type) ? kernel_is_tet(m->arrays.cells, candidate->cell, vertices)
                                      : kernel_is_linear(type);
}

/* Adds a candidate of the current layer and the given part to the queue of its type or, if it cannot be traced in a
 * batch, to the list of single cells. value: index of the isovalue in the layer. */
SIMD_INLINE void kernel_tile_queue_add(kernel_tile_trace *t, kernel_tile_search *m,
                                       const kernel_tile_candidate *candidate, int part, int value)
{
    kernel_tile_queue_set_part(t, m, part);
    const int type = kernel_arrays_type(&m->arrays, candidate->cell);
    if (kernel_is_traced_in_vectors(m, candidate, type)) {
        kernel_tile_queue_append(t, m, &m->pending[kernel_lane_type_index(type)], candidate, value);
        return;
    }
    if (kernel_is_single_tet(m, candidate, type)) {
        kernel_tile_queue_append(t, m, &m->pending[KERNEL_LANE_TYPES], candidate, value);
        return;
    }
    if (m->alone_count == KERNEL_ALONE) kernel_tile_queue_trace_singly(t, m);
    m->alone[m->alone_count++] = *candidate;
}

/* Traces all cells that are still queued or listed. */
static void kernel_tile_queue_finish(kernel_tile_trace *t, kernel_tile_search *m)
{
    kernel_tile_queue_trace_singly(t, m);
    for (int i = 0; i < KERNEL_SURFACE_QUEUES; i++) kernel_tile_queue_trace(t, m, &m->pending[i]);
}

#endif
