/* What render makes and compositing merges: a stretch of one pixel's ray.
 *
 * A volume fragment covers the samples of one rank between t_in and t_out, both included; a surface fragment has t_in
 * == t_out, the hit. Fragments of one pixel, from any ranks, do not overlap, so sorting by t_in and blending front to
 * back gives the picture. Where cells overlap, fragments may: either all volume fragments of the pixel are then single
 * samples, or short stretches of one cell each, or the pixel is not a picture yet (comp.h). Colours are linear and
 * premultiplied: over(front, back) = (C1 + T1 C2, T1 T2). */
#ifndef BASE_FRAGMENT_H
#define BASE_FRAGMENT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct fragment {
    uint32_t pixel; /* y * width + x, y = 0 at the top */
    float t_in;     /* the ray's parameter, (depth - depth_origin) * scale (render.h), of the first sample or the hit */
    float t_out; /* of the last sample, or what ends a little before its last cell (kernel_segments.h); a hit's t_in */
    float colour[3];     /* premultiplied linear RGB */
    float transmittance; /* 0 opaque .. 1 clear */
    uint32_t kind;       /* as below */
} fragment;

/* Samples on their own are FRAGMENT_VOLUME + FRAGMENT_LAYER times the volume (0 .. 3), and say so where they are within
 * rounding of their cell's begin or end, where the cell before or behind it may have the same sample. Other stretches
 * of volumes are FRAGMENT_VOLUME; hits are FRAGMENT_SURFACE + surface id (0, 1, ...). */
enum { FRAGMENT_VOLUME = 0, FRAGMENT_EARLY = 1, FRAGMENT_LATE = 2, FRAGMENT_LAYER = 4, FRAGMENT_SURFACE = 16 };

/* A growing list, memory from memory.h. */
typedef struct fragment_list {
    fragment *items;
    int64_t count;
    int64_t capacity;
} fragment_list;

/* A rectangle of an image's pixels. */
typedef struct pixel_area {
    int x, y; /* its upper left pixel */
    int width, height;
} pixel_area;

/* Takes all that a rank has in an area, as soon as it is made: count fragments in any order, that may be reordered and
 * are gone after the call. thread: 0, 1 ..., of those who call at once. False where memory ran out. */
typedef bool fragment_taker(void *state, int thread, const pixel_area *area, fragment *items, int64_t count);

#endif
