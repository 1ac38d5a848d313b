/* A rank reads no more than it must where files are made of parts: with at least as many parts (the pieces of a .pvtu,
 * the blocks of a .vtm, the files of --pieces) as ranks, each rank reads some parts whole. Otherwise, and for any other
 * partition than blocks, every rank reads all and keeps its cells. */
#include "step_source.h"

#include <algorithm>
#include <stdexcept>

#include <vtkDataObject.h>
#include <vtkMultiBlockDataSet.h>

namespace render_tool
{

step_source::step_source(const options &o, int rank, int ranks) : options_(o), rank_(rank), ranks_(ranks)
{
    for (const std::string &file : o.files) {
        const std::string why_not = why_not_data(file);
        if (!why_not.empty()) throw std::runtime_error(why_not);
    }
    int64_t cycle = 0;
    auto add = [&](size_t file, size_t inside) {
        if (cycle >= o.first_step && cycle <= o.last_step) steps_.push_back({file, inside, cycle});
        cycle++;
    };
    const size_t file_count = o.pieces ? 1 : o.files.size();
    for (size_t f = 0; f < file_count; f++) {
        const bool has_steps = !o.pieces && may_hold_steps(o.files[f]);
        const size_t inside = has_steps ? std::max<size_t>(open(f).times().size(), 1) : 1;
        for (size_t i = 0; i < inside; i++) add(f, i);
    }
    if (steps_.empty()) throw std::runtime_error("--steps: none chosen of " + std::to_string(cycle));
}

std::string step_source::name(size_t step) const
{
    const std::string &path = options_.files[steps_[step].file];
    std::string name = path.substr(path.find_last_of('/') + 1);
    if (options_.pieces && options_.files.size() > 1)
        name += " and " + std::to_string(options_.files.size() - 1) + " more";
    return name;
}

data_file &step_source::open(size_t file)
{
    if (!open_ || open_index_ != file) {
        open_.reset();
        open_ = std::make_unique<data_file>(options_.files[file]);
        open_index_ = file;
    }
    return *open_;
}

bool step_source::keeps_whole_files() const
{
    return options_.how == partition::block && static_cast<int>(options_.files.size()) >= ranks_;
}

vtkSmartPointer<vtkDataObject> step_source::read_pieces()
{
    const auto files = static_cast<int64_t>(options_.files.size());
    auto all = vtkSmartPointer<vtkMultiBlockDataSet>::New();
    all->SetNumberOfBlocks(static_cast<unsigned>(files));
    for (int64_t f = 0; f < files; f++) {
        if (keeps_whole_files() && f * ranks_ / files != rank_) continue;
        all->SetBlock(static_cast<unsigned>(f), open(static_cast<size_t>(f)).read(0, 0, 1));
    }
    if (keeps_whole_files()) return all;
    return deal(all, options_.how, rank_, ranks_);
}

step_source::result step_source::read(size_t index)
{
    const step &s = steps_[index];
    const auto fallback = static_cast<double>(s.cycle);
    result r;
    if (options_.pieces) {
        r.data = read_pieces();
        r.time = fallback;
        return r;
    }
    data_file &file = open(s.file);
    const bool is_by_pieces = ranks_ > 1 && options_.how == partition::block && file.pieces() >= ranks_;
    r.data = is_by_pieces ? file.read(s.inside, rank_, ranks_) : file.read(s.inside, 0, 1);
    r.time = s.inside < file.times().size() ? file.times()[s.inside] : time_of(r.data, fallback);
    if (!is_by_pieces) r.data = deal(r.data, options_.how, rank_, ranks_);
    return r;
}

} // namespace render_tool
