/* Reads CGNS files by VTK's reader, and refuses those of which that makes wrong cells. */
#ifndef CGNS_READER_H
#define CGNS_READER_H

#include <string>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

/* A reader with all bases and arrays switched on. Throws std::runtime_error where path is no CGNS file, or is cut
 * short, and with the zone and the section where elements of a boundary come before the cells. */
vtkSmartPointer<vtkAlgorithm> make_cgns(const std::string &path);

} // namespace render_tool

#endif
