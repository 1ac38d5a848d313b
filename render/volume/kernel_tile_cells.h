/* Processes the cells of a volume in a whole tile and one window, an interval of depths. kernel_local_queue.h defines
 * the terms. Cells are queued by type; SIMD_WIDTH cells of a type are transformed at once and passed to the functions
 * that compute samples or segments (kernel_volume_method). Other cells are transformed one by one and, unless they are
 * tets, passed to the packets of the blocks that they may meet. If the trees have been traversed in advance for the
 * whole picture (kernel_candidates.h), the tile's cells are known: they are sorted by depth, and a window processes
 * those that overlap it. Otherwise the tile traverses the trees once per window.
 *
 *     cells, by where they begin   |--a--|  |---b---|    |-c-|
 *                                     |--d--|   |--e--|
 *     window                                |=========|          d, b and e; a has ended, c begins later */
#ifndef RENDER_KERNEL_TILE_CELLS_H
#define RENDER_KERNEL_TILE_CELLS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_bins.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_visible_values.h"
#include "kernel_local_queue.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_polyhedron.h"
#include "kernel_tet_blocks.h"
#include "kernel_transformed_tets.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "render_polyhedra.h"
#include "simd.h"

/* KERNEL_OPEN_PIECE: number of candidates that are processed between two prefetches; KERNEL_SORT_PIECE: the quicksort
 * of candidates sorts ranges of at most this length at once */
enum { KERNEL_OPEN_PIECE = 16, KERNEL_SORT_PIECE = 64 };

/* Callbacks by which a volume is sampled (kernel_tile_volume.h) or integrated (kernel_tile_segments.h) in its cells. */
typedef struct kernel_volume_method {
    /* set if the packets compute edge functions of hexes, wedges and pyramids from the edges' lines (affine functions
     * of the rays' parameters; kernel_packet.is_pencil); the lines must then be computed for each cell */
    bool is_pencil;
    /* Processes a cell with the rays of the packet with this index: the polyhedron c or, if c is NULL, the tile's
     * current cell (kernel_tile_cells.cell), a hex, wedge or pyramid. */
    void (*process_packet)(kernel_tile_trace *t, int packet, const polyhedron *c);
    /* Processes the current vector of tets, paired with rays by kernel_tet_pairs_next(). */
    void (*process_tets)(kernel_tile_trace *t);
    /* Transforms the current vector of cells of this type: hexes, wedges or pyramids. Returns a mask of the visible
     * ones. *lanes: mask of those that can be processed in lanes. */
    unsigned (*transform)(kernel_tile_trace *t, int type, unsigned *lanes);
    /* Processes the listed pixels of the current vector of cells, and empties the list. */
    void (*process_pixels)(kernel_tile_trace *t, int type);
    /* called after all pixels of a vector of cells have been listed and processed, and after a cell has been processed
     * by packets */
    void (*finish)(kernel_tile_trace *t, int type);
} kernel_volume_method;

/* Returns the mask of the tile's blocks that contain pixels of the box. The box is packed as in
 * kernel_tile_candidate.box. */
SIMD_INLINE unsigned kernel_get_blocks_of_pixel_box(unsigned box)
{
    const unsigned x0 = (box & 15) / KERNEL_BLOCK, x1 = (box >> 4 & 15) / KERNEL_BLOCK;
    const unsigned y0 = (box >> 8 & 15) / KERNEL_BLOCK, y1 = (box >> 12 & 15) / KERNEL_BLOCK;
    return kernel_mask_blocks_in_columns_and_rows((2u << x1) - (1u << x0), (2u << y1) - (1u << y0));
}

