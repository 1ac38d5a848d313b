/* Reads VTK's HDF files (.vtkhdf). VTK 9.1's own reader supports only the first version of the format: it ignores steps
 * and reads the points and cells of all steps as one grid. */
#ifndef HDF_FILE_H
#define HDF_FILE_H

#include <memory>
#include <string>

#include "data_file.h"

namespace render_tool
{

/* Opens a file of unstructured grids, with or without steps. Returns null for an image without steps, which VTK's
 * reader can read. Throws std::runtime_error for any other type, or if the file is not a VTK HDF file. */
std::unique_ptr<data_file> open_hdf(const std::string &path);

} // namespace render_tool

#endif
