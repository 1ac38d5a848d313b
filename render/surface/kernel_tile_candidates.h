/* A tile's share of an isosurface's cells as they were found and binned (kernel_candidates.h), traced from the nearest
 * on; blocks that know of something nearer are left out, and so in the end are the tile's farther cells. */
#ifndef RENDER_KERNEL_TILE_CANDIDATES_H
#define RENDER_KERNEL_TILE_CANDIDATES_H

#include "grid.h"
#include "kernel_batch.h"
#include "kernel_bins.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_hexes.h"
#include "kernel_packed.h"
#include "kernel_prefetch.h"
#include "kernel_surface.h"
#include "kernel_tile_surface.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* A tile's cells by depth, as far as it takes to leave out what is hidden: in so many bins of the tile's depth, in any
 * order within each. */
enum { KERNEL_DEPTHS = 32 };

typedef struct kernel_by_depth {
    kernel_tile_candidate *items;
    float low, scale;
    int first[KERNEL_DEPTHS]; /* of each bin's items, the nearest bin first; each knows the next, -1 is none */
} kernel_by_depth;

/* The bin of a depth: no smaller than that of anything nearer. */
SIMD_INLINE int kernel_depth_bin(const kernel_by_depth *q, float near)
{
    const float bin = (near - q->low) * q->scale;
    return bin > 0 ? bin < KERNEL_DEPTHS - 1 ? (int)bin : KERNEL_DEPTHS - 1 : 0;
}

static inline void kernel_sort_by_depth(kernel_by_depth *q, kernel_tile_candidate *items, int count)
{
    float low = items[0].near, high = low;
    for (int i = 1; i < count; i++) {
        low = items[i].near < low ? items[i].near : low;
        high = items[i].near > high ? items[i].near : high;
    }
    q->items = items;
    q->low = low;
    q->scale = high > low ? KERNEL_DEPTHS / (high - low) : 0;
    for (int bin = 0; bin < KERNEL_DEPTHS; bin++) q->first[bin] = -1;
    for (int i = count - 1; i >= 0; i--) {
        int *first = &q->first[kernel_depth_bin(q, items[i].near)];
        items[i].next = *first;
        *first = i;
    }
}

