/* Opens each file with one of VTK's readers (file_kinds.cpp), or as a list of other files (piece_files.cpp). If a
 * reader returns zeros for data missing at the end of a file, the length of the file is checked first. */
#include "data_file.h"

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <sys/stat.h>
#include <unistd.h>

#include <vtkAlgorithm.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataObject.h>
#include <vtkDataSet.h>
#include <vtkFieldData.h>
#include <vtkInformation.h>
#include <vtkStreamingDemandDrivenPipeline.h>
#include <vtkUnstructuredGrid.h>

#ifdef INSITU_VTK_EXODUS
#include "exodus_reader.h"
#endif
#include "extent_parts.h"
#include "file_kinds.h"
#include "file_length.h"
#ifdef INSITU_VTK_HDF
#include "hdf_file.h"
#endif
#include "part_files.h"
#include "piece_files.h"
#include "vtk_messages.h"

namespace render_tool
{

namespace
{

int count_tags(const std::string &path, const char *tag)
{
    std::ifstream in(path);
    int count = 0;
    for (std::string line; std::getline(in, line);)
        for (size_t at = line.find(tag); at != std::string::npos; at = line.find(tag, at + 1)) count++;
    return count > 0 ? count : 1;
}

bool is_empty(vtkDataObject *data)
{
    return !data || (!vtkDataSet::SafeDownCast(data) && !vtkCompositeDataSet::SafeDownCast(data));
}

/* A file that one of VTK's readers reads. */
class vtk_file : public data_file
{
  public:
    vtk_file(const std::string &path, const file_kind &kind) : path_(path), reader_(nullptr)
    {
        check_length(path);
        if (kind.names_files) check_named_files(path);
        const quiet_stderr quiet;
        reader_ = kind.make(path);
        reader_->UpdateInformation();
        throw_pending_message(path);
        vtkInformation *info = reader_->GetOutputInformation(0);
        using pipeline = vtkStreamingDemandDrivenPipeline;
        if (kind.may_hold_steps && info && info->Has(pipeline::TIME_STEPS())) {
            const double *first = info->Get(pipeline::TIME_STEPS());
            times_.assign(first, first + info->Length(pipeline::TIME_STEPS()));
        }
#ifdef INSITU_VTK_EXODUS
        if (!times_.empty()) warnings() = exodus_warnings(path, reader_);
#endif
        if (kind.piece_tag) pieces_ = count_tags(path, kind.piece_tag);
        if (kind.has_extents && info && info->Has(pipeline::WHOLE_EXTENT())) {
            info->Get(pipeline::WHOLE_EXTENT(), whole_.data());
            cells_ = count_cells_of_extent(whole_);
            pieces_ = static_cast<int>(std::clamp<int64_t>(cells_, 1, INT_MAX));
        }
    }

    const std::vector<double> &times() const override
    {
        return times_;
    }
    std::string step_path(size_t) const override
    {
        return path_;
    }
    int pieces(size_t) override
    {
        return pieces_;
    }
    vtkSmartPointer<vtkDataObject> read(size_t step, int piece, int pieces) override
    {
        const quiet_stderr quiet;
        extent part;
        const bool is_extent = cells_ > 0;
        if (is_extent && !find_part_of_extent(whole_, {0, cells_, cells_}, piece, pieces, part)) return nullptr;
        if (is_extent)
            reader_->UpdateExtent(part.data());
        else if (step < times_.size())
            reader_->UpdateTimeStep(times_[step], piece, pieces);
        else
            reader_->UpdatePiece(piece, pieces, 0);
        throw_pending_message(path_);
        vtkDataObject *output = reader_->GetOutputDataObject(0);
        if (is_empty(output)) throw std::runtime_error(path_ + ": holds no data set");
        /* Returns a shallow copy, so that the reader can read the next step while this one is in use. */
        auto kept = vtkSmartPointer<vtkDataObject>::Take(output->NewInstance());
        kept->ShallowCopy(output);
        return kept;
    }

