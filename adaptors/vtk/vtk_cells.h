/* The cells of a vtkUnstructuredGrid as libinsitu draws them: VTK's own arrays where all are cells that it knows, else
 * a new list with every cell reordered, split, made linear or left out. */
#ifndef VTK_CELLS_H
#define VTK_CELLS_H

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "vtk_arrays.h"

class vtkUnstructuredGrid;

namespace insitu_vtk
{

struct cell_counts {
    int64_t split = 0;
    int64_t linear = 0;
    int64_t flat = 0;
    int64_t not_drawn = 0;
    std::map<int, int64_t> left_out; // 3-D cells not drawn by VTK's type
};

struct cell_list {
    int64_t count = 0;
    bool is_one_to_one = true;   // cell i is VTK's cell i; else see source
    std::vector<int64_t> source; // VTK's cell for each cell i
};

// Where the cells of a grid go, and what is told of them.
struct cells_view {
    const std::string &what; // the grid's name in messages
    hold &held;
    tally &count;
    insitu_mesh &mesh;
    cell_list &cells;
    cell_counts &counts;
};

/* Fill in the cells of the view's mesh (count, types, connectivity, offsets) from grid. The indices of the connectivity
 * are not checked here. False, with a message, where grid's arrays do not fit together. */
bool view_cells(vtkUnstructuredGrid *grid, const cells_view &view, std::string &error);

/* Say in count which cells were left out or simplified. */
void tell_about_cells(const cell_counts &counts, const std::string &what, tally &count);

} // namespace insitu_vtk

#endif
