/* Finds candidates: the cells in which isosurfaces and volumes may be visible. Once per frame, the trees are traversed
 * for the whole picture. Each cell that an isovalue crosses, or whose values are visible in the volume, is fetched and
 * transformed once, and the pixels in which it may be visible are computed. The candidates are then binned by tile:
 * each tile gets a list of its candidates, called a bin (render_candidates.c; sort-middle in the terms of Molnar et al.
 * 1994). Tiles trace them roughly front to back, and skip blocks that have nearer hits (render_kernels.c,
 * kernel_batch.h; for volumes kernel_tile_cells.h):
 *
 *     nodes --- ranges, picture's planes ---> cells --- surfaces' boxes ---> tiles --- nearest first ---> blocks
 *
 * Alternatively each tile traverses the trees (kernel_tile_surface.h). It then tests many of the nodes that its
 * neighbours test too, and transforms cells that mostly lie beside the tile. That is faster if most cells are hidden,
 * because it skips everything behind the hits. Tiles therefore traverse the trees themselves if opaque surfaces have
 * several cells per pixel, or if too many cells are visible in the frame.
 *
 * A cell's pixels are the bounding box of the surface in it (kernel_candidate_surfaces.h), widened by a margin that is
 * larger than all rounding errors. A candidate only selects pixels; whether a ray meets the surface is decided by
 * intersecting the cell. So the picture is bit-identical for any traversal. */
#ifndef RENDER_KERNEL_CANDIDATES_H
#define RENDER_KERNEL_CANDIDATES_H

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_candidate_surfaces.h"
#include "kernel_cell.h"
#include "kernel_finder.h"
#include "kernel_visible_values.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "mmbvh.h"
#include "simd.h"

/* ---- cells of volumes; each covers the pixels of the bounding box of its vertices ---- */

/* Reads one cell's positions and values from the mesh into s->cell. */
SIMD_INLINE void kernel_finder_fetch_cell(kernel_finder *s, uint32_t cell)
{
    kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part], cell);
}

/* Adds those cells of the list whose values are visible in the volume to the candidates. */
static __attribute__((noinline)) void kernel_find_volume_cells(kernel_finder *s, const kernel_cells *c)
{
    kernel_view_bounds e = kernel_view_bounds_empty();
    vm fitting = vm_all_lanes();
    vf v[8] = {vf_set(0)};
    for (int i = 0; i < c->vertices; i++) {
        const vi vertex = kernel_cells_load_vertex_indices(c, i);
        kernel_raw_numbers value;
        vf place[3], at[3];
        kernel_arrays_values(&s->arrays, vertex, c->cell, &value);
        v[i] = kernel_numbers_are_narrow(&s->arrays.values) ? value.narrow : kernel_halves_narrow(value.wide);
        fitting = vm_and(fitting, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        kernel_finder_read_vertex_positions(s, vertex, place);
        fitting = kernel_keep_lanes_in_float_range(fitting, place);
        kernel_rotate_to_camera(s, place, at);
        kernel_view_bounds_add(s, &e, at, vm_all_lanes());
    }
    const vm shows = kernel_visible_values_overlap_cells(s->visible_values, v, c->vertices);
    const unsigned all = (1u << c->count) - 1;
    const unsigned good = kernel_arrays_drawn_lanes(&s->arrays, c->cell, all & vm_bits(vm_and(fitting, shows)));
    if (good) kernel_add_candidates_of_lanes(s, &e, good, c->cell, s->source);
    for (unsigned odd = all & ~vm_bits(fitting); odd; odd &= odd - 1) {
        kernel_finder_fetch_cell(s, c->cell[__builtin_ctz(odd)]);
        kernel_add_cell_if_visible(s);
    }
}

/* ---- cells ---- */

/* Tests the cells of a list of s->pending, and empties the list. Cells that may be visible become candidates; hexes,
 * wedges and pyramids that an isovalue crosses are first added to the lists s->crossed. */
static void kernel_process_pending_cells(kernel_finder *s, kernel_cells *c)
{
    if (!c->count) return;
    kernel_cells_pad_lanes(c);
    if (!s->surface)
        kernel_find_volume_cells(s, c);
    else if (kernel_is_linear(c->type))
        kernel_find_tets(s, c);
    else
        kernel_find_crossed_curved_cells(s, c);
    c->count = 0;
}

/* ---- leaves ---- */

/* Tests one cell that cannot be processed in lanes, and adds it to the candidates if it may be visible. */
static __attribute__((noinline)) void kernel_find_single_cell(kernel_finder *s, uint32_t cell)
{
    kernel_finder_fetch_cell(s, cell);
    if (kernel_has_own_faces(s->cell.type))
        kernel_add_polyhedron_candidate(s, cell);
    else if (!s->surface)
        kernel_add_cell_if_visible(s);
    else
        for (int value = 0; value < s->surface->layer->value_count; value++)
            kernel_add_cell_if_crossed(s, &s->cell, value);
}

/* Moves the cells of s->queued, whose connectivity has been prefetched, to the lists s->pending, and prefetches their
 * vertices. A list that is full is processed first. */
static void kernel_process_queued_cells(kernel_finder *s)
{
    const kernel_arrays *p = &s->arrays;
    for (int n = 0; n < s->queued_count; n++) {
        const uint32_t cell = s->queued[n];
        const int type = kernel_arrays_type(p, cell);
        if (kernel_has_own_faces(type) || !p->has_lanes) {
            kernel_find_single_cell(s, cell);
            continue;
        }
        kernel_cells *c = &s->pending[kernel_lane_type_index(type)];
        if (c->count == SIMD_WIDTH) kernel_process_pending_cells(s, c);
        c->cell[c->count] = cell;
        kernel_arrays_read_indices_of_any_type(p, cell, c->vertices, c->vertex[0] + c->count, SIMD_WIDTH);
        c->count++;
    }
    s->queued_count = 0;
}

static void kernel_queue_leaf_cells(kernel_finder *s, const uint32_t *cells, int count)
{
    const grid *g = s->arrays.cells;
    const bool is_plain = !g->offsets.data && !g->cell_types && !g->lattice;
    const char *indices = g->connectivity.data;
    const int64_t stride = g->connectivity.stride * grid_type_vertex_count(g->cell_type);
    for (int n = 0; n < count; n++) {
        if (s->queued_count == SIMD_WIDTH) kernel_process_queued_cells(s);
        s->queued[s->queued_count++] = cells[n];
        if (is_plain)
            __builtin_prefetch(indices + cells[n] * stride);
        else
            kernel_prefetch_indices(g, cells[n]);
    }
}

static void kernel_process_all_queued_cells(kernel_finder *s)
{
    kernel_process_queued_cells(s);
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) kernel_process_pending_cells(s, &s->pending[i]);
    for (int i = 0; i < KERNEL_CURVED_TYPES; i++) kernel_process_crossed_cells(s, &s->crossed[i]);
}

