/* Functions with which tests read and corrupt the nodes of a tree in either layout. */
#ifndef TEST_MMBVH_NODES_H
#define TEST_MMBVH_NODES_H

#include <math.h>
#include <string.h>

#include "mmbvh.h"

typedef struct node_view {
    float lower[4], upper[4], range_low, range_high;
    int count;
    int64_t ref;
} node_view;

static inline node_view read_node(const mmbvh *tree, int64_t index)
{
    node_view v = {.count = mmbvh_node_count(tree, index), .ref = mmbvh_node_ref(tree, index)};
    const mmbvh_ranges own = mmbvh_own_ranges(tree);
    mmbvh_node_box(tree, index, v.lower, v.upper);
    memcpy(&v.range_low, own.low + index * own.stride, sizeof v.range_low);
    memcpy(&v.range_high, own.high + index * own.stride, sizeof v.range_high);
    return v;
}

static inline mmbvh_statistics assert_proved(const mmbvh *tree, const grid *g, const grid_field *field)
{
    mmbvh_statistics statistics = {0};
    base_error error = {0};
    if (mmbvh_check(tree, g, field, &statistics, &error)) fail_msg("%s", error.message);
    return statistics;
}

static inline size_t get_node_size(const mmbvh *tree)
{
    return tree->compact ? sizeof *tree->compact : sizeof *tree->nodes;
}

static inline const void *get_node_bytes(const mmbvh *tree)
{
    return tree->compact ? (const void *)tree->compact : (const void *)tree->nodes;
}

#define assert_same_nodes(a, b)                                                                                        \
    do {                                                                                                               \
        assert_int_equal((a)->node_count, (b)->node_count);                                                            \
        assert_int_equal(get_node_size(a), get_node_size(b));                                                          \
        assert_memory_equal(&(a)->grid, &(b)->grid, sizeof(mmbvh_grid));                                               \
        assert_memory_equal(get_node_bytes(a), get_node_bytes(b), (size_t)(a)->node_count *get_node_size(a));          \
    } while (0)

static inline void corrupt_range(const mmbvh *tree, int64_t index)
{
    if (tree->compact) {
        tree->compact[index].range_low = tree->compact[index].range_high = NAN;
    } else {
        tree->nodes[index].range_low = tree->nodes[index].range_high = NAN;
    }
}

static inline void corrupt_box(const mmbvh *tree, int64_t index)
{
    if (tree->compact) {
        tree->compact[index].axis[0] = 0;
        tree->compact[index].axis[2] = UINT32_MAX;
    } else {
        tree->nodes[index].lower[0] = tree->nodes[index].upper[2] = NAN;
    }
}

#endif
