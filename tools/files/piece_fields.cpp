/* Fields are added to a piece, or removed from it, depending only on the piece itself and on the parallel file. The
 * picture therefore does not depend on which pieces a rank reads. A field whose type differs between the pieces that a
 * rank reads is converted to double. This does not change values, because double represents all numbers of fewer than 8
 * bytes exactly. */
#include "piece_fields.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include <vtkCellData.h>
#include <vtkDataArray.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLDataElement.h>

namespace render_tool
{

namespace
{

vtkDataSetAttributes *get_grid_attributes(vtkUnstructuredGrid *grid, bool is_at_points)
{
    if (is_at_points) return grid->GetPointData();
    return grid->GetCellData();
}

bool is_ghost_array(const std::string &name)
{
    return name == vtkDataSetAttributes::GhostArrayName() || name == "avtGhostZones";
}

/* Returns the name of the array's type in VTK's XML files, for example "Float64". */
std::string type_name(vtkDataArray *array)
{
    const int bits = 8 * array->GetDataTypeSize(), type = array->GetDataType();
    if (type == VTK_BIT) return "Bit";
    if (type == VTK_FLOAT || type == VTK_DOUBLE) return "Float" + std::to_string(bits);
    return (array->GetDataTypeMin() < 0 ? "Int" : "UInt") + std::to_string(bits);
}

vtkSmartPointer<vtkDoubleArray> convert_to_doubles(const std::string &name, int components, vtkIdType count)
{
    auto array = vtkSmartPointer<vtkDoubleArray>::New();
    array->SetName(name.c_str());
    array->SetNumberOfComponents(components);
    array->SetNumberOfTuples(count);
    array->Fill(std::nan(""));
    return array;
}

/* Removes the arrays that are not declared. There is no warning about arrays of texts, because they are no fields. */
void remove_undeclared(vtkDataSetAttributes *data, bool is_at_points, const std::vector<declared_field> &fields,
                       const std::string &piece, std::string &warnings)
{
    for (int i = data->GetNumberOfArrays() - 1; i >= 0; i--) {
        const char *const text = data->GetAbstractArray(i)->GetName();
        const std::string name = text ? text : "";
        const auto is_same = [&](const declared_field &f) { return f.is_at_points == is_at_points && f.name == name; };
        if (is_ghost_array(name) || std::any_of(fields.begin(), fields.end(), is_same)) continue;
        if (data->GetArray(i))
            warnings.append(piece)
                .append(": has a field \"")
                .append(name)
                .append("\", which the file that names the piece does not declare for ")
                .append(is_at_points ? "points" : "cells")
                .append(": left out\n");
        data->RemoveArray(i);
    }
}

} // namespace

std::vector<declared_field> declared_fields(vtkXMLDataElement *parallel)
{
    std::vector<declared_field> fields;
    for (const bool is_at_points : {true, false}) {
        vtkXMLDataElement *list = parallel->FindNestedElementWithName(is_at_points ? "PPointData" : "PCellData");
        for (int i = 0; list && i < list->GetNumberOfNestedElements(); i++) {
            vtkXMLDataElement *element = list->GetNestedElement(i);
            const char *name = element->GetAttribute("Name"), *type = element->GetAttribute("type");
            if (!name || std::string(element->GetName()) == "PArray" || is_ghost_array(name)) continue;
            int components = 1;
            (void)element->GetScalarAttribute("NumberOfComponents", components);
            fields.push_back({name, is_at_points, components, type ? type : ""});
        }
    }
    return fields;
}

void make_fields_as_declared(vtkUnstructuredGrid *grid, const std::vector<declared_field> &fields,
                             const std::string &piece, std::string &warnings)
{
    if (fields.empty()) return;
    for (const bool is_at_points : {true, false})
        remove_undeclared(get_grid_attributes(grid, is_at_points), is_at_points, fields, piece, warnings);
    for (const declared_field &f : fields) {
        vtkDataSetAttributes *data = get_grid_attributes(grid, f.is_at_points);
        vtkDataArray *array = data->GetArray(f.name.c_str());
        const std::string field = piece + ": its field \"" + f.name + "\"";
        if (!array) {
            warnings += piece + ": has no field \"" + f.name + "\", which other pieces may have: drawn as NaN\n";
            data->AddArray(convert_to_doubles(f.name, f.components,
                                              f.is_at_points ? grid->GetNumberOfPoints() : grid->GetNumberOfCells()));
        } else if (array->GetNumberOfComponents() != f.components) {
            throw std::runtime_error(field + " has " + std::to_string(array->GetNumberOfComponents()) +
                                     " components, the file that names the piece declares " +
                                     std::to_string(f.components));
        } else if (!f.type.empty() && type_name(array) != f.type) {
            warnings += field + " is of type " + type_name(array) + ", declared as " + f.type + '\n';
        }
    }
}

void unify_field_types(const std::vector<vtkUnstructuredGrid *> &pieces)
{
    std::map<std::pair<bool, std::string>, std::set<int>> types;
    for (const bool is_at_points : {true, false})
        for (vtkUnstructuredGrid *grid : pieces) {
            vtkDataSetAttributes *data = get_grid_attributes(grid, is_at_points);
            for (int i = 0; i < data->GetNumberOfArrays(); i++)
                if (vtkDataArray *array = data->GetArray(i))
                    if (array->GetName()) types[{is_at_points, array->GetName()}].insert(array->GetDataType());
        }
    for (const auto &[field, of_field] : types) {
        if (of_field.size() < 2 || is_ghost_array(field.second)) continue;
        for (vtkUnstructuredGrid *grid : pieces) {
            vtkDataSetAttributes *data = get_grid_attributes(grid, field.first);
            vtkDataArray *array = data->GetArray(field.second.c_str());
            if (!array || array->GetDataType() == VTK_DOUBLE) continue;
            const auto wide =
                convert_to_doubles(field.second, array->GetNumberOfComponents(), array->GetNumberOfTuples());
            wide->DeepCopy(array);
            data->AddArray(wide); /* replaces the array of the same name by the converted one */
        }
    }
}

} // namespace render_tool
