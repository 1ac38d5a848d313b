/* Prints a summary of a file's contents, for insitu-render --info. */
#ifndef DATA_INFO_H
#define DATA_INFO_H

#include <string>
#include <vector>

class vtkDataObject;

namespace render_tool
{

/* Prints the number of cells by type, bounds, fields (centring, type, components, ranges) and times to stdout, after a
 * line that begins with title. data must contain only unstructured grids (grids_of.h). The number of cells that are not
 * drawn (hidden or ghosts) is printed on a separate line. Otherwise these cells, and points that only these cells use,
 * are ignored. */
void print_info(const std::string &title, vtkDataObject *data, const std::vector<double> &times);

/* The extent of a series: the bounds of its points, and the smallest and largest value of a field (the magnitude of a
 * vector). It is empty if low is greater than high. */
struct data_extent {
    double low[4], high[4]; // ranges of x, y, z and the field's value

    data_extent();
    bool has_bounds() const { return low[0] <= high[0]; }
    bool has_range() const { return low[3] < high[3]; }
};

/* Extends the extent by the cells of data that select_drawn_cells() selects. If there is no point field of this name,
 * the cell field is used. */
void add_extent(vtkDataObject *data, const std::string &field, data_extent &extent);

} // namespace render_tool

#endif
