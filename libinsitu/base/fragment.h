/* A fragment is a stretch of one pixel's ray: render makes fragments, compositing merges them.
 *
 * A volume fragment covers the samples of one rank between t_in and t_out, both included; a surface fragment has t_in
 * == t_out, the hit. Fragments of one pixel, from any ranks, do not overlap, so sorting by t_in and blending front to
 * back gives the picture. Where cells overlap, fragments may overlap too. Then all volume fragments of the pixel are
 * single samples, or all are short stretches of one cell each, or the pixel has to be drawn again (comp.h). Colours are
 * linear and premultiplied: over(front, back) = (C1 + T1 C2, T1 T2). */
#ifndef BASE_FRAGMENT_H
#define BASE_FRAGMENT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct fragment {
    uint32_t pixel; /* y * width + x, y = 0 at the top */
    float t_in;     /* the ray's parameter, (depth - depth_origin) * scale (render.h), of the first sample or the hit */
    float t_out; /* t of the last sample, or slightly before the last cell's end (kernel_segments.h); for a hit t_in */
    float colour[3];     /* premultiplied linear RGB */
    float transmittance; /* 0 opaque .. 1 clear */
    uint32_t kind;       /* as below */
} fragment;

/* Kinds of fragments. Single samples are FRAGMENT_VOLUME + FRAGMENT_LAYER times the volume (0 .. 3). Those within
 * rounding of their cell's begin or end, where the cell before or behind may have the same sample, add FRAGMENT_EARLY
 * or FRAGMENT_LATE. Other stretches of volumes are FRAGMENT_VOLUME; hits are FRAGMENT_SURFACE + surface id (0, 1, ...).
 */
enum { FRAGMENT_VOLUME = 0, FRAGMENT_EARLY = 1, FRAGMENT_LATE = 2, FRAGMENT_LAYER = 4, FRAGMENT_SURFACE = 16 };

/* Tells whether a fragment changes the picture. Its transmittance rounds to 1 where it is faint, and its light is seen
 * all the same: a rank that left it out would draw another picture than one that has folded it with others. */
static inline bool fragment_shows(const fragment *f)
{
    return f->transmittance < 1 || f->colour[0] != 0 || f->colour[1] != 0 || f->colour[2] != 0;
}

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

/* Takes all fragments that a rank has in an area, as soon as they are made: count of them in any order. It may reorder
 * them; they are gone after the call. thread is the number (0, 1 ...) of the thread that calls. False where memory ran
 * out. */
typedef bool fragment_taker(void *state, int thread, const pixel_area *area, fragment *items, int64_t count);

#endif
