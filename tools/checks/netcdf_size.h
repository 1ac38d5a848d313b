/* Whether a NetCDF file of the classic formats (Exodus files often are) is as long as its header says. The library that
 * reads them gives zeros for what is missing, and pictures of zeros would be lies. */
#ifndef NETCDF_SIZE_H
#define NETCDF_SIZE_H

#include <cstdint>
#include <string>

namespace render_tool
{

/* The bytes that the header of a classic NetCDF file (CDF-1, CDF-2, CDF-5) implies; 0 for any other file, or for one
 * whose header itself cannot be followed to its end. */
int64_t netcdf_bytes(const std::string &path);

} // namespace render_tool

#endif
