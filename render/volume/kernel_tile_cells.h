/* A volume's cells, for a whole tile and one window of depth: each is transformed once and passed to the packets of the
 * blocks that it may meet. If the whole picture has been traversed at once (kernel_candidates.h), the tile's cells are
 * known: they are sorted by depth, and a window processes those that overlap it. Else the tile traverses the trees once
 * per window.
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
#include "kernel_outline.h"
#include "kernel_packet.h"
#include "kernel_transformed_tets.h"
#include "kernel_prefetch.h"
#include "kernel_tile.h"
#include "kernel_tile_blocks.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

enum { KERNEL_OPEN_PIECE = 16, KERNEL_SORT_PIECE = 64, KERNEL_SORT_ENDS = 48 };

/* Callback that traces those of the given lanes' tets for which one ray-tet pair per lane is faster. Returns the
 * remaining lanes. */
typedef unsigned kernel_tile_trace_tets(kernel_tile_trace *t, unsigned lanes);

/* The cells of a volume in the tile. The first open_count items begin before the end of the last window and end behind
 * its begin; `next` is the first item that no window has reached. Only the first `sorted` items are sorted, because a
 * tile that soon becomes dark does not need the others. `ends` are the partition points of the quicksort, the nearest
 * one last: no item before such a point is farther than any item behind it. */
typedef struct kernel_tile_cells {
    kernel_tile_candidate *items;
    int count, open_count, next;
    int sorted, end_count, ends[KERNEL_SORT_ENDS];
    kernel_cell cell;     /* the cell that packets are tracing */
    kernel_map map;       /* inverse map of that cell */
    kernel_arrays arrays; /* arrays of the volume's field on the current mesh part */
    int plain_volume, plain_part;
    kernel_transformed_tets transformed;
    kernel_block_rays block_rays;
    kernel_local_queue tets; /* tets that are transformed SIMD_WIDTH at a time */
    /* callback that traces small tets in lanes; NULL if each tet is traced by packets */
    kernel_tile_trace_tets *trace_tets;
} kernel_tile_cells;

/* Transforms the cell that has been read, and prepares it for the rays of the blocks. Returns the blocks in which it
 * may be visible. is_pencil: the rays are the tile's own primary rays (kernel_packet.h). */
SIMD_INLINE unsigned kernel_tile_transform_cell(kernel_tile_trace *t, kernel_tile_cells *cells, const grid *g,
                                                const kernel_transfer *transfer, bool is_pencil, unsigned blocks)
{
    kernel_cell *c = &cells->cell;
    kernel_outline outline;
    if (!c->is_finite || !kernel_cell_is_visible(c, transfer)) return 0;
    kernel_cell_move_to_tile_space(c, t->frame, &t->tile, g);
    kernel_vertex_outline(c, &outline);
    const unsigned meets = kernel_tile_visible_blocks(t, &outline, blocks);
    if (!meets) return 0;
    kernel_cell_order(c);
    kernel_cell_domain(c, transfer);
    if (is_pencil || kernel_is_linear(c->type)) kernel_cell_lines(c, t->frame, &t->tile);
    if (kernel_is_linear(c->type)) return meets & kernel_tet_blocks(&cells->block_rays, c);
    if (!c->is_constant) kernel_map_setup(&cells->map, c);
    return meets;
}

/* Makes a cell of a batch the tile's current cell, which is traced on its own by the rays of all blocks. Does nothing
 * if it already is the current cell. cell: the cell's index; lane: its lane in the batch. Returns false if it is
 * invisible. *alone is the lane of the current cell, or -1. */
static __attribute__((noinline, cold)) bool kernel_tile_make_current(kernel_tile_trace *t, int volume, int part,
                                                                     uint32_t cell, bool is_pencil, int lane,
                                                                     int *alone)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    const grid *g = t->frame->job->parts[part].cells;
    if (*alone == lane) return true;
    *alone = -1;
    kernel_cell_fetch(&cells->cell, g, &t->frame->job->volumes[volume].field.fields[part], cell);
    if (!kernel_tile_transform_cell(t, cells, g, &t->frame->volumes[volume], is_pencil, KERNEL_ALL_BLOCKS))
        return false;
    *alone = lane;
    return true;
}

