/* Chooses the depth (length along the rays, in units of t) of a tile's next window of samples. All cells in a window
 * are transformed and traced. In a dense medium no light reaches most of a deep window, so most of that work would be
 * wasted:
 *
 *     light   1 \__                                   windows of as many samples as fit:  |===============|=====...
 *                  \___                               as deep as light reaches:          |====|=|
 *             0 --------x----------------->  depth
 *
 * A ray is dark if less light than KERNEL_DARK is left on it. Neighbouring tiles become dark at similar depths, so this
 * tile is expected to be dark at the same depth as the previous tile, counted from the tiles' first cells. If light is
 * left there, the brightest ray is expected to continue losing light at the rate of the previous window. Rays that keep
 * their light have the deepest windows that fit, because cells at every boundary between windows are transformed twice.
 *
 * The values of samples do not depend on windows (kernel_tile_volume.h). But cells that overlap behind the depth at
 * which all light is absorbed are detected only if they lie in a window, and a pixel with detected overlaps is drawn a
 * second time. So that windows do not depend on the number of threads, a tile uses results only of earlier tiles in its
 * run of KERNEL_TILES_PER_TASK tiles, which one thread draws in order. */
#ifndef RENDER_KERNEL_TILE_DEPTH_H
#define RENDER_KERNEL_TILE_DEPTH_H

#include <math.h>

#include "kernel_local_samples.h"
#include "kernel_samples.h"
#include "simd.h"

/* Begins a run of tiles: for its first tile, no depth is known at which an earlier tile became dark. */
SIMD_INLINE void kernel_depth_reset(kernel_tile_volume *d)
{
    d->dark = INFINITY;
    d->has_met = false;
}

SIMD_INLINE void kernel_depth_begin_window(kernel_tile_volume *d)
{
    d->lit_count = d->dark_count = 0;
    d->brightest = 0;
    d->first_lit = INFINITY;
    d->last_dark = -INFINITY;
}

/* Begins a tile. begin: depth t of its first cell, or +inf if that is not known. */
SIMD_INLINE void kernel_depth_begin_tile(kernel_tile_volume *d, float begin)
{
    if (d->has_met) d->dark = d->own_dark;
    d->has_met = false;
    d->begin = begin;
    d->expected = d->own_dark = INFINITY;
    d->before = 1;
    kernel_depth_begin_window(d);
}

/* Returns the depth (length) of the next window, which begins at the depth `at`: 9/8 of the distance from there to the
 * depth at which the tile is expected to be dark. */
SIMD_INLINE float kernel_depth_choose_window_length(const kernel_tile_volume *d, float at)
{
    const float left = simd_min(d->begin, at) + d->dark - at;
    return 1.125f * simd_min(left > 0 ? left : INFINITY, d->expected);
}

/* Adds the light that is left on a packet's rays after the window to the counts and extremes that *d collects per
 * window. */
SIMD_INLINE void kernel_depth_add_packet(kernel_tile_volume *d, vm rays, const kernel_blend *b)
{
    const vf far = vf_set(INFINITY);
    const vm met = vm_and(rays, vf_lt(b->light, vf_set(1))), lit = vm_and(met, vf_lt(vf_set(KERNEL_DARK), b->light));
    const vm ended = vm_andnot(met, lit);
    if (!vm_any(met)) return;
    d->lit_count += __builtin_popcount(vm_bits(met));
    d->dark_count += __builtin_popcount(vm_bits(ended));
    d->brightest = simd_max(vf_reduce_max(vf_select(lit, b->light, vf_set(0))), d->brightest);
    d->first_lit = simd_min(vf_reduce_min(vf_select(met, b->t_first, far)), d->first_lit);
    d->last_dark = simd_max(vf_reduce_max(vf_select(ended, b->t_last, -far)), d->last_dark);
}

/* Updates the estimates of the depth at which the tile becomes dark, after kernel_depth_add_packet() has been called
 * for all packets of a window. depth: length of that window in units of t. */
SIMD_INLINE void kernel_depth_end_window(kernel_tile_volume *d, float depth)
{
    const bool fades = d->brightest > 0 && d->brightest < 0.9f * d->before;
    d->expected = fades ? depth * logf(KERNEL_DARK / d->brightest) / logf(d->brightest / d->before) : INFINITY;
    d->before = d->brightest > 0 ? d->brightest : 1;
    d->begin = simd_min(d->first_lit, d->begin);
    d->has_met = d->has_met || d->lit_count;
    /* no ray of this tile has lost light yet, so the depth at which the previous tile became dark is a poor estimate */
    if (d->begin == INFINITY) d->dark *= 2;
    if (d->own_dark == INFINITY && d->dark_count > 0 && 2 * d->dark_count >= d->lit_count)
        d->own_dark = d->last_dark - d->begin;
    kernel_depth_begin_window(d);
}

#endif
