/* Sweeps over the bins of the three axes at once: lane k of a vector is axis k's candidate, so that one transposition
 * turns three boxes' extents into one product sum for three surface areas. */
#include "mmbvh_bins.h"

void bins_clear(bins *b, int count)
{
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) b->boxes[bin][axis] = bin_box_empty();
        for (int axis = 0; axis < 4; axis++) b->counts[bin][axis] = 0;
    }
}

void bins_merge(bins *b, const bins *other, int count)
{
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) {
            bin_box_add(&b->boxes[bin][axis], other->boxes[bin][axis].lower, other->boxes[bin][axis].upper);
            b->counts[bin][axis] += other->counts[bin][axis];
        }
    }
}

/* One factor that takes the node's longest side to 1, so that no area leaves the floats' range. */
static vec4 unit_of(const bin_box *bounds)
{
    const vec4 extent = bounds->upper - bounds->lower;
    float longest = 0;
    for (int axis = 0; axis < 3; axis++) longest = extent[axis] > longest ? extent[axis] : longest;
    const float unit = 1 / longest;
    return vec4_set1(unit < INFINITY ? unit : 1);
}

static inline float half_area(const bin_box *box, vec4 unit)
{
    const vec4 d = (box->upper - box->lower) * unit;
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
}

/* Half the surface areas of three boxes, in lanes 0 to 2. */
static inline vec4 half_areas(const bin_box boxes[3], vec4 unit)
{
    const vec4 a = boxes[0].upper - boxes[0].lower, b = boxes[1].upper - boxes[1].lower;
    const vec4 c = boxes[2].upper - boxes[2].lower;
    const vec4 ab_xy = __builtin_shufflevector(a, b, 0, 4, 1, 5), cc_xy = __builtin_shufflevector(c, c, 0, 4, 1, 5);
    const vec4 ab_zz = __builtin_shufflevector(a, b, 2, 6, 2, 6), cc_zz = __builtin_shufflevector(c, c, 2, 6, 2, 6);
    const vec4 x = __builtin_shufflevector(ab_xy, cc_xy, 0, 1, 4, 5) * unit;
    const vec4 y = __builtin_shufflevector(ab_xy, cc_xy, 2, 3, 6, 7) * unit;
    const vec4 z = __builtin_shufflevector(ab_zz, cc_zz, 0, 1, 4, 5) * unit;
    return x * y + y * z + z * x;
}

/* As floats, though the counts use all 32 bits. */
static inline vec4 counts_to_float(ivec4 counts)
{
    const ivec4 half = (counts >> 1) & 0x7fffffff;
    return __builtin_convertvector(half, vec4) * 2.0f + __builtin_convertvector(counts & 1, vec4);
}

/* An empty side's area is not a number or infinite, and its count 0: their product never compares as less. */
static inline vec4 side_cost(const bin_box boxes[3], ivec4 counts, vec4 unit)
{
    const vec4 cost = half_areas(boxes, unit) * counts_to_float(counts);
    const ivec4 empty = (ivec4)(counts == 0);
    return (vec4)(((ivec4)cost & ~empty) | ((ivec4)vec4_set1(INFINITY) & empty));
}

static inline void grow(bin_box boxes[3], ivec4 *counts, const bins *b, int bin)
{
    for (int axis = 0; axis < 3; axis++) {
        bin_box_add(&boxes[axis], b->boxes[bin][axis].lower, b->boxes[bin][axis].upper);
    }
    *counts += *(const ivec4 *)b->counts[bin];
}

bin_split bins_choose(const bins *b, const bin_mapping *m, const bin_box *bounds)
{
    const vec4 unit = unit_of(bounds);
    vec4 right_cost[BINS_MAX];
    bin_box boxes[3] = {bin_box_empty(), bin_box_empty(), bin_box_empty()};
    ivec4 counts = {0};
    for (int border = m->count - 1; border > 0; border--) {
        grow(boxes, &counts, b, border);
        right_cost[border] = side_cost(boxes, counts, unit);
    }
    for (int axis = 0; axis < 3; axis++) boxes[axis] = bin_box_empty();
    counts = (ivec4){0};
    vec4 best = vec4_set1(INFINITY);
    ivec4 best_border = {0};
    for (int border = 1; border < m->count; border++) {
        grow(boxes, &counts, b, border - 1);
        const vec4 cost = side_cost(boxes, counts, unit) + right_cost[border];
        const ivec4 better = (ivec4)(cost < best);
        best = (vec4)(((ivec4)cost & better) | ((ivec4)best & ~better));
        best_border = (border & better) | (best_border & ~better);
    }
    bin_split split = {.axis = -1, .cost = INFINITY};
    for (int axis = 0; axis < 3; axis++) {
        if (best[axis] < split.cost) split = (bin_split){axis, best_border[axis], best[axis]};
    }
    const float area = half_area(bounds, unit);
    if (split.axis >= 0) split.cost = area > 0 ? split.cost / area : INFINITY;
    return split;
}

void bins_split_bounds(const bins *b, const bin_mapping *m, bin_split split, bin_box sides[2])
{
    sides[0] = sides[1] = bin_box_empty();
    for (int bin = 0; bin < m->count; bin++) {
        const bin_box *box = &b->boxes[bin][split.axis];
        bin_box_add(&sides[bin >= split.border], box->lower, box->upper);
    }
}
