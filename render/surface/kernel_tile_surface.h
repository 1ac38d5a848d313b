/* Isosurfaces of a whole tile in one traversal: the tree is gone down once for all its blocks, with a mask of those
 * that a node may meet before what they already know to be nearer. A leaf's cells are fetched and placed once a tile,
 * narrowed down to the blocks that their surface may show in (kernel_outline.h), and given to these blocks' packets,
 * which are set up when the first cell comes to them. A tile without a surface costs its nodes alone. */
#ifndef RENDER_KERNEL_TILE_SURFACE_H
#define RENDER_KERNEL_TILE_SURFACE_H

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_outline.h"
#include "kernel_prefetch.h"
#include "kernel_surface.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
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

/* Returns the blocks in which the cell's surface may show. */
SIMD_INLINE unsigned kernel_tile_narrow(const kernel_tile_trace *t, const kernel_cell *c, unsigned blocks)
{
    kernel_outline outline;
    if (c->type != GRID_TET)
        kernel_vertex_outline(c, &outline);
    else if (!kernel_tet_outline(c, &outline))
        return 0;
    blocks = kernel_tile_keep(t, &outline, blocks);
    if (!blocks || c->type == GRID_TET) return blocks;
    return kernel_slab_outline(c, &outline) ? kernel_tile_keep(t, &outline, blocks) : 0;
}

/* Most cells are not ordered, for they turn out to lie beside the tile. */
SIMD_INLINE void kernel_tile_cell(kernel_tile_trace *t, int part, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    kernel_cell *c = t->cell;
    bool is_ordered = false;
    for (int value = 0; value < layer->value_count; value++) {
        if (!kernel_cell_straddles(c, layer->values[value])) continue;
        if (!c->is_placed) kernel_cell_move(c, t->frame, &t->tile, t->frame->job->parts[part].cells);
        kernel_cell_relative(c, layer->values[value]);
        t->poly->is_set_up = false;
        const unsigned left = kernel_tile_narrow(t, c, blocks);
        if (left && !is_ordered) {
            is_ordered = true;
            kernel_tile_ready(t, part);
        }
        kernel_blocks_meet(t, left, part, c->index, c, value);
    }
}

static void kernel_tile_leaf(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = t->cell;
    kernel_prefetch(g, &layer->field.fields[part], cells, count);
    for (int n = 0; n < count; n++) {
        kernel_cell_fetch(c, g, &layer->field.fields[part], cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_blocks_meet(t, blocks, part, cells[n], NULL, 0);
            continue;
        }
        if (c->is_finite) kernel_tile_cell(t, part, blocks);
    }
}

static void kernel_tile_parts(kernel_tile_trace *t, int unused, const uint32_t *parts, int count, unsigned blocks)
{
    const render_field *field = &t->surface->layer->field;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (field->ranges[part].low)
            kernel_tile_traverse(t, t->frame->job->parts[part].tree, &field->ranges[part], &t->surface->interest,
                                 blocks, part, kernel_tile_leaf);
    }
}

/* Traces the surface of all parts. Opaque hits stand in the packets afterwards. */
SIMD_INLINE void kernel_tile_surface(kernel_tile_trace *t)
{
    const render_job *job = t->frame->job;
    if (job->parent) {
        kernel_tile_traverse(t, job->parent, NULL, NULL, t->wanted, 0, kernel_tile_parts);
        return;
    }
    for (uint32_t part = 0; part < (uint32_t)job->part_count; part++) kernel_tile_parts(t, 0, &part, 1, t->wanted);
}

SIMD_INLINE void kernel_tile_surfaces(kernel_tile_trace *t)
{
    for (t->layer = 0; t->layer < t->frame->surface_count; t->layer++) {
        t->surface = &t->frame->surfaces[t->layer];
        kernel_tile_surface(t);
    }
}

#endif
