/* Isosurfaces by one traversal a frame: the trees are gone down once for the whole picture, and each cell that the
 * surface crosses, or that shows in the volume, is fetched and placed once, to find the pixels that it may show in; the
 * cells are then binned by tile (render_candidates.c; sort-middle, in the terms of Molnar et al. 1994), and tiles trace
 * them from the nearest on, blocks that know of something nearer left out (render_kernels.c, kernel_batch.h; of
 * the volume kernel_tile_cells.h):
 *
 *     nodes --- ranges, picture's planes ---> cells --- outlines' boxes ---> tiles --- nearest first ---> blocks
 *
 * A tile's own traversal (kernel_tile_surface.h) looks at the same nodes as its neighbours and places the same cells,
 * most of which lie beside it. It is better where surfaces hide more cells than they show, for it sees none of what is
 * behind them: frames go back to it where too many cells show.
 *
 * Boxes are of the outline projected (kernel_outline.h), widened by pads that are more than all rounding. Rays test
 * what boxes hold, so that the picture is that of any traversal, to the last bit. */
#ifndef RENDER_KERNEL_CANDIDATES_H
#define RENDER_KERNEL_CANDIDATES_H

#include "grid.h"
#include "kernel_active_cells.h"
#include "kernel_candidate_polys.h"
#include "kernel_candidate_tets.h"
#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_interest.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

/* Finds the candidates among the cells that wait for their vertices. */
static void kernel_find_pending(kernel_finder *s)
{
    if (s->writer)
        kernel_activate_pending(s);
    else if (!s->surface && (s->packed.is_hexes || s->packed.is_tets))
        kernel_find_packed_volume(s, s->packed.is_hexes ? 8 : 4);
    else if (s->packed.is_hexes)
        kernel_find_packed_hexes(s);
    else if (s->packed.is_tets)
        kernel_find_packed_tets(s);
    else
        kernel_find_any_tets(s);
}

/* ---- leaves ---- */

/* Makes the queued cells of a packed mesh pending, and prefetches their vertices. */
static void kernel_find_queued_packed(kernel_finder *s)
{
    const kernel_packed *p = &s->packed;
    const int count = p->is_hexes ? 8 : 4;
    for (int n = 0; n < s->queued_count; n++) {
        s->tets.cell[n] = s->queued[n];
        for (int i = 0; i < count; i++) {
            s->tets.packed[i][n] = kernel_packed_vertex(p, s->queued[n], count, i);
            kernel_packed_prefetch(p, s->tets.packed[i][n]);
        }
    }
    s->tets.count = s->queued_count;
    s->queued_count = 0;
}

/* Looks for cells whose connectivity has come. Tets become pending until their vertices come; others are looked for
 * now. */
static void kernel_find_queued(kernel_finder *s)
{
    if (s->packed.is_tets || s->packed.is_hexes) {
        kernel_find_queued_packed(s);
        return;
    }
    const grid *g = s->frame->job->parts[s->part].cells;
    const grid_field *field = &s->field->fields[s->part];
    if (!s->surface || g->cell_type != GRID_TET)
        for (int n = 0; n < s->queued_count; n++) kernel_prefetch_vertices(g, field, s->queued[n]);
    for (int n = 0; n < s->queued_count; n++) {
        const uint32_t cell = s->queued[n];
        if (s->surface && grid_cell_type(g, cell) == GRID_TET) {
            int64_t *vertices = s->tets.vertices[s->tets.count];
            s->tets.cell[s->tets.count++] = cell;
            grid_cell_vertices(g, cell, vertices);
            for (int i = 0; i < 4; i++) kernel_prefetch_vertex(g, field, vertices[i]);
            continue;
        }
        kernel_cell_fetch(&s->cell, g, field, cell);
        if (s->cell.type == GRID_POLYHEDRON)
            kernel_find_polyhedron(s, cell);
        else
            kernel_find_cell(s);
    }
    s->queued_count = 0;
}

static void kernel_find_leaf(kernel_finder *s, const uint32_t *cells, int count)
{
    const grid *g = s->frame->job->parts[s->part].cells;
    const int vertices = g->offsets.data ? 0 : grid_type_vertices(g->cell_type);
    for (int n = 0; n < count; n++) {
        if (s->queued_count == SIMD_WIDTH) {
            kernel_find_pending(s);
            kernel_find_queued(s);
        }
        s->queued[s->queued_count++] = cells[n];
        if (vertices) __builtin_prefetch(g->connectivity.data + (int64_t)cells[n] * vertices * g->connectivity.stride);
    }
}

static void kernel_find_rest(kernel_finder *s)
{
    kernel_find_pending(s);
    kernel_find_queued(s);
    kernel_find_pending(s);
    kernel_find_all_crossed(s);
}

/* A node is looked at beside others, each of which has what it needs on its way from memory while they wait. */
enum { KERNEL_FRONT = 16, KERNEL_FRONT_ROOM = KERNEL_FRONT * MMBVH_MAX_DEPTH };

/* Nodes, as 2 nodes + 1 where it lies in the picture. */
typedef struct kernel_front {
    int count;
    int64_t entries[KERNEL_FRONT];
} kernel_front;