/* KERNEL_FRONT: number of nodes that are taken from the stack and tested together, so that the memory accesses of their
 * prefetches overlap. KERNEL_FRONT_ROOM: size of the stack, apart from a reserve of 2 * KERNEL_FRONT entries. */
enum { KERNEL_FRONT = 16, KERNEL_FRONT_ROOM = KERNEL_FRONT * MMBVH_MAX_DEPTH };

/* Returns whether the node's box may be visible in the picture. On entry, *is_inside states whether the parent's whole
 * box lies in the picture; then the node's box does too and need not be tested. On return, *is_inside states whether
 * the node's whole box lies in the picture. */
SIMD_INLINE bool kernel_node_in_picture(const kernel_finder *s, const mmbvh *tree, int64_t node, bool *is_inside)
{
    if (*is_inside) return true;
    const kernel_placement placement = kernel_box_placement(&s->planes, tree, node);
    const unsigned outside =
        (placement.below & (1u | 1u << KERNEL_ROWS_LANE)) | (placement.above & (2u | 2u << KERNEL_ROWS_LANE));
    *is_inside = !outside && placement.near >= s->t_near;
    return placement.blocks && !(placement.far < s->t_near);
}

/* Keeps those entries whose nodes have visible values and a box that may be visible in the picture, and returns their
 * number. An entry is 2 * node, plus 1 if the node's whole box lies in the picture. Values are tested without a branch,
 * because about half of the entries are rejected, which a processor could not predict. */
SIMD_INLINE int kernel_keep_visible_node_entries(const kernel_finder *s, const mmbvh *tree, const mmbvh_ranges *ranges,
                                                 int64_t entries[KERNEL_FRONT], int count)
{
    int left = 0, chosen = 0;
    for (int n = 0; n < count; n++) {
        const int64_t entry = entries[n];
        entries[left] = entry;
        left += kernel_node_is_visible(s->visible_values, ranges, entry >> 1);
    }
    for (int n = 0; n < left; n++) {
        const int64_t entry = entries[n];
        bool is_inside = entry & 1;
        if (kernel_node_in_picture(s, tree, entry >> 1, &is_inside)) entries[chosen++] = entry | is_inside;
    }
    return chosen;
}

/* Finds the candidates in a subtree. It is traversed depth first, left children first, with up to KERNEL_FRONT nodes
 * taken from the stack at a time, so that leaves are visited roughly in the order of memory. If the stack is almost
 * full, one node is taken at a time, which needs no more space than the tree's depth. */
static void kernel_find_candidates(kernel_finder *s, int64_t root)
{
    const mmbvh *tree = s->frame->job->parts[s->part].tree;
    const mmbvh_ranges *ranges = &s->field->ranges[s->part];
    int64_t stack[KERNEL_FRONT_ROOM + 2 * KERNEL_FRONT];
    int top = 0;
    stack[top++] = 2 * root;
    while (top && !s->list->is_full) {
        const int most = top < KERNEL_FRONT_ROOM - MMBVH_MAX_DEPTH ? KERNEL_FRONT : 1;
        int64_t front[KERNEL_FRONT], leaves[KERNEL_FRONT], children[KERNEL_FRONT];
        int count = top < most ? top : most, leaf_count = 0, child_count = 0;
        for (int n = 0; n < count; n++) front[n] = stack[--top];
        count = kernel_keep_visible_node_entries(s, tree, ranges, front, count);
        /* lists the leaves among the nodes, and the left children of the inner nodes; prefetches the leaves' cells and
         * the children's ranges of values */
        for (int n = 0; n < count; n++) {
            const int64_t node = front[n] >> 1, ref = mmbvh_node_ref(tree, node);
            const bool is_leaf = mmbvh_node_count(tree, node);
            const char *next = ranges->low + ref * ranges->stride;
            leaves[leaf_count] = node;
            leaf_count += is_leaf;
            children[child_count] = 2 * ref | (front[n] & 1);
            child_count += !is_leaf;
            __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref) : next);
            __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref + MMBVH_MAX_LEAF) : next + ranges->stride);
        }
        for (int n = 0; n < leaf_count; n++)
            kernel_queue_leaf_cells(s, tree->cells + mmbvh_node_ref(tree, leaves[n]),
                                    mmbvh_node_count(tree, leaves[n]));
        while (child_count) {
            const int64_t left = children[--child_count];
            stack[top++] = left + 2;
            stack[top++] = left;
        }
    }
    kernel_process_all_queued_cells(s);
}

#endif
