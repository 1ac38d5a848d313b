/* Data sets that are divided into files, each of which holds a part of every step. */
#ifndef PART_FILES_H
#define PART_FILES_H

#include <memory>
#include <string>
#include <vector>

#include "data_file.h"

namespace render_tool
{

/* A data set with these steps, of parts that VTK's readers read (open_by_vtk()), each a block. path names the whole.
 * All parts have blocks of their own alike. */
class parts_file : public data_file
{
  public:
    parts_file(std::string path, std::vector<std::string> parts, std::vector<double> times);

    void warn(const std::string &what) { warnings() += path_ + ": " + what + '\n'; }

    const std::vector<double> &times() const override { return times_; }
    std::string step_path(size_t) const override { return path_; }
    int pieces(size_t) override { return static_cast<int>(parts_.size()); }
    vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) override;

  private:
    std::string path_;
    std::vector<std::string> parts_;
    std::vector<std::unique_ptr<data_file>> files_; // by part; null until read
    std::vector<double> times_;

    vtkSmartPointer<vtkDataObject> read_part(size_t part, size_t step);
};

/* The files of a parallel run's Exodus output (Nemesis), run.e.4.0 to run.e.4.3. */
struct nemesis_name {
    std::string start; // "run.e.4."
    int count = 1;     // 4
    size_t digits = 1; // of the last number
};

/* Tells whether path is such a name, and takes it apart. */
bool parse_nemesis(const std::string &path, nemesis_name &name);

/* The name with the ending by which a file's kind is known. It is another for Nemesis files and for files of runs whose
 * mesh changes: run.e for run.e.4.0, run.e-s002 and run.e-s002.4.0. */
std::string plain_name(const std::string &path);

/* A time as messages have it. */
std::string time_text(double time);

/* Opens all files of which path is one. Throws std::runtime_error with the file that is missing. */
std::unique_ptr<data_file> open_nemesis(const std::string &path, const nemesis_name &name);

/* Opens the processors' folders of an OpenFOAM case that has them, if it has no mesh of its own beside path or fewer
 * steps. Null for any other case, which VTK's reader reads. Throws std::runtime_error with the folder that is missing.
 */
std::unique_ptr<data_file> open_decomposed_foam(const std::string &path);

} // namespace render_tool

#endif