/* Returns the bounding box of the pixels of the blocks in the mask, packed as in kernel_tile_candidate.box. */
SIMD_INLINE unsigned kernel_get_pixel_box_of_blocks(unsigned blocks)
{
    int x0 = KERNEL_BLOCKS_ACROSS, x1 = 0, y0 = KERNEL_BLOCKS_ACROSS, y1 = 0;
    for (; blocks; blocks &= blocks - 1) {
        const int x = __builtin_ctz(blocks) % KERNEL_BLOCKS_ACROSS, y = __builtin_ctz(blocks) / KERNEL_BLOCKS_ACROSS;
        x0 = x < x0 ? x : x0;
        x1 = x > x1 ? x : x1;
        y0 = y < y0 ? y : y0;
        y1 = y > y1 ? y : y1;
    }
    return (unsigned)(x0 * KERNEL_BLOCK) | (unsigned)(x1 * KERNEL_BLOCK + KERNEL_BLOCK - 1) << 4 |
           (unsigned)(y0 * KERNEL_BLOCK) << 8 | (unsigned)(y1 * KERNEL_BLOCK + KERNEL_BLOCK - 1) << 12;
}

/* ---- SIMD_WIDTH tets at once ---- */

/* Converts the values at the tets' vertices to the transfer function's domain, and stores them as transformed->f. */
SIMD_INLINE void kernel_map_tet_values_to_domain(kernel_transformed_tets *transformed, const kernel_transfer *t)
{
    for (int half = 0; half < 2; half++)
        for (int i = 0; i < 4; i++) {
            const kernel_f64 f = (transformed->values[i][half] - t->low) * t->inverse_width;
            kernel_f64_store_half_of_vector(&transformed->f[i], half, kernel_f64_clamp(f, 1e18));
        }
}

/* Returns the lanes whose tets have finite and visible values and end behind the window's begin. near: least depth of
 * each tet. */
SIMD_INLINE unsigned kernel_find_visible_transformed_tets(const kernel_tile_trace *t,
                                                          const kernel_transformed_tets *transformed,
                                                          const kernel_visible_values *visible_values,
                                                          float near[SIMD_WIDTH])
{
    const vf *z = transformed->at[2];
    vf v[4], odd = vf_set(0);
    vm is_finite = vm_all_lanes();
    for (int i = 0; i < 4; i++) {
        for (int half = 0; half < 2; half++) {
            const kernel_f64 own = transformed->values[i][half];
            kernel_f64_store_half_of_vector(&odd, half, own - own);
            kernel_f64_store_half_of_vector(&v[i], half, kernel_f64_clamp(own, 3e38));
        }
        is_finite = vm_and(is_finite, vf_eq(odd, odd));
    }
    const vm shows = kernel_visible_values_overlap_cells(visible_values, v, 4);
    const vf front = vf_min(vf_min(z[0], z[1]), vf_min(z[2], z[3]));
    const vf back = vf_max(vf_max(z[0], z[1]), vf_max(z[2], z[3]));
    const vf pad = KERNEL_OUTLINE_PAD * vf_max(vf_abs(front), vf_abs(back));
    vf_store(near, front - pad);
    return vm_bits(vm_andnot(vm_and(is_finite, shows), vf_lt(back + pad, vf_set(t->t_near))));
}

/* Reads the values of tets whose field is constant per cell. */
static __attribute__((noinline, cold)) void kernel_read_cell_values_of_tets(kernel_transformed_tets *transformed,
                                                                            const kernel_arrays *arrays,
                                                                            const uint32_t cells[SIMD_WIDTH])
{
    vi cell;
    memcpy(&cell, cells, sizeof cell);
    kernel_numbers_gather(&arrays->values, cell, transformed->values[0]);
    for (int i = 1; i < 4; i++) memcpy(transformed->values[i], transformed->values[0], sizeof transformed->values[i]);
}

/* Transforms the first `count` tets of the queue. From each tet's mask of blocks, removes blocks whose rays all end in
 * front of the tet. Returns a mask of the lanes with a visible tet for which a block is left. */
