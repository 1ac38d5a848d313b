/* Describes a file's content for a person: insitu-render --info. */
#ifndef DATA_INFO_H
#define DATA_INFO_H

#include <string>
#include <vector>

class vtkDataObject;

namespace render_tool
{

/* Print the cells by type, bounds, fields with centring, type, components and ranges, and times to stdout, after a line
 * that begins with title. data has unstructured grids only (grids_of.h). Cells that are not drawn, being hidden or
 * ghosts, have a line of their own; they, and points that no other cell has, do not count otherwise. */
void print_info(const std::string &title, vtkDataObject *data, const std::vector<double> &times);

} // namespace render_tool

#endif
