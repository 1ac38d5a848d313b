/* The struct image: a finished picture on rank 0, with linear premultiplied float RGBA and the depth of the nearest
 * surface. */
#ifndef BASE_IMAGE_H
#define BASE_IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "insitu/image_output.h"

/* The samples of an image's pixels sorted by depth, as in insitu_deep; only on rank 0, and all zero on other ranks. */
typedef struct deep_image {
    /* array in which `first` and `counts` select the samples of each pixel; it may also contain samples that no pixel
     * uses */
    insitu_deep_sample *samples;
    int64_t count, capacity;
    int64_t *first;   /* index of the first sample of each pixel */
    uint32_t *counts; /* number of samples of each pixel; may be 0 */
} deep_image;

typedef struct image {
    int width;
    int height;
    float *rgba; /* row-major, height × width × 4, top row first, premultiplied, linear light */
    /* row-major, height × width: fragment.t_in of the nearest surface hit; +infinity if the pixel has no surface hit.
     * NULL: depth was not requested. */
    float *depth;
    deep_image *deep; /* samples of the image, only on rank 0; NULL on every rank if samples were not requested */
    bool is_folded;   /* set if ranks have folded the fragments from which the image is made, that is, blended several
                         fragments of a volume into one (fragment_fold.h) */
} image;

#endif
