/* The scene for files where the caller gives none. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "data_info.h"
#include "default_look.h"
#include "render_options.h"

namespace render_tool
{

/* A scene of the data's outer surface, coloured by the look's field unless that is "", cut open if the look is, with
 * the plane of the cut; flat meshes are seen from the front and not lit. With an extent, that of all steps, the scale
 * of colours and the camera are the same at every step. */
std::string default_scene(const options &o, const default_look &look, const data_extent *extent);

} // namespace render_tool

#endif
