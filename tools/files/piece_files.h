/* Files that name other files: a .pvtu its pieces; a .pvd and a .series the files that are time steps. */
#ifndef PIECE_FILES_H
#define PIECE_FILES_H

#include <memory>
#include <string>

#include "data_file.h"

namespace render_tool
{

/* Check that the files which an XML file names for VTK's own readers exist and are whole. Throws std::runtime_error
 * with the file's name and what is wrong, as do the functions below. */
void check_named_files(const std::string &path);

std::unique_ptr<data_file> open_pvtu(const std::string &path);
std::unique_ptr<data_file> open_pvd(const std::string &path);
std::unique_ptr<data_file> open_series(const std::string &path);

} // namespace render_tool

#endif
