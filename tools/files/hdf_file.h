/* VTK's HDF files (.vtkhdf), of which VTK 9.1's own reader takes the first version alone: it reads no steps, but all
 * steps' points and cells as one grid. */
#ifndef HDF_FILE_H
#define HDF_FILE_H

#include <memory>
#include <string>

#include "data_file.h"

namespace render_tool
{

/* Opens a file of unstructured grids, with or without steps. Null for an image without steps, which VTK's reader reads.
 * Throws std::runtime_error with what is not read for any other type, and where the file is none of VTK's. */
std::unique_ptr<data_file> open_hdf(const std::string &path);

} // namespace render_tool

#endif