/* Tells whether the node may show in the picture. Children of a node within the picture need not be tested. */
SIMD_INLINE bool kernel_node_in_picture(const kernel_finder *s, const mmbvh *tree, int64_t node, bool *is_inside)
{
    kernel_placement placement = {0};
    if (*is_inside) return true;
    const kernel_sides sides = kernel_box_sides(&s->planes, tree, node, &placement);
    const unsigned outside =
        (sides.below & (1u | 1u << KERNEL_ROWS_LANE)) | (sides.above & (2u | 2u << KERNEL_ROWS_LANE));
    *is_inside = !outside && placement.near >= s->t_near;
    return kernel_blocks_of(sides) && !(placement.far < s->t_near);
}

/* Chooses the entries whose values show and whose boxes are in view. Values decide about half of them, which no branch
 * predicts. */
SIMD_INLINE void kernel_front_choose(const kernel_finder *s, const mmbvh *tree, const mmbvh_ranges *ranges,
                                     kernel_front *front, const int64_t *entries, int count)
{
    int64_t candidates[KERNEL_FRONT];
    int left = 0;
    for (int n = 0; n < count; n++) {
        candidates[left] = entries[n];
        left += kernel_node_shows(s->interest, ranges, entries[n] >> 1);
    }
    front->count = 0;
    for (int n = 0; n < left; n++) {
        bool is_inside = candidates[n] & 1;
        if (kernel_node_in_picture(s, tree, candidates[n] >> 1, &is_inside))
            front->entries[front->count++] = candidates[n] | is_inside;
    }
}

/* Sorts out the leaves, whose cells are prefetched, and the inner nodes' left children, which are too. */
SIMD_INLINE void kernel_front_open(const mmbvh *tree, const mmbvh_ranges *ranges, const kernel_front *front,
                                   kernel_front *leaves, kernel_front *children)
{
    leaves->count = children->count = 0;
    for (int n = 0; n < front->count; n++) {
        const int64_t node = front->entries[n] >> 1, ref = mmbvh_node_ref(tree, node);
        const bool is_leaf = mmbvh_node_count(tree, node);
        const char *next = ranges->low + ref * ranges->stride;
        leaves->entries[leaves->count] = node;
        leaves->count += is_leaf;
        children->entries[children->count] = 2 * ref | (front->entries[n] & 1);
        children->count += !is_leaf;
        __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref) : next);
        __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref + MMBVH_MAX_LEAF) : next + ranges->stride);
    }
}

/* Depth first, from the left, KERNEL_FRONT nodes at once: about in the order in which leaves lie in memory. One node at
 * once needs no more room than the tree is deep. */
static void kernel_find_candidates(kernel_finder *s, int64_t root)
{
    const mmbvh *tree = s->frame->job->parts[s->part].tree;
    const mmbvh_ranges *ranges = &s->field->ranges[s->part];
    int64_t stack[KERNEL_FRONT_ROOM + 2 * KERNEL_FRONT];
    int top = 0;
    stack[top++] = 2 * root + (s->writer != NULL);
    while (top && !(s->writer ? s->writer->is_refused : s->list->is_full)) {
        kernel_front front, leaves, children;
        const int most = top < KERNEL_FRONT_ROOM - MMBVH_MAX_DEPTH ? KERNEL_FRONT : 1;
        const int count = top < most ? top : most;
        int64_t next[KERNEL_FRONT];
        for (int n = 0; n < count; n++) next[n] = stack[--top];
        kernel_front_choose(s, tree, ranges, &front, next, count);
        kernel_front_open(tree, ranges, &front, &leaves, &children);
        for (int n = 0; n < leaves.count; n++) {
            const int64_t leaf = leaves.entries[n];
            kernel_find_leaf(s, tree->cells + mmbvh_node_ref(tree, leaf), mmbvh_node_count(tree, leaf));
        }
        while (children.count) {
            const int64_t left = children.entries[--children.count];
            stack[top++] = left + 2;
            stack[top++] = left;
        }
    }
    kernel_find_rest(s);
}

/* Makes records of the subtree's active cells, if its mesh allows it. */
static void kernel_activate_subtree(kernel_finder *s, int64_t root)
{
    kernel_active_writer *k = s->writer;
    k->vertices = s->packed.is_hexes ? 8 : 4;
    k->is_refused = k->is_refused || !(s->packed.is_tets || s->packed.is_hexes);
    if (!k->is_refused) kernel_find_candidates(s, root);
}

/* Finds the candidates among count active records, from the first on. */
static void kernel_find_active(kernel_finder *s, int64_t first, int64_t count)
{
    const int vertices = s->packed.is_hexes ? 8 : 4;
    for (int64_t at = first, end = first + count; at < end && !s->list->is_full; at += SIMD_WIDTH) {
        s->tets.count = end - at < SIMD_WIDTH ? (int)(end - at) : SIMD_WIDTH;
        for (int n = 0; n < s->tets.count; n++) {
            s->tets.cell[n] = (uint32_t)(at + n);
            for (int i = 0; i < vertices; i++) s->tets.packed[i][n] = (int32_t)((at + n) * vertices + i);
        }
        kernel_find_pending(s);
    }
    kernel_find_all_crossed(s);
}

#endif
