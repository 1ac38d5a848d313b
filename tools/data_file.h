/* A file of unstructured cells, by whichever of VTK's readers reads it. VTK reports errors by printing them and going
 * on; here they are caught and become one exception with the file's name. */
#ifndef DATA_FILE_H
#define DATA_FILE_H

#include <memory>
#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkAlgorithm;
class vtkDataObject;

namespace render_tool
{

/* Catch VTK's messages from now on: nothing of VTK's is printed any more. */
void catch_vtk_messages();

/* "" or why the file cannot be one of data: missing, a directory, not readable, an ending that no reader has. */
std::string why_not_data(const std::string &path);

/* The endings that are read, for help texts: ".vtu .pvtu ...". */
std::string known_endings();

/* Whether files of this ending hold time steps inside. */
bool may_hold_steps(const std::string &path);

class data_file
{
  public:
    /* Throws std::runtime_error as read() does. */
    explicit data_file(const std::string &path);
    ~data_file();
    data_file(const data_file &) = delete;
    data_file &operator=(const data_file &) = delete;

    const std::string &path() const { return path_; }
    const std::vector<double> &times() const { return times_; } /* of the steps inside; empty where the file has none */
    int pieces() const { return pieces_; }                      /* that can be read apart; 1 for most */

    /* One step (0 where there are none inside), and of it piece `piece` of `pieces`, with 0 of 1 for all. Throws
     * std::runtime_error with the file's name and what VTK said. */
    vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces);

  private:
    std::string path_;
    vtkSmartPointer<vtkAlgorithm> reader_;
    std::vector<double> times_;
    int pieces_ = 1;
};

/* The time a data set says it is of, in the field data TimeValue; fallback where it says nothing. */
double time_of(vtkDataObject *data, double fallback);

} // namespace render_tool

#endif
