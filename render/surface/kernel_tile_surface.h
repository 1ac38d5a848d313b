/* Traces isosurfaces in a tile that traverses the trees itself, roughly front to back. (In other frames the cells of
 * all tiles are found in advance, kernel_candidates.h.) Cells behind the hits that the tile's pixels already have are
 * not fetched. The box of a node or cell is the rectangle of the tile's pixels that may see it:
 *     nodes, one per lane:  range of values, depth, box ---> stack, the nearest node on top
 *     from the stack:       does the box have a pixel without a nearer hit?
 *     leaves' cells:        tested in lanes (kernel_candidates.h), restricted to the tile's pixels
 *     cells with pixels:    queued and traced in batches (kernel_tile_queue.h), whose hits hide what is behind
 * A node whose box of pixels is empty, because it lies between the pixels' centres, is skipped, too. The box of pixels
 * is computed from the distances of the node's bounding box to the planes through the tile's borders, divided by the
 * farthest depth of the bounding box. The quotient is a lower bound of how far beyond a border of the tile the node is.
 * The margins are larger than all rounding errors. */
#ifndef RENDER_KERNEL_TILE_SURFACE_H
#define RENDER_KERNEL_TILE_SURFACE_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernel_bins.h"
#include "kernel_candidates.h"
#include "kernel_finder.h"
#include "kernel_tile.h"
#include "kernel_tile_queue.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

/* ---- queuing the cells that the search finds ---- */

/* Queues the cells in the list, which the search has found, for tracing, unless nearer hits hide them. Empties the
 * list. It always returns true, as the callback kernel_finder.grow must. */
static bool kernel_queue_found_candidates(kernel_candidate_list *list)
{
    kernel_tile_search *s = (kernel_tile_search *)((char *)list - offsetof(kernel_tile_search, list));
    kernel_tile_trace *t = s->tile;
    for (int n = 0; n < list->count; n++) {
        const kernel_candidate *found = &list->items[n];
        int part;
        const int value = kernel_tile_set_layer_of_source(t, found->source, &part);
        const kernel_tile_candidate candidate = kernel_convert_candidate_to_tile(found, t->tile.x0, t->tile.y0);
        if (kernel_candidate_blocks(t, &candidate) && kernel_box_has_pixel_not_hidden_at(t, candidate.box, found->near))
            kernel_tile_queue_add(t, s, &candidate, part, value);
    }
    list->count = 0;
    return true;
}

/* Prepares the search for cells of a mesh part, unless that part is being searched already. Cells of the previous part
 * that the finder has collected are processed first. */
static void kernel_tile_set_searched_part(kernel_tile_trace *t, kernel_tile_search *s, int part)
{
    kernel_finder *finder = t->thread->finder;
    if (finder->frame == t->frame && finder->surface == t->surface && finder->part == part) return;
    if (finder->frame) kernel_process_all_queued_cells(finder);
    kernel_finder_begin(finder, t->frame, &(kernel_subtree){.surface = t->layer, .part = part});
    finder->list = &s->list;
    finder->grow = kernel_queue_found_candidates;
    finder->first[0] = t->tile.x0;
    finder->first[1] = t->tile.y0;
    const render_camera *c = &t->frame->job->camera;
    finder->last[0] = t->tile.x0 + KERNEL_TILE < c->width ? t->tile.x0 + KERNEL_TILE - 1 : c->width - 1;
    finder->last[1] = t->tile.y0 + KERNEL_TILE < c->height ? t->tile.y0 + KERNEL_TILE - 1 : c->height - 1;
}

/* ---- traversal of nodes ---- */

/* KERNEL_NODES_AT_ONCE: maximum number of inner nodes whose children are tested at once, one child per lane, with
 * siblings in neighbouring lanes. KERNEL_NODES_ROOM: size of the stack of nodes. */
enum { KERNEL_NODES_AT_ONCE = SIMD_WIDTH / 2, KERNEL_NODES_ROOM = (KERNEL_NODES_AT_ONCE + 1) * MMBVH_MAX_DEPTH };

/* One node per lane: its bounding box in tree space and its range of values, and the results of testing it. near: its
 * least depth; box: its box of pixels (first and last column, first and last row, 4 bits each from bit 0 on); along:
 * the position of its middle along the tile's direction, by which siblings are sorted. */
typedef struct kernel_node_lanes {
    vf low[3], high[3], range_low, range_high;
    float near[SIMD_WIDTH], along[SIMD_WIDTH];
    int32_t box[SIMD_WIDTH];
} kernel_node_lanes;

/* Reads the boxes and value ranges of nodes one by one, which works for every format in which a tree stores its
 * nodes. */
