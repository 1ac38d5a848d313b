/* Makes one pixel's fragments into a finished pixel. */
#ifndef COMP_COMP_PIXELS_H
#define COMP_COMP_PIXELS_H

#include "comp_deep.h"
#include "error.h"
#include "fragment.h"
#include "image.h"

typedef struct comp_pixel {
    float depth;
    float rgba[4];
} comp_pixel;

/* An error unless the image has pixels, and no more than fragments can name. */
insitu_status comp_check_size(const image *out, base_error *error);

/* Adds the pixel to a set that other threads add to at the same time. */
void comp_add_overlap(unsigned char *overlaps, uint32_t pixel);

/* What merging is given and gives beside pixels. */
typedef struct comp_merged {
    const float *background; /* 4 */
    bool is_folded;          /* by comp_merge_folded_pixel() */
    image *out;              /* rank 0's picture; NULL elsewhere */
    unsigned char *overlaps; /* pixel_set.h: pixels whose fragments overlap are added. NULL: not wanted */
    comp_deep_list *deep;    /* one for each thread: samples are added. NULL: not wanted */
} comp_merged;

/* Merges one pixel of the image; its fragments are reordered. Local, and any number of threads at once. */
comp_pixel comp_pixels_blend(const comp_merged *merged, fragment *items, int64_t count, uint32_t pixel);

#endif
