/* Checks a file's length by its own text, for formats whose readers read zeros where the end is cut off. */
#ifndef FILE_LENGTH_H
#define FILE_LENGTH_H

#include <string>

namespace render_tool
{

/* Throw std::runtime_error where the file is shorter than it says, ends within a line of text, or has a word among its
 * numbers that is none. */
void check_length(const std::string &path);

/* Tells whether a .vtu is whole and declares all its pieces to have neither points nor cells. */
bool is_empty_vtu(const std::string &path);

} // namespace render_tool

#endif
