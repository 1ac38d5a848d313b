/* Data sets that are stored in several files, each of which contains a part of every step. */
#ifndef PART_FILES_H
#define PART_FILES_H

#include <memory>
#include <string>
#include <vector>

#include "data_file.h"

namespace render_tool
{

/* A data set whose parts are read by VTK's readers (open_by_vtk()); each part becomes a block. path names the whole
 * data set. All parts must have the same structure of blocks. */
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
    std::vector<std::unique_ptr<data_file>> files_; // files of the parts; a file is null until it is read
    std::vector<double> times_;

    vtkSmartPointer<vtkDataObject> read_part(size_t part, size_t step);
};

/* The parsed name of a file of a parallel run's Exodus output (Nemesis), for example run.e.4.0, which is one of the
 * four files run.e.4.0 to run.e.4.3. */
struct nemesis_name {
    std::string start; // beginning of the file name, for example "run.e.4."
    int count = 1;     // number of files of the output, for example 4
    size_t digits = 1; // number of digits of the file number
};

/* Parses path; returns false if it is not the name of a file of a parallel run's Exodus output. */
bool parse_nemesis(const std::string &path, nemesis_name &name);

/* Returns the name with the extension that determines the kind of file. It differs from the file's name for Nemesis
 * files and for files of runs whose mesh changes: it is run.e for run.e.4.0, run.e-s002 and run.e-s002.4.0. */
std::string logical_name(const std::string &path);

/* Formats a time for messages. */
std::string time_text(double time);

/* Opens all files of the output to which path belongs. Throws std::runtime_error with the name of a file that is
 * missing. */
std::unique_ptr<data_file> open_nemesis(const std::string &path, const nemesis_name &name);

/* Opens the processor folders of an OpenFOAM case, if the case has any, unless it also has a complete mesh next to path
 * with at least as many steps. Returns null for any other case, which VTK's reader can read. Throws std::runtime_error
 * with the name of a folder that is missing. */
std::unique_ptr<data_file> open_decomposed_foam(const std::string &path);

} // namespace render_tool

#endif
