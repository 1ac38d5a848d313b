/* Gives all pieces of a parallel file the same fields, whichever of them one rank reads. */
#ifndef PIECE_FIELDS_H
#define PIECE_FIELDS_H

#include <string>
#include <vector>

class vtkUnstructuredGrid;
class vtkXMLDataElement;

namespace render_tool
{

/* A field as the parallel file declares it. */
struct declared_field {
    std::string name;
    bool is_at_points = false;
    int components = 1;
    std::string type; // as in "Float64"
};

/* The PDataArrays of a parallel file's PPointData and PCellData. */
std::vector<declared_field> declared_fields(vtkXMLDataElement *parallel);

/* Makes a piece's fields those declared, if any are: what it lacks becomes NaN, and what is not declared is left out.
 * Appends to warnings what was done, a line each. `piece` names the piece. Throws std::runtime_error where a field has
 * another number of components. */
void make_fields_as_declared(vtkUnstructuredGrid *grid, const std::vector<declared_field> &fields,
                             const std::string &piece, std::string &warnings);

/* Makes fields that are of several types in these pieces doubles in all of them: appending drops them otherwise. */
void even_out_types(const std::vector<vtkUnstructuredGrid *> &pieces);

} // namespace render_tool

#endif
