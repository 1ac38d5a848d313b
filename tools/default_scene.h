/* The scene that files are drawn by where the caller has none. */
#ifndef DEFAULT_SCENE_H
#define DEFAULT_SCENE_H

#include <string>

#include "render_options.h"

namespace render_tool
{

/* The outer surface of the data, coloured by a field: the one the options name, else the first that the first file has,
 * at points before cells. Reads that file where no field is named. Throws std::runtime_error. */
std::string default_scene(const options &o);

/* A file that holds a text for as long as the object lives. */
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
