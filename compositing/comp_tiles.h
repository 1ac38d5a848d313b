/* One rank alone: pixels are blended as their fragments are made, a tile at a time. */
#ifndef COMP_COMP_TILES_H
#define COMP_COMP_TILES_H

#include "comp.h"

typedef struct comp_tile_scratch comp_tile_scratch;

typedef struct comp_tiles {
    const float *background;
    image *out;
    unsigned char *overlaps; /* pixel_set.h; NULL: not wanted */
    double inverse_width;
    int threads;
    comp_tile_scratch *scratch; /* each thread's */
} comp_tiles;

/* Begins tiles for at most so many threads. out is as in comp_composite(). If finds_overlaps, pixels whose fragments
 * overlap are recorded. Local; after an error there is nothing to end. */
insitu_status comp_tiles_begin(comp_tiles *tiles, const float background[4], int threads, bool finds_overlaps,
                               image *out, base_error *error);

/* A fragment_taker (fragment.h), tiles its state: the tile's pixels in out become bit for bit what comp_composite()
 * would make of these fragments. Tiles lie in out, and do not overlap. */
bool comp_tiles_take(void *tiles, int thread, const pixel_area *area, fragment *items, int64_t count);

/* Ends the tiles. statistics gets the number of fragments taken and the time of the slowest thread; overlaps, which may
 * be NULL, gets the pixels that were found. */
void comp_tiles_end(comp_tiles *tiles, comp_overlaps *overlaps, comp_statistics *statistics);

#endif
