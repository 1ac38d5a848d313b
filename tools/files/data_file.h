/* A file of cells, by whichever reader reads it. */
#ifndef DATA_FILE_H
#define DATA_FILE_H

#include <memory>
#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataObject;

namespace render_tool
{

/* "" or why the file cannot be one of data: missing, a directory, not readable, an ending that no reader has. */
std::string why_not_data(const std::string &path);

/* The endings that are read, for help texts: ".vtu .pvtu ...". */
std::string known_endings();

/* Tells whether files of this ending hold time steps, or name files that are steps. */
bool may_hold_steps(const std::string &path);

class data_file
{
  public:
    virtual ~data_file() = default;

    /* The times of the steps inside; empty where the file has none. */
    virtual const std::vector<double> &times() const = 0;

    /* The file that step is read from, as a person would name it. */
    virtual std::string step_path(size_t step) const = 0;

    /* The number of pieces that a step can be read in; 1 for most files. Throws as read() does. */
    virtual int pieces(size_t step) = 0;

    /* One step (0 where there are none inside), and of it piece `piece` of `pieces`, with 0 of 1 for all. Throws
     * std::runtime_error with the file's name and what is wrong. */
    virtual vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) = 0;
};

/* Throws as data_file::read() does. */
std::unique_ptr<data_file> open_data_file(const std::string &path);

/* The time a data set says it is of, in the field data TimeValue; fallback where it says nothing. */
double time_of(vtkDataObject *data, double fallback);

} // namespace render_tool

#endif
