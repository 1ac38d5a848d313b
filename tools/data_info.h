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

/* What a series spans: the bounds of its points, and the least and greatest value of a field, a vector's by magnitude.
 * Empty where the first number is greater than the second. */
struct data_extent {
    double low[4], high[4]; // x, y, z, the field

    data_extent();
    bool has_bounds() const { return low[0] <= high[0]; }
    bool has_range() const { return low[3] < high[3]; }
};

/* Widens the extent by data, of which hidden cells do not count. Without a field of the name at points, that of the
 * cells counts. */
void add_extent(vtkDataObject *data, const std::string &field, data_extent &extent);

} // namespace render_tool

#endif
