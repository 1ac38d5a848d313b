/* Computes the length that the header of a NetCDF file in a classic format (common for Exodus files) implies. The
 * NetCDF library returns zeros for missing numbers, which would give wrong pictures. */
#ifndef NETCDF_SIZE_H
#define NETCDF_SIZE_H

#include <cstdint>
#include <string>

namespace render_tool
{

/* Returns the length in bytes according to the header of a classic NetCDF file (CDF-1, CDF-2, CDF-5). Returns 0 for any
 * other file, or if the header is truncated. */
int64_t netcdf_bytes(const std::string &path);

} // namespace render_tool

#endif