static void kernel_tile_meet(kernel_tile_trace *t, kernel_hexes *hexes, const kernel_packed *packed,
                             const kernel_tile_candidate *candidate, int part, int value, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = t->cell;
    if (packed->is_tets) {
        kernel_packed_cell(c, packed, t->frame, &t->tile, candidate->cell);
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
    if (c->type == GRID_HEX) kernel_poly_setup(t->frame, &t->tile, t->poly, layer, c, value);
    if (kernel_hexes_take(t, c)) {
        kernel_hexes_turn(t, hexes, packed, part);
        kernel_hexes_add(t, hexes, candidate, value);
        return;
    }
    kernel_blocks_meet(t, blocks, part, c->index, c, value);
}

/* Set the layer of the tile by the source; returns the isovalue's number in it. */
SIMD_INLINE int kernel_tile_source(kernel_tile_trace *t, uint32_t source, int *part)
{
    const kernel_isovalue *isovalue = &t->frame->isovalues[source % RENDER_MAX_ISOVALUES];
    *part = (int)(source / RENDER_MAX_ISOVALUES);
    kernel_tile_set_layer(t, isovalue->surface);
    return isovalue->value;
}

/* What comes first of a cell: its vertices' indices, or all of it, where it is kept. */
SIMD_INLINE void kernel_candidate_prefetch(const kernel_frame *f, const kernel_tile_candidate *candidate)
{
    const int part = (int)(candidate->source / RENDER_MAX_ISOVALUES);
    const kernel_active *active =
        kernel_active_of(f, f->isovalues[candidate->source % RENDER_MAX_ISOVALUES].surface, part);
    if (!active) {
        kernel_prefetch_indices(f->job->parts[part].cells, candidate->cell);
        return;
    }
    const float *record = active->records + (int64_t)candidate->cell * active->vertices * KERNEL_ACTIVE_FLOATS;
    for (int at = 0; at < active->vertices * KERNEL_ACTIVE_FLOATS; at += 16) __builtin_prefetch(record + at);
}

/* Cells whose vertices' indices are on their way from memory. */
typedef struct kernel_pending {
    int count;
    const kernel_tile_candidate *items[SIMD_WIDTH];
} kernel_pending;

SIMD_INLINE unsigned kernel_candidate_blocks(const kernel_tile_trace *t, const kernel_tile_candidate *candidate)
{
    return candidate->blocks & t->wanted & kernel_blocks_beyond(t, candidate->near);
}

/* Vertices of all that wait come from memory while those that came before are traced. */
static __attribute__((noinline)) void kernel_tile_meet_pending(kernel_tile_trace *t, kernel_batch *b, kernel_hexes *h,
                                                               kernel_pending *w)
{
    for (int n = 0; n < w->count; n++) {
        int part;
        kernel_tile_source(t, w->items[n]->source, &part);
        if (!b->count) kernel_batch_turn(t, b, part);
        const bool is_known = b->layer == t->layer && b->part == part;
        if (kernel_active_of(t->frame, t->layer, part)) continue;                        /* all of it was asked for */
        if (is_known && (b->takes_batches || kernel_hexes_fit(t, &b->packed))) continue; /* batches ask for theirs */
        kernel_prefetch_vertices(t->frame->job->parts[part].cells, &t->surface->layer->field.fields[part],
                                 w->items[n]->cell);
    }
    for (int n = 0; n < w->count; n++) {
        int part;
        const int value = kernel_tile_source(t, w->items[n]->source, &part);
        const unsigned blocks = kernel_candidate_blocks(t, w->items[n]);
        if (!blocks) continue;
        kernel_batch_turn(t, b, part);
        if (b->takes_batches) {
            kernel_batch_add(t, b, w->items[n], value);
        } else if (kernel_hexes_fit(t, &b->packed)) {
            kernel_hexes_turn(t, h, &b->packed, part);
            kernel_hexes_wait(t, h, w->items[n], value);
        } else {
            kernel_tile_meet(t, h, &b->packed, w->items[n], part, value, blocks);
        }
    }
    w->count = 0;
}

/* The tile's opaque surfaces, or the transparent ones, for which those must be known. */
static __attribute__((noinline)) void kernel_tile_trace_candidates(kernel_tile_trace *t, const kernel_by_depth *q,
                                                                   bool transparent)
{
    kernel_batch batch;
    kernel_hexes hexes;
    kernel_pending pending = {0};
    kernel_batch_begin(&batch);
    kernel_hexes_begin(&hexes);
    for (int bin = 0; bin < KERNEL_DEPTHS && bin <= kernel_depth_bin(q, kernel_tile_far(t)); bin++)
        for (int i = q->first[bin]; i >= 0; i = q->items[i].next) {
            const kernel_tile_candidate *candidate = &q->items[i];
            const uint32_t source = candidate->source;
            const bool is_transparent =
                t->frame->isovalues[source % RENDER_MAX_ISOVALUES].surface >= t->frame->opaque_count;
            if (is_transparent != transparent || !kernel_candidate_blocks(t, candidate)) continue;
            kernel_candidate_prefetch(t->frame, candidate);
            pending.items[pending.count++] = candidate;
            if (pending.count == SIMD_WIDTH) kernel_tile_meet_pending(t, &batch, &hexes, &pending);
        }
    kernel_tile_meet_pending(t, &batch, &hexes, &pending);
    kernel_batch_end(t, &batch);
    kernel_hexes_end(t, &hexes);
}

SIMD_INLINE void kernel_tile_surface_candidates(kernel_tile_trace *t)
{
    const kernel_frame *f = t->frame;
    kernel_tile_candidate *items;
    const int count = kernel_candidates_in_tile(f, t->tile.x0, t->tile.y0, &items);
    if (!count) return;
    kernel_by_depth by_depth;
    kernel_sort_by_depth(&by_depth, items, count);
    if (f->opaque_count) kernel_tile_trace_candidates(t, &by_depth, false);
    if (f->opaque_count < f->surface_count) kernel_tile_trace_candidates(t, &by_depth, true);
}

#endif
