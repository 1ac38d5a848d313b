/* Finds the split of lowest SAH cost. The bins of all three axes are swept at the same time: lane k of a vector belongs
 * to axis k. The extents of the three axes' boxes are transposed, so that one sum of products of vectors gives three
 * surface areas. */
#include "mmbvh_bins.h"

enum { COUNT_MAX = INT16_MAX }; /* largest number of items that a 16-bit lane can count */

/* Returns the mapping from centroids to bins. Few items get few bins, because the work per bin dominates the cost of
 * small nodes. */
bin_mapping bin_mapping_make(lanes centroids, int64_t item_count)
{
    const int wanted = (int)(4 + (item_count < (int64_t)8 * BINS_MAX ? item_count / 8 : BINS_MAX));
    const int count = wanted < BINS_MAX ? wanted : BINS_MAX;
    const lanes used = centroids & (lanes){-1, -1, -1, 0, -1, -1, -1, 0};
    const ivec4 least = -lanes_lower(used), extent = lanes_upper(used) - least;
    /* The quotient is truncated to an integer. If it is below 2^15, its rounding error is too small to change that
     * integer; larger quotients are clamped. */
    const vec4 quotient = vec4_set1((float)(count * 65536)) / vec4_from_int(extent + 1);
    /* the limit ensures that a bin is at least as wide as a step of the item_grid */
    const ivec4 factor = vec4_truncate(vec4_min(quotient, vec4_set1(32768)));
    return (bin_mapping){(ulanes)lanes_pack(least, least),
                         lanes_pack(factor - 32768, factor - 32768) ^ lanes_set1(INT16_MIN), count};
}

void bins_clear(bins *b, int count)
{
    const lanes none = {INT16_MIN, INT16_MIN, INT16_MIN, 0, INT16_MIN, INT16_MIN, INT16_MIN, 0};
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) b->bin_array[bin].boxes[axis] = none;
        *(ivec4 *)b->bin_array[bin].counts = (ivec4){0};
    }
}

void bins_merge(bins *b, const bins *other, int count)
{
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) {
            b->bin_array[bin].boxes[axis] = lanes_max(b->bin_array[bin].boxes[axis], other->bin_array[bin].boxes[axis]);
            b->bin_array[bin].counts[axis] += other->bin_array[bin].counts[axis];
        }
    }
}

/* Returns the byte offsets of the bins of two items: lanes 0 to 2 hold those of `a` on each axis, lanes 4 to 6 those of
 * `b`. */
static inline ulanes find_lane_offsets(const bin_mapping *m, item a, item b)
{
    const lanes upper = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
    const lanes lower = __builtin_shufflevector(
        a, b, 0, 1, 2, 3, 8, 9, 10, 11); /* the lower bound is stored as ITEM_TOP - lower, hence the subtraction */
    const ulanes places = (ulanes)lanes_multiply_high((lanes)((ulanes)upper - (ulanes)lower - m->origin), m->factor);
    return places * (uint16_t)sizeof(bin);
}

/* Adds an item to its bin on each axis. Lane 3 of a bin's box counts the items, so that a bin needs only one load and
 * one store. */
static inline void add_item(bins *b, const uint16_t offsets[3], item i)
{
    const lanes counted = i & (lanes){-1, -1, -1, 0, -1, -1, -1, 0};
    for (int axis = 0; axis < 3; axis++) {
        lanes *box = (lanes *)(void *)((char *)b->bin_array + offsets[axis]) + axis;
        *box = lanes_max(*box, counted) + (lanes){0, 0, 0, 1};
    }
}

/* Adds the counts in lane 3 of the boxes to the bins' counters, and sets lane 3 to 0. */
static void add_lane_counts(bins *b, int count)
{
    for (int i = 0; i < count; i++) {
        bin *of = &b->bin_array[i];
        const ivec4 x = (ivec4)of->boxes[0], y = (ivec4)of->boxes[1], z = (ivec4)of->boxes[2];
        const ivec4 xy = __builtin_shufflevector(x, y, 1, 1, 5, 5);
        *(ivec4 *)of->counts += __builtin_shufflevector(xy, z, 0, 2, 5, 5) >> 16;
        for (int axis = 0; axis < 3; axis++) of->boxes[axis] &= (lanes){-1, -1, -1, 0, -1, -1, -1, 0};
    }
}

/* Adds `count` items, every stride-th one, two at a time: one from each half of the list. Two neighbouring items are
 * not added at the same time, because they often belong to the same bin, and the second load would then wait for the
 * first store. */
static void bin_items(bins *b, const bin_mapping *mapping, const item *items, int64_t count, int64_t stride)
{
    const int64_t half = count / 2;
    const item *halves = items + half * stride;
    const bin_mapping m = *mapping; /* a local copy stays in registers */
    uint16_t offsets[8];
    for (int64_t i = 0; i < half; i++) {
        const item first = items[i * stride], second = halves[i * stride];
        *(ulanes *)(void *)offsets = find_lane_offsets(&m, first, second);
        add_item(b, offsets, first);
        add_item(b, offsets + 4, second);
    }
    if (!(count & 1)) return;
    const item last = items[(count - 1) * stride];
    *(ulanes *)(void *)offsets = find_lane_offsets(&m, last, last);
    add_item(b, offsets, last);
}

