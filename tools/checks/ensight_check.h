/* Checks that the files of an EnSight Gold case are whole. Where numbers are missing at a file's end, VTK's reader
 * takes whatever its memory holds, or crashes. */
#ifndef ENSIGHT_CHECK_H
#define ENSIGHT_CHECK_H

#include <string>

namespace render_tool
{

/* Follow every file that the case names (text, C binary, Fortran binary) to its end. Throws std::runtime_error with the
 * file's name where one is missing, ends too early or cannot be followed, and for a case of another type than Gold. */
void check_ensight(const std::string &case_path);

} // namespace render_tool

#endif
