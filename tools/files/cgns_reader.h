/* Reads CGNS files with VTK's reader, after renumbering elements if VTK would misread them. */
#ifndef CGNS_READER_H
#define CGNS_READER_H

#include <string>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

/* Returns a reader with all bases and arrays enabled. Throws std::runtime_error if path is not a CGNS file or is
 * truncated, or, with the names of the zone and section, if a zone that VTK would misread has gaps in its element
 * numbers. */
vtkSmartPointer<vtkAlgorithm> make_cgns_reader(const std::string &path);

} // namespace render_tool

#endif