static __attribute__((noinline)) void kernel_nodes_fetch_scalar(const mmbvh *tree, const mmbvh_ranges *ranges,
                                                                const int64_t node[SIMD_WIDTH], kernel_node_lanes *out)
{
    float low[3][SIMD_WIDTH], high[3][SIMD_WIDTH], range[2][SIMD_WIDTH];
    for (int n = 0; n < SIMD_WIDTH; n++) {
        float lower[4], upper[4];
        mmbvh_node_box(tree, node[n], lower, upper);
        for (int a = 0; a < 3; a++) {
            low[a][n] = lower[a];
            high[a][n] = upper[a];
        }
        memcpy(&range[0][n], ranges->low + node[n] * ranges->stride, sizeof range[0][n]);
        memcpy(&range[1][n], ranges->high + node[n] * ranges->stride, sizeof range[1][n]);
    }
    for (int a = 0; a < 3; a++) {
        out->low[a] = vf_load(low[a]);
        out->high[a] = vf_load(high[a]);
    }
    out->range_low = vf_load(range[0]);
    out->range_high = vf_load(range[1]);
}

/* Reads the bounding box and the range of values of one node per lane. If the nodes are compact, and few enough for the
 * 32-bit indices of a gather, they are decoded in lanes, by the operations of compact_decode(). */
SIMD_INLINE void kernel_nodes_fetch(const mmbvh *tree, const mmbvh_ranges *ranges, const int64_t node[SIMD_WIDTH],
                                    kernel_node_lanes *out)
{
    if (!tree->compact || tree->node_count > INT32_MAX / 10) {
        kernel_nodes_fetch_scalar(tree, ranges, node, out);
        return;
    }
    int32_t index[SIMD_WIDTH];
    vi at;
    for (int n = 0; n < SIMD_WIDTH; n++) index[n] = (int32_t)node[n];
    memcpy(&at, index, sizeof at);
    const float *nodes = (const float *)(const void *)tree->compact;
    const vi place = at * (int)(sizeof *tree->compact / sizeof(float));
    for (int a = 0; a < 3; a++) {
        const vi word = vi_from_bits(vf_gather(nodes + a, place));
        const vi bits = (word >> (COMPACT_LOWER_BITS + COMPACT_MANTISSA_BITS - 23)) &
                        (COMPACT_EXTENT_MAX << (23 - COMPACT_MANTISSA_BITS));
        const vf extent = vf_from_bits(bits + COMPACT_ONE) - 16.0f;
        out->low[a] = vf_from_vi(word & COMPACT_LOWER_MAX) * tree->grid.step[a] + tree->grid.origin[a];
        out->high[a] = extent * tree->grid.step[a] + out->low[a];
    }
    const vi pair = at * (int)(ranges->stride / (int64_t)sizeof(float));
    out->range_low = vf_gather((const float *)(const void *)ranges->low, pair);
    out->range_high = vf_gather((const float *)(const void *)ranges->high, pair);
}

/* Computes the first and last column (shift 0) or row (shift 8) of pixels that each lane's node may meet, and adds them
 * to its box of pixels. low: lower bound of the node's signed distance from the tile's first border (left or top);
 * high: upper bound of its signed distance from the last border (right or bottom); scale: pixels per unit of distance;
 * pad: margin in pixels. Returns the lanes that meet a pixel. A NaN counts as meeting all pixels. */
SIMD_INLINE vm kernel_node_pixels(vf low, vf high, vf scale, float pad, vi *box, int shift)
{
    const vf end = vf_set(KERNEL_TILE), zero = vf_set(0);
    const vf first = vf_min(vf_max(low * scale + (0.5f - pad), zero), end);
    const vf last = vf_max(vf_min(high * scale + (KERNEL_TILE + 0.5f + pad), end), zero);
    const vi from = vi_from_vf(first), to = vi_from_vf(last) - 1;
    *box |= from << shift | to << (shift + 4);
    return vf_lt(vf_from_vi(from), vf_from_vi(to) + 0.5f);
}

/* Tests which nodes may be visible, by the planes through the tile's four borders, the nodes' depths and the surface's
 * isovalues, and sets the members near, along and box of *nodes. Returns a mask of the lanes whose nodes may be
 * visible. */
