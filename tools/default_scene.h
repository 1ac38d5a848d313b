/* Writes the scene that is drawn if the user gives data files but no scene. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "data_info.h"
#include "default_look.h"
#include "render_options.h"

namespace render_tool
{

/* Returns a scene of the data's outer surface. The surface is coloured by the look's field unless the field is "". If
 * the look has a cut, the surface is cut open, and a slice is drawn in the plane of the cut. Flat meshes are viewed
 * from the front without lighting. If an extent of all steps is given, the colour range and the camera are the same for
 * every step. */
std::string default_scene(const options &o, const default_look &look, const data_extent *extent);

} // namespace render_tool

#endif
