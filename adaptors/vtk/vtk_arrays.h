/* Makes VTK's data arrays readable for libinsitu: borrowed where the layout allows, else copied. */
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

/* Objects that one mesh keeps alive while the session may read it: VTK's arrays by reference, and conversions. Moving a
 * hold leaves the memory where it is. */
struct hold {
    std::vector<vtkSmartPointer<vtkObject>> objects;
    std::vector<std::unique_ptr<std::byte[]>> copies;

    std::byte *allocate(size_t bytes);
};

/* Counts of what was borrowed and copied, and warnings, over one insitu_vtk_set(). */
struct tally {
    int64_t bytes_borrowed = 0;
    int64_t bytes_copied = 0;
    std::string copied_why;
    std::string cells_why;
    std::string warnings;

    void copied(const std::string &what, const std::string &why, int64_t bytes);
    void about_cells(const std::string &text);
    void warn(const std::string &text);
    void add(const tally &other);
};

/* A data array of tuple_count × component_count elements in memory. */
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

/* Returns the array as a field's values. They are borrowed, or copied if VTK's type or layout has no counterpart here.
 * what is the array's name in the tally. */
array_view view_array(vtkDataArray *array, const std::string &what, hold &held, tally &count);

/* The three coordinate arrays of points: borrowed (AOS, or SOA with components wherever they lie) or copied. */
void view_points(vtkDataArray *points, const std::string &what, hold &held, tally &count, insitu_array coordinates[3]);

/* The tuples source[0], source[1], ... of a view, packed in a copy that held owns. */
array_view gather(const array_view &view, const std::vector<int64_t> &source, hold &held);

} // namespace insitu_vtk

#endif
