/* Checks that a file of VTK's legacy format (.vtk) is complete. If numbers are missing at the end of a file, VTK's
 * reader uses uninitialized memory; if a header is truncated, it crashes. */
#ifndef LEGACY_CHECK_H
#define LEGACY_CHECK_H

#include <string>

namespace render_tool
{

/* Reads the file to its end by the counts that it declares. Throws std::runtime_error with the file's name if it ends
 * too early. Composite data sets, and sections after one with an unknown keyword, are not checked. */
void check_legacy(const std::string &path);

} // namespace render_tool

#endif
