/* Converts the cells of a vtkUnstructuredGrid to cell types that libinsitu draws. If all cells are supported, VTK's own
 * arrays are used; otherwise a new list is made, in which cells are reordered, made linear or left out. */
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
    std::map<int, int64_t> left_out; // number of 3-D cells not drawn, by VTK's cell type
};

struct cell_list {
    int64_t count = 0;
    bool is_one_to_one = true;   // true if every cell i of the mesh is VTK's cell i; `source` is then not used
    std::vector<int64_t> source; // index of VTK's cell for each cell of the mesh
};

//  The outputs of view_cells(), and the name of the grid for messages.
struct cells_view {
    const std::string &grid_name; // name of the grid in messages
    held_arrays &held;
    conversion_log &log;
    insitu_mesh &mesh;
    cell_list &cells;
    cell_counts &counts;
    bool are_higher_by_corners; // true if cells of higher order are drawn by their corners in any case
};

/* Fills in the cells of the view's mesh (count, types, connectivity, offsets) from grid. The indices in the
 * connectivity are not checked. Returns false and a message if the sizes of grid's arrays are inconsistent. */
bool view_cells(vtkUnstructuredGrid *grid, const cells_view &view, std::string &error);

/* Reports in `log` which cells were left out or simplified. */
void log_cells(const cell_counts &counts, const std::string &what, conversion_log &log);

} // namespace insitu_vtk

#endif
