/* A fragment is an interval of one pixel's ray: render makes fragments, and compositing merges them.
 *
 * A volume fragment covers the samples of one rank between t_in and t_out, both included; a surface fragment has
 * t_in == t_out, the ray parameter of the hit. Fragments of one pixel, from any ranks, do not overlap, so that
 * sorting by t_in and blending front to back gives the picture. If cells overlap, fragments may overlap too. In this
 * case the pixel must be drawn again (comp.h), unless all of its volume fragments are single samples, or all are
 * short intervals of one cell each. Colours are linear and premultiplied: over(front, back) = (C1 + T1 C2, T1 T2). */
#ifndef BASE_FRAGMENT_H
#define BASE_FRAGMENT_H

#include <stdbool.h>
#include <stdint.h>

typedef struct fragment {
    uint32_t pixel; /* index of the pixel, y * width + x, with y = 0 at the top */
    /* ray parameter t of the first sample, of the begin of the first segment, or of the hit: t = (z - depth_origin) *
     * scale, where z is the depth along the camera's axis (render.h) */
    float t_in;
    /* end of the fragment: t of its last sample; or, if it consists of segments instead of samples, t at the end of its
     * last segment or slightly less (kernel_segments.h). For a hit, t_out is equal to t_in. */
    float t_out;
    float colour[3];     /* premultiplied linear RGB */
    float transmittance; /* from 0 for an opaque fragment to 1 for a transparent one */
    uint32_t kind;       /* FRAGMENT_VOLUME or FRAGMENT_SURFACE, plus numbers for the layer and the position in the
                            cell (enum below) */
} fragment;

/* Values of fragment.kind. A single sample of a volume has FRAGMENT_VOLUME + FRAGMENT_LAYER times the index of its
 * volume layer (0 .. 3). FRAGMENT_EARLY or FRAGMENT_LATE is added if the sample lies within rounding of the start or
 * end of its cell's interval on the ray, because the preceding or the next cell may have the same sample. A fragment
 * that combines several samples or segments of a volume has the kind FRAGMENT_VOLUME. A hit has FRAGMENT_SURFACE + the
 * index (0, 1, ...) of its surface. */
enum { FRAGMENT_VOLUME = 0, FRAGMENT_EARLY = 1, FRAGMENT_LATE = 2, FRAGMENT_LAYER = 4, FRAGMENT_SURFACE = 16 };

/* Returns whether a fragment changes the picture. The transmittance of a faint fragment rounds to 1, but its light is
 * still visible. If a rank dropped its faint fragments, its pictures would differ from those of a rank that has folded
 * the fragments with others (fragment_fold.h). */
static inline bool fragment_changes_picture(const fragment *f)
{
    return f->transmittance < 1 || f->colour[0] != 0 || f->colour[1] != 0 || f->colour[2] != 0;
}

/* A growing list of fragments in memory from memory.h. */
typedef struct fragment_list {
    fragment *items;
    int64_t count;
    int64_t capacity;
} fragment_list;

/* A rectangle of an image's pixels. */
typedef struct pixel_area {
    int x, y; /* column and row of the upper left pixel */
    int width, height;
} pixel_area;

/* Callback that receives fragments while a rank traces rays. A call receives the rank's `count` fragments of all pixels
 * in `area`, in any order, as soon as they are complete. The callback may reorder the fragments; they are invalid after
 * the call. thread: index (0, 1, ...) of the calling thread. Returns false if memory ran out. */
typedef bool fragment_callback(void *state, int thread, const pixel_area *area, fragment *items, int64_t count);

#endif
