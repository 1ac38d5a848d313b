/* Reads CGNS files by VTK's reader, with elements numbered as that expects them. */
#ifndef CGNS_READER_H
#define CGNS_READER_H

#include <string>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

/* A reader with all bases and arrays switched on. Throws std::runtime_error if path is no CGNS file or is cut short,
 * and with the zone and the section if the numbers of a misread zone's elements have gaps. */
vtkSmartPointer<vtkAlgorithm> make_cgns(const std::string &path);

} // namespace render_tool

#endif