  private:
    std::string path_;
    vtkSmartPointer<vtkAlgorithm> reader_;
    std::vector<double> times_;
    int pieces_ = 1;
    extent whole_{};    /* extent of a structured grid */
    int64_t cells_ = 0; /* number of cells of the structured grid; 0 for other files */
};

/* A .vtu file without points and cells. VTK's reader reports an error if the lists of points and cells are missing in
 * such a file. */
class empty_file : public data_file
{
  public:
    explicit empty_file(const std::string &path) : path_(path) {}

    const std::vector<double> &times() const override { return times_; }
    std::string step_path(size_t) const override { return path_; }
    int pieces(size_t) override { return 1; }
    vtkSmartPointer<vtkDataObject> read(size_t, int, int) override
    {
        return vtkSmartPointer<vtkUnstructuredGrid>::New();
    }

  private:
    std::string path_;
    std::vector<double> times_; /* times of the steps; always empty, because the file has no steps */
};

} // namespace

std::string known_endings()
{
    std::string all;
    for (const file_kind &kind : file_kinds()) all += (all.empty() ? "" : " ") + std::string(kind.ending);
    return all;
}

bool has_known_ending(const std::string &path)
{
    return kind_of(path) != nullptr;
}

bool is_scene(const std::string &path)
{
    const std::string ending = std::filesystem::path(path).extension().string();
    return ending == ".yaml" || ending == ".yml";
}

bool may_hold_steps(const std::string &path)
{
    const file_kind *kind = kind_of(path);
    return kind && kind->may_hold_steps;
}

std::string find_reason_not_data(const std::string &path)
{
    struct stat info;
    if (stat(path.c_str(), &info) != 0) return path + ": " + std::strerror(errno);
    if (S_ISDIR(info.st_mode)) return path + ": is a directory, expected a file";
    if (access(path.c_str(), R_OK) != 0) return path + ": " + std::strerror(errno);
    if (is_scene(path))
        return path + ": is a scene file, expected data: a file with one of the endings " + known_endings();
    if (!kind_of(path)) return path + ": unknown ending, expected one of " + known_endings();
    return "";
}

std::unique_ptr<data_file> open_data_file(const std::string &path)
{
    const std::string why_not = find_reason_not_data(path);
    if (!why_not.empty()) throw std::runtime_error(why_not);
    const file_kind &kind = *kind_of(path);
    const std::string ending = kind.ending;
    if (ending == ".pvtu") return open_pvtu(path);
    if (ending == ".pvd") return open_pvd(path);
    if (ending == ".series") return open_series(path);
    nemesis_name parts_name;
    if (parse_nemesis(path, parts_name)) return open_nemesis(path, parts_name);
    if (ending == ".foam")
        if (auto parts = open_decomposed_foam(path)) return parts;
#ifdef INSITU_VTK_HDF
    if (ending == ".vtkhdf")
        if (auto grids = open_hdf(path)) return grids;
#endif
    if (ending == ".vtu" && is_empty_vtu(path)) return std::make_unique<empty_file>(path);
    return open_by_vtk(path);
}

std::unique_ptr<data_file> open_by_vtk(const std::string &path)
{
    return std::make_unique<vtk_file>(path, *kind_of(path));
}

std::optional<double> find_time_of_data(vtkDataObject *data)
{
    vtkFieldData *fields = data ? data->GetFieldData() : nullptr;
    vtkDataArray *array = fields ? fields->GetArray("TimeValue") : nullptr;
    if (array && array->GetNumberOfTuples() > 0) return array->GetComponent(0, 0);
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) return std::nullopt;
    std::optional<double> time;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !time && !it->IsDoneWithTraversal(); it->GoToNextItem())
        time = find_time_of_data(it->GetCurrentDataObject());
    return time;
}

} // namespace render_tool
