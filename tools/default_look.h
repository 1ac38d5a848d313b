/* Chooses the field, camera and cut of a file's default picture. */
#ifndef DEFAULT_LOOK_H
#define DEFAULT_LOOK_H

#include <array>
#include <string>

#include "render_options.h"
#include "step_source.h"

namespace render_tool
{

struct default_look {
    std::string field;                  // name of the field; "" if the file has no field
    int flat_axis = -1;                 // axis perpendicular to a flat mesh; -1 if the mesh is not flat
    std::array<int, 3> cut = {0, 0, 0}; // normal of a plane through the centre; the side to which it points is cut away
    bool is_cut() const { return cut[0] || cut[1] || cut[2]; }
};

/* Chooses the look from the first step. The field is the one named in the options, otherwise the first point field or
 * cell field that the last step also has, otherwise the first field of the last step. A solid is cut open if its outer
 * surface, seen from the viewer, shows only a small part of the field's range. Throws std::runtime_error. */
default_look choose_look(const options &o, const step_source &source);

/* eye_direction() returns the direction from the data to the viewer, which is that of the options or else a default.
 * up_direction() returns the axis that points up in the picture: y, or z if the viewer looks along y. */
std::array<double, 3> eye_direction(const options &o);
std::array<double, 3> up_direction(const options &o);

} // namespace render_tool

#endif
