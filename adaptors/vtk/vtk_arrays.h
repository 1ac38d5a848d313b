/* Makes VTK's data arrays readable for libinsitu. Arrays are borrowed if libinsitu can read their layout, and copied
 * otherwise. */
#ifndef VTK_ARRAYS_H
#define VTK_ARRAYS_H

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <vtkSmartPointer.h>

#include "insitu/insitu.h"

class vtkDataArray;
class vtkObject;

namespace insitu_vtk
{

/* The memory that one mesh keeps alive while the session may read it: references to VTK's arrays, and conversions.
 * Moving the struct does not move this memory. */
struct held_arrays {
    std::vector<vtkSmartPointer<vtkObject>> objects;
    std::vector<std::unique_ptr<std::byte[]>> copies;

    std::byte *allocate(size_t bytes);
};

/* Counts of what was borrowed and copied during one insitu_vtk_set(), and its warnings. */
struct conversion_log {
    int64_t bytes_borrowed = 0;
    int64_t bytes_copied = 0;
    std::string copied_why;
    std::string cells_why;
    std::string warnings;

    void copied(const std::string &what, const std::string &why, int64_t bytes);
    void note_cells(const std::string &text);
    void warn(const std::string &text);
    void add(const conversion_log &other);
};

/* An array in memory with tuple_count × component_count elements. */
struct array_view {
    const void *data = nullptr;
    insitu_type type = INSITU_FLOAT64;
    int64_t tuple_count = 0;
    int component_count = 1;
    int64_t tuple_stride_bytes = 0;
    int64_t component_stride_bytes = 0;

    const std::byte *element(int64_t tuple, int component) const;
    insitu_array component(int index) const;
};

int64_t type_size(insitu_type type);

/* Returns the array as a field's values: borrowed, or copied if libinsitu does not support VTK's type or layout. `what`
 * is the name of the array in reports. */
array_view borrow_or_copy_array(vtkDataArray *array, const std::string &what, held_arrays &held, conversion_log &log);

/* Describes the coordinates of points as three arrays: borrowed if they are AOS or SOA, otherwise copied. */
void view_points(vtkDataArray *points, const std::string &what, held_arrays &held, conversion_log &log,
                 insitu_array coordinates[3]);

/* Copies the tuples source[0], source[1], ... of a view to a packed array that `held` owns. */
array_view gather(const array_view &view, const std::vector<int64_t> &source, held_arrays &held);

} // namespace insitu_vtk

#endif
