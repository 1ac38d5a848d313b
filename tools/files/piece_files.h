/* Opens files that reference other files: a .pvtu file references its pieces; .pvd and .series files reference time
 * steps. */
#ifndef PIECE_FILES_H
#define PIECE_FILES_H

#include <memory>
#include <string>

#include "data_file.h"

namespace render_tool
{

/* Checks that the files which an XML file references for VTK's own readers exist and are complete. Like the functions
 * below, throws std::runtime_error with the file's name and the problem. */
void check_named_files(const std::string &path);

std::unique_ptr<data_file> open_pvtu(const std::string &path);
std::unique_ptr<data_file> open_pvd(const std::string &path);
std::unique_ptr<data_file> open_series(const std::string &path);

} // namespace render_tool

#endif
