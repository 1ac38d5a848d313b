/* Checks that the files of an EnSight Gold case are complete. If numbers are missing at the end of a file, VTK's reader
 * uses uninitialized memory or crashes. */
#ifndef ENSIGHT_CHECK_H
#define ENSIGHT_CHECK_H

#include <string>

namespace render_tool
{

/* Reads every file that the case names (text, C binary, Fortran binary) to its end. Throws std::runtime_error with the
 * file's name if a file is missing, ends too early or cannot be parsed, or if the case is not of type Gold. */
void check_ensight(const std::string &case_path);

} // namespace render_tool

#endif
