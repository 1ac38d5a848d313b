/* Points and lines are not drawn. Meshes often have some far away from everything else: probes, springs, or points that
 * no cell uses. */
#include "drawn_cells.h"

#include <algorithm>
#include <array>
#include <vector>

#include <vtkCell.h>
#include <vtkCellTypes.h>
#include <vtkDataSetAttributes.h>
#include <vtkGenericCell.h>
#include <vtkNew.h>
#include <vtkUnsignedCharArray.h>
#include <vtkUnstructuredGrid.h>

#include "cell_extract.h"

namespace render_tool
{

namespace
{

using type_flags = std::array<bool, 256>; // one flag for each cell type of VTK

/* Returns, for each type of VTK, whether the grid has cells of this type that have two or three dimensions. */
type_flags find_drawn_types(vtkUnstructuredGrid *grid)
{
    type_flags are_drawn{};
    vtkNew<vtkCellTypes> types;
    grid->GetCellTypes(types);
    for (vtkIdType i = 0; i < types->GetNumberOfTypes(); i++) {
        const unsigned char type = types->GetCellType(i);
        const auto cell = vtkSmartPointer<vtkCell>::Take(vtkGenericCell::InstantiateCell(type));
        are_drawn[type] = cell && cell->GetCellDimension() >= 2;
    }
    return are_drawn;
}

/* Returns the ghost flags of the grid's cells; null if there are none. */
vtkUnsignedCharArray *get_ghost_flags(vtkUnstructuredGrid *grid)
{
    vtkUnsignedCharArray *ghosts = grid->GetCellGhostArray();
    return ghosts && ghosts->GetNumberOfValues() == grid->GetNumberOfCells() ? ghosts : nullptr;
}

/* Selects the visible cells of the given types. */
selection select_cells(vtkUnstructuredGrid *grid, const type_flags &types)
{
    constexpr int hiding =
        vtkDataSetAttributes::DUPLICATECELL | vtkDataSetAttributes::HIDDENCELL | vtkDataSetAttributes::REFINEDCELL;
    vtkUnsignedCharArray *ghosts = get_ghost_flags(grid);
    selection shown;
    shown.cells.resize(static_cast<size_t>(grid->GetNumberOfCells()));
    shown.points.resize(static_cast<size_t>(grid->GetNumberOfPoints()));
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
        const bool is_hidden = ghosts && (ghosts->GetValue(i) & hiding);
        if (is_hidden || !types[static_cast<unsigned char>(grid->GetCellType(i))]) continue;
        shown.cells[static_cast<size_t>(i)] = true;
        vtkIdType count = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(i, count, points);
        for (vtkIdType k = 0; k < count; k++) shown.points[static_cast<size_t>(points[k])] = true;
    }
    return shown;
}

bool are_all(const std::vector<bool> &flags)
{
    return std::all_of(flags.begin(), flags.end(), [](bool flag) { return flag; });
}

} // namespace

selection select_visible_cells(vtkUnstructuredGrid *grid)
{
    type_flags all_types;
    if (!get_ghost_flags(grid)) return {};
    all_types.fill(true);
    const selection shown = select_cells(grid, all_types);
    return are_all(shown.cells) ? selection{} : shown;
}

selection select_drawn_cells(vtkUnstructuredGrid *grid)
{
    const selection shown = select_cells(grid, find_drawn_types(grid));
    return are_all(shown.cells) && are_all(shown.points) ? selection{} : shown;
}

vtkSmartPointer<vtkUnstructuredGrid> extract_drawn_cells(vtkUnstructuredGrid *grid)
{
    const selection drawn = select_drawn_cells(grid);
    if (drawn.cells.empty() && drawn.points.empty()) return grid;
    std::vector<vtkIdType> cells;
    for (size_t i = 0; i < drawn.cells.size(); i++)
        if (drawn.cells[i]) cells.push_back(static_cast<vtkIdType>(i));
    return extract_cells(grid, cells);
}

} // namespace render_tool
