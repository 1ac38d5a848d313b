/* Sweeps over the bins of the three axes at once: lane k of a vector is axis k's candidate, so that one transposition
 * turns three boxes' extents into one product sum for three surface areas. */
#include "mmbvh_bins.h"

/* Few items need few bins: the bins' own cost is most of a small node's. */
bin_mapping bin_mapping_make(lanes centroids, int64_t item_count)
{
    const int wanted = (int)(4 + (item_count < 4 * BINS_MAX ? item_count / 4 : BINS_MAX));
    bin_mapping m = {.count = wanted < BINS_MAX ? wanted : BINS_MAX};
    for (int axis = 0; axis < 3; axis++) {
        const int least = -centroids[axis], extent = centroids[4 + axis] - least;
        const int factor = m.count * 65536 / (extent + 1);
        m.origin[4 + axis] = (int16_t)least;
        m.factor[4 + axis] = (int16_t)(uint16_t)(factor < 32768 ? factor : 32768); /* so that 2 steps part */
    }
    return m;
}

void bins_clear(bins *b, int count)
{
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) b->of[bin].boxes[axis] = lanes_set1(INT16_MIN);
        for (int axis = 0; axis < 4; axis++) b->of[bin].counts[axis] = 0;
    }
}

void bins_merge(bins *b, const bins *other, int count)
{
    for (int bin = 0; bin < count; bin++) {
        for (int axis = 0; axis < 3; axis++) {
            b->of[bin].boxes[axis] = lanes_max(b->of[bin].boxes[axis], other->of[bin].boxes[axis]);
            b->of[bin].counts[axis] += other->of[bin].counts[axis];
        }
    }
}

void bins_fill(bins *b, const bin_mapping *m, const item *items, int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        const lanes places = bin_of(m, items[i]);
        for (int axis = 0; axis < 3; axis++) {
            bin *to = &b->of[places[4 + axis]];
            to->boxes[axis] = lanes_max(to->boxes[axis], items[i]);
            to->counts[axis]++;
        }
    }
}

/* Steps to lengths of which the box's longest is 1, so that no area leaves the floats' range. */
static vec4 lengths_of(lanes bounds, const item_grid *grid)
{
    const lanes extent = item_extent(bounds);
    double longest = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double length = extent[axis] * grid->step[axis];
        longest = length > longest ? length : longest;
    }
    vec4 lengths = {0};
    for (int axis = 0; axis < 3; axis++) lengths[axis] = longest > 0 ? (float)(grid->step[axis] / longest) : 0;
    return lengths;
}

static inline float half_area(lanes box, vec4 lengths)
{
    const vec4 d = lanes_to_vec4(item_extent(box)) * lengths;
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
}

/* Half the surface areas of three boxes, in lanes 0 to 2. */
static inline vec4 half_areas(const lanes boxes[3], vec4 lengths)
{
    const vec4 a = lanes_to_vec4(item_extent(boxes[0])) * lengths;
    const vec4 b = lanes_to_vec4(item_extent(boxes[1])) * lengths;
    const vec4 c = lanes_to_vec4(item_extent(boxes[2])) * lengths;
    const vec4 ab_xy = __builtin_shufflevector(a, b, 0, 4, 1, 5), cc_xy = __builtin_shufflevector(c, c, 0, 4, 1, 5);
    const vec4 ab_zz = __builtin_shufflevector(a, b, 2, 6, 2, 6), cc_zz = __builtin_shufflevector(c, c, 2, 6, 2, 6);
    const vec4 x = __builtin_shufflevector(ab_xy, cc_xy, 0, 1, 4, 5);
    const vec4 y = __builtin_shufflevector(ab_xy, cc_xy, 2, 3, 6, 7);
    const vec4 z = __builtin_shufflevector(ab_zz, cc_zz, 0, 1, 4, 5);
    return x * y + y * z + z * x;
}

/* As floats, though the counts use all 32 bits. */
static inline vec4 counts_to_float(ivec4 counts)
{
    const ivec4 half = (counts >> 1) & 0x7fffffff;
    return vec4_from_int(half) * 2.0f + vec4_from_int(counts & 1);
}

/* An empty side costs without end, whatever its box says. */
static inline vec4 side_cost(const lanes boxes[3], ivec4 counts, vec4 lengths)
{
    const vec4 cost = half_areas(boxes, lengths) * counts_to_float(counts);
    const ivec4 empty = (ivec4)(counts == 0);
    return (vec4)(((ivec4)cost & ~empty) | ((ivec4)vec4_set1(INFINITY) & empty));
}

static inline void grow(lanes boxes[3], ivec4 *counts, const bins *b, int bin)
{
    for (int axis = 0; axis < 3; axis++) boxes[axis] = lanes_max(boxes[axis], b->of[bin].boxes[axis]);
    *counts += *(const ivec4 *)b->of[bin].counts;
}

bin_split bins_choose(const bins *b, const bin_mapping *m, lanes bounds, const item_grid *grid)
{
    const vec4 lengths = lengths_of(bounds, grid);
    const lanes none = lanes_set1(INT16_MIN);
    vec4 right_cost[BINS_MAX];
    lanes boxes[3] = {none, none, none};
    ivec4 counts = {0};
    for (int border = m->count - 1; border > 0; border--) {
        grow(boxes, &counts, b, border);
        right_cost[border] = side_cost(boxes, counts, lengths);
    }
    for (int axis = 0; axis < 3; axis++) boxes[axis] = none;
    counts = (ivec4){0};
    vec4 best = vec4_set1(INFINITY);
    ivec4 best_border = {0};
    for (int border = 1; border < m->count; border++) {
        grow(boxes, &counts, b, border - 1);
        const vec4 cost = side_cost(boxes, counts, lengths) + right_cost[border];
        const ivec4 better = (ivec4)(cost < best);
        best = (vec4)(((ivec4)cost & better) | ((ivec4)best & ~better));
        best_border = (border & better) | (best_border & ~better);
    }
    bin_split split = {.axis = -1, .cost = INFINITY};
    for (int axis = 0; axis < 3; axis++) {
        if (best[axis] < split.cost) split = (bin_split){axis, best_border[axis], best[axis]};
    }
    const float area = half_area(bounds, lengths);
    if (split.axis >= 0) split.cost = area > 0 ? split.cost / area : INFINITY;
    return split;
}

void bins_split_bounds(const bins *b, const bin_mapping *m, bin_split split, lanes sides[2])
{
    sides[0] = sides[1] = lanes_set1(INT16_MIN);
    for (int bin = 0; bin < m->count; bin++) {
        lanes *side = &sides[bin >= split.border];
        *side = lanes_max(*side, b->of[bin].boxes[split.axis]);
    }
}

/* Whichever side it is of, an item changes places with the first right one so far; only how far the left ones reach
 * depends on it. No branch is there to be mispredicted. */
int64_t bins_part(const bin_mapping *m, bin_split split, item *items, int64_t count, lanes centroids[2])
{
    int64_t left = 0;
    for (int64_t i = 0; i < count; i++) {
        const item moved = items[i];
        const int side = bin_side(m, split, moved);
        centroids[side] = lanes_max(centroids[side], item_centroid(moved));
        items[i] = items[left];
        items[left] = moved;
        left += !side;
    }
    return left;
}
