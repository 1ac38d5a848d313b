/* Computes the bounding boxes of a tree's nodes, for a new tree or after the mesh's vertices have moved. */
#include <string.h>

#include "mmbvh_bounds.h"
#include "mmbvh_cost.h"
#include "mmbvh_measure.h"
#include "region.h"

enum {
    PREFETCH_CELLS = 48,
    VISIBLE_NODES = 16 /* if invisible nodes are skipped: groups of at most this many nodes are computed without
                          checking the visibility of each node, because the checks would cost more than skipping
                          saves */
};

static void store_box_of_leaf(const sweep *s, int64_t index, int64_t first, int count, int64_t *outside_grid,
                              double *area_change)
{
    const mmbvh *tree = s->tree;
    fetch_box box;
    float lower[3], upper[3];
    fetch_box_empty(&box);
    const uint32_t *cells = tree->cells + first; /* the sweep processes the cells in descending order */
    s->source->extend(s->source, cells, count, first < PREFETCH_CELLS ? NULL : cells - PREFETCH_CELLS, &box);
    round_box_outward(&box, tree->origin, tree->scale, lower, upper);
    store_box_and_measure_area(s, index, (vec4){lower[0], lower[1], lower[2], 0},
                               (vec4){upper[0], upper[1], upper[2], 0}, outside_grid, area_change);
}

static sweep_sum run_bounds(const sweep *s, int64_t first, int64_t end)
{
    sweep_sum sum = {0};
    for (int64_t i = end - 1; i >= first; i--) {
        const int count = mmbvh_node_count(s->tree, i);
        const int64_t ref = mmbvh_node_ref(s->tree, i);
        if (count)
            store_box_of_leaf(s, i, ref, count, &sum.count, &sum.area_change);
        else
            store_union_of_children(s, i, ref, &sum.count, &sum.area_change);
    }
    return sum;
}

sweep sweep_of_bounds(const mmbvh *tree, const bounds_source *source)
{
    sweep s = {.tree = tree, .source = source, .run = run_bounds};
    sweep_bounds_as_floats(&s);
    return s;
}

sweep sweep_of_bounds_and_ranges(const mmbvh *tree, const bounds_source *source, const sweep *ranges)
{
    sweep both;
    if (sweep_bounds_and_ranges_as_floats(ranges, source, &both)) return both;
    both = sweep_of_bounds(tree, source);
    both.follower = ranges;
    return both;
}

/* Returns the bounds of all the tree's cells, in the source's coordinates. */
static fetch_box compute_exact_bounds(const mmbvh *tree, const bounds_source *source, int threads)
{
    fetch_box all;
    fetch_box_empty(&all);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        fetch_box own;
        fetch_box_empty(&own);
#pragma omp for schedule(static)
        for (int64_t begin = 0; begin < tree->cell_count; begin += BOUNDS_BLOCK) {
            const int64_t left = tree->cell_count - begin;
            const int count = (int)(left < BOUNDS_BLOCK ? left : BOUNDS_BLOCK);
            source->extend(source, tree->cells + begin, count, NULL, &own);
        }
#pragma omp critical(mmbvh_merge)
        unite_boxes(&all, &own);
        region_leave();
    }
    return all;
}

/* Computes a new grid and new bounds for a mesh that has moved out of the tree's grid. The new grid has a margin of an
 * eighth of the mesh's size on each side. */
static insitu_status recompute_bounds_in_new_grid(mmbvh *tree, const bounds_source *source, int threads)
{
    const fetch_box exact = compute_exact_bounds(tree, source, threads);
    float lower[3], upper[3];
    round_box_outward(&exact, tree->origin, tree->scale, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        const float margin = 0.125f * (upper[axis] - lower[axis]);
        if (!(margin < INFINITY)) return INSITU_ERROR_MESH;
        lower[axis] -= margin;
        upper[axis] += margin;
    }
    tree->grid = store_make_grid(lower, upper);
    /* areas are not measured, because the nodes' boxes are still in steps of the old grid */
    const sweep all = sweep_of_bounds(tree, source);
    if (sweep_tree(&all, threads).count) return INSITU_ERROR_MESH;
    tree->area = compute_area_sum_of_tree(tree, threads);
    return INSITU_OK;
}

/* Returns whether the mesh has shrunk so much that it uses only a small part of the grid's steps. */
static bool is_grid_too_coarse(const mmbvh *tree)
{
    const int few = COMPACT_LOWER_MAX / 8;
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        const float steps = (upper[axis] - lower[axis]) / tree->grid.step[axis];
        const float far = fmaxf(fabsf(lower[axis]), fabsf(upper[axis]));
        if (steps < (float)few && tree->grid.step[axis] > far * 0x1p-20f) return true;
    }
    return false;
}

static sweep sweep_of_visible_bounds(const mmbvh *tree, const bounds_source *source, const mmbvh_visible *visible,
                                     int visible_count)
{
    sweep s = sweep_of_bounds(tree, source);
    s.measures_area = true;
    s.visible = visible;
    s.visible_count = visible_count;
    if (visible_count) s.range_max = VISIBLE_NODES;
    return s;
}

insitu_status mmbvh_refit_visible_bounds(mmbvh *tree, const grid *g, const mmbvh_visible *visible, int visible_count,
                                         const mmbvh_options *options, bool *is_whole)
{
    if (!tree || !g || !is_whole) return INSITU_ERROR_ARGUMENT;
    *is_whole = visible_count == 0;
    if (!tree->node_count) return INSITU_OK;
    const int threads = sweep_threads(options);
    const bounds_source source = bounds_source_make(g, NULL, NULL, g->cell_count, tree->origin, tree->scale);
    const sweep s = sweep_of_visible_bounds(tree, &source, visible, visible_count);
    const sweep_sum sum = sweep_tree(&s, threads);
    tree->area += sum.area_change;
    if (!tree->compact || !(sum.count || (*is_whole && is_grid_too_coarse(tree)))) return INSITU_OK;
    *is_whole = true;
    return recompute_bounds_in_new_grid(tree, &source, threads);
}

insitu_status mmbvh_refit_bounds(mmbvh *tree, const grid *g, const mmbvh_options *options)
{
    bool is_whole;
    return mmbvh_refit_visible_bounds(tree, g, NULL, 0, options, &is_whole);
}
