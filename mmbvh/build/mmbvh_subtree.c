/* The items of a node (its cells, mmbvh_item.h) are partitioned in place. Therefore they are always contiguous, and
 * their final order depends only on their initial order. If a node is so small that the grid is too coarse for its
 * items, as in meshes whose cell sizes differ by orders of magnitude, the boxes are computed anew from the vertices, in
 * steps of a finer grid. */
#include "mmbvh_subtree.h"

/* Minimum number of grid steps along the longest side of a node's box; with fewer, rounding changes surface areas by
 * more than 3 percent. */
enum { COARSE = 64 };

bool subtree_needs_finer_grid(lanes bounds, const item_grid *grid)
{
    const lanes extent = item_extent(bounds);
    return !grid->is_finest && extent[0] < COARSE && extent[1] < COARSE && extent[2] < COARSE;
}

item_grid subtree_finer_grid(lanes bounds, const item_grid *grid)
{
    double lower[3], upper[3];
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = grid->origin[axis] + (ITEM_TOP - bounds[axis] - 0.5) * grid->step;
        upper[axis] = grid->origin[axis] + (bounds[4 + axis] + 0.5) * grid->step;
    }
    return item_grid_make(lower, upper);
}

typedef struct subtree {
    topology_scratch *scratch;
    const bounds_source *source;
    item *items;
    bins bins;
} subtree;

/* Chooses the split plane from a sample if there are many items. If the sample allows no split, all items are used. */
static bin_split choose_split(subtree *s, lanes centroids, const item *items, int64_t count, bin_mapping *mapping)
{
    *mapping = bin_mapping_make(centroids, count);
    for (int64_t stride = bins_sampling_stride(count);; stride = 1) {
        bins_clear(&s->bins, mapping->count);
        bins_fill(&s->bins, mapping, items, count, stride);
        const bin_split split = bins_choose(&s->bins, mapping);
        if (split.axis >= 0 || stride == 1) return split;
    }
}

static bool is_certainly_leaf(const item *items, int64_t count, lanes bounds)
{
    return count <= MMBVH_MAX_LEAF && !bins_is_split_cheaper(bins_compute_cost_bound(items, count), count, bounds);
}

static topology_link build_node(subtree *s, int64_t first, int64_t count, const item_grid *grid, int depth)
{
    if (count == 1) return topology_leaf(first, 1);
    item *items = s->items + first;
    item_set set = item_set_of(items, count);
    item_grid finer;
    if (subtree_needs_finer_grid(set.bounds, grid)) {
        finer = subtree_finer_grid(set.bounds, grid);
        grid = &finer;
        set = item_set_empty();
        bounds_fill_items(s->source, grid, items, count, &set, NULL);
    }
    if (is_certainly_leaf(items, count, set.bounds)) return topology_leaf(first, count);
    bin_mapping mapping;
    bin_split split = {.axis = -1, .cost = INFINITY};
    if (depth < TOPOLOGY_MEDIAN_DEPTH) split = choose_split(s, set.centroids, items, count, &mapping);
    if (!bins_is_split_cheaper(split.cost, count, set.bounds)) return topology_leaf(first, count);

    const int64_t left_count = split.axis < 0 ? count / 2 : bins_partition(&mapping, split, items, count);
    const int64_t pair = topology_new_pair(s->scratch);
    const topology_link left = build_node(s, first, left_count, grid, depth + 1);
    const topology_link right = build_node(s, first + left_count, count - left_count, grid, depth + 1);
    s->scratch->links[pair] = left;
    s->scratch->links[pair + 1] = right;
    return topology_inner(pair);
}

topology_link subtree_build(topology_scratch *scratch, const bounds_source *source, item *items, int64_t count,
                            const item_grid *grid, int depth)
{
    subtree s = {.scratch = scratch, .source = source, .items = items};
    scratch->count = 0;
    return build_node(&s, 0, count, grid, depth);
}
