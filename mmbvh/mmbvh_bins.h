/* Binned surface area heuristic: what the parallel top of the tree and the serial subtrees share.
 *
 * Boxes are sorted by centroid into bins along all three axes at once; every border between two bins of an axis is a
 * candidate plane. Minima, maxima and counts come out the same whatever order the boxes are met in, so bins filled by
 * different threads merge to the same bits. */
#ifndef MMBVH_BINS_H
#define MMBVH_BINS_H

#include <math.h>
#include <stdbool.h>

#include "mmbvh.h"
#include "mmbvh_vec4.h"

enum { BINS_MAX = 16 };

/* A box on its way into the tree. */
typedef struct bin_item {
    vec4 lower;
    vec4 upper; /* the spare lane holds the bits of the cell's index */
} bin_item;

/* Twice the centroid: the factor does not matter to the order. */
static inline vec4 bin_centroid(vec4 lower, vec4 upper)
{
    return vec4_xyz(lower + upper);
}

/* A box; the spare lane is rubbish. */
typedef struct bin_box {
    vec4 lower;
    vec4 upper;
} bin_box;

static inline bin_box bin_box_empty(void)
{
    return (bin_box){vec4_set1(INFINITY), vec4_set1(-INFINITY)};
}

static inline void bin_box_add(bin_box *box, vec4 lower, vec4 upper)
{
    box->lower = vec4_min(lower, box->lower);
    box->upper = vec4_max(upper, box->upper);
}

/* A set of items on its way to be a node: bounds of the boxes and of their centroids. */
typedef struct bin_set {
    bin_box bounds;
    bin_box centroids;
} bin_set;

static inline bin_set bin_set_empty(void)
{
    return (bin_set){bin_box_empty(), bin_box_empty()};
}

static inline void bin_set_add(bin_set *set, vec4 lower, vec4 upper)
{
    const vec4 centroid = bin_centroid(lower, upper);
    bin_box_add(&set->bounds, lower, upper);
    bin_box_add(&set->centroids, centroid, centroid);
}

static inline void bin_set_merge(bin_set *set, const bin_set *other)
{
    bin_box_add(&set->bounds, other->bounds.lower, other->bounds.upper);
    bin_box_add(&set->centroids, other->centroids.lower, other->centroids.upper);
}

static inline void bin_set_store(const bin_set *set, mmbvh_node *node)
{
    for (int axis = 0; axis < 3; axis++) {
        node->lower[axis] = set->bounds.lower[axis];
        node->upper[axis] = set->bounds.upper[axis];
    }
}

/* From a centroid to a bin on each axis. */
typedef struct bin_mapping {
    vec4 origin;
    vec4 factor;
    vec4 last;
    int count;
} bin_mapping;

/* Few boxes need few bins: the bins' own cost is most of a small node's. */
static inline bin_mapping bin_mapping_make(const bin_box *centroids, int64_t item_count)
{
    const int wanted = (int)(4 + (item_count < 4 * BINS_MAX ? item_count / 4 : BINS_MAX));
    const int count = wanted < BINS_MAX ? wanted : BINS_MAX;
    const vec4 extent = vec4_xyz(centroids->upper - centroids->lower);
    bin_mapping m = {.origin = vec4_xyz(centroids->lower), .last = vec4_set1((float)(count - 1)), .count = count};
    for (int axis = 0; axis < 3; axis++) {
        const float factor = (float)count / extent[axis];
        m.factor[axis] = extent[axis] > 0 && factor < INFINITY ? factor : 0;
    }
    return m;
}

/* In 0 .. count - 1 on each axis; a centroid that is not a number goes to the last. */
static inline ivec4 bin_of(const bin_mapping *m, vec4 centroid)
{
    return vec4_truncate(vec4_min((centroid - m->origin) * m->factor, m->last));
}

/* A side of a plane: left where the bin on the split's axis is below its border. */
typedef struct bin_split {
    int axis; /* -1: no plane leaves items on both sides */
    int border;
    float cost; /* Σ surface area × items of both sides, in units of the node's surface area */
} bin_split;

typedef struct bins {
    bin_box boxes[BINS_MAX][3];
    uint32_t counts[BINS_MAX][4];
} bins;

void bins_clear(bins *b, int count);
void bins_merge(bins *b, const bins *other, int count);

static inline void bins_add(bins *b, const bin_mapping *m, vec4 lower, vec4 upper)
{
    const ivec4 bin = bin_of(m, bin_centroid(lower, upper));
    for (int axis = 0; axis < 3; axis++) {
        bin_box_add(&b->boxes[bin[axis]][axis], lower, upper);
        b->counts[bin[axis]][axis]++;
    }
}

/* The plane of least cost; the first of equals. */
bin_split bins_choose(const bins *b, const bin_mapping *m, const bin_box *bounds);

/* The bounds on the split's two sides. */
void bins_split_bounds(const bins *b, const bin_mapping *m, bin_split split, bin_box sides[2]);

/* Whether count items are better parted than kept in a leaf: two boxes to test against the cells. More than a leaf
 * can hold always are. */
static inline bool bins_worth_splitting(bin_split split, int64_t count)
{
    return count > MMBVH_MAX_LEAF || (split.axis >= 0 && 2 + split.cost < (float)count);
}

#endif
