/* Detects truncated files by their text, for formats whose readers return zeros for missing data. */
#ifndef FILE_LENGTH_H
#define FILE_LENGTH_H

#include <string>

namespace render_tool
{

/* Throws std::runtime_error if the file is shorter than it declares, ends in the middle of a line of text, contains a
 * word that is not a number among its numbers, or consists of pieces with different fields. */
void check_length(const std::string &path);

/* Checks whether a .vtu file is complete and declares that none of its pieces has points or cells. */
bool is_empty_vtu(const std::string &path);

} // namespace render_tool

#endif
