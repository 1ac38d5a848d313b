/* Binned surface area heuristic: what the parallel top of the tree and the serial subtrees share.
 *
 * Items are sorted by centroid into bins along all three axes at once; every border between two bins of an axis is a
 * candidate plane. Maxima and counts come out the same whatever order the items are met in, so bins filled by
 * different threads merge to the same bits. */
#ifndef MMBVH_BINS_H
#define MMBVH_BINS_H

#include <math.h>

#include "mmbvh.h"
#include "mmbvh_item.h"

enum { BINS_MAX = 16 };

/* From an item to a bin on each axis, in lanes 4 to 6. */
typedef struct bin_mapping {
    lanes origin;
    lanes factor;
    int count;
} bin_mapping;

bin_mapping bin_mapping_make(lanes centroids, int64_t item_count);

static inline lanes bin_of(const bin_mapping *m, item i)
{
    return lanes_scale((lanes)((ulanes)item_centroid(i) - (ulanes)m->origin), m->factor);
}

/* A side of a plane: left where the bin on the split's axis is below its border. */
typedef struct bin_split {
    int axis; /* -1: no plane leaves items on both sides */
    int border;
    float cost; /* Σ surface area × items of both sides, in units of the node's surface area */
} bin_split;

/* An item's side: 0 left, 1 right. lane is of the split's axis in bin_of()'s order; callers keep it in a register. */
static inline int bin_side(const bin_mapping *m, bin_split split, item i)
{
    int16_t bins[8];
    *(lanes *)(void *)bins = bin_of(m, i);
    return bins[4 + split.axis] >= split.border;
}

/* One cache line a bin. */
typedef struct bin {
    lanes boxes[3];
    uint32_t counts[4];
} bin;

typedef struct bins {
    _Alignas(64) bin of[BINS_MAX];
} bins;

void bins_clear(bins *b, int count);
void bins_merge(bins *b, const bins *other, int count);
void bins_fill(bins *b, const bin_mapping *m, const item *items, int64_t count);

/* The plane of least cost; the first of equals. */
bin_split bins_choose(const bins *b, const bin_mapping *m, lanes bounds, const item_grid *grid);

/* The bounds on the split's two sides. */
void bins_split_bounds(const bins *b, const bin_mapping *m, bin_split split, lanes sides[2]);

/* Whether count items are better parted than kept in a leaf: two boxes to test against the cells. More than a leaf
 * can hold always are. */
static inline bool bins_worth_splitting(bin_split split, int64_t count)
{
    return count > MMBVH_MAX_LEAF || (split.axis >= 0 && 2 + split.cost < (float)count);
}

/* Left items to the front; returns how many, and what the sides' centroids span. The order depends on the order
 * before alone. */
int64_t bins_part(const bin_mapping *m, bin_split split, item *items, int64_t count, lanes centroids[2]);

#endif
