/* Tests whether the range of field values in a tree's node or in a cell contains a value at which the layer is
 * visible. */
#ifndef RENDER_KERNEL_VISIBLE_VALUES_H
#define RENDER_KERNEL_VISIBLE_VALUES_H

#include <string.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

SIMD_INLINE bool kernel_visible_values_overlap(const kernel_visible_values *visible_values, float low, float high)
{
    for (int i = 0; i < visible_values->count; i++)
        if (low <= visible_values->intervals[i].high && high >= visible_values->intervals[i].low) return true;
    return false;
}

/* Returns the lanes whose range of values, from low to high, overlaps a visible interval. */
SIMD_INLINE vm kernel_visible_values_overlap_lanes(const kernel_visible_values *visible_values, vf low, vf high)
{
    vm meets = vm_none();
    for (int i = 0; i < visible_values->count; i++) {
        const mmbvh_interval own = visible_values->intervals[i];
        meets = vm_or(meets, vm_and(vf_le(low, vf_set(own.high)), vf_le(vf_set(own.low), high)));
    }
    return meets;
}

/* Returns the lanes whose cell has a range of values that overlaps a visible interval. v: `count` vertex values of one
 * cell per lane. */
SIMD_INLINE vm kernel_visible_values_overlap_cells(const kernel_visible_values *visible_values, const vf *v, int count)
{
    vf low = v[0], high = v[0];
    for (int i = 1; i < count; i++) {
        low = vf_min(v[i], low);
        high = vf_max(v[i], high);
    }
    return kernel_visible_values_overlap_lanes(visible_values, low, high);
}

SIMD_INLINE bool kernel_node_is_visible(const kernel_visible_values *visible_values, const mmbvh_ranges *ranges,
                                        int64_t node)
{
    float low, high;
    memcpy(&low, ranges->low + node * ranges->stride, sizeof low);
    memcpy(&high, ranges->high + node * ranges->stride, sizeof high);
    return kernel_visible_values_overlap(visible_values, low, high);
}

#endif
