/* A finished picture on rank 0: linear premultiplied float RGBA and the depth of the nearest opaque surface. */
#ifndef BASE_IMAGE_H
#define BASE_IMAGE_H

typedef struct image {
    int width;
    int height;
    float *rgba;  /* row-major, height × width × 4, top row first, premultiplied, linear light */
    float *depth; /* row-major, height × width: fragment.t_in of the nearest
                     surface hit; +infinity where there is none. NULL: not wanted */
} image;

#endif
