/* Everything a subtree needs lies in one thread's scratch: the items are parted in place, so a node's items are always
 * one contiguous run, and the order they end in depends on nothing but the order they came in. */
#include "mmbvh_subtree.h"

/* Items of the left side to the front; returns how many. The sides' centroids are gathered on the way. */
static int64_t part(bin_item *items, int64_t count, const bin_mapping *m, bin_split split, bin_set sides[2])
{
    int64_t left = 0, right = count;
    while (left < right) {
        const bin_item item = items[left];
        const vec4 centroid = bin_centroid(item.lower, item.upper);
        if (bin_of(m, centroid)[split.axis] < split.border) {
            bin_box_add(&sides[0].centroids, centroid, centroid);
            left++;
        } else {
            bin_box_add(&sides[1].centroids, centroid, centroid);
            items[left] = items[--right];
            items[right] = item;
        }
    }
    return left;
}

static int64_t halve(const bin_item *items, int64_t count, bin_set sides[2])
{
    const int64_t middle = count / 2;
    for (int64_t i = 0; i < count; i++) bin_set_add(&sides[i >= middle], items[i].lower, items[i].upper);
    return middle;
}

static mmbvh_node build(subtree *s, int64_t first, int64_t count, const bin_set *set, int depth)
{
    mmbvh_node node = {.ref = (s->first_entry + (uint64_t)first) & (UINT64_MAX >> 3), .count = (unsigned)count & 7};
    bin_set_store(set, &node);
    if (count == 1) return node;

    bin_item *items = s->items + first;
    bin_split split = {.axis = -1};
    bin_mapping mapping = {.count = 0};
    if (depth < SUBTREE_MEDIAN_DEPTH) {
        mapping = bin_mapping_make(&set->centroids, count);
        bins_clear(&s->bins, mapping.count);
        for (int64_t i = 0; i < count; i++) bins_add(&s->bins, &mapping, items[i].lower, items[i].upper);
        split = bins_choose(&s->bins, &mapping, &set->bounds);
    }
    if (!bins_worth_splitting(split, count)) return node;

    bin_set sides[2] = {bin_set_empty(), bin_set_empty()};
    int64_t left_count;
    if (split.axis < 0) {
        left_count = halve(items, count, sides);
    } else {
        bin_box bounds[2];
        bins_split_bounds(&s->bins, &mapping, split, bounds);
        for (int side = 0; side < 2; side++) sides[side].bounds = bounds[side];
        left_count = part(items, count, &mapping, split, sides);
    }
    const int64_t pair = s->node_count;
    s->node_count += 2;
    s->nodes[pair] = build(s, first, left_count, &sides[0], depth + 1);
    s->nodes[pair + 1] = build(s, first + left_count, count - left_count, &sides[1], depth + 1);
    node.count = 0;
    node.ref = (uint64_t)pair & (UINT64_MAX >> 3);
    return node;
}

mmbvh_node subtree_build(subtree *s, int64_t count, const bin_set *set, int depth)
{
    s->node_count = 0;
    return build(s, 0, count, set, depth);
}
