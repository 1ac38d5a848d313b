/* VTK reports errors by printing them and continues. These functions store the messages instead, and convert them to an
 * exception. */
#ifndef VTK_MESSAGES_H
#define VTK_MESSAGES_H

#include <string>

namespace render_tool
{

/* Redirects VTK's messages from now on; VTK no longer prints them. */
void catch_vtk_messages();

/* Throws std::runtime_error with path and VTK's message since the last call, if there is one. */
void throw_pending_message(const std::string &path);

/* Suppresses all output to stderr during its lifetime, because the libraries used by VTK's readers (Exodus, NetCDF,
 * HDF5) print errors that VTK reports as well. */
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