SIMD_INLINE unsigned kernel_tile_transform_tets(kernel_tile_trace *t, kernel_tile_cells *cells, kernel_local_queue *q,
                                                int count)
{
    const kernel_arrays *arrays = &cells->arrays;
    const kernel_transfer *transfer = &t->frame->volumes[cells->volume];
    int32_t vertices[4][SIMD_WIDTH];
    float near[SIMD_WIDTH];
    unsigned lanes = 0;
    t->thread->volume_cells += count;
    kernel_local_read_indices(arrays, q, count, GRID_TET);
    for (int i = 0; i < 4; i++) memcpy(vertices[i], q->vertex[i], sizeof vertices[i]);
    for (int n = count; n < SIMD_WIDTH; n++) q->cell[n] = q->cell[0];
    kernel_transform_tets(&cells->tets, arrays, t->frame, &t->tile, vertices, count);
    if (arrays->is_by_cell) kernel_read_cell_values_of_tets(&cells->tets, arrays, q->cell);
    kernel_map_tet_values_to_domain(&cells->tets, transfer);
    unsigned candidates =
        kernel_find_visible_transformed_tets(t, &cells->tets, &transfer->visible_values, near) & ((1u << count) - 1);
    candidates = kernel_arrays_drawn_lanes(arrays, q->cell, candidates);
    for (; candidates; candidates &= candidates - 1) {
        const int n = __builtin_ctz(candidates);
        q->blocks[n] &= (uint16_t)kernel_blocks_not_hidden_at(t, near[n]);
        lanes |= (unsigned)(q->blocks[n] != 0) << n;
    }
    return lanes;
}

/* Maximum number of pixels in the box of a small tet. The pixels of small tets are listed, because a packet would leave
 * most lanes idle. Larger tets are traced by whole packets, which fill as many lanes as a list does, and store samples
 * by whole vectors. */
enum { KERNEL_TET_PIXELS = 32 };

_Static_assert(SIMD_WIDTH *(KERNEL_TET_PIXELS + 1) <= KERNEL_LIST_ROOM, "a vector of tets has room");

/* Pairs the transformed tets in the given lanes with rays. blocks, boxes: the blocks and the box of pixels in which
 * each tet may be visible, by lane. Skips tets that lie between the pixels' centres. */
static void kernel_tet_pairs_list_pairs(const kernel_tile_trace *t, unsigned lanes, const uint16_t *blocks,
                                        const uint16_t *boxes)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_tet_pairs *pairs = &cells->tet_pairs;
    vf places[3][8];
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 4; i++) places[a][i] = cells->tets.at[a][i];
    kernel_local_compute_pixel_bounds(t, 4, (const vf(*)[8])places, cells->pixel_ends);
    cells->rays.count = 0;
    pairs->next = 0;
    pairs->large = pairs->left = 0;
    pairs->packet = -1;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = boxes[n];
        if (!kernel_local_clip_box(cells->pixel_ends, n, &box)) continue;
        if (kernel_count_pixels_in_box(box) <= KERNEL_TET_PIXELS) {
            kernel_pixel_list_add_box(&cells->rays, box, n);
            continue;
        }
        pairs->blocks[n] = (uint16_t)(blocks[n] & kernel_get_blocks_of_pixel_box(box) &
                                      kernel_tet_blocks(&cells->block_rays, &cells->tets, n));
        if (pairs->blocks[n]) pairs->large |= 1u << n;
    }
    kernel_pixel_list_pad(&cells->rays);
}

/* Sets *out to the rays of the next vector of pairs. Returns false if there is none. */
SIMD_INLINE bool kernel_tet_pairs_next(const kernel_tile_trace *t, kernel_lane_rays *out)
{
    const kernel_pixel_list *listed = &t->thread->tile_cells->rays;
    kernel_tet_pairs *pairs = &t->thread->tile_cells->tet_pairs;
    if (pairs->next < listed->count) {
        kernel_lane_rays_begin(out, t, listed, pairs->next);
        pairs->next += SIMD_WIDTH;
        return true;
    }
    if (++pairs->packet % KERNEL_BLOCK_PACKETS == 0) {
        while (!pairs->left) {
            if (!pairs->large) return false;
            pairs->lane = __builtin_ctz(pairs->large);
            pairs->left = pairs->blocks[pairs->lane];
            pairs->large &= pairs->large - 1;
        }
        pairs->packet = __builtin_ctz(pairs->left) * KERNEL_BLOCK_PACKETS;
        pairs->left &= pairs->left - 1;
    }
    kernel_lane_rays_of_packet(out, t, pairs->packet, pairs->lane);
    return true;
}

