/* What is in a file, for a person: insitu-render --info. */
#ifndef DATA_INFO_H
#define DATA_INFO_H

#include <string>
#include <vector>

class vtkDataObject;

namespace render_tool
{

/* Print the cells by type, bounds, fields with centring, type, components and ranges, and times to stdout. */
void print_info(const std::string &path, vtkDataObject *data, const std::vector<double> &times);

} // namespace render_tool

#endif
