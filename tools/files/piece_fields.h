/* Gives all pieces of a parallel file the same fields, regardless of which pieces a rank reads. */
#ifndef PIECE_FIELDS_H
#define PIECE_FIELDS_H

#include <string>
#include <vector>

class vtkUnstructuredGrid;
class vtkXMLDataElement;

namespace render_tool
{

/* A field that the parallel file declares. */
struct declared_field {
    std::string name;
    bool is_at_points = false;
    int components = 1;
    std::string type; // type of the values, for example "Float64"
};

/* Returns the PDataArrays in PPointData and PCellData of a parallel file. */
std::vector<declared_field> declared_fields(vtkXMLDataElement *parallel);

/* Changes a piece's fields to those declared, if any are: missing fields are filled with NaN, and undeclared ones are
 * removed. Appends a line to warnings for each change. `piece` is the name of the piece. Throws std::runtime_error if a
 * field has a different number of components. */
void make_fields_as_declared(vtkUnstructuredGrid *grid, const std::vector<declared_field> &fields,
                             const std::string &piece, std::string &warnings);

/* Converts fields that have different types in these pieces to double in all of them, because appending would drop such
 * fields. */
void unify_field_types(const std::vector<vtkUnstructuredGrid *> &pieces);

} // namespace render_tool

#endif