SIMD_INLINE void kernel_tile_process_cell(kernel_tile_trace *t, int volume, int part, uint32_t index, bool is_pencil,
                                          unsigned blocks, kernel_tile_trace_cell *take)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_cell *c = &cells->cell;
    const grid *g = t->frame->job->parts[part].cells;
    t->thread->volume_cells++;
    kernel_cell_fetch(c, g, &t->frame->job->volumes[volume].field.fields[part], index);
    if (kernel_has_own_faces(c->type)) {
        take(t, part, c, NULL, blocks);
        return;
    }
    blocks = kernel_tile_transform_cell(t, cells, g, &t->frame->volumes[volume], is_pencil, blocks);
    if (blocks) take(t, part, c, kernel_is_linear(c->type) || c->is_constant ? NULL : &cells->map, blocks);
}

enum { KERNEL_ALL_PIXELS = -1 };

/* Returns a box of pixels in the format of candidates (kernel_types.h): `box` itself, or the bounding box of the blocks
 * if box is KERNEL_ALL_PIXELS. */
SIMD_INLINE unsigned kernel_tile_box(unsigned blocks, int box)
{
    if (box >= 0) return (unsigned)box;
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

/* Converts the values to the domain of the transfer function. */
SIMD_INLINE void kernel_transformed_domain(kernel_transformed_tets *transformed, const kernel_transfer *t)
{
    for (int half = 0; half < 2; half++)
        for (int i = 0; i < 4; i++) {
            const kernel_f64 f = (transformed->values[i].half[half] - t->low) * t->inverse_width;
            kernel_f64_store_lanes(&transformed->f[i], half, kernel_f64_clamp(f, 1e18));
        }
}

/* Returns the lanes whose cells are visible and reach into the window; stores the least depth of each cell. */
SIMD_INLINE unsigned kernel_transformed_tets_visible(const kernel_tile_trace *t,
                                                     const kernel_transformed_tets *transformed,
                                                     const kernel_visible_values *visible_values,
                                                     float near[SIMD_WIDTH])
{
    const vf *z = transformed->at[2];
    vf v[4], odd = vf_set(0);
    vm is_finite = vm_all_lanes();
    for (int i = 0; i < 4; i++) {
        for (int half = 0; half < 2; half++) {
            const kernel_f64 own = transformed->values[i].half[half];
            kernel_f64_store_lanes(&odd, half, own - own);
            kernel_f64_store_lanes(&v[i], half, kernel_f64_clamp(own, 3e38));
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

/* Transforms the first `count` pending tets. Returns the lanes of those that are visible in a block in which some ray
 * has no nearer end. */
SIMD_INLINE unsigned kernel_tile_transform_pending(kernel_tile_trace *t, kernel_tile_cells *cells, int count)
{
    t->thread->volume_cells += count;
    const kernel_transfer *transfer = &t->frame->volumes[cells->plain_volume];
    int32_t vertices[4][SIMD_WIDTH];
    float near[SIMD_WIDTH];
    unsigned lanes = 0;
    kernel_local_read_indices(&cells->arrays, &cells->tets, count, GRID_TET);
    for (int i = 0; i < 4; i++) memcpy(vertices[i], cells->tets.vertex[i], sizeof vertices[i]);
    kernel_transform_tets(&cells->transformed, &cells->arrays, t->frame, &t->tile, vertices, count);
    kernel_transformed_domain(&cells->transformed, transfer);
    unsigned candidates =
        kernel_transformed_tets_visible(t, &cells->transformed, &transfer->visible_values, near) & ((1u << count) - 1);
    candidates = kernel_arrays_drawn(&cells->arrays, cells->tets.cell, candidates);
    for (; candidates; candidates &= candidates - 1) {
        const int n = __builtin_ctz(candidates);
        cells->tets.blocks[n] &= (uint16_t)kernel_blocks_beyond(t, near[n]);
        lanes |= (unsigned)(cells->tets.blocks[n] != 0) << n;
    }
    return lanes;
}

/* Transforms the first vector of pending tets, and passes them to trace_tets or, one by one, to take(). */
static __attribute__((noinline)) void kernel_tile_process_vector(kernel_tile_trace *t, kernel_tile_cells *cells,
                                                                 kernel_tile_trace_cell *take)
{
    const int count = cells->tets.count < SIMD_WIDTH ? cells->tets.count : SIMD_WIDTH;
    const bool is_double = t->frame->is_double;
    unsigned lanes = kernel_tile_transform_pending(t, cells, count);
    if (cells->trace_tets && lanes) lanes = cells->trace_tets(t, lanes);
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        kernel_transformed_tets_cell(&cells->transformed, n, &cells->cell);
        if (is_double) kernel_transformed_tets_double(&cells->transformed, n, &cells->cell);
        const unsigned blocks = cells->tets.blocks[n] & kernel_tet_blocks(&cells->block_rays, &cells->cell);
        cells->cell.index = cells->tets.cell[n];
        if (blocks) take(t, cells->plain_part, &cells->cell, NULL, blocks);
    }
    kernel_local_pop(&cells->tets);
}

SIMD_INLINE void kernel_tile_process_pending(kernel_tile_trace *t, kernel_tile_cells *cells,
                                             kernel_tile_trace_cell *take)
{
    while (cells->tets.count) kernel_tile_process_vector(t, cells, take);
}

/* Sets the volume and the mesh part of the tets that are queued from now on; queued tets of another part are processed
 * first. Returns whether the part's tets are processed in lanes. They are not if the field is constant per cell,
 * because nothing is interpolated then. */
SIMD_INLINE bool kernel_tile_set_tet_part(kernel_tile_trace *t, kernel_tile_cells *cells, int volume, int part,
                                          kernel_tile_trace_cell *take)
{
    if (part != cells->plain_part || volume != cells->plain_volume) {
        kernel_tile_process_pending(t, cells, take);
        kernel_arrays_begin(&cells->arrays, t->frame->job->parts[part].cells,
                            &t->frame->job->volumes[volume].field.fields[part]);
        cells->plain_volume = volume;
        cells->plain_part = part;
    }
    return cells->arrays.has_lanes && !cells->arrays.is_by_cell;
}

/* Queues a tet. If the queue is full, some tets are processed. box: its box of pixels (kernel_tile_box()). */
SIMD_INLINE void kernel_tile_enqueue_tet(kernel_tile_trace *t, kernel_tile_cells *cells, uint32_t cell, unsigned blocks,
                                         unsigned box, kernel_tile_trace_cell *take)
{
    if (kernel_local_push(&cells->arrays, &cells->tets, cell, blocks, box, GRID_TET))
        kernel_tile_process_vector(t, cells, take);
}

/* ---- cells found by traversing trees ---- */

/* Callbacks that process a volume's cells. */
typedef struct kernel_cell_visitor {
    bool is_pencil;
    kernel_tile_trace_cell *take;
    /* Queues a cell, if cells of its type are processed in lanes; otherwise returns false. box: the cell's pixels, in a
     * candidate's format, or KERNEL_ALL_PIXELS for all pixels of the blocks. */
    bool (*queue)(kernel_tile_trace *t, int part, uint32_t cell, unsigned blocks, int box);
} kernel_cell_visitor;

SIMD_INLINE void kernel_tile_process_leaf(kernel_tile_trace *t, const kernel_cell_visitor *visitor, int volume,
                                          int part, const uint32_t *cells, int count, unsigned blocks)
{
    const grid *g = t->frame->job->parts[part].cells;
    kernel_tile_cells *pending = t->thread->tile_cells;
    const bool waits = kernel_tile_set_tet_part(t, pending, volume, part, visitor->take);
    if (!waits) kernel_prefetch(g, &t->frame->job->volumes[volume].field.fields[part], cells, count);
    const unsigned box = kernel_tile_box(blocks, KERNEL_ALL_PIXELS);
    for (int n = 0; n < count; n++)
        if (waits && kernel_is_linear(kernel_arrays_type(&pending->arrays, cells[n])))
            kernel_tile_enqueue_tet(t, pending, cells[n], blocks, box, visitor->take);
        else
            kernel_tile_process_cell(t, volume, part, cells[n], visitor->is_pencil, blocks, visitor->take);
}

/* Traverses the trees of the given mesh parts, skipping nodes whose values are invisible in the volume. */
SIMD_INLINE void kernel_tile_volume_trees(kernel_tile_trace *t, int volume, const uint32_t *parts, int count,
                                          unsigned blocks, kernel_tile_visit *visit)
{
    const render_field *field = &t->frame->job->volumes[volume].field;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (field->ranges[part].low)
            kernel_tile_traverse(t, t->frame->job->parts[part].tree, &field->ranges[part],
                                 &t->frame->volumes[volume].visible_values, blocks, part, visit);
    }
}

/* Traverses the trees of all mesh parts, or the tree over the parts if there is one. take() receives their cells. */
SIMD_INLINE void kernel_tile_all_trees(kernel_tile_trace *t, unsigned blocks, kernel_tile_visit *parts,
                                       kernel_tile_trace_cell *take)
{
    const render_job *job = t->frame->job;
    if (job->parent)
        kernel_tile_traverse(t, job->parent, NULL, NULL, blocks, 0, parts);
    else
        for (uint32_t part = 0; part < (uint32_t)job->part_count; part++) parts(t, 0, &part, 1, blocks);
    kernel_tile_process_pending(t, t->thread->tile_cells, take);
}

/* Processes a leaf's cells: queues those whose types are processed in lanes, and transforms the others. */
SIMD_INLINE void kernel_visit_leaf(kernel_tile_trace *t, const kernel_cell_visitor *visitor, int volume, int part,
                                   const uint32_t *cells, int count, unsigned blocks)
{
    const grid *g = t->frame->job->parts[part].cells;
    uint32_t others[MMBVH_MAX_LEAF];
    int left = 0;
    for (int n = 0; n < count; n++) kernel_prefetch_indices(g, cells[n]);
    for (int n = 0; n < count; n++)
        if (!visitor->queue(t, part, cells[n], blocks, KERNEL_ALL_PIXELS)) others[left++] = cells[n];
    if (left) kernel_tile_process_leaf(t, visitor, volume, part, others, left, blocks);
}

/* ---- cells found before, as candidates of the tile ---- */

/* Partitions the items by depth: those before the returned index are no farther than the others. Neither part is
 * empty. */
static inline int kernel_depth_bin_of(kernel_tile_candidate *items, int count)
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

/* Sorts by quicksort down to short pieces. It recurses only into the shorter part, so that the stack stays small. */
static void kernel_order_by_depth(kernel_tile_candidate *items, int count)
{
    enum { PIECE = 8 };
    while (count > PIECE) {
        const int middle = kernel_depth_bin_of(items, count);
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

/* Continues the incremental quicksort until at least one more item is sorted. */
static __attribute__((noinline)) void kernel_tile_cells_sort(kernel_tile_cells *cells)
{
    kernel_tile_candidate *items = cells->items + cells->sorted;
    int count = cells->ends[cells->end_count - 1] - cells->sorted;
    while (count > KERNEL_SORT_PIECE && cells->end_count < KERNEL_SORT_ENDS) {
        count = kernel_depth_bin_of(items, count);
        cells->ends[cells->end_count++] = cells->sorted + count;
    }
    kernel_order_by_depth(items, count);
    cells->sorted += count;
    cells->end_count--;
}

/* Begins a tile, before its first window. Returns false if the tile is known to have no cells. */
SIMD_INLINE bool kernel_tile_cells_begin(kernel_tile_trace *t, kernel_tile_trace_tets *trace_tets)
{
    const kernel_frame *f = t->frame;
    kernel_tile_cells *cells = t->thread->tile_cells;
    cells->tets.count = cells->tets.indexed_count = 0;
    cells->trace_tets = trace_tets;
    cells->plain_part = -1;
    if (!f->volume_candidates) return true;
    cells->items = t->thread->volume_bin.items;
    cells->count = t->thread->volume_bin.count;
    cells->open_count = cells->next = cells->sorted = 0;
    cells->end_count = 1;
    cells->ends[0] = cells->count;
    if (cells->count) kernel_tile_cells_sort(cells);
    return cells->count > 0;
}

/* Moves the cells that overlap the window to the front of the list and sets open_count to their number. */
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

/* Processes one of the cells that overlap the window. */
SIMD_INLINE void kernel_tile_process_item(kernel_tile_trace *t, kernel_tile_cells *cells,
                                          const kernel_tile_candidate *item, bool is_pencil, unsigned blocks,
                                          kernel_tile_trace_cell *take)
{
    const int part = (int)item->source;
    if (kernel_tile_set_tet_part(t, cells, 0, part, take) &&
        kernel_is_linear(kernel_arrays_type(&cells->arrays, item->cell)))
        kernel_tile_enqueue_tet(t, cells, item->cell, blocks, item->box, take);
    else
        kernel_tile_process_cell(t, 0, part, item->cell, is_pencil, blocks, take);
}

/* Prefetches the next cells of the window: the vertex indices of 2 * KERNEL_OPEN_PIECE cells, and the vertices of
 * KERNEL_OPEN_PIECE cells. */
SIMD_INLINE void kernel_tile_prefetch_window(const kernel_tile_trace *t, const kernel_tile_cells *cells, int first)
{
    const render_job *job = t->frame->job;
    for (int pass = 0; pass < 2; pass++) {
        const int end = first + (pass ? KERNEL_OPEN_PIECE : 2 * KERNEL_OPEN_PIECE);
        for (int n = first; n < end && n < cells->open_count; n++) {
            const kernel_tile_candidate *item = &cells->items[n];
            const grid *g = job->parts[item->source].cells;
            if (pass)
                kernel_prefetch_vertices(g, &job->volumes[0].field.fields[item->source], item->cell);
            else
                kernel_prefetch_indices(g, item->cell);
        }
    }
}

/* Processes all candidates of the tile that overlap the window. */
SIMD_INLINE void kernel_visit_window(kernel_tile_trace *t, const kernel_cell_visitor *visitor, unsigned blocks)
{
    kernel_tile_cells *cells = t->thread->tile_cells;
    kernel_tile_cells_select_window(t, cells);
    for (int n = 0; n < cells->open_count; n++) {
        const kernel_tile_candidate *item = &cells->items[n];
        if (n % KERNEL_OPEN_PIECE == 0) kernel_tile_prefetch_window(t, cells, n);
        const unsigned met = item->blocks & blocks & kernel_blocks_beyond(t, item->near);
        if (met && !visitor->queue(t, (int)item->source, item->cell, met, item->box))
            kernel_tile_process_item(t, cells, item, visitor->is_pencil, met, visitor->take);
    }
    kernel_tile_process_pending(t, cells, visitor->take);
}

/* ---- windows of depth ---- */

/* Returns the depth at which the tile's first cell begins; +inf if cells are found only by traversing the trees. */
SIMD_INLINE float kernel_tile_cells_near(const kernel_tile_trace *t)
{
    return t->frame->volume_candidates ? t->thread->tile_cells->items[0].near : INFINITY;
}

/* Returns the blocks that the bounding box of some tree may meet, and the range of these boxes' depths. */
SIMD_INLINE kernel_placement kernel_tile_trees_placement(const kernel_tile_trace *t)
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

/* Sets up the packets of the given blocks for tracing volumes, and stores them in a list. Returns their number. */
SIMD_INLINE int kernel_tile_volume_begin(kernel_tile_trace *t, unsigned blocks, int packets[KERNEL_TILE_PACKETS])
{
    int count = 0;
    for (; blocks; blocks &= blocks - 1) {
        const int block = __builtin_ctz(blocks);
        kernel_block_begin(t, block);
        for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
            const int i = block * KERNEL_BLOCK_PACKETS + n;
            if (t->frame->volume_intervals) kernel_packet_clip_volumes(&t->packets[i], t->clip_interval);
            packets[count++] = i;
        }
    }
    if (count) kernel_block_rays_setup(&t->thread->tile_cells->block_rays, t->frame, &t->tile);
    return count;
}

#endif
