/* A finished picture on rank 0: linear premultiplied float RGBA and the depth of the nearest surface. */
#ifndef BASE_IMAGE_H
#define BASE_IMAGE_H

#include <stdbool.h>
#include <stdint.h>

#include "insitu/image_output.h"

/* The samples of an image's pixels by depth, as in insitu_deep, on rank 0. All zero elsewhere. */
typedef struct deep_image {
    insitu_deep_sample *samples; /* some may no longer belong to a pixel */
    int64_t count, capacity;
    int64_t *first;   /* a pixel's first sample */
    uint32_t *counts; /* a pixel's number of samples; 0: it has none */
} deep_image;

typedef struct image {
    int width;
    int height;
    float *rgba;      /* row-major, height × width × 4, top row first, premultiplied, linear light */
    float *depth;     /* row-major, height × width: fragment.t_in of the nearest
                         surface hit; +infinity where there is none. NULL: not wanted */
    deep_image *deep; /* NULL on every rank: not wanted */
    bool is_folded;   /* made of fragments that ranks have folded (fragment_fold.h) */
} image;

#endif
