/* How deep a tile's next window of samples is to be. A window's cells are placed and traced for all of its depth, so
 * that in a dense medium, which lets no light through to most of the window, most of them would be placed for nothing:
 *
 *     light   1 \__                                   windows of as many samples as fit:  |===============|=====...
 *                  \___                               as deep as light goes:              |====|=|
 *             0 --------x----------------->  depth
 *
 * Neighbouring tiles lose their light in much the same depth, so the last tile's is expected of this one. Where light
 * is left after it, the brightest ray is expected to go on losing it at the rate of the window before. Rays that keep
 * their light have windows as deep as there is room, as every boundary between windows has cells placed twice.
 *
 * Samples do not depend on windows (kernel_tile_volume.h). Which cells are seen to overlap behind what takes all light
 * does, and so whether a pixel is drawn a second time. So that windows do not depend on the number of threads, a tile
 * learns only from those before it in its run of KERNEL_TILE_RUN tiles, which one thread draws in order. */
#ifndef RENDER_KERNEL_TILE_DEPTH_H
#define RENDER_KERNEL_TILE_DEPTH_H

#include <math.h>

#include "kernel_samples.h"
#include "simd.h"

typedef struct kernel_tile_depth {
    /* How deep behind its begin the last tile's rays, or most of them, had lost their light; +inf: they kept it. */
    float dark;
    /* for the tile under way */
    float own_dark; /* the same, once it is known */
    float begin;    /* where its first cell is known to be, or the first sample is; +inf: none has been yet */
    bool has_met;   /* any */
    float expected; /* how much deeper than the last window its rays are to be dark, by the light left after it */
    float before;   /* the brightest ray's light before the last window */
    /* the last window's, over rays that have lost any light */
    int met, ended;
    float brightest, first, last; /* first: where they begin; last: where those that are dark end */
} kernel_tile_depth;

/* Begins a run of tiles. */
SIMD_INLINE void kernel_depth_forget(kernel_tile_depth *d)
{
    d->dark = INFINITY;
    d->has_met = false;
}

SIMD_INLINE void kernel_depth_begin_window(kernel_tile_depth *d)
{
    d->met = d->ended = 0;
    d->brightest = 0;
    d->first = INFINITY;
    d->last = -INFINITY;
}

/* begin: the depth of the tile's first cell, or +inf where that is not known. */
SIMD_INLINE void kernel_depth_begin(kernel_tile_depth *d, float begin)
{
    if (d->has_met) d->dark = d->own_dark;
    d->has_met = false;
    d->begin = begin;
    d->expected = d->own_dark = INFINITY;
    d->before = 1;
    kernel_depth_begin_window(d);
}

/* How deep the window at a depth is to be, an eighth deeper than expected. */
SIMD_INLINE float kernel_depth_wanted(const kernel_tile_depth *d, float at)
{
    const float left = simd_min(d->begin, at) + d->dark - at;
    return 1.125f * simd_min(left > 0 ? left : INFINITY, d->expected);
}

/* Look at what light a packet's rays have after the window. */
SIMD_INLINE void kernel_depth_add(kernel_tile_depth *d, vm rays, const kernel_blend *b)
{
    const vf far = vf_set(INFINITY);
    const vm met = vm_and(rays, vf_lt(b->light, vf_set(1))), lit = vm_and(met, vf_lt(vf_set(KERNEL_DARK), b->light));
    const vm ended = vm_andnot(met, lit);
    if (!vm_any(met)) return;
    d->met += __builtin_popcount(vm_bits(met));
    d->ended += __builtin_popcount(vm_bits(ended));
    d->brightest = simd_max(vf_reduce_max(vf_select(lit, b->light, vf_set(0))), d->brightest);
    d->first = simd_min(vf_reduce_min(vf_select(met, b->t_first, far)), d->first);
    d->last = simd_max(vf_reduce_max(vf_select(ended, b->t_last, -far)), d->last);
}

/* All rays are looked at after a window of this depth. */
SIMD_INLINE void kernel_depth_end_window(kernel_tile_depth *d, float depth)
{
    const bool fades = d->brightest > 0 && d->brightest < 0.9f * d->before;
    d->expected = fades ? depth * logf(KERNEL_DARK / d->brightest) / logf(d->brightest / d->before) : INFINITY;
    d->before = d->brightest > 0 ? d->brightest : 1;
    d->begin = simd_min(d->first, d->begin);
    d->has_met = d->has_met || d->met;
    if (d->begin == INFINITY) d->dark *= 2; /* nothing has been met yet, so that what is expected says little */
    if (d->own_dark == INFINITY && d->ended > 0 && 2 * d->ended >= d->met) d->own_dark = d->last - d->begin;
    kernel_depth_begin_window(d);
}

#endif
