/* Polyhedra out of a vtkUnstructuredGrid: VTK lists each cell's faces in full (its face stream), libinsitu wants each
 * face once and cells that name their faces. */
#ifndef VTK_FACES_H
#define VTK_FACES_H

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "vtk_arrays.h"

class vtkUnstructuredGrid;

namespace insitu_vtk
{

class face_list
{
  public:
    /* Read cell of the grid: VTK's type 42 by its face stream, prisms (15, 16) by their points. False where the
     * cell's faces are not all there. */
    bool add_cell(vtkUnstructuredGrid *grid, int64_t cell, int type, const int64_t *points);

    /* The faces of the number-th cell added. */
    const int64_t *cell_faces(size_t number) const { return cells.data() + cell_starts[number]; }
    int64_t cell_size(size_t number) const { return cell_starts[number + 1] - cell_starts[number]; }

    /* Hands the faces over to mesh, in memory that held owns. Returns its bytes. */
    int64_t hand_over(hold &held, insitu_mesh &mesh) const;

  private:
    int64_t face(const int64_t *points, size_t count);
    bool add_stream(vtkUnstructuredGrid *grid, int64_t cell);
    void add_prism(const int64_t *points, int sides);

    std::vector<int64_t> starts{0}, loops, sorted; // faces: their points around, and in rising order
    std::unordered_multimap<uint64_t, int64_t> by_points;
    std::vector<int64_t> cell_starts{0}, cells;
};

} // namespace insitu_vtk

#endif
