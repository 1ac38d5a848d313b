/* Faces of neighbouring cells are matched by their set of points. Each face is stored once, in the orientation of the
 * first cell that has it. */
#include "vtk_faces.h"

#include <algorithm>
#include <cstring>

#include <vtkCellType.h>
#include <vtkIdTypeArray.h>
#include <vtkUnstructuredGrid.h>

namespace insitu_vtk
{

int64_t face_list::face(const int64_t *points, size_t count)
{
    std::vector<int64_t> key(points, points + count);
    std::sort(key.begin(), key.end());
    uint64_t hash = count;
    for (const int64_t point : key) {
        hash = (hash ^ static_cast<uint64_t>(point)) * 0x9e3779b97f4a7c15u;
        hash ^= hash >> 29;
    }
    const auto range = by_points.equal_range(hash);
    for (auto it = range.first; it != range.second; ++it) {
        const auto at = static_cast<size_t>(it->second);
        if (std::equal(key.begin(), key.end(), sorted.begin() + starts[at], sorted.begin() + starts[at + 1]))
            return it->second;
    }
    const auto made = static_cast<int64_t>(starts.size()) - 1;
    face_points.insert(face_points.end(), points, points + count);
    sorted.insert(sorted.end(), key.begin(), key.end());
    starts.push_back(static_cast<int64_t>(face_points.size()));
    by_points.emplace(hash, made);
    return made;
}

/* Reads the face stream of a cell: the number of faces, and for each face its number of points and its points. Returns
 * false if the stream is not valid. */
bool face_list::add_faces_of_stream(vtkUnstructuredGrid *grid, int64_t cell)
{
    vtkIdTypeArray *stream = grid->GetFaces(), *places = grid->GetFaceLocations();
    if (!stream || !places || cell >= places->GetNumberOfValues()) return false;
    const int64_t end = stream->GetNumberOfValues();
    int64_t at = places->GetValue(cell);
    if (at < 0 || at >= end) return false;
    const int64_t faces = stream->GetValue(at++);
    for (int64_t i = 0; i < faces; i++) {
        if (at >= end) return false;
        const int64_t count = stream->GetValue(at++);
        if (count < 3 || count > end - at) return false;
        const std::vector<int64_t> points(stream->GetPointer(at), stream->GetPointer(at) + count);
        cells.push_back(face(points.data(), points.size()));
        at += count;
    }
    return faces >= 4;
}

/* Adds the faces of a prism. Its points go around one base, then around the other. */
void face_list::add_faces_of_prism(const int64_t *points, int sides)
{
    cells.push_back(face(points, static_cast<size_t>(sides)));
    cells.push_back(face(points + sides, static_cast<size_t>(sides)));
    for (int i = 0; i < sides; i++) {
        const int next = (i + 1) % sides;
        const int64_t quad[4] = {points[i], points[next], points[sides + next], points[sides + i]};
        cells.push_back(face(quad, 4));
    }
}

bool face_list::add_cell(vtkUnstructuredGrid *grid, int64_t cell, int type, const int64_t *points)
{
    const size_t before = cells.size();
    bool is_whole = true;
    if (type == VTK_POLYHEDRON)
        is_whole = add_faces_of_stream(grid, cell);
    else
        add_faces_of_prism(points, type == VTK_PENTAGONAL_PRISM ? 5 : 6);
    if (is_whole)
        cell_starts.push_back(static_cast<int64_t>(cells.size()));
    else
        cells.resize(before);
    return is_whole;
}

int64_t face_list::copy_to_mesh(held_arrays &held, insitu_mesh &mesh) const
{
    auto copy = [&held](const std::vector<int64_t> &from) -> insitu_array {
        std::byte *to = held.allocate(from.size() * sizeof(int64_t));
        if (!from.empty()) std::memcpy(to, from.data(), from.size() * sizeof(int64_t));
        return {to, INSITU_INT64, 0};
    };
    mesh.face_count = static_cast<int64_t>(starts.size()) - 1;
    mesh.face_offsets = copy(starts);
    mesh.face_connectivity_count = static_cast<int64_t>(face_points.size());
    mesh.face_connectivity = copy(face_points);
    return static_cast<int64_t>((starts.size() + face_points.size()) * sizeof(int64_t));
}

} // namespace insitu_vtk
