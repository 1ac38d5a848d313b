/* A finished picture on rank 0: linear premultiplied float RGBA and the depth of the nearest opaque surface. */
#ifndef BASE_IMAGE_H
#define BASE_IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "insitu/image_output.h"

/* What lies behind each other in an image's pixels, as insitu_deep has it, on rank 0. All zero elsewhere. */
typedef struct deep_image {
    insitu_deep_sample *samples; /* some may be of no pixel any more */
    int64_t count, capacity;
    int64_t *first;   /* a pixel's first sample */
    uint32_t *counts; /* a pixel's number of samples; 0: it has none */
} deep_image;

typedef struct image {
    int width;
    int height;
    float *rgba;  /* row-major, height × width × 4, top row first, premultiplied, linear light */
    float *depth; /* row-major, height × width: fragment.t_in of the nearest
                     surface hit; +infinity where there is none. NULL: not wanted */
    deep_image *deep; /* NULL on every rank: not wanted */
    bool is_folded;   /* of fragments that ranks have folded (fragment_fold.h) */
} image;

#endif
