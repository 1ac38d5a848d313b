/* Merges one pixel's fragments into a finished pixel. */
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

/* Returns an error if the image has no pixels, or more than a fragment's 32-bit pixel index can address. Local. */
insitu_status comp_check_size(const image *out, base_error *error);

/* Adds the pixel to the set. Other threads may add pixels at the same time. */
void comp_add_overlap(unsigned char *overlaps, uint32_t pixel);

/* Settings of a merge, and the destinations of its results. */
typedef struct comp_merge_output {
    const float *background; /* colour of the background: linear premultiplied RGBA */
    bool is_folded; /* set if ranks may have folded the fragments, that is, blended several fragments of a volume into
                       one (fragment_fold.h); pixels are then merged by comp_merge_folded_pixel() */
    image *out;     /* picture that receives the pixels on rank 0; NULL on other ranks */
    /* set (pixel_set.h) to which pixels with overlapping fragments are added; NULL: overlaps are not searched */
    unsigned char *overlaps;
    comp_deep_list *deep; /* lists that receive the samples, one per thread; NULL if deep samples are not requested */
} comp_merge_output;

/* Merges the fragments of one pixel of the image. The order of `items` is changed. Local; any number of threads may
 * call it at once. */
comp_pixel comp_pixels_blend(const comp_merge_output *merged, fragment *items, int64_t count, uint32_t pixel);

#endif