SIMD_INLINE unsigned kernel_test_node_visibility(const kernel_tile_trace *t, kernel_node_lanes *nodes)
{
    enum { LEFT, RIGHT, TOP, BOTTOM, DEPTH, ALONG, PLANES };
    static const int plane[PLANES] = {0,
                                      KERNEL_BLOCKS_ACROSS,
                                      KERNEL_ROWS_LANE,
                                      KERNEL_ROWS_LANE + KERNEL_BLOCKS_ACROSS,
                                      KERNEL_DEPTH_LANE,
                                      KERNEL_ALONG_LANE};
    const kernel_tile_search *s = t->search;
    const kernel_planes *q = &t->tree_planes;
    vf at[PLANES], reach[PLANES], middle[3], half[3];
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5f * (nodes->low[a] + nodes->high[a]);
        half[a] = 0.5f * (nodes->high[a] - nodes->low[a]);
    }
    for (int n = 0; n < PLANES; n++) {
        const int v = plane[n] / SIMD_WIDTH, i = plane[n] % SIMD_WIDTH;
        at[n] = (q->normal[0][v][i] * middle[0] + q->normal[1][v][i] * middle[1]) +
                (q->normal[2][v][i] * middle[2] + q->offset[v][i]);
        reach[n] =
            (q->size[0][v][i] * half[0] + q->size[1][v][i] * half[1]) + (q->size[2][v][i] * half[2] + q->error[v][i]);
    }
    const vf far = at[DEPTH] + reach[DEPTH];
    vf inverse = vf_set(1);
    vi box = vi_set(0);
    if (!t->frame->job->camera.is_orthographic)
        inverse = 1.0f / vf_max(far + (float)t->frame->depth_shift, vf_set(1e-20f));
    vm shown = vm_not(vf_lt(far, vf_set(t->t_near)));
    for (int a = 0; a < 2; a++) {
        const int first = a ? TOP : LEFT, last = first + 1;
        const vf scale = inverse * (a ? s->row_scale : s->column_scale);
        shown = vm_and(
            shown, kernel_node_pixels(at[first] - reach[first], at[last] + reach[last], scale, s->pad[a], &box, 8 * a));
    }
    shown = vm_and(
        shown, kernel_visible_values_overlap_lanes(&t->surface->visible_values, nodes->range_low, nodes->range_high));
    vf_store(nodes->near, vf_max(at[DEPTH] - reach[DEPTH], vf_set(-INFINITY)));
    vf_store(nodes->along, at[ALONG]);
    memcpy(nodes->box, &box, sizeof box);
    return vm_bits(shown);
}

/* Pushes a node on the stack if its lane's bit is set in `visible`, and prefetches what is read next. Returns the
 * number of nodes pushed, 0 or 1. */
SIMD_INLINE int kernel_push_visible_node(const mmbvh *tree, const mmbvh_ranges *ranges, int64_t node,
                                         const kernel_node_lanes *nodes, unsigned visible, int lane,
                                         kernel_tile_node *to)
{
    if (!(visible >> lane & 1)) return 0;
    const int64_t ref = mmbvh_node_ref(tree, node);
    const int count = mmbvh_node_count(tree, node);
    if (count) {
        __builtin_prefetch(tree->cells + ref);
        __builtin_prefetch(tree->cells + ref + count - 1);
    } else {
        mmbvh_prefetch_node(tree, ref);
        mmbvh_prefetch_node(tree, ref + 1);
        __builtin_prefetch(ranges->low + ref * ranges->stride);
    }
    *to = (kernel_tile_node){ref, nodes->near[lane], (uint16_t)nodes->box[lane], (uint16_t)count};
    return 1;
}

/* Tests the children of `count` inner nodes, and pushes those that may be visible on the stack, so that the nearest are
 * on top. left: index of each inner node's left child, the nearest inner node first. Returns the number of pushed
 * nodes. */
SIMD_INLINE int kernel_tile_push_visible_children(const kernel_tile_trace *t, const mmbvh *tree,
                                                  const mmbvh_ranges *ranges, const int64_t *left, int count,
                                                  kernel_tile_node *stack)
{
    int64_t node[SIMD_WIDTH];
    kernel_node_lanes lanes;
    int top = 0;
    for (int n = 0; n < KERNEL_NODES_AT_ONCE; n++) {
        node[2 * n] = left[n < count ? n : 0];
        node[2 * n + 1] = node[2 * n] + 1;
    }
    kernel_nodes_fetch(tree, ranges, node, &lanes);
    const unsigned visible = kernel_test_node_visibility(t, &lanes);
    for (int n = 2 * (count - 1); n >= 0; n -= 2) {
        const int far = lanes.along[n] < lanes.along[n + 1];
        top += kernel_push_visible_node(tree, ranges, node[n + far], &lanes, visible, n + far, stack + top);
        top += kernel_push_visible_node(tree, ranges, node[n + !far], &lanes, visible, n + !far, stack + top);
    }
    return top;
}

