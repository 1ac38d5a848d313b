/* Draws a picture's background, lines, colour bars, axes and text. */
#ifndef ADAPTORS_DECORATE_H
#define ADAPTORS_DECORATE_H

#include <vector>

#include "insitu/image_output.h"

/* Blends the image's background behind rgba and draws its decorations over rgba. On entry rgba is a copy of the image's
 * pixels. */
void decorate(const insitu_image &image, std::vector<float> &rgba);

/* Reports text that decorate() leaves out or draws differently: missing fonts, missing glyphs, or lack of space. */
void find_text_faults(const insitu_image &image, insitu_word_faults &out);

#endif
