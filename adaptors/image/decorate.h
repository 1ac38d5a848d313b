/* A picture's background, lines, colour bars, axes and words. */
#ifndef ADAPTORS_DECORATE_H
#define ADAPTORS_DECORATE_H

#include <string>
#include <vector>

#include "insitu/image_output.h"

/* A rectangle of the picture in pixels, x to the right and y down. */
struct area {
    double x0, y0, x1, y1;
};

/* An anchor, or so many pixels below it. */
struct spot {
    insitu_anchor at;
    double down;
};

/* Finds room for a block of this size: at its spot, a margin from the borders, and past the areas that are taken, to
 * which it is added. A block that finds no room stays at its spot. */
area place_block(const insitu_image &image, const spot &where, double width, double height, double margin,
                 std::vector<area> &taken);

/* Puts the image's background under rgba, a copy of its pixels, and its decorations over it. warning becomes a message
 * about what was left out, or stays. */
void decorate(const insitu_image &image, std::vector<float> &rgba, std::string &warning);

#endif
