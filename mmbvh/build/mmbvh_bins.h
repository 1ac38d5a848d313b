/* Binned surface area heuristic (SAH), used by the parallel top of the tree and by the serial subtrees. Items are
 * sorted into bins by centroid along all three axes at the same time; every border between two bins of an axis is a
 * candidate plane. Maxima and counts do not depend on the order of the items. Therefore the bins of several threads can
 * be merged in any order, with bit-identical results. */
#ifndef MMBVH_BINS_H
#define MMBVH_BINS_H

#include <math.h>

#include "mmbvh.h"
#include "mmbvh_item.h"

enum {
    BINS_MAX = 16,
    BINS_SAMPLED = 2048, /* nodes with at least this number of items are split by a sample of their items */
    /* sampling stride: only every BINS_STRIDE-th item is binned; the resulting splits are as good as with all items */
    BINS_STRIDE = 7
};

/* Maps v = 2 * centroid - ITEM_TOP, which item_centroid() returns, to one of `count` bins on each axis: bin (v -
 * origin) * factor / 2^16, rounded down. ITEM_TOP is the largest coordinate of an item (mmbvh_item.h). Lanes 4 to 6
 * repeat lanes 0 to 2, so that two items are mapped at once. */
typedef struct bin_mapping {
    ulanes origin;
    lanes factor;
    int count;
} bin_mapping;

bin_mapping bin_mapping_make(lanes centroids, int64_t item_count);

/* A plane between two bins. Items whose bin on the axis is below the border belong to the left side. */
typedef struct bin_split {
    int axis; /* axis of the split; -1 if no plane leaves items on both sides */
    int first_right_bin;
    /* cost of the split: the sum over both sides of half the surface area (in squared grid steps) times the number of
     * items */
    float cost;
} bin_split;

/* The data of three bins, one per axis, that have the same index on their axes. The struct fills one cache line. */
typedef struct bin {
    lanes boxes[3];     /* one box per axis; lanes 3 and 7 contain no bounds, and lane 3 counts items while they are
                           added */
    uint32_t counts[4]; /* number of items in each axis's bin; element 3 is not used */
} bin;

typedef struct bins {
    _Alignas(64) bin bin_array[BINS_MAX];
} bins;

void bins_clear(bins *b, int count);
void bins_merge(bins *b, const bins *other, int count);

/* Returns the sampling stride for a node with `count` items: only every n-th item is binned, where n is the stride. */
static inline int64_t bins_sampling_stride(int64_t count)
{
    return count < BINS_SAMPLED ? 1 : BINS_STRIDE;
}

/* Fills the bins with every stride-th item, starting with the first. */
void bins_fill(bins *b, const bin_mapping *m, const item *items, int64_t count, int64_t stride);

/* Returns the plane of lowest SAH cost for the items in the bins; if several planes have equal costs, the first of
 * them. */
bin_split bins_choose(const bins *b, const bin_mapping *m);

/* Returns a lower bound of the SAH cost of all planes that separate the items. */
float bins_compute_cost_bound(const item *items, int64_t count);

/* Returns whether a node with this SAH cost of its best split should be split rather than become a leaf. A split costs
 * two additional box tests. Returns true if the items do not fit in a leaf. */
static inline bool bins_is_split_cheaper(float cost, int64_t count, lanes bounds)
{
    return count > MMBVH_MAX_LEAF || cost < (float)(count - 2) * item_half_area(bounds);
}

/* Moves the items of the left side to the front and returns their number. The new order depends only on the old
 * order. */
int64_t bins_partition(const bin_mapping *m, bin_split split, item *items, int64_t count);

#endif