/* Processes the queue's first SIMD_WIDTH tets. */
SIMD_INLINE void kernel_tile_process_tets(kernel_tile_trace *t, kernel_tile_cells *cells, kernel_local_queue *q)
{
    const int count = q->count < SIMD_WIDTH ? q->count : SIMD_WIDTH;
    const unsigned lanes = kernel_tile_transform_tets(t, cells, q, count);
    if (!lanes) return;
    kernel_tet_pairs_list_pairs(t, lanes, q->blocks, q->box);
    cells->method->process_tets(t);
}

/* Processes the tet in `cell`, which has been read and sorted but not queued, as the only one of a vector. blocks: the
 * blocks in which it may be visible. */
static __attribute__((noinline, cold)) void kernel_tile_process_single_tet(kernel_tile_trace *t,
                                                                           kernel_tile_cells *cells, unsigned blocks)
{
    const uint16_t own_blocks = (uint16_t)blocks, box = (uint16_t)kernel_get_pixel_box_of_blocks(blocks);
    kernel_transform_single_tet(&cells->tets, &cells->cell, t->frame, &t->tile);
    kernel_map_tet_values_to_domain(&cells->tets, &t->frame->volumes[cells->volume]);
    kernel_tet_pairs_list_pairs(t, 1, &own_blocks, &box);
    cells->method->process_tets(t);
}

/* ---- cells that are not queued ---- */

/* Transforms the cell that has been read into `cell`, and prepares it for the rays of the given blocks. Returns those
 * of the blocks in which it may be visible. */
static __attribute__((noinline)) unsigned kernel_tile_transform_cell(kernel_tile_trace *t, kernel_tile_cells *cells,
                                                                     const grid *g, unsigned blocks)
{
    const kernel_transfer *transfer = &t->frame->volumes[cells->volume];
    kernel_cell *c = &cells->cell;
    const float *const places[3] = {c->x, c->y, c->z};
    if (!c->is_finite || !kernel_cell_is_visible(c, transfer)) return 0;
    kernel_cell_move_to_tile_space(c, t->frame, &t->tile, g);
    const unsigned meets = kernel_tile_visible_blocks(t, places, c->count, blocks);
    if (!meets) return 0;
    kernel_cell_sort_vertices(c);
    kernel_cell_map_values_to_domain(c, transfer);
    if (kernel_is_linear(c->type)) return meets;
    if (cells->method->is_pencil) kernel_cell_compute_lines(c, t->frame, &t->tile);
    cells->cell_map = c->is_constant ? NULL : &cells->map;
    if (!c->is_constant) kernel_map_setup(&cells->map, c);
    return meets;
}

/* Reads and transforms the cell in the given lane of the current vector into cells->cell, from where packets of any
 * block process it. Does nothing if it is already there. Returns false if the cell is invisible. */
static __attribute__((noinline, cold)) bool kernel_tile_set_current_cell(kernel_tile_trace *t, int lane)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    const grid *g = cells->arrays.cells;
    if (cells->alone == lane) return true;
    cells->alone = -1;
    kernel_cell_fetch(&cells->cell, g, &t->frame->job->volumes[cells->volume].field.fields[cells->part],
                      cells->current->cell[lane]);
    if (!kernel_tile_transform_cell(t, cells, g, KERNEL_ALL_BLOCKS)) return false;
    cells->alone = lane;
    return true;
}

/* Returns the polyhedron with this part and index, in tile space and with its values in the transfer function's domain.
 * NULL if it is invisible or memory ran out. p: any packet of the tile. */
static polyhedron *kernel_polyhedron_prepare(kernel_packet *p, int volume, int part, uint32_t index)
{
    const kernel_transfer *t = &p->frame->volumes[volume];
    const grid_field *field = &p->frame->job->volumes[volume].field.fields[part];
    polyhedron *c = kernel_polyhedron_find(p, field, part, p->frame->surface_count + volume, index);
    if (!c || !kernel_values_are_visible(c->values, c->vertex_count, t)) return NULL;
    if (!c->is_transformed) {
        kernel_polyhedron_transform(c, p);
        for (int i = 0; i <= c->vertex_count; i++)
            c->f[i] = kernel_clamp((c->values[i] - t->low) * t->inverse_width, 1e18);
    }
    return c;
}

