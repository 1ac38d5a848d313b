/* VTK reports errors by printing them and going on. Here they are kept instead, and become one exception. */
#ifndef VTK_MESSAGES_H
#define VTK_MESSAGES_H

#include <string>

namespace render_tool
{

/* Catch VTK's messages from now on: nothing of VTK's is printed any more. */
void catch_vtk_messages();

/* Throw std::runtime_error with path and what VTK reported since the last call, if anything. */
void throw_caught(const std::string &path);

/* While it lives nothing reaches stderr, for the libraries below VTK's readers (Exodus, NetCDF, HDF5) print what VTK
 * reports as well. */
class quiet_stderr
{
  public:
    quiet_stderr();
    ~quiet_stderr();
    quiet_stderr(const quiet_stderr &) = delete;
    quiet_stderr &operator=(const quiet_stderr &) = delete;

  private:
    int kept_;
};

} // namespace render_tool

#endif
