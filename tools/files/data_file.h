/* The interface to a file of cells, independent of the reader that it needs. */
#ifndef DATA_FILE_H
#define DATA_FILE_H

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataObject;

namespace render_tool
{

/* Returns "", or the reason why the file cannot be read as data: it does not exist, is a directory, is not readable, or
 * has an unknown extension. */
std::string find_reason_not_data(const std::string &path);

/* Returns the supported extensions for help texts: ".vtu .pvtu ...". */
std::string known_endings();

/* Checks whether there is a reader for the file's extension. */
bool has_known_ending(const std::string &path);

/* Checks whether the name is that of a scene file. */
bool is_scene(const std::string &path);

/* Checks whether files with this extension may contain time steps, or reference files that are steps. */
bool may_hold_steps(const std::string &path);

class data_file
{
  public:
    virtual ~data_file() = default;

    /* Returns the times of the steps in the file; empty if the file has no steps. */
    virtual const std::vector<double> &times() const = 0;

    /* Returns the path of the file that contains the step, for messages. */
    virtual std::string step_path(size_t step) const = 0;

    /* Returns the largest number of pieces in which a step can be read. It is 1 for most files, and the number of cells
     * for a structured grid. Throws as read() does. */
    virtual int pieces(size_t step) = 0;

    /* Reads piece number `piece` of `pieces` of a step; piece 0 of 1 is the whole step. step is 0 for a file without
     * steps. Returns null if the piece is empty. Throws std::runtime_error with the file's name and the problem. */
    virtual vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) = 0;

    /* Returns the warnings since the last call, one per line. */
    std::string take_warnings() { return std::exchange(warnings_, ""); }

  protected:
    std::string &warnings() { return warnings_; }

  private:
    std::string warnings_;
};

/* Opens a file with the reader for its extension. Throws as data_file::read() does. */
std::unique_ptr<data_file> open_data_file(const std::string &path);

/* Opens path with VTK's reader for its extension, which must be known. If the reader uses only the folder, the file
 * need not exist. Throws as data_file::read() does. */
std::unique_ptr<data_file> open_by_vtk(const std::string &path);

/* Returns the time in the field data TimeValue of a data set or, if it has none, of its first leaf that has one. */
std::optional<double> find_time_of_data(vtkDataObject *data);

} // namespace render_tool

#endif