/* Processes the polyhedron c or, if c is NULL, the tile's current cell by the packets of the given blocks. */
static void kernel_tile_process_packets(kernel_tile_trace *t, const polyhedron *c, unsigned blocks)
{
    const kernel_volume_method *method = t->thread->tile_cells->method;
    for (; blocks; blocks &= blocks - 1) {
        const int first = __builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS;
        for (int i = first; i < first + KERNEL_BLOCK_PACKETS; i++) method->process_packet(t, i, c);
    }
    method->finish(t, GRID_NO_TYPE);
}

/* Reads a cell, transforms it, and processes it in the given blocks: by packets, unless it is a tet. */
static __attribute__((noinline)) void kernel_tile_process_cell(kernel_tile_trace *t, int part, uint32_t index,
                                                               unsigned blocks)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    const grid *g = t->frame->job->parts[part].cells;
    t->thread->volume_cells++;
    kernel_cell_fetch(&cells->cell, g, &t->frame->job->volumes[cells->volume].field.fields[part], index);
    /* the type of a polyhedron that is a tet is now GRID_TET (kernel_cell_fetch()) */
    if (kernel_has_own_faces(cells->cell.type)) {
        kernel_packet *p = &t->packets[__builtin_ctz(blocks) * KERNEL_BLOCK_PACKETS];
        const polyhedron *c = kernel_polyhedron_prepare(p, cells->volume, part, index);
        if (c) kernel_tile_process_packets(t, c, blocks);
        return;
    }
    blocks = kernel_tile_transform_cell(t, cells, g, blocks);
    if (!blocks) return;
    if (kernel_is_linear(cells->cell.type))
        kernel_tile_process_single_tet(t, cells, blocks);
    else
        kernel_tile_process_packets(t, NULL, blocks);
}

/* ---- SIMD_WIDTH hexes, wedges or pyramids at once ---- */

/* Processes the queue's first SIMD_WIDTH cells: lists the pixels in which each may be visible, and passes these to the
 * method. Cells that cannot be processed in lanes are processed by packets. */
SIMD_INLINE void kernel_tile_process_curved(kernel_tile_trace *t, kernel_tile_cells *cells, kernel_local_queue *q,
                                            int type)
{
    const kernel_volume_method *method = cells->method;
    unsigned transformed;
    const unsigned all = KERNEL_OF_TYPE(type, kernel_local_begin_vector, cells, q);
    const unsigned showing = method->transform(t, type, &transformed) & all;
    transformed &= all;
    t->thread->volume_cells += __builtin_popcount(all & ~(showing & ~transformed));
    cells->rays.count = 0;
    for (unsigned lanes = transformed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        unsigned box = q->box[n];
        if (!kernel_local_clip_box(cells->pixel_ends, n, &box)) continue;
        kernel_pixel_list_add_box(&cells->rays, box, n);
        if (cells->rays.count >= KERNEL_LIST_PIXELS) method->process_pixels(t, type);
    }
    method->process_pixels(t, type);
    method->finish(t, type);
    for (unsigned lanes = showing & ~transformed; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        kernel_tile_process_cell(t, cells->part, q->cell[n], q->blocks[n]);
    }
}

/* ---- queues ---- */

/* Processes the first SIMD_WIDTH cells of the queue with this index, and removes them. */
static __attribute__((noinline)) void kernel_tile_process_queue(kernel_tile_trace *t, int index)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_local_queue *q = &cells->queues[index];
    const int type = kernel_lane_types[index];
    if (kernel_is_linear(type))
        kernel_tile_process_tets(t, cells, q);
    else
        kernel_tile_process_curved(t, cells, q, type);
    kernel_local_queue_remove_vector(q);
}

/* Processes all queued cells. */
SIMD_INLINE void kernel_tile_process_queues(kernel_tile_trace *t)
{
    for (int i = 0; i < KERNEL_LANE_TYPES; i++)
        while (t->thread->tile_cells->queues[i].count) kernel_tile_process_queue(t, i);
}

