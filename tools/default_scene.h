/* The scene for files where the caller gives none. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "render_options.h"

namespace render_tool
{

/* A scene of the data's outer surface, coloured by the field that the options name, else by the first file's first
 * field, at points before cells. Reads that file where no field is named. Throws std::runtime_error. */
std::string default_scene(const options &o);

/* A file with a text, which exists as long as the object. */
class temporary_file
{
  public:
    /* Throws std::runtime_error. */
    explicit temporary_file(const std::string &text);
    ~temporary_file();
    temporary_file(const temporary_file &) = delete;
    temporary_file &operator=(const temporary_file &) = delete;

    const std::string &path() const { return path_; }

  private:
    std::string path_;
};

} // namespace render_tool

#endif
