/* A tile's cells on their way from where they are found to its rays: into batches of several, or each alone. Whoever
 * finds them, in the picture's bins or down the trees, from about the nearest on. */
#ifndef RENDER_KERNEL_TILE_QUEUE_H
#define RENDER_KERNEL_TILE_QUEUE_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_batch.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_polys.h"
#include "kernel_surface.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* Makes a placed cell with its values ready for blocks to meet it. */
SIMD_INLINE void kernel_tile_ready(kernel_tile_trace *t, int part)
{
    t->cell->part = part;
    kernel_cell_order(t->cell);
    kernel_cell_lines(t->cell, t->frame, &t->tile);
    if (t->surface->layer->colour_map) kernel_cell_colours(t->cell, t->surface, part);
}

static void kernel_tile_meet(kernel_tile_trace *t, const kernel_arrays *arrays, const kernel_tile_candidate *candidate,
                             int part, int value, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = t->cell;
    if (arrays->has_lanes && kernel_arrays_type(arrays, candidate->cell) == GRID_TET) {
        kernel_arrays_fetch(c, arrays, candidate->cell, 4);
        kernel_tet_place(c, t->frame, &t->tile);
    } else {
        kernel_cell_fetch(c, g, &layer->field.fields[part], candidate->cell);
        if (c->type == GRID_POLYHEDRON) {
            kernel_blocks_meet(t, blocks, part, candidate->cell, NULL, 0);
            return;
        }
        kernel_cell_move(c, t->frame, &t->tile, g);
    }
    kernel_cell_relative(c, layer->values[value]);
    kernel_tile_ready(t, part);
    t->poly->is_set_up = false;
    kernel_blocks_meet(t, blocks, part, c->index, c, value);
}

/* Sets the tile's layer by the source. Returns the isovalue's number in that layer. */
SIMD_INLINE int kernel_tile_source(kernel_tile_trace *t, uint32_t source, int *part)
{
    const kernel_isovalue *isovalue = &t->frame->isovalues[source % RENDER_MAX_ISOVALUES];
    *part = (int)(source / RENDER_MAX_ISOVALUES);
    kernel_tile_set_layer(t, isovalue->surface);
    return isovalue->value;
}

SIMD_INLINE unsigned kernel_candidate_blocks(const kernel_tile_trace *t, const kernel_tile_candidate *candidate)
{
    return candidate->blocks & t->wanted & kernel_blocks_beyond(t, candidate->near);
}

/* Is the cell, of the batch's layer and part, put into a batch of hexes, wedges or pyramids? Where types are mixed a
 * tile has few large wedges or pyramids of one type, and what is in front is known sooner if they are traced alone. */
SIMD_INLINE bool kernel_is_for_polys(const kernel_tile_trace *t, const kernel_batch *b,
                                     const kernel_tile_candidate *candidate, int type)
{
    if (type == GRID_TET || type == GRID_POLYHEDRON || !kernel_polys_fit(t, &b->arrays)) return false;
    return type == GRID_HEX || b->arrays.type != GRID_NO_TYPE ||
           kernel_box_pixels(candidate->box) <= KERNEL_POLY_PIXELS;
}

/* What a tile's cells go through from where they are found: batches of several, or, those that are for no batch, one by
 * one. */
enum { KERNEL_ALONE = SIMD_WIDTH };

typedef struct kernel_tile_queue {
    kernel_batch batch;
    kernel_polys polys;
    int alone_count;
    kernel_tile_candidate alone[KERNEL_ALONE];
} kernel_tile_queue;

static void kernel_tile_queue_begin(kernel_tile_queue *m)
{
    kernel_batch_begin(&m->batch);
    kernel_polys_begin(&m->polys);
    m->alone_count = 0;
}

/* Is it put into any batch? */
SIMD_INLINE bool kernel_is_for_batch(const kernel_tile_trace *t, const kernel_batch *b,
                                     const kernel_tile_candidate *candidate)
{
    const int type = kernel_arrays_type(&b->arrays, candidate->cell);
    return type == GRID_TET ? b->takes_batches : kernel_is_for_polys(t, b, candidate, type);
}

/* Traces the cells that are for no batch. What came before them in batches is traced first, for it may hide them. */
static void kernel_tile_queue_alone(kernel_tile_trace *t, kernel_tile_queue *m)
{
    if (!m->alone_count) return;
    kernel_batch_end(t, &m->batch);
    kernel_polys_end(t, &m->polys);
    for (int n = 0; n < m->alone_count; n++) {
        int part;
        const int value = kernel_tile_source(t, m->alone[n].source, &part);
        const unsigned blocks = kernel_candidate_blocks(t, &m->alone[n]);
        kernel_batch_turn(t, &m->batch, part);
        if (blocks) kernel_tile_meet(t, &m->batch.arrays, &m->alone[n], part, value, blocks);
    }
    m->alone_count = 0;
}

/* Takes a cell of the layer under way and the part. */
SIMD_INLINE void kernel_tile_queue_add(kernel_tile_trace *t, kernel_tile_queue *m,
                                       const kernel_tile_candidate *candidate, int part, int value)
{
    kernel_batch_turn(t, &m->batch, part);
    const int type = kernel_arrays_type(&m->batch.arrays, candidate->cell);
    if (type == GRID_TET && m->batch.takes_batches) {
        kernel_batch_add(t, &m->batch, candidate, value);
    } else if (kernel_is_for_polys(t, &m->batch, candidate, type)) {
        kernel_polys_turn(t, &m->polys, &m->batch.arrays, part);
        kernel_polys_wait(t, &m->polys, type, candidate, value);
    } else {
        if (m->alone_count == KERNEL_ALONE) kernel_tile_queue_alone(t, m);
        m->alone[m->alone_count++] = *candidate;
    }
}

/* Traces all that waits. */
static void kernel_tile_queue_end(kernel_tile_trace *t, kernel_tile_queue *m)
{
    kernel_tile_queue_alone(t, m);
    kernel_batch_end(t, &m->batch);
    kernel_polys_end(t, &m->polys);
}

#endif
