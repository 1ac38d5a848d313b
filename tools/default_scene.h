/* The scene for files where the caller gives none. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "data_info.h"
#include "render_options.h"

namespace render_tool
{

/* The field that the options name, else the first file's first field, at points before cells; "" if it has none. Reads
 * that file where no field is named. Throws std::runtime_error. */
std::string default_field(const options &o);

/* A scene of the data's outer surface, coloured by the field unless that is "". With an extent, that of all steps, the
 * scale of colours and the camera are the same at every step. */
std::string default_scene(const options &o, const std::string &field, const data_extent *extent);

} // namespace render_tool

#endif
