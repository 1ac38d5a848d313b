/* Where a picture has edges. */
#ifndef COMP_EDGES_H
#define COMP_EDGES_H

#include <stdbool.h>

#include "image.h"
#include "pixel_set.h"

/* Add to the set (pixel_set.h, of the whole picture) both of each two neighbours, of eight around a pixel, that differ
 * by more than some 6 of 255 sRGB codes in a channel of the colour, or as much of the opacity. False: no memory. Local.
 */
bool comp_find_edges(const image *picture, int threads, unsigned char *pixels);

#endif
