/* Checks that a file of VTK's legacy format (.vtk) is whole. VTK's reader goes on with whatever its memory held where
 * numbers are missing at a file's end, and crashes where a header is cut. */
#ifndef LEGACY_CHECK_H
#define LEGACY_CHECK_H

#include <string>

namespace render_tool
{

/* Follow the file to its end by the counts that it declares. Throws std::runtime_error with the file's name where it
 * ends too early. Composite data sets are not followed, nor is what comes behind a word that the format does not have.
 */
void check_legacy(const std::string &path);

} // namespace render_tool

#endif
