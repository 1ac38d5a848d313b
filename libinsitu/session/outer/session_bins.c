#include "session_bins.h"

#include <math.h>
#include <string.h>

#include "memory.h"

static int64_t bin_index_along(const session_bins *b, double position, int axis)
{
    const double at = (position - b->lower[axis]) * b->bins_per_length;
    return at < 0 ? 0 : at >= (double)b->counts[axis] ? b->counts[axis] - 1 : (int64_t)at;
}

static int64_t bin_index(const session_bins *b, const double position[3])
{
    return bin_index_along(b, position[0], 0) +
           b->counts[0] * (bin_index_along(b, position[1], 1) + b->counts[1] * bin_index_along(b, position[2], 2));
}

static const double *position_at(const double *positions, int64_t stride, int64_t i)
{
    return (const double *)(const void *)((const char *)positions + i * stride);
}

/* Computes the size of the bins and the number of bins along each axis. Returns the total number of bins. */
static int64_t choose_bin_size(session_bins *b, const double *positions, int64_t stride, int64_t count)
{
    double upper[3], widest = 0;
    for (int axis = 0; axis < 3; axis++) {
        b->lower[axis] = (double)INFINITY;
        upper[axis] = -(double)INFINITY;
        for (int64_t i = 0; i < count; i++) {
            b->lower[axis] = fmin(b->lower[axis], position_at(positions, stride, i)[axis]);
            upper[axis] = fmax(upper[axis], position_at(positions, stride, i)[axis]);
        }
        widest = fmax(widest, upper[axis] - b->lower[axis]);
    }
    const double across = fmin(fmax(sqrt((double)count) / 2, 1), 128);
    int64_t bins = 1;
    b->bins_per_length = widest > 0 ? across / widest : 1;
    for (int axis = 0; axis < 3; axis++) {
        b->counts[axis] = count ? (int64_t)((upper[axis] - b->lower[axis]) * b->bins_per_length) + 1 : 1;
        bins *= b->counts[axis];
    }
    return bins;
}

bool session_bins_create(session_bins *b, const double *positions, int64_t stride, int64_t count)
{
    const int64_t bins = choose_bin_size(b, positions, stride, count);
    b->starts = base_calloc((size_t)bins + 2, sizeof *b->starts);
    b->items = base_alloc((size_t)(count + 1) * sizeof *b->items);
    if (!b->starts || !b->items) return false;
    for (int64_t i = 0; i < count; i++) b->starts[bin_index(b, position_at(positions, stride, i)) + 2]++;
    for (int64_t n = 0; n < bins; n++) b->starts[n + 2] += b->starts[n + 1];
    for (int64_t i = 0; i < count; i++) b->items[b->starts[bin_index(b, position_at(positions, stride, i)) + 1]++] = i;
    return true;
}

void session_bins_free(session_bins *bins)
{
    base_free(bins->starts);
    base_free(bins->items);
    *bins = (session_bins){0};
}

/* Sets the iterator to the points of one row of bins. The row extends along the first axis, and has the indices
 * walk->bin[1] and walk->bin[2] along the other axes. */
static void enter_bin_row(session_bin_walk *walk)
{
    const session_bins *b = walk->bins;
    const int64_t row = b->counts[0] * (walk->bin[1] + b->counts[1] * walk->bin[2]);
    walk->next = b->starts[row + walk->first_bin[0]];
    walk->end = b->starts[row + walk->last_bin[0] + 1];
}

session_bin_walk session_begin_bin_walk(const session_bins *bins, const double lower[3], const double upper[3],
                                        double margin)
{
    session_bin_walk walk = {.bins = bins};
    for (int axis = 0; axis < 3; axis++) {
        walk.bin[axis] = walk.first_bin[axis] = bin_index_along(bins, lower[axis] - margin, axis);
        walk.last_bin[axis] = bin_index_along(bins, upper[axis] + margin, axis);
    }
    enter_bin_row(&walk);
    return walk;
}

bool session_next_point_in_bins(session_bin_walk *walk, int64_t *point)
{
    while (walk->next == walk->end) {
        if (++walk->bin[1] > walk->last_bin[1]) {
            walk->bin[1] = walk->first_bin[1];
            if (++walk->bin[2] > walk->last_bin[2]) return false;
        }
        enter_bin_row(walk);
    }
    *point = walk->bins->items[walk->next++];
    return true;
}