void bins_fill(bins *b, const bin_mapping *m, const item *items, int64_t count, int64_t stride)
{
    const int64_t samples = (count + stride - 1) / stride;
    for (int64_t begin = 0; begin < samples; begin += COUNT_MAX) {
        const int64_t n = samples - begin < COUNT_MAX ? samples - begin : COUNT_MAX;
        bin_items(b, m, items + begin * stride, n, stride);
        add_lane_counts(b, m->count);
    }
}

/* Returns half the surface areas of three boxes, in lanes 0 to 2. */
static inline vec4 compute_three_half_areas(const lanes boxes[3])
{
    const lanes x = item_extent(boxes[0]), y = item_extent(boxes[1]), z = item_extent(boxes[2]);
    const ivec4 xy = item_half_area_summands(__builtin_shufflevector(x, y, 0, 1, 2, 3, 8, 9, 10, 11)),
                zz = item_half_area_summands(z);
    return vec4_from_int(__builtin_shufflevector(xy, zz, 0, 2, 4, 6)) +
           vec4_from_int(__builtin_shufflevector(xy, zz, 1, 3, 5, 7));
}

/* Returns the SAH costs of one side of a plane, for three planes: lane k (0 to 2) belongs to a plane perpendicular to
 * axis k. The cost is half the surface area of the box of the items on that side, times the number of these items. The
 * cost of an empty side is NaN, which never compares as the smallest. */
static inline vec4 compute_side_costs(const lanes boxes[3], ivec4 counts)
{
    return (vec4)((ivec4)(compute_three_half_areas(boxes) * vec4_from_int(counts)) | (ivec4)(counts == 0));
}

static inline void extend_side(lanes boxes[3], ivec4 *counts, const bins *b, int bin)
{
    for (int axis = 0; axis < 3; axis++) boxes[axis] = lanes_max(boxes[axis], b->bin_array[bin].boxes[axis]);
    *counts += *(const ivec4 *)b->bin_array[bin].counts;
}

/* Compares the best splits of the three axes and returns the one with the lowest cost. Uses no branches that the
 * processor would often predict wrongly. */
static bin_split find_cheapest_axis(vec4 costs, ivec4 borders)
{
    float cost = costs[0];
    int axis = 0, border = borders[0];
    for (int other = 1; other < 3; other++) {
        const bool is_less = costs[other] < cost;
        cost = is_less ? costs[other] : cost;
        axis = is_less ? other : axis;
        border = is_less ? borders[other] : border;
    }
    return (bin_split){cost < INFINITY ? axis : -1, border, cost};
}

bin_split bins_choose(const bins *b, const bin_mapping *m)
{
    const lanes none = lanes_set1(INT16_MIN);
    vec4 right_cost[BINS_MAX];
    lanes boxes[3] = {none, none, none};
    ivec4 counts = {0};
    for (int border = m->count - 1; border > 0; border--) {
        extend_side(boxes, &counts, b, border);
        right_cost[border] = compute_side_costs(boxes, counts);
    }
    for (int axis = 0; axis < 3; axis++) boxes[axis] = none;
    counts = (ivec4){0};
    vec4 best = vec4_set1(INFINITY);
    ivec4 best_border = {0};
    for (int border = 1; border < m->count; border++) {
        extend_side(boxes, &counts, b, border - 1);
        const vec4 cost = compute_side_costs(boxes, counts) + right_cost[border];
        const ivec4 better = (ivec4)(cost < best);
        best = (vec4)(((ivec4)cost & better) | ((ivec4)best & ~better));
        best_border = (border & better) | (best_border & ~better);
    }
    return find_cheapest_axis(best, best_border);
}

/* Each item's box lies in the box of all items on its side of the plane. Therefore no plane costs less than the sum of
 * the surface areas of the items' boxes. */
float bins_compute_cost_bound(const item *items, int64_t count)
{
    vec4 terms = {0};
    for (int64_t i = 0; i < count; i++) terms += vec4_from_int(item_half_area_summands(item_extent(items[i])));
    return terms[0] + terms[1];
}

/* Partitions without unpredictable branches: every item is swapped with the first item of the right side. If the item
 * belongs to the left side, the left side then grows by one. */
int64_t bins_partition(const bin_mapping *m, bin_split split, item *items, int64_t count)
{
    enum { SIZE = sizeof(item), SIGN_TO_SIZE = 27 };
    const int factor = (uint16_t)m->factor[split.axis];
    /* lowest value of (2 * centroid - ITEM_TOP) on the axis that belongs to the right side */
    const int first = (int16_t)m->origin[split.axis] + (split.first_right_bin * 65536 + factor - 1) / factor;
    const int16_t *lower = (const int16_t *)(const void *)items + split.axis, *upper = lower + 4;
    char *base = (char *)items;
    int64_t left = 0; /* size of the left side in bytes */
    for (int64_t i = 0; i < count; i++) {
        const int before = upper[8 * i] - lower[8 * i] - first; /* negative if the item belongs to the left side */
        const item moved = items[i];
        item *place = (item *)(void *)(base + left);
        items[i] = *place;
        *place = moved;
        left += before >> SIGN_TO_SIZE & SIZE;
    }
    return left / SIZE;
}
