/* Reads the polyhedra of a vtkUnstructuredGrid. VTK lists all faces of each cell (its face stream); libinsitu needs a
 * list with each face one time, and cells that refer to their faces by index. */
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
    /* Reads a cell of the grid: type 42 from its face stream, prisms (15, 16) from their points. Returns false if the
     * cell's faces are incomplete. */
    bool add_cell(vtkUnstructuredGrid *grid, int64_t cell, int type, const int64_t *points);

    /* Returns the faces of the cell with the index `number`. Cells are counted from 0 in the order in which they were
     * added. */
    const int64_t *cell_faces(size_t number) const { return cells.data() + cell_starts[number]; }
    int64_t cell_size(size_t number) const { return cell_starts[number + 1] - cell_starts[number]; }

    /* Sets the faces of mesh to copies owned by `held`; returns their size in bytes. */
    int64_t copy_to_mesh(held_arrays &held, insitu_mesh &mesh) const;

  private:
    int64_t face(const int64_t *points, size_t count);
    bool add_faces_of_stream(vtkUnstructuredGrid *grid, int64_t cell);
    void add_faces_of_prism(const int64_t *points, int sides);

    /* starts: for each face, the index of its first point in face_points, and a final entry, the total; face_points:
     * the points of all faces, in order around each face; sorted: the same points, sorted within each face */
    std::vector<int64_t> starts{0}, face_points, sorted;
    std::unordered_multimap<uint64_t, int64_t> by_points; // indices of faces, by a hash of their points
    std::vector<int64_t> cell_starts{0}, cells;
};

} // namespace insitu_vtk

#endif
