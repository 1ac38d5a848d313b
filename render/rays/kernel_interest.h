/* Tests whether the range of values of a node or a cell contains a visible value. */
#ifndef RENDER_KERNEL_INTEREST_H
#define RENDER_KERNEL_INTEREST_H

#include <string.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

SIMD_INLINE bool kernel_interest_meets(const kernel_interest *interest, float low, float high)
{
    for (int i = 0; i < interest->count; i++)
        if (low <= interest->high[i] && high >= interest->low[i]) return true;
    return false;
}

/* Tests one range of values per lane against the visible intervals; returns the lanes that meet one. */
SIMD_INLINE vm kernel_interest_meets_lanes(const kernel_interest *interest, vf low, vf high)
{
    vm meets = vm_none();
    for (int i = 0; i < interest->count; i++)
        meets = vm_or(meets, vm_and(vf_le(low, vf_set(interest->high[i])), vf_le(vf_set(interest->low[i]), high)));
    return meets;
}

/* Tests one cell per lane, each with `count` vertex values, against the visible intervals; returns the lanes that meet
 * one. */
SIMD_INLINE vm kernel_interest_meets_values(const kernel_interest *interest, const vf *v, int count)
{
    vf low = v[0], high = v[0];
    for (int i = 1; i < count; i++) {
        low = vf_min(v[i], low);
        high = vf_max(v[i], high);
    }
    return kernel_interest_meets_lanes(interest, low, high);
}

SIMD_INLINE bool kernel_node_shows(const kernel_interest *interest, const mmbvh_ranges *ranges, int64_t node)
{
    float low, high;
    memcpy(&low, ranges->low + node * ranges->stride, sizeof low);
    memcpy(&high, ranges->high + node * ranges->stride, sizeof high);
    return kernel_interest_meets(interest, low, high);
}

#endif
