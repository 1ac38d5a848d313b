/* Finds the pixels at edges of a picture, for example so that only these pixels are antialiased. */
#ifndef COMP_EDGES_H
#define COMP_EDGES_H

#include <stdbool.h>

#include "image.h"
#include "pixel_set.h"

/* Adds the pixels at edges to the set (pixel_set.h) of the whole picture. A pixel is at an edge if one of its eight
 * neighbours differs from it by more than about 6 of 255 sRGB codes in a colour channel, or by as much in opacity.
 * Returns false if memory ran out. Local. */
bool comp_find_edges(const image *picture, int threads, unsigned char *pixels);

#endif