/* Returns whether cells of this type in the mesh part are queued for processing in vectors. Polyhedra and cells with
 * vertex indices too large for lanes are processed one by one. */
SIMD_INLINE bool kernel_tile_can_queue_type(const kernel_tile_trace *t, int part, int type)
{
    const kernel_tile_cells *cells = t->thread->tile_cells;
    if (kernel_has_own_faces(type) || !kernel_arrays_have_small_indices(t->frame->job->parts[part].cells)) return false;
    return kernel_is_linear(type) || cells->has_curved_lanes;
}

/* Adds a cell to the queue of its type; if the queue is then full, its first SIMD_WIDTH cells are processed. Returns
 * false if the cell must be processed on its own. blocks: mask of the blocks in which it may be visible; box: its box
 * of pixels, packed as in kernel_tile_candidate. */
static __attribute__((noinline)) bool kernel_tile_enqueue(kernel_tile_trace *t, int part, uint32_t cell,
                                                          unsigned blocks, unsigned box)
{
    const int type = grid_cell_type(t->frame->job->parts[part].cells, cell);
    kernel_tile_cells *cells = t->thread->tile_cells;
    if (!kernel_tile_can_queue_type(t, part, type)) return false;
    if (part != cells->part) {
        kernel_tile_process_queues(t);
        kernel_tile_cells_set_part(t, cells, part);
    }
    const int index = kernel_lane_type_index(type);
    kernel_local_queue *q = &cells->queues[index];
    if (kernel_is_linear(type) ? kernel_local_push(&cells->arrays, q, cell, blocks, box, GRID_TET)
                               : KERNEL_OF_TYPE(type, kernel_local_push, &cells->arrays, q, cell, blocks, box))
        kernel_tile_process_queue(t, index);
    return true;
}

/* ---- cells found by traversing trees ---- */

/* Processes the cells of a tree's leaf, as a callback of the traversal (kernel_tile_visit): queues those that are
 * processed in vectors, and then processes the others one by one. */
static void kernel_process_volume_leaf(kernel_tile_trace *t, int part, const uint32_t *cells, int count,
                                       unsigned blocks)
{
    const grid *g = t->frame->job->parts[part].cells;
    const int volume = t->thread->tile_cells->volume;
    const unsigned box = kernel_get_pixel_box_of_blocks(blocks);
    uint32_t others[MMBVH_MAX_LEAF];
    int left = 0;
    for (int n = 0; n < count; n++) kernel_prefetch_indices(g, cells[n]);
    for (int n = 0; n < count; n++)
        if (!kernel_tile_enqueue(t, part, cells[n], blocks, box)) others[left++] = cells[n];
    kernel_prefetch(g, &t->frame->job->volumes[volume].field.fields[part], others, left);
    for (int n = 0; n < left; n++) kernel_tile_process_cell(t, part, others[n], blocks);
}

/* Traverses the trees of the given mesh parts, as a callback of the traversal of the tree over all parts
 * (kernel_tile_visit). Skips nodes whose values are invisible. */
static void kernel_traverse_trees_of_volume_parts(kernel_tile_trace *t, int unused, const uint32_t *parts, int count,
                                                  unsigned blocks)
{
    const int volume = t->thread->tile_cells->volume;
    const render_field *field = &t->frame->job->volumes[volume].field;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (field->ranges[part].low)
            kernel_tile_traverse(t, t->frame->job->parts[part].tree, &field->ranges[part],
                                 &t->frame->volumes[volume].visible_values, blocks, part, kernel_process_volume_leaf);
    }
}

/* Traverses the trees of all mesh parts, or the tree over the parts if there is one. */
SIMD_INLINE void kernel_traverse_volume_trees(kernel_tile_trace *t, unsigned blocks)
{
    const render_job *job = t->frame->job;
    if (job->parent)
        kernel_tile_traverse(t, job->parent, NULL, NULL, blocks, 0, kernel_traverse_trees_of_volume_parts);
    else
        for (uint32_t part = 0; part < (uint32_t)job->part_count; part++)
            kernel_traverse_trees_of_volume_parts(t, 0, &part, 1, blocks);
}

