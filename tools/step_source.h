/* The steps of a run: the file of each step, the index of the step in that file, and this rank's part of its data. */
#ifndef STEP_SOURCE_H
#define STEP_SOURCE_H

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <vtkSmartPointer.h>

#include "data_file.h"
#include "render_options.h"

namespace render_tool
{

class step_source
{
  public:
    /* Opens the files that contain several steps; throws std::runtime_error. */
    step_source(const options &o, int rank, int ranks);

    size_t count() const { return steps_.size(); }
    int64_t cycle(size_t step) const { return steps_[step].cycle; }
    const std::string &path(size_t step) const { return options_.files[steps_[step].file]; }
    size_t index_in_file(size_t step) const { return steps_[step].inside; }
    const std::string &name(size_t step) const
    {
        return steps_[step].name;
    } /* name of the step's file without its folder */

    struct result {
        vtkSmartPointer<vtkDataObject> data; /* this rank's part of the step; null if the rank has no part */
        std::optional<double> time;          // none if this rank's part states no time
        std::string warnings;                // warnings about the step, one per line
    };
    result read(size_t step); /* reads a step; throws std::runtime_error */

  private:
    struct step {
        size_t file;
        size_t inside;
        int64_t cycle;
        std::string name;
    };
    void check_steps_of_pieces();
    void add_steps_of(size_t file, int64_t &cycle);
    data_file &open(size_t file);
    result read_pieces();
    bool keeps_whole_files() const;

    options options_;
    int rank_, ranks_;
    std::vector<step> steps_;
    std::string warnings_;            // warnings about the given files, returned with the first step
    std::unique_ptr<data_file> open_; // the file that was read last, which stays open
    size_t open_index_ = 0;
};

} // namespace render_tool

#endif
