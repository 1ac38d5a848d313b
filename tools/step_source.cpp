/* If a step has at least as many parts (the pieces of a .pvtu, the blocks of a .vtm, the files of --pieces) as there
 * are ranks, each rank reads some parts completely. If the step is one structured grid, each rank reads a part of its
 * extent. Otherwise, and for any partition other than blocks, every rank reads everything and keeps its own cells. */
#include "step_source.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <vtkDataObject.h>
#include <vtkMultiBlockDataSet.h>

#include "cell_deal.h"
#include "grids_of.h"

namespace render_tool
{

namespace
{

std::string file_name(const std::string &path)
{
    return path.substr(path.find_last_of('/') + 1);
}

/* Returns a warning if a run whose mesh changes continues in a file next to this one (run.e-s002) that was not given;
 * otherwise "". */
std::string make_next_file_warning(const std::string &file, const std::vector<std::string> &given)
{
    const std::string next = file + "-s002";
    if (!has_known_ending(next) || std::count(given.begin(), given.end(), next) > 0 ||
        !find_reason_not_data(next).empty())
        return "";
    return file + ": the run goes on in " + file_name(next) + ", which is not given\n";
}

/* Returns the time of a step: that of the file's list of steps, or else the one that the data state, if any. */
std::optional<double> find_time(const data_file &file, size_t step, vtkDataObject *data)
{
    if (step < file.times().size()) return file.times()[step];
    return find_time_of_data(data);
}

/* Converts data as convert_to_drawable_data() does, but the leaves of each block of a multiblock stay in one block, so
 * that their number can be made known to ranks that do not read the block (add_empty_leaves()). */
vtkSmartPointer<vtkDataObject> convert_blocks(vtkDataObject *data, const std::string &path)
{
    auto *blocks = vtkMultiBlockDataSet::SafeDownCast(data);
    if (!blocks) return convert_to_drawable_data(data, path);
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(blocks->GetNumberOfBlocks());
    for (unsigned b = 0; b < blocks->GetNumberOfBlocks(); b++)
        if (blocks->GetBlock(b)) all->SetBlock(b, convert_to_drawable_data(blocks->GetBlock(b), path));
    return all;
}

} // namespace

step_source::step_source(const options &o, int rank, int ranks) : options_(o), rank_(rank), ranks_(ranks)
{
    for (const std::string &file : o.files) {
        const std::string why_not = find_reason_not_data(file);
        if (!why_not.empty()) throw std::runtime_error(why_not);
        warnings_ += make_next_file_warning(file, o.files);
    }
    if (o.pieces) check_steps_of_pieces();
    int64_t cycle = 0;
    const size_t file_count = o.pieces ? 1 : o.files.size();
    for (size_t f = 0; f < file_count; f++) add_steps_of(f, cycle);
    if (steps_.empty()) throw std::runtime_error("--steps: none chosen of " + std::to_string(cycle));
}

/* Throws if a piece has several steps, because only one picture is drawn of all pieces. */
void step_source::check_steps_of_pieces()
{
    for (size_t f = 0; f < options_.files.size(); f++) {
        const std::string &path = options_.files[f];
        const size_t steps = may_hold_steps(path) ? open(f).times().size() : 1;
        if (steps > 1)
            throw std::runtime_error(path + ": has " + std::to_string(steps) +
                                     " steps, but files given with --pieces must have one");
    }
}

void step_source::add_steps_of(size_t file, int64_t &cycle)
{
    const std::string &path = options_.files[file];
    const bool has_steps = !options_.pieces && may_hold_steps(path);
    const size_t inside = has_steps ? std::max<size_t>(open(file).times().size(), 1) : 1;
    for (size_t i = 0; i < inside; i++, cycle++) {
        if (cycle < options_.first_step || cycle > options_.last_step) continue;
        std::string name = file_name(has_steps ? open(file).step_path(i) : path);
        if (options_.pieces && options_.files.size() > 1)
            name += " and " + std::to_string(options_.files.size() - 1) + " more";
        steps_.push_back({file, i, cycle, name});
    }
}

data_file &step_source::open(size_t file)
{
    if (!open_ || open_index_ != file) {
        open_.reset();
        open_ = open_data_file(options_.files[file]);
        open_index_ = file;
    }
    return *open_;
}

bool step_source::keeps_whole_files() const
{
    return options_.how == partition::block && static_cast<int>(options_.files.size()) >= ranks_;
}

step_source::result step_source::read_pieces()
{
    result r;
    const auto files = static_cast<int64_t>(options_.files.size());
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(files));
    for (int64_t f = 0; f < files; f++) {
        if (keeps_whole_files() && f * ranks_ / files != rank_) continue;
        const auto file = static_cast<size_t>(f);
        const auto data = open(file).read(0, 0, 1);
        if (!r.time) r.time = find_time(open(file), 0, data);
        all->SetBlock(static_cast<unsigned>(f), convert_to_drawable_data(data, options_.files[file]));
        r.warnings += open(file).take_warnings();
    }
    r.data = all;
    if (!keeps_whole_files()) r.data = distribute_cells(all, options_.how, rank_, ranks_);
    return r;
}

step_source::result step_source::read(size_t index)
{
    const step &s = steps_[index];
    const std::string earlier_warnings = std::exchange(warnings_, "");
    result r;
    if (options_.pieces) {
        r = read_pieces();
        r.warnings = earlier_warnings + r.warnings;
        return r;
    }
    data_file &file = open(s.file);
    const bool is_by_pieces = ranks_ > 1 && options_.how == partition::block && file.pieces(s.inside) >= ranks_;
    const auto data = is_by_pieces ? file.read(s.inside, rank_, ranks_) : file.read(s.inside, 0, 1);
    r.warnings = earlier_warnings + file.take_warnings();
    r.time = find_time(file, s.inside, data);
    if (!data) return r;
    const std::string path = file.step_path(s.inside);
    r.data = is_by_pieces ? convert_blocks(data, path)
                          : distribute_cells(convert_to_drawable_data(data, path), options_.how, rank_, ranks_);
    return r;
}

} // namespace render_tool
