/* A file of cells, whichever reader it needs. */
#ifndef DATA_FILE_H
#define DATA_FILE_H

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataObject;

namespace render_tool
{

/* "" or why the file cannot be read as data: it is missing, a directory or not readable, or no reader has its ending.
 */
std::string why_not_data(const std::string &path);

/* The endings that are read, for help texts: ".vtu .pvtu ...". */
std::string known_endings();

/* Tells whether a reader has the file's ending. */
bool has_known_ending(const std::string &path);

/* Tells whether the name is that of a scene file. */
bool is_scene(const std::string &path);

/* Tells whether files of this ending hold time steps, or name files that are steps. */
bool may_hold_steps(const std::string &path);

class data_file
{
  public:
    virtual ~data_file() = default;

    /* The times of the steps inside; empty where the file has none. */
    virtual const std::vector<double> &times() const = 0;

    /* The file from which the step is read, as a person would name it. */
    virtual std::string step_path(size_t step) const = 0;

    /* The number of pieces that a step can be read in; 1 for most files. Throws as read() does. */
    virtual int pieces(size_t step) = 0;

    /* Reads piece `piece` of `pieces` of a step (0 where the file has none); 0 of 1 is all of it. Throws
     * std::runtime_error with the file's name and what is wrong. */
    virtual vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) = 0;

    /* What is worth a warning of what was read since the last call, a line each. */
    std::string take_warnings() { return std::exchange(warnings_, ""); }

  protected:
    std::string &warnings() { return warnings_; }

  private:
    std::string warnings_;
};

/* Throws as data_file::read() does. */
std::unique_ptr<data_file> open_data_file(const std::string &path);

/* Opens path by VTK's reader for its ending, which must be known. The file need not exist if the reader goes by its
 * folder alone. Throws as data_file::read() does. */
std::unique_ptr<data_file> open_by_vtk(const std::string &path);

/* A data set's time, from its field data TimeValue, or fallback where there is none. */
double time_of(vtkDataObject *data, double fallback);

} // namespace render_tool

#endif