/* ---- cells found by a search over the whole picture (candidates) ---- */

/* Partitions the items by their least depth: no item before the returned index is farther than the others. There is at
 * least one item before the index and one from it on. */
static inline int kernel_partition_by_depth(kernel_tile_candidate *items, int count)
{
    const float a = items[0].near, b = items[count / 2].near, c = items[count - 1].near;
    const float least = a < b ? a : b, most = a < b ? b : a;
    const float pivot = c < least ? least : c < most ? c : most;
    int i = -1, j = count;
    for (;;) {
        do i++;
        while (items[i].near < pivot);
        do j--;
        while (pivot < items[j].near);
        if (i >= j) return j + 1 < count ? j + 1 : j;
        const kernel_tile_candidate moved = items[i];
        items[i] = items[j];
        items[j] = moved;
    }
}

/* Sorts the items by their least depth: by quicksort down to ranges of a few items, and these by insertion. The
 * function recurses only into the shorter range, so that the call stack stays small. */
static void kernel_order_by_depth(kernel_tile_candidate *items, int count)
{
    enum { PIECE = 8 };
    while (count > PIECE) {
        const int middle = kernel_partition_by_depth(items, count);
        const bool is_first = middle < count - middle;
        kernel_order_by_depth(is_first ? items : items + middle, is_first ? middle : count - middle);
        items += is_first ? middle : 0;
        count = is_first ? count - middle : middle;
    }
    for (int i = 1; i < count; i++) {
        const kernel_tile_candidate moved = items[i];
        int j = i;
        for (; j > 0 && moved.near < items[j - 1].near; j--) items[j] = items[j - 1];
        items[j] = moved;
    }
}

/* Continues the quicksort of the tile's candidates until at least one more item is sorted. */
static __attribute__((noinline)) void kernel_tile_cells_sort(kernel_tile_cells *cells)
{
    kernel_tile_candidate *items = cells->items + cells->sorted;
    int count = cells->ends[cells->end_count - 1] - cells->sorted;
    while (count > KERNEL_SORT_PIECE && cells->end_count < KERNEL_SORT_ENDS) {
        count = kernel_partition_by_depth(items, count);
        cells->ends[cells->end_count++] = cells->sorted + count;
    }
    kernel_order_by_depth(items, count);
    cells->sorted += count;
    cells->end_count--;
}

/* Begins a tile, before its first window. Returns false if the tile is known to have no cells. */
SIMD_INLINE bool kernel_tile_cells_begin(kernel_tile_trace *t, const kernel_volume_method *method,
                                         bool has_curved_lanes)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    cells->method = method;
    cells->has_curved_lanes = has_curved_lanes;
    if (!t->frame->volume_candidates) return true;
    cells->items = t->thread->volume_bin.items;
    cells->count = t->thread->volume_bin.count;
    cells->open_count = cells->next = cells->sorted = 0;
    cells->end_count = 1;
    cells->ends[0] = cells->count;
    if (cells->count) kernel_tile_cells_sort(cells);
    return cells->count > 0;
}

/* Moves the candidates that overlap the window, from t->t_near to the farthest end of the tile's rays, to the front of
 * the list, and sets open_count to their number. */
SIMD_INLINE void kernel_tile_cells_select_window(const kernel_tile_trace *t, kernel_tile_cells *cells)
{
    kernel_tile_candidate *items = cells->items;
    const float far = kernel_tile_far(t);
    int count = 0;
    for (int n = 0; n < cells->open_count; n++)
        if (!(items[n].far < t->t_near)) items[count++] = items[n];
    for (; cells->next < cells->count; cells->next++) {
        if (cells->next == cells->sorted) kernel_tile_cells_sort(cells);
        if (!(items[cells->next].near <= far)) break;
        if (!(items[cells->next].far < t->t_near)) items[count++] = items[cells->next];
    }
    cells->open_count = count;
}

