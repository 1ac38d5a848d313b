/* Writes the scene for files if the user gives none. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "data_info.h"
#include "default_look.h"
#include "render_options.h"

namespace render_tool
{

/* Returns a scene of the data's outer surface. It is coloured by the look's field unless that is "", and cut open if
 * the look is, with a slice in the plane of the cut. Flat meshes are viewed from the front without lighting. If an
 * extent of all steps is given, the colour range and the camera are the same for every step. */
std::string default_scene(const options &o, const default_look &look, const data_extent *extent);

} // namespace render_tool

#endif
