/* Reads Exodus files with VTK's reader, and corrects the cells of element types that VTK does not support. */
#ifndef EXODUS_READER_H
#define EXODUS_READER_H

#include <string>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

/* Returns a reader with all arrays enabled. Elements with more nodes than any VTK cell type become linear cells with
 * the same corners. Throws std::runtime_error with the block, the element type and its number of nodes if an element
 * has fewer nodes than corners; the reader reports the same for element types that are unknown to VTK and to this
 * file. */
vtkSmartPointer<vtkAlgorithm> make_exodus_reader(const std::string &path);

/* Returns a warning if the reader, which make_exodus_reader() must have created, displaces points; otherwise "". */
std::string exodus_warnings(const std::string &path, vtkAlgorithm *reader);

} // namespace render_tool

#endif
