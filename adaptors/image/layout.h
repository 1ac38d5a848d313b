/* Where decorations stand in a picture. Only rectangles and lines of words are computed here, no pixels: a function of
 * the decorations, the picture's size, and how wide words are.
 *
 * Rooms of blocks are whole pixels, lie within the picture and overlap nowhere. What is too wide is wrapped, then made
 * smaller; bars share the height of their side, then stand in more columns. What finds no room at all is left out and
 * named. */
#ifndef ADAPTORS_LAYOUT_H
#define ADAPTORS_LAYOUT_H

#include <functional>
#include <string>
#include <vector>

#include "insitu/image_output.h"

/* A rectangle of the picture in pixels, x to the right and y down. */
struct area {
    double x0, y0, x1, y1;
};

enum class block_kind { words, bar, scale_bar, axes, label };

/* One line of words, from the left end of its baseline. */
struct placed_line {
    std::string text;
    double x, baseline;
};

struct block {
    block_kind kind;
    int index; /* the decoration's number among those of its kind */
    int size;  /* the height of its words, pixels */
    area room;
    std::vector<placed_line> lines;
    area gradient;          /* a bar's colours */
    std::vector<int> ticks; /* the ticks of a bar whose numbers have room, in rising order */
};

struct layout {
    std::vector<block> blocks;
    std::vector<std::string> left_out; /* "the axes"; labels that do not fit are not named */
};

/* The width of words in letters of this size, pixels. */
using word_measure = std::function<int(const std::string &text, int size)>;

layout make_layout(const insitu_image &image, const word_measure &measure);

/* The height of words, pixels. */
int word_size(const insitu_image &image);

/* The row of a bar's tick. */
double tick_row(const insitu_tick &tick, const area &gradient);

#endif
