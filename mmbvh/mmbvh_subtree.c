/* Items are parted in place, so a node's items are always one contiguous run, and the order they end in depends on
 * nothing but the order they came in. Where a node is so small that the grid tells its items apart badly, as in meshes
 * whose cells differ by orders of magnitude, their boxes are read from the vertices again, in steps of a finer grid. */
#include "mmbvh_subtree.h"

enum { COARSE = 64 }; /* steps of the longest side: an area is off by 3 percent */

bool subtree_wants_finer_grid(const subtree_node *node)
{
    const lanes extent = item_extent(node->set.bounds);
    return !node->grid.is_finest && extent[0] < COARSE && extent[1] < COARSE && extent[2] < COARSE;
}

item_grid subtree_finer_grid(const subtree_node *node)
{
    double lower[3], upper[3];
    for (int axis = 0; axis < 3; axis++) {
        const double origin = node->grid.origin[axis], step = node->grid.step[axis];
        lower[axis] = origin + (ITEM_TOP - node->set.bounds[axis] - 0.5) * step;
        upper[axis] = origin + (node->set.bounds[4 + axis] + 0.5) * step;
    }
    return item_grid_make(lower, upper);
}

typedef struct subtree {
    topology_scratch *scratch;
    const bounds_source *source;
    item *items;
    bins bins;
} subtree;

static int64_t halve(const item *items, int64_t count, item_set sides[2])
{
    const int64_t middle = count / 2;
    for (int64_t i = 0; i < count; i++) item_set_add(&sides[i >= middle], items[i]);
    return middle;
}

static topology_link build(subtree *s, int64_t first, int64_t count, subtree_node *node)
{
    if (count == 1) return topology_leaf(first, 1);
    item *items = s->items + first;
    if (subtree_wants_finer_grid(node)) {
        node->grid = subtree_finer_grid(node);
        node->set = item_set_empty();
        bounds_place(s->source, &node->grid, items, count, &node->set, NULL);
    }
    bin_split split = {.axis = -1};
    bin_mapping mapping = {.count = 0};
    if (node->depth < TOPOLOGY_MEDIAN_DEPTH) {
        mapping = bin_mapping_make(node->set.centroids, count);
        bins_clear(&s->bins, mapping.count);
        bins_fill(&s->bins, &mapping, items, count);
        split = bins_choose(&s->bins, &mapping, node->set.bounds, &node->grid);
    }
    if (!bins_worth_splitting(split, count)) return topology_leaf(first, count);

    item_set sides[2] = {item_set_empty(), item_set_empty()};
    int64_t left_count;
    if (split.axis < 0) {
        left_count = halve(items, count, sides);
    } else {
        lanes bounds[2], centroids[2] = {sides[0].centroids, sides[1].centroids};
        bins_split_bounds(&s->bins, &mapping, split, bounds);
        left_count = bins_part(&mapping, split, items, count, centroids);
        for (int side = 0; side < 2; side++) sides[side] = (item_set){bounds[side], centroids[side]};
    }
    const int64_t pair = topology_new_pair(s->scratch);
    for (int side = 0; side < 2; side++) {
        subtree_node child = {sides[side], node->grid, node->depth + 1};
        const int64_t begin = side ? left_count : 0, end = side ? count : left_count;
        const topology_link link = build(s, first + begin, end - begin, &child);
        s->scratch->links[pair + side] = link;
    }
    return topology_inner(pair);
}

topology_link subtree_build(topology_scratch *scratch, const bounds_source *source, item *items, int64_t count,
                            const subtree_node *root)
{
    subtree s = {.scratch = scratch, .source = source, .items = items};
    subtree_node node = *root;
    scratch->count = 0;
    return build(&s, 0, count, &node);
}
