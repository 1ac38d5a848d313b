/* A set of an image's pixels with one bit per pixel: pixel p is bit p & 7 of byte p >> 3. */
#ifndef BASE_PIXEL_SET_H
#define BASE_PIXEL_SET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Returns the size in bytes of a set of this many pixels. Bits beyond the image's last pixel must be 0. */
static inline size_t pixel_set_bytes(int64_t pixel_count)
{
    return (size_t)((pixel_count + 7) >> 3);
}

static inline bool pixel_set_has(const unsigned char *set, int64_t pixel)
{
    return set[pixel >> 3] >> (pixel & 7) & 1;
}

static inline void pixel_set_add(unsigned char *set, int64_t pixel)
{
    set[pixel >> 3] = (unsigned char)(set[pixel >> 3] | 1u << (pixel & 7));
}

static inline int64_t pixel_set_count(const unsigned char *set, int64_t pixel_count)
{
    int64_t count = 0;
    for (size_t i = 0; i < pixel_set_bytes(pixel_count); i++) count += __builtin_popcount(set[i]);
    return count;
}

#endif
