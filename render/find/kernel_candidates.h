/* Finds the cells in which isosurfaces and volumes may be visible by one traversal per frame. The trees are traversed
 * once for the whole picture. Each cell that the surface crosses, or whose values are visible in the volume, is fetched
 * and transformed once, and the pixels in which it may be visible are computed. The cells are then binned by tile
 * (render_candidates.c; sort-middle in the terms of Molnar et al. 1994). Tiles trace them roughly front to back, and
 * skip blocks that have nearer hits (render_kernels.c, kernel_batch.h; for volumes kernel_tile_cells.h):
 *
 *     nodes --- ranges, picture's planes ---> cells --- surfaces' boxes ---> tiles --- nearest first ---> blocks
 *
 * Alternatively each tile traverses the trees (kernel_tile_surface.h). It then tests many of the nodes that its
 * neighbours test too, and transforms cells that mostly lie beside the tile. That is faster if most cells are hidden,
 * because it skips everything behind the hits. It is used for opaque surfaces with several cells per pixel, and for
 * frames in which too many cells are visible.
 *
 * A cell's pixels are the bounding box of the surface in it (kernel_candidate_surfaces.h), widened by a margin that is
 * larger than all rounding errors. Rays then test the cells themselves, so the picture is the same to the last bit for
 * any traversal. */
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

/* ---- cells of volumes; their pixels are those of the bounding box of their vertices ---- */

/* Reads one cell's positions and values from the mesh into s->cell. */
SIMD_INLINE void kernel_finder_fetch_cell(kernel_finder *s, uint32_t cell)
{
    kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part], cell);
}

/* Adds the cells whose values are visible in the volume to the candidates. All cells of the list have one type. */
static __attribute__((noinline)) void kernel_find_volumes(kernel_finder *s, const kernel_cells *c)
{
    kernel_view_bounds e = kernel_view_bounds_empty();
    vm fitting = vm_all_lanes();
    vf v[8] = {vf_set(0)};
    for (int i = 0; i < c->vertices; i++) {
        const vi vertex = kernel_cells_vertex(c, i);
        kernel_raw_numbers value;
        vf place[3], at[3];
        kernel_arrays_values(&s->arrays, vertex, c->cell, &value);
        v[i] = kernel_numbers_are_narrow(&s->arrays.values) ? value.narrow : kernel_halves_narrow(value.wide);
        fitting = vm_and(fitting, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        kernel_finder_positions(s, vertex, place);
        fitting = kernel_positions_fit_lanes(fitting, place);
        kernel_rotate_to_camera(s, place, at);
        kernel_view_bounds_add(s, &e, at, vm_all_lanes());
    }
    const vm shows = kernel_visible_values_overlap_cells(s->visible_values, v, c->vertices);
    const unsigned all = (1u << c->count) - 1;
    const unsigned good = kernel_arrays_drawn(&s->arrays, c->cell, all & vm_bits(vm_and(fitting, shows)));
    if (good) kernel_add_lanes(s, &e, good, c->cell, s->source);
    for (unsigned odd = all & ~vm_bits(fitting); odd; odd &= odd - 1) {
        kernel_finder_fetch_cell(s, c->cell[__builtin_ctz(odd)]);
        kernel_find_volume(s);
    }
}

/* ---- cells ---- */

/* Adds the pending cells that may be visible to the candidates. All pending cells in the list have one type. */
static void kernel_find_pending(kernel_finder *s, kernel_cells *c)
{
    if (!c->count) return;
    kernel_cells_fill(c);
    if (!s->surface)
        kernel_find_volumes(s, c);
    else if (kernel_is_linear(c->type))
        kernel_find_tets(s, c);
    else
        kernel_find_curved(s, c);
    c->count = 0;
}

/* ---- leaves ---- */

/* Tests one cell that cannot be processed in lanes, and adds it to the candidates if it is visible. */
static __attribute__((noinline)) void kernel_find_single_cell(kernel_finder *s, uint32_t cell)
{
    kernel_finder_fetch_cell(s, cell);
    if (kernel_has_own_faces(s->cell.type))
        kernel_find_polyhedron(s, cell);
    else if (!s->surface)
        kernel_find_volume(s);
    else
        for (int value = 0; value < s->surface->layer->value_count; value++) kernel_find_surface(s, &s->cell, value);
}

/* Moves the queued cells, whose connectivity has been prefetched, to the lists of pending cells, and prefetches their
 * vertices. A pending list that is full is processed first. */
static void kernel_find_queued(kernel_finder *s)
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
        if (c->count == SIMD_WIDTH) kernel_find_pending(s, c);
        c->cell[c->count] = cell;
        kernel_arrays_vertices_of_any(p, cell, c->vertices, c->vertex[0] + c->count, SIMD_WIDTH);
        c->count++;
    }
    s->queued_count = 0;
}

