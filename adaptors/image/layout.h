/* Computes the positions of decorations in a picture. Only rectangles and lines of text are computed, no pixels; the
 * result depends on the decorations, the picture's size, and the widths of text.
 *
 * The rectangles of blocks have integer coordinates, lie within the picture and do not overlap. Areas that other
 * pictures cover are blocks too, so that no decoration is below another picture. Text that is too wide is wrapped,
 * and then made smaller. Colour bars share the height of their side, and then use more columns. Decorations for
 * which there is still not enough space are left out and listed. */
#ifndef ADAPTORS_LAYOUT_H
#define ADAPTORS_LAYOUT_H

#include <functional>
#include <string>
#include <vector>

#include "insitu/image_output.h"

/* A rectangle of the picture in pixels; x points to the right and y down. */
struct area {
    double x0, y0, x1, y1;
};

enum class block_kind { covered, words, bar, scale_bar, axes, label };

/* One line of text; x and baseline are the left end of its baseline. */
struct placed_line {
    std::string text;
    double x, baseline;
};

struct block {
    block_kind kind;
    int index; /* index of the decoration in the image's list of this kind, for example of the colour bars */
    int size;  /* height of the block's text in pixels */
    area bounds;
    std::vector<placed_line> lines;
    area gradient;          /* rectangle of a colour bar's colours */
    std::vector<int> ticks; /* indices of the bar's ticks whose numbers are drawn, in ascending order */
};

struct layout {
    std::vector<block> blocks;
    std::vector<std::string>
        left_out; /* names of decorations without space, for example "the axes"; labels are not listed */
};

/* Returns the width in pixels of text with letters of this height. */
using text_measure = std::function<int(const std::string &text, int size)>;

layout make_layout(const insitu_image &image, const text_measure &measure);

/* Returns the height of the text in pixels. */
int compute_text_height(const insitu_image &image);

/* Returns the y coordinate of a bar's tick. */
double compute_tick_y(const insitu_tick &tick, const area &gradient);

#endif
