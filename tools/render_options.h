/* The command line of insitu-render. */
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
    bool pieces = false; // the files are pieces of one step, not steps
    int64_t first_step = 0;
    int64_t last_step = std::numeric_limits<int64_t>::max();
    partition how = partition::block;
    std::string scene; // "": the default scene, of the five below
    int width = 1280, height = 720;
    std::string field;     // "": the first
    std::string direction; // towards the eye; "": by the data
    bool whole = false;    // not cut open
    std::vector<std::string> files;
};

/* Throws std::runtime_error with what is wrong. Files whose names differ only in numbers are sorted by these, so that
 * file_2 comes before file_10, unlike in a shell's order. */
options parse_options(int argc, char **argv);

std::string help_text();

} // namespace render_tool

#endif
