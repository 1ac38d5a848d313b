/* A picture's background, lines, colour bars, axes and words. */
#ifndef ADAPTORS_DECORATE_H
#define ADAPTORS_DECORATE_H

#include <string>
#include <vector>

#include "insitu/image_output.h"

/* Puts the image's background under rgba, a copy of its pixels, and its decorations over it. warning becomes a message
 * about what was left out, or stays. */
void decorate(const insitu_image &image, std::vector<float> &rgba, std::string &warning);

#endif