/* Prefetches data of the window's candidates from index `first` on: the vertex indices of 2 * KERNEL_OPEN_PIECE cells,
 * and, among the first KERNEL_OPEN_PIECE of these, the vertices of the cells that are not queued; queues prefetch the
 * vertices of the others. */
SIMD_INLINE void kernel_tile_prefetch_window(const kernel_tile_trace *t, const kernel_tile_cells *cells, int first)
{
    const render_job *job = t->frame->job;
    for (int pass = 0; pass < 2; pass++) {
        const int end = first + (pass ? KERNEL_OPEN_PIECE : 2 * KERNEL_OPEN_PIECE);
        for (int n = first; n < end && n < cells->open_count; n++) {
            const kernel_tile_candidate *item = &cells->items[n];
            const grid *g = job->parts[item->source].cells;
            if (!pass)
                kernel_prefetch_indices(g, item->cell);
            else if (!kernel_tile_can_queue_type(t, (int)item->source, grid_cell_type(g, item->cell)))
                kernel_prefetch_vertices(g, &job->volumes[0].field.fields[item->source], item->cell);
        }
    }
}

/* Processes all candidates of the tile that overlap the window in one of the given blocks. */
SIMD_INLINE void kernel_process_volume_candidates(kernel_tile_trace *t, unsigned blocks)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_tile_cells_select_window(t, cells);
    for (int n = 0; n < cells->open_count; n++) {
        const kernel_tile_candidate *item = &cells->items[n];
        if (n % KERNEL_OPEN_PIECE == 0) kernel_tile_prefetch_window(t, cells, n);
        const unsigned met = item->blocks & blocks & kernel_blocks_not_hidden_at(t, item->near);
        if (met && !kernel_tile_enqueue(t, (int)item->source, item->cell, met, item->box))
            kernel_tile_process_cell(t, (int)item->source, item->cell, met);
    }
}

/* ---- one window (interval of depths) ---- */

/* Processes all cells of a volume that may overlap the window in one of the given blocks. */
static __attribute__((noinline)) void kernel_tile_process_window(kernel_tile_trace *t, int volume, unsigned blocks)
{
    kernel_tile_cells_begin_volume(t->thread->tile_cells, volume);
    if (t->frame->volume_candidates)
        kernel_process_volume_candidates(t, blocks);
    else
        kernel_traverse_volume_trees(t, blocks);
    kernel_tile_process_queues(t);
}

/* ---- preparation of a tile ---- */

/* Returns the blocks that the bounding box of at least one tree may meet, and the least and greatest depth of these
 * boxes. */
SIMD_INLINE kernel_placement kernel_tile_find_placement_of_trees(const kernel_tile_trace *t)
{
    const render_job *job = t->frame->job;
    kernel_placement all = {.near = INFINITY, .far = -INFINITY};
    for (int i = 0; i < job->part_count; i++) {
        if (!job->parts[i].tree->node_count) continue;
        const kernel_placement placement = kernel_box_placement(&t->tree_planes, job->parts[i].tree, 0);
        all.blocks |= placement.blocks & t->traced_blocks;
        all.near = fminf(all.near, placement.near);
        all.far = fmaxf(all.far, placement.far);
    }
    return all;
}

/* Sets up the packets of the given blocks for tracing volumes, and stores their indices in `packets`. Returns their
 * number. Also computes the rays of the tile's blocks, for which the tile's rays must be known. */
SIMD_INLINE int kernel_tile_volume_begin(kernel_tile_trace *t, unsigned blocks, int packets[KERNEL_TILE_PACKETS])
{
    int count = 0;
    for (; blocks; blocks &= blocks - 1) {
        const int block = __builtin_ctz(blocks);
        kernel_block_set_up_packets(t, block);
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            const int i = block * KERNEL_BLOCK_PACKETS + n;
            kernel_packet_set_samples(&t->packets[i]);
            if (t->frame->volume_intervals) kernel_packet_clip_volumes(&t->packets[i], t->clip_interval);
            packets[count++] = i;
        }
    }
    if (count) kernel_block_rays_begin(&t->thread->tile_cells->block_rays, t->frame, &t->tile);
    return count;
}

#endif
