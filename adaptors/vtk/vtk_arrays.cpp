/* VTK has many array classes, but almost all data use two of them: AOS (one tuple after the other) and SOA (one block
 * per component). libinsitu reads both by pointers and strides, if it supports the element type:
 *
 *     AOS   x0 y0 z0 x1 y1 z1 ...                tuple stride 3 elements, component stride 1
 *     SOA   x0 x1 ... | y0 y1 ... | z0 z1 ...    tuple stride 1, component stride is the distance between blocks
 *
 * A field has a single component stride, so the blocks of an SOA array can be borrowed only if they are equally spaced
 * in memory. Coordinates are passed as three separate arrays, so that their blocks may be anywhere in memory. All other
 * arrays (shorts, characters, unsigned integers, bits, arrays computed on access) are copied: integers to an integer
 * type that represents every value, if there is one, otherwise to double. */
#include "vtk_arrays.h"

#include <cstring>
#include <type_traits>

#include <vtkAOSDataArrayTemplate.h>
#include <vtkDataArray.h>
#include <vtkSOADataArrayTemplate.h>

namespace insitu_vtk
{

namespace
{

/* Returns the insitu_type of T. In VTK's interface, long and long long are different types, although both have 64
 * bits. */
template <typename T> constexpr insitu_type element_type()
{
    if constexpr (std::is_integral_v<T>)
        return sizeof(T) == 4 ? INSITU_INT32 : INSITU_INT64;
    else
        return sizeof(T) == 4 ? INSITU_FLOAT32 : INSITU_FLOAT64;
}

array_view describe_array(vtkDataArray *array, insitu_type type)
{
    array_view view;
    view.type = type;
    view.tuple_count = array->GetNumberOfTuples();
    view.component_count = array->GetNumberOfComponents();
    view.component_stride_bytes = type_size(type);
    view.tuple_stride_bytes = view.component_count * type_size(type);
    return view;
}

template <typename T> bool borrow_aos(vtkDataArray *array, array_view &view)
{
    auto *typed = vtkAOSDataArrayTemplate<T>::FastDownCast(array);
    if (!typed) return false;
    view = describe_array(array, element_type<T>());
    view.data = typed->GetPointer(0);
    return true;
}

/* Returns the distance in bytes between the blocks of an SOA array if they are equally spaced in ascending order,
 * otherwise 0. */
template <typename T> int64_t find_block_stride(vtkSOADataArrayTemplate<T> *array)
{
    auto address = [array](int c) { return reinterpret_cast<uintptr_t>(array->GetComponentArrayPointer(c)); };
    const int components = array->GetNumberOfComponents();
    if (components == 1) return sizeof(T);
    if (address(1) <= address(0) || (address(1) - address(0)) % sizeof(T) != 0) return 0;
    const uintptr_t stride = address(1) - address(0);
    for (int c = 2; c < components; c++)
        if (address(c) - address(c - 1) != stride) return 0;
    return static_cast<int64_t>(stride);
}

template <typename T> bool borrow_soa(vtkDataArray *array, array_view &view)
{
    auto *typed = vtkSOADataArrayTemplate<T>::FastDownCast(array);
    if (!typed || array->GetNumberOfTuples() == 0) return false;
    const int64_t stride = find_block_stride(typed);
    if (stride == 0) return false;
    view = describe_array(array, element_type<T>());
    view.data = typed->GetComponentArrayPointer(0);
    view.tuple_stride_bytes = sizeof(T);
    view.component_stride_bytes = stride;
    return true;
}

template <typename T> bool borrow(vtkDataArray *array, array_view &view)
{
    return borrow_aos<T>(array, view) || borrow_soa<T>(array, view);
}

/* Copies values of VTK's type From to type To. To must represent all values of From. */
template <typename From, typename To> bool convert(vtkDataArray *array, held_arrays &held, array_view &view)
{
    auto *typed = vtkAOSDataArrayTemplate<From>::FastDownCast(array);
    if (!typed) return false;
    view = describe_array(array, element_type<To>());
    const int64_t count = view.tuple_count * view.component_count;
    auto *to = reinterpret_cast<To *>(held.allocate(static_cast<size_t>(count) * sizeof(To)));
    const From *from = typed->GetPointer(0);
    for (int64_t i = 0; i < count; i++) to[i] = static_cast<To>(from[i]);
    view.data = to;
    return true;
}

/* Copies an array of any class element by element. Each element is read by GetComponent(), which returns a double. */
template <typename To> array_view copy_elements_one_by_one(vtkDataArray *array, held_arrays &held)
{
    array_view view = describe_array(array, element_type<To>());
    const size_t count = static_cast<size_t>(view.tuple_count) * static_cast<size_t>(view.component_count);
    auto *to = reinterpret_cast<To *>(held.allocate(count * sizeof(To)));
    view.data = to;
    for (int64_t i = 0; i < view.tuple_count; i++)
        for (int c = 0; c < view.component_count; c++) *to++ = static_cast<To>(array->GetComponent(i, c));
    return view;
}

array_view copy_array(vtkDataArray *array, held_arrays &held)
{
    array_view view;
    if (convert<char, int32_t>(array, held, view) || convert<signed char, int32_t>(array, held, view) ||
        convert<unsigned char, int32_t>(array, held, view) || convert<short, int32_t>(array, held, view) ||
        convert<unsigned short, int32_t>(array, held, view) || convert<unsigned int, int64_t>(array, held, view))
        return view;
    if (array->GetDataType() == VTK_FLOAT) return copy_elements_one_by_one<float>(array, held);
    return copy_elements_one_by_one<double>(array, held);
}

int64_t count_bytes(const array_view &view)
{
    return view.tuple_count * view.component_count * type_size(view.type);
}

/* Checks whether libinsitu supports the type of the elements, so that only the layout prevents borrowing. */
bool is_supported_element_type(vtkDataArray *array)
{
    const int type = array->GetDataType();
    return type == VTK_FLOAT || type == VTK_DOUBLE || type == VTK_INT || type == VTK_LONG || type == VTK_LONG_LONG ||
           type == VTK_ID_TYPE;
}

const char *type_name(insitu_type type)
{
    switch (type) {
    case INSITU_FLOAT32: return "float32";
    case INSITU_FLOAT64: return "float64";
    case INSITU_INT32: return "int32";
    case INSITU_INT64: return "int64";
    default: return "uint8";
    }
}

std::string find_copy_reason(vtkDataArray *array, const array_view &copy)
{
    if (is_supported_element_type(array)) return "components not laid out evenly";
    return std::string(array->GetDataTypeAsString()) + " values to " + type_name(copy.type);
}

template <typename T> bool borrow_soa_points(vtkDataArray *points, insitu_array coordinates[3])
{
    auto *typed = vtkSOADataArrayTemplate<T>::FastDownCast(points);
    if (!typed) return false;
    for (int c = 0; c < 3; c++) coordinates[c] = {typed->GetComponentArrayPointer(c), element_type<T>(), sizeof(T)};
    return true;
}

void add_lines(std::string &text, const std::string &lines)
{
    if (!text.empty() && !lines.empty()) text += '\n';
    text += lines;
}

} // namespace

std::byte *held_arrays::allocate(size_t bytes)
{
    copies.push_back(std::make_unique<std::byte[]>(bytes > 0 ? bytes : 1));
    return copies.back().get();
}

void conversion_log::copied(const std::string &what, const std::string &why, int64_t bytes)
{
    bytes_copied += bytes;
    add_lines(copied_why, what + ": " + why + " (" + std::to_string(bytes) + " bytes)");
}

void conversion_log::note_cells(const std::string &text)
{
    add_lines(cells_why, text);
}

void conversion_log::warn(const std::string &text)
{
    add_lines(warnings, text);
}

void conversion_log::add(const conversion_log &other)
{
    bytes_borrowed += other.bytes_borrowed;
    bytes_copied += other.bytes_copied;
    add_lines(copied_why, other.copied_why);
    add_lines(cells_why, other.cells_why);
    add_lines(warnings, other.warnings);
}

const std::byte *array_view::element(int64_t tuple, int component) const
{
    return static_cast<const std::byte *>(data) + tuple * tuple_stride_bytes + component * component_stride_bytes;
}

insitu_array array_view::component(int index) const
{
    return {element(0, index), type, tuple_stride_bytes};
}

int64_t type_size(insitu_type type)
{
    switch (type) {
    case INSITU_UINT8: return 1;
    case INSITU_FLOAT32:
    case INSITU_INT32: return 4;
    default: return 8;
    }
}

array_view borrow_or_copy_array(vtkDataArray *array, const std::string &what, held_arrays &held, conversion_log &log)
{
    array_view view;
    if (borrow<float>(array, view) || borrow<double>(array, view) || borrow<int>(array, view) ||
        borrow<long>(array, view) || borrow<long long>(array, view)) {
        held.objects.emplace_back(array);
        log.bytes_borrowed += count_bytes(view);
        return view;
    }
    view = copy_array(array, held);
    log.copied(what, find_copy_reason(array, view), count_bytes(view));
    return view;
}

void view_points(vtkDataArray *points, const std::string &what, held_arrays &held, conversion_log &log,
                 insitu_array coordinates[3])
{
    if (borrow_soa_points<float>(points, coordinates) || borrow_soa_points<double>(points, coordinates)) {
        held.objects.emplace_back(points);
        log.bytes_borrowed += points->GetNumberOfTuples() * 3 * type_size(coordinates[0].type);
        return;
    }
    array_view view;
    if (borrow_aos<float>(points, view) || borrow_aos<double>(points, view)) {
        held.objects.emplace_back(points);
        log.bytes_borrowed += count_bytes(view);
    } else {
        view = copy_elements_one_by_one<double>(points, held);
        log.copied(what, std::string(points->GetDataTypeAsString()) + " coordinates to float64", count_bytes(view));
    }
    for (int c = 0; c < 3; c++) coordinates[c] = view.component(c);
}

array_view gather(const array_view &view, const std::vector<int64_t> &source, held_arrays &held)
{
    const auto size = static_cast<size_t>(type_size(view.type));
    array_view packed = view;
    packed.tuple_count = static_cast<int64_t>(source.size());
    packed.component_stride_bytes = type_size(view.type);
    packed.tuple_stride_bytes = view.component_count * type_size(view.type);
    std::byte *to = held.allocate(source.size() * static_cast<size_t>(packed.tuple_stride_bytes));
    packed.data = to;
    for (const int64_t tuple : source)
        for (int c = 0; c < view.component_count; c++, to += size) std::memcpy(to, view.element(tuple, c), size);
    return packed;
}

} // namespace insitu_vtk
