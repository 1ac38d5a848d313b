/* The field along a ray through a cell: on the line between the values at its faces, and by the inverse map. */
#ifndef RENDER_KERNEL_FIELD_H
#define RENDER_KERNEL_FIELD_H

#include <string.h>

#include "kernel_cell.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "simd.h"

/* Where the line through the ends is zero. */
SIMD_INLINE vf kernel_secant(vf t0, vf v0, vf t1, vf v1)
{
    return vf_clamp(t0 - v0 * ((t1 - t0) / (v1 - v0)), t0, t1);
}

/* How much of the interval lies before t: 0 .. 1. */
SIMD_INLINE vf kernel_share(const kernel_interval *i, vf t)
{
    const vf length = i->t_out - i->t_in;
    return vf_select(vf_lt(vf_set(0), length), (t - i->t_in) / length, vf_set(0));
}

/* The value at t on the line between those at the faces; and a guess for the coordinates there, likewise. */
SIMD_INLINE vf kernel_line_value(const kernel_interval *i, vf t)
{
    return i->v_in + kernel_share(i, t) * (i->v_out - i->v_in);
}

SIMD_INLINE void kernel_guess(const kernel_interval *i, vf t, vf r[3])
{
    const vf along = kernel_share(i, t);
    for (int a = 0; a < 3; a++) r[a] = i->r_in[a] + along * (i->r_out[a] - i->r_in[a]);
}

/* Field and the cell's own coordinates at t, from the guess in r; on rays where the inverse map fails, the lines
 * between the faces' values and coordinates, counted. */
SIMD_INLINE vf kernel_solve_lanes(const kernel_rays *rays, const kernel_map_lanes *map, const kernel_interval *i,
                                  vm wanted, vf t, vf r[3], int64_t *failures)
{
    const vm failed = kernel_map_invert(rays, map, wanted, t, r);
    const bool has_failed = vm_any(failed);
    if (has_failed) {
        vf line[3];
        kernel_guess(i, t, line);
        for (int a = 0; a < 3; a++) r[a] = vf_select(failed, line[a], r[a]);
        *failures += __builtin_popcount(vm_bits(failed));
    }
    const kernel_product m = kernel_product_at(map->is_pyramid, r);
    const vf value = kernel_value_of(map->field, map->is_pyramid, &m, r);
    return has_failed ? vf_select(failed, kernel_line_value(i, t), value) : value;
}

/* The packet's rays, all in one cell. */
SIMD_INLINE vf kernel_solve(kernel_packet *p, const kernel_map *map, const kernel_interval *i, vm rays, vf t, vf r[3])
{
    const kernel_rays own = kernel_packet_rays(p);
    kernel_map_lanes lanes;
    kernel_map_spread(map, &lanes);
    return kernel_solve_lanes(&own, &lanes, i, rays, t, r, &p->thread->map_failures);
}

SIMD_INLINE vf kernel_value_at(kernel_packet *p, const kernel_map *map, const kernel_interval *i, vm rays, vf t)
{
    vf r[3];
    kernel_guess(i, t, r);
    return kernel_solve(p, map, i, rays, t, r);
}

/* A point of a ray in a cell. */
typedef struct kernel_point {
    vf t, value, r[3];
} kernel_point;

SIMD_INLINE void kernel_point_ends(const kernel_interval *i, kernel_point *in, kernel_point *out)
{
    in->t = i->t_in;
    in->value = i->v_in;
    out->t = i->t_out;
    out->value = i->v_out;
    memcpy(in->r, i->r_in, sizeof in->r);
    memcpy(out->r, i->r_out, sizeof out->r);
}

SIMD_INLINE void kernel_place_move(vm mask, const kernel_point *from, kernel_point *to)
{
    to->t = vf_select(mask, from->t, to->t);
    to->value = vf_select(mask, from->value, to->value);
    for (int a = 0; a < 3; a++) to->r[a] = vf_select(mask, from->r[a], to->r[a]);
}

/* On the line between the places, at t. */
SIMD_INLINE void kernel_place_between(const kernel_point *low, const kernel_point *high, vf t, vf r[3])
{
    const vf length = high->t - low->t;
    const vf along = vf_select(vf_lt(vf_set(0), length), (t - low->t) / length, vf_set(0));
    for (int a = 0; a < 3; a++) r[a] = low->r[a] + along * (high->r[a] - low->r[a]);
}

#endif
