/* Neubauer's method (thesis, algorithm 4.2), to compare the robust roots with (kernel_roots.h). */
#ifndef RENDER_KERNEL_NEUBAUER_H
#define RENDER_KERNEL_NEUBAUER_H

#include "kernel_cell.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "simd.h"

/* Makes steps of regula falsi on the field along the ray. The guess for an inverse map is on the line between the
 * places found so far, and so better in every step. */
SIMD_INLINE void kernel_neubauer(kernel_packet *p, const kernel_map *map, const kernel_interval *i, vm rays, int steps,
                                 kernel_point *out)
{
    kernel_point low, high;
    kernel_point_ends(i, &low, &high);
    *out = low;
    for (int n = 0; n <= steps; n++) {
        out->t = kernel_secant(low.t, low.value, high.t, high.value);
        kernel_place_between(&low, &high, out->t, out->r);
        out->value = kernel_solve(p, map, i, rays, out->t, out->r);
        const vm same = vm_not(vm_xor(vf_lt(out->value, vf_set(0)), vf_lt(low.value, vf_set(0))));
        kernel_place_move(same, out, &low);
        kernel_place_move(vm_not(same), out, &high);
    }
}

#endif
