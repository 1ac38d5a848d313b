/* What the default picture of a file shows of it, and from where. */
#ifndef DEFAULT_LOOK_H
#define DEFAULT_LOOK_H

#include <array>
#include <string>

#include "render_options.h"

namespace render_tool
{

struct default_look {
    std::string field;                  // "": the file has none
    int flat_axis = -1;                 // the axis at right angles to a flat mesh; -1: it is none
    std::array<int, 3> cut = {0, 0, 0}; // the normal of a plane through the middle; the side it points to is cut away
    bool is_cut() const { return cut[0] || cut[1] || cut[2]; }
};

/* Chooses the look by the first step of the first file. The field is the one that the options name, else the first, at
 * points before cells. A solid is cut open where its outside, seen from the eye, shows little of the field's range.
 * Throws std::runtime_error. */
default_look choose_look(const options &o);

/* The direction from a solid to the eye, the options' or the usual one, and the direction that is up. */
std::array<double, 3> eye_direction(const options &o);
std::array<double, 3> up_direction(const options &o);

} // namespace render_tool

#endif
