/* Reads Exodus files by VTK's reader, and sets right what that makes of element types that it does not have. */
#ifndef EXODUS_READER_H
#define EXODUS_READER_H

#include <string>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

/* A reader with all arrays switched on. Elements with more nodes than VTK has a cell type for become linear cells
 * between their corners. Throws std::runtime_error with the block, the element type and its number of nodes where an
 * element has fewer nodes than corners; the reader reports the same for types that neither VTK nor this file has. */
vtkSmartPointer<vtkAlgorithm> make_exodus(const std::string &path);

/* What is worth a warning of the file of a reader that make_exodus() made, a line each: that its points are moved. */
std::string warn_of_exodus(const std::string &path, vtkAlgorithm *reader);

} // namespace render_tool

#endif
