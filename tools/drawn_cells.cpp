/* Points and lines are not drawn. Meshes often have some far away from everything else: probes, springs, or points that
 * no cell uses. */
#include "drawn_cells.h"

#include <algorithm>
#include <array>
#include <vector>

#include <vtkCell.h>
#include <vtkCellTypes.h>
#include <vtkGenericCell.h>
#include <vtkNew.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "cell_extract.h"

namespace render_tool
{

namespace
{

/* Returns, for each type of VTK, whether the grid has cells of this type that have two or three dimensions. */
std::array<bool, 256> find_drawn_types(vtkUnstructuredGrid *grid)
{
    std::array<bool, 256> are_drawn{};
    vtkNew<vtkCellTypes> types;
    grid->GetCellTypes(types);
    for (vtkIdType i = 0; i < types->GetNumberOfTypes(); i++) {
        const unsigned char type = types->GetCellType(i);
        const auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(type));
        are_drawn[type] = cell && cell->GetCellDimension() >= 2;
    }
    return are_drawn;
}

} // namespace

vtkSmartPointer<vtkUnstructuredGrid> extract_drawn_cells(vtkUnstructuredGrid *grid)
{
    const std::array<bool, 256> are_drawn = find_drawn_types(grid);
    vtkUnsignedCharArray *ghosts = grid->GetCellGhostArray();
    if (ghosts && ghosts->GetNumberOfValues() != grid->GetNumberOfCells()) ghosts = nullptr;
    std::vector<vtkIdType> cells;
    std::vector<bool> are_used(static_cast<size_t>(grid->GetNumberOfPoints()));
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
        const bool is_hidden = ghosts && (ghosts->GetValue(i) & hiding_flags);
        if (is_hidden || !are_drawn[static_cast<unsigned char>(grid->GetCellType(i))]) continue;
        cells.push_back(i);
        vtkIdType count = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(i, count, points);
        for (vtkIdType k = 0; k < count; k++) are_used[static_cast<size_t>(points[k])] = true;
    }
    const bool is_whole = static_cast<vtkIdType>(cells.size()) == grid->GetNumberOfCells() &&
                          std::all_of(are_used.begin(), are_used.end(), [](bool is_used) { return is_used; });
    return is_whole ? vtkSmartPointer<vtkUnstructuredGrid>(grid) : extract_cells(grid, cells);
}

} // namespace render_tool
