/* Checks that a NetCDF file of the classic formats (Exodus files often are) is as long as its header says. The library
 * that reads them returns zeros for missing numbers, and pictures of zeros would be lies. */
#ifndef NETCDF_SIZE_H
#define NETCDF_SIZE_H

#include <cstdint>
#include <string>

namespace render_tool
{

/* The file's length in bytes, by the header of a classic NetCDF file (CDF-1, CDF-2, CDF-5); 0 for any other file, or if
 * the header itself cannot be read to its end. */
int64_t netcdf_bytes(const std::string &path);

} // namespace render_tool

#endif
