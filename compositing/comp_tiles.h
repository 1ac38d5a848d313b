/* Blends pixels on a single rank, tile by tile, as soon as their fragments are made. */
#ifndef COMP_COMP_TILES_H
#define COMP_COMP_TILES_H

#include "comp.h"

typedef struct comp_tile_scratch comp_tile_scratch;

typedef struct comp_tiles {
    const float *background;
    image *out;
    /* set of the pixels (pixel_set.h) whose fragments overlap; NULL: overlaps are not searched */
    unsigned char *overlaps;
    double inverse_width;
    int threads;
    comp_tile_scratch *scratch; /* scratch memory, one per thread */
} comp_tiles;

/* Prepares blending by at most this number of threads. `out` is the picture; its members must be set as for
 * comp_composite(). If finds_overlaps is set, pixels whose fragments overlap are recorded. Local. After an error,
 * comp_tiles_end() must not be called. */
insitu_status comp_tiles_begin(comp_tiles *tiles, const float background[4], int threads, bool finds_overlaps,
                               image *out, base_error *error);

/* A fragment_callback (fragment.h) with a comp_tiles as its state: blends the fragments of a tile and stores its pixels
 * in out. The result is bitwise equal to that of comp_composite() for these fragments. Tiles must lie within out and
 * not overlap. */
bool comp_tiles_blend(void *tiles, int thread, const pixel_area *area, fragment *items, int64_t count);

/* Frees the scratch memory after the last tile. statistics receives the number of blended fragments and the time of the
 * slowest thread. overlaps receives the pixels whose fragments overlap; it may be NULL. */
void comp_tiles_end(comp_tiles *tiles, comp_overlaps *overlaps, comp_statistics *statistics);

#endif