/* Finds the cells of a mesh part that the current layer's surface may cross in the tile. If the stack is almost full,
 * one node is taken from it at a time, which needs no more space than the tree's depth. */
SIMD_INLINE void kernel_tile_find_cells(kernel_tile_trace *t, int part)
{
    const mmbvh *tree = t->frame->job->parts[part].tree;
    const mmbvh_ranges *ranges = &t->surface->layer->field.ranges[part];
    kernel_tile_node stack[KERNEL_NODES_ROOM];
    int top = 0;
    if (!ranges->low || !tree->node_count) return;
    stack[top++] = (kernel_tile_node){mmbvh_node_ref(tree, 0), -INFINITY, 0xf0f0, (uint16_t)mmbvh_node_count(tree, 0)};
    while (top) {
        int64_t inner[KERNEL_NODES_AT_ONCE];
        const int most = top < KERNEL_NODES_ROOM - KERNEL_NODES_AT_ONCE - MMBVH_MAX_DEPTH ? KERNEL_NODES_AT_ONCE : 1;
        int inner_count = 0;
        for (int n = 0; n < most && top; n++) {
            const kernel_tile_node e = stack[--top];
            if (!kernel_box_has_pixel_not_hidden_at(t, e.place, e.near)) continue;
            if (e.count) {
                kernel_tile_set_searched_part(t, t->search, part);
                kernel_queue_leaf_cells(t->thread->finder, tree->cells + e.ref, e.count);
            } else {
                inner[inner_count++] = e.ref;
            }
        }
        if (inner_count) top += kernel_tile_push_visible_children(t, tree, ranges, inner, inner_count, stack + top);
    }
}

/* ---- surfaces ---- */

/* Finds the cells of the given mesh parts that the current layer's surface may cross in the tile. It has the parameters
 * of the callback that kernel_tile_traverse() calls for a leaf of the tree over all parts. */
static void kernel_find_cells_of_mesh_parts(kernel_tile_trace *t, int unused, const uint32_t *parts, int count,
                                            unsigned blocks)
{
    (void)unused, (void)blocks;
    for (int n = 0; n < count; n++) kernel_tile_find_cells(t, (int)parts[n]);
}

/* Finds the cells of all mesh parts that the current layer's surface may cross in the tile. They are queued; full
 * queues are traced at once. */
SIMD_INLINE void kernel_tile_surface(kernel_tile_trace *t)
{
    const render_job *job = t->frame->job;
    if (job->parent) {
        kernel_tile_traverse(t, job->parent, NULL, NULL, t->traced_blocks, 0, kernel_find_cells_of_mesh_parts);
        return;
    }
    for (uint32_t part = 0; part < (uint32_t)job->part_count; part++)
        kernel_find_cells_of_mesh_parts(t, 0, &part, 1, t->traced_blocks);
}

/* Sets the scales and margins from which nodes' boxes of pixels are computed (kernel_node_pixels()). */
SIMD_INLINE void kernel_set_pixel_box_scales(kernel_tile_trace *t)
{
    kernel_tile_search *s = t->search;
    const kernel_frame *f = t->frame;
    const bool flat = f->job->camera.is_orthographic;
    const double unit = flat ? f->job->space.scale : 1;
    const float error_bound = flat ? 4e-6f * (2 + fabsf((float)f->depth_shift)) : 4e-6f;
    s->column_scale = (float)(1 / (fabs(f->slope_dx) * unit));
    s->row_scale = (float)(1 / (fabs(f->slope_dy) * unit));
    s->pad[0] = 0.01f + error_bound * s->column_scale + 3e-5f * (float)f->job->camera.width;
    s->pad[1] = 0.01f + error_bound * s->row_scale + 3e-5f * (float)f->job->camera.height;
}

/* Traces the surfaces of all layers. */
static void kernel_tile_trace_all_layers(kernel_tile_trace *t)
{
    kernel_tile_search *s = t->search;
    s->tile = t;
    s->list = (kernel_candidate_list){.items = s->items, .capacity = 2 * SIMD_WIDTH};
    t->thread->finder->frame = NULL;
    kernel_set_pixel_box_scales(t);
    kernel_tile_queue_begin(s);
    for (int layer = 0; layer < t->frame->surface_count; layer++) {
        kernel_tile_set_layer(t, layer);
        kernel_tile_surface(t);
        if (t->thread->finder->frame) kernel_process_all_queued_cells(t->thread->finder);
        kernel_queue_found_candidates(&s->list);
        kernel_tile_queue_finish(t, s);
    }
}

#endif
