/* Binned surface area heuristic, shared by the parallel top of the tree and the serial subtrees. Items are sorted by
 * centroid into bins along all three axes at once; every border between two bins of an axis is a candidate plane.
 * Maxima and counts do not depend on the order of the items, so bins filled by different threads merge to the same
 * bits. */
#ifndef MMBVH_BINS_H
#define MMBVH_BINS_H

#include <math.h>

#include "mmbvh.h"
#include "mmbvh_item.h"

enum {
    BINS_MAX = 16,
    BINS_SAMPLED = 2048, /* this many items or more are sampled */
    BINS_STRIDE = 7      /* one item in this many is binned; the split found is as good */
};

/* Maps twice the centroid, less TOP, to a bin on each axis. Lanes 4 to 6 repeat 0 to 2, for two items at a time. */
typedef struct bin_mapping {
    ulanes origin;
    lanes factor;
    int count;
} bin_mapping;

bin_mapping bin_mapping_make(lanes centroids, int64_t item_count);

/* A side of a plane: left where the bin on the split's axis is below its border. */
typedef struct bin_split {
    int axis; /* -1: no plane leaves items on both sides */
    int border;
    float cost; /* Σ half the surface area, in square steps, × items of both sides */
} bin_split;

/* One cache line a bin. */
typedef struct bin {
    lanes boxes[3]; /* lanes 3 and 7 are scratch */
    uint32_t counts[4];
} bin;

typedef struct bins {
    _Alignas(64) bin of[BINS_MAX];
} bins;

void bins_clear(bins *b, int count);
void bins_merge(bins *b, const bins *other, int count);

/* Returns how many items of a node one sampled item stands for. */
static inline int64_t bins_stride(int64_t count)
{
    return count < BINS_SAMPLED ? 1 : BINS_STRIDE;
}

/* Fills the bins with every stride-th item, from the first on. */
void bins_fill(bins *b, const bin_mapping *m, const item *items, int64_t count, int64_t stride);

/* The plane of least cost for the items in the bins; the first of equals. */
bin_split bins_choose(const bins *b, const bin_mapping *m);

/* A lower bound of what any plane between the items costs. */
float bins_least_cost(const item *items, int64_t count);

/* Tells whether splitting count items at this cost, which adds two boxes to test, is better than a leaf. Items that do
 * not fit in a leaf are always split. */
static inline bool bins_worth_splitting(float cost, int64_t count, lanes bounds)
{
    return count > MMBVH_MAX_LEAF || cost < (float)(count - 2) * item_half_area(bounds);
}

/* Moves the left items to the front; returns how many they are. The result depends only on the order before. */
int64_t bins_part(const bin_mapping *m, bin_split split, item *items, int64_t count);

#endif