static void kernel_find_leaf(kernel_finder *s, const uint32_t *cells, int count)
{
    const grid *g = s->arrays.cells;
    const bool is_plain = !g->offsets.data && !g->cell_types && !g->lattice;
    const char *indices = g->connectivity.data;
    const int64_t stride = g->connectivity.stride * grid_type_vertices(g->cell_type);
    for (int n = 0; n < count; n++) {
        if (s->queued_count == SIMD_WIDTH) kernel_find_queued(s);
        s->queued[s->queued_count++] = cells[n];
        if (is_plain)
            __builtin_prefetch(indices + cells[n] * stride);
        else
            kernel_prefetch_indices(g, cells[n]);
    }
}

static void kernel_find_flush(kernel_finder *s)
{
    kernel_find_queued(s);
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) kernel_find_pending(s, &s->pending[i]);
    for (int i = 0; i < KERNEL_CURVED_TYPES; i++) kernel_find_crossed(s, &s->crossed[i]);
}

/* Number of nodes that are tested at a time, so that their prefetches overlap in time. */
enum { KERNEL_FRONT = 16, KERNEL_FRONT_ROOM = KERNEL_FRONT * MMBVH_MAX_DEPTH };

/* Returns whether the node may be visible in the picture. Sets *is_inside if it lies completely in the picture: then
 * its children need not be tested. */
SIMD_INLINE bool kernel_node_in_picture(const kernel_finder *s, const mmbvh *tree, int64_t node, bool *is_inside)
{
    if (*is_inside) return true;
    const kernel_placement placement = kernel_box_placement(&s->planes, tree, node);
    const unsigned outside =
        (placement.below & (1u | 1u << KERNEL_ROWS_LANE)) | (placement.above & (2u | 2u << KERNEL_ROWS_LANE));
    *is_inside = !outside && placement.near >= s->t_near;
    return placement.blocks && !(placement.far < s->t_near);
}

/* Selects the entries whose values are visible and whose boxes are in the picture, and returns their number. An entry
 * is 2 * node, plus 1 if the node lies completely in the picture. The test of values has no branch, because it rejects
 * about half of the entries unpredictably. */
SIMD_INLINE int kernel_front_choose(const kernel_finder *s, const mmbvh *tree, const mmbvh_ranges *ranges,
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

/* Traverses a subtree depth first, from the left, KERNEL_FRONT nodes at a time, and so roughly in the order of leaves
 * in memory. If the stack is almost full, it takes one node at a time, which needs no more space than the tree's
 * depth. */
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
        count = kernel_front_choose(s, tree, ranges, front, count);
        /* splits the nodes into leaves and the left children of inner nodes, and prefetches the leaves' cells and the
         * children's ranges of values */
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
            kernel_find_leaf(s, tree->cells + mmbvh_node_ref(tree, leaves[n]), mmbvh_node_count(tree, leaves[n]));
        while (child_count) {
            const int64_t left = children[--child_count];
            stack[top++] = left + 2;
            stack[top++] = left;
        }
    }
    kernel_find_flush(s);
}

#endif
