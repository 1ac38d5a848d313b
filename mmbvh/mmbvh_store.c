#include "mmbvh_store.h"

#include <math.h>

/* Returns the smallest power of two that is not below x, or 0 for 0. */
static double ceil_power_of_two(double x)
{
    int exponent;
    const double fraction = frexp(x, &exponent);
    return x > 0 ? ldexp(1, fraction > 0.5 ? exponent : exponent - 1) : 0;
}

/* The step of an axis is at least the distance between neighbouring floats at the largest absolute coordinate of the
 * box, so that rounding never loses a step. */
mmbvh_grid store_make_grid(const float lower[3], const float upper[3])
{
    enum { STEPS = (1 << COMPACT_LOWER_BITS) - (1 << (COMPACT_LOWER_BITS - COMPACT_MANTISSA_BITS)) };
    mmbvh_grid grid = {0};
    for (int axis = 0; axis < 3; axis++) {
        const double low = (double)lower[axis], high = (double)upper[axis];
        const double far = fmax(fabs(low), fabs(high));
        const double step = fmax(ceil_power_of_two(fmax((high - low) / STEPS, far * 0x1p-23)), 0x1p-100);
        grid.step[axis] = (float)step;
        grid.origin[axis] = (float)(floor(low / step) * step);
        if (grid.origin[axis] > lower[axis]) grid.origin[axis] = nextafterf(grid.origin[axis], -INFINITY);
    }
    return grid;
}

bool store_compact_slowly(const mmbvh *tree, int64_t index, vec4 lower, vec4 upper)
{
    for (int axis = 0; axis < 3; axis++) {
        uint32_t *word = &tree->compact[index].axis[axis];
        if (!(tree->grid.origin[axis] <= lower[axis] && lower[axis] <= upper[axis])) return false;
        for (;;) {
            float low[4], high[4];
            compact_box(&tree->compact[index], &tree->grid, low, high);
            const bool is_low = low[axis] <= lower[axis], is_high = high[axis] >= upper[axis];
            if (is_low && is_high) break;
            if (!is_low && !(*word & COMPACT_LOWER_MAX)) return false;
            if (is_low && *word >> COMPACT_LOWER_BITS == COMPACT_EXTENT_MAX) return false;
            *word += is_low ? 1u << COMPACT_LOWER_BITS : UINT32_MAX;
        }
    }
    return true;
}
