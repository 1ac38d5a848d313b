/* Parses the command line of insitu-render. */
#ifndef RENDER_OPTIONS_H
#define RENDER_OPTIONS_H

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "cell_deal.h"

namespace render_tool
{

struct options {
    bool help = false;
    bool version = false;
    bool info = false;
    bool pieces = false; // true if the files are pieces of one step instead of steps
    int64_t first_step = 0;
    int64_t last_step = std::numeric_limits<int64_t>::max();
    partition how = partition::block;
    std::string scene; // "" for the default scene, to which the five options below apply
    int width = 1280, height = 720;
    std::string field;     // name of the field; "" for the first field of the file
    std::string direction; // direction to the viewer; "" to choose it from the data
    bool whole = false;    // true if solids are not cut open
    std::vector<std::string> files;
};

/* Throws std::runtime_error if an option is wrong. Files whose names differ only in numbers are sorted by these
 * numbers, so that file_2 comes before file_10, unlike in the order of a shell. */
options parse_options(int argc, char **argv);

std::string help_text();

} // namespace render_tool

#endif
