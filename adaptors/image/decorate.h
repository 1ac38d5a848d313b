/* A picture's background, lines, colour bars, axes and words. */
#ifndef ADAPTORS_DECORATE_H
#define ADAPTORS_DECORATE_H

#include <vector>

#include "insitu/image_output.h"

/* Puts the image's background under rgba, a copy of its pixels, and its decorations over it. */
void decorate(const insitu_image &image, std::vector<float> &rgba);

/* Finds what decorate() leaves out or draws otherwise than it is given. */
void check_words(const insitu_image &image, insitu_word_faults &out);

#endif
