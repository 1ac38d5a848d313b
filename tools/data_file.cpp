/* Each ending has a function that makes its reader, with every array switched on: some of VTK's readers load nothing
 * unless asked. Readers that Debian's VTK may lack are compiled in only where CMake found them. */
#include "data_file.h"

#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <vtkAlgorithm.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkDataObject.h>
#include <vtkDataSet.h>
#include <vtkFieldData.h>
#include <vtkGenericDataObjectReader.h>
#include <vtkInformation.h>
#include <vtkLogger.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkStreamingDemandDrivenPipeline.h>
#include <vtkXMLMultiBlockDataReader.h>
#include <vtkXMLPUnstructuredGridReader.h>
#include <vtkXMLPartitionedDataSetCollectionReader.h>
#include <vtkXMLUnstructuredGridReader.h>
#ifdef INSITU_VTK_HDF
#include <vtkHDFReader.h>
#endif
#ifdef INSITU_VTK_EXODUS
#include <vtkExodusIIReader.h>
#endif
#ifdef INSITU_VTK_CGNS
#include <vtkCGNSReader.h>
#endif

#include "netcdf_size.h"

namespace render_tool
{

namespace
{

/* Takes the place of VTK's output window: keeps the first error, drops the rest. */
class message_catcher : public vtkOutputWindow
{
  public:
    static message_catcher *New();
    vtkTypeMacro(message_catcher, vtkOutputWindow);

    void DisplayText(const char *) override {}
    void DisplayWarningText(const char *) override {}
    void DisplayGenericWarningText(const char *) override {}
    void DisplayDebugText(const char *) override {}
    void DisplayErrorText(const char *text) override
    {
        if (first_error.empty() && text) first_error = text;
    }

    std::string first_error;
};

vtkStandardNewMacro(message_catcher)

    message_catcher *catcher = nullptr; // owned by VTK from catch_vtk_messages() on

/* VTK writes "ERROR: In file, line n\nclass (0x...): what\n\n"; only the last part is of use to a person. */
std::string plain_words(std::string text)
{
    if (text.find("returned failure for request") != std::string::npos) return "VTK's reader failed";
    const size_t address = text.find("): ");
    if (address != std::string::npos) text.erase(0, address + 3);
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
    for (char &c : text)
        if (c == '\n') c = ' ';
    return text;
}

/* Throw what VTK reported since the last call, if anything. */
void throw_caught(const std::string &path)
{
    if (!catcher || catcher->first_error.empty()) return;
    const std::string text = plain_words(catcher->first_error);
    catcher->first_error.clear();
    throw std::runtime_error(path + ": cannot be read: " + text);
}

/* While it lives nothing reaches stderr: the libraries below VTK's readers (Exodus, NetCDF, HDF5) print by themselves
 * what VTK then reports. */
class quiet_stderr
{
  public:
    quiet_stderr() : kept_(dup(STDERR_FILENO))
    {
        const int nowhere = open("/dev/null", O_WRONLY);
        if (kept_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
        if (nowhere >= 0) close(nowhere);
    }
    ~quiet_stderr()
    {
        if (kept_ < 0) return;
        dup2(kept_, STDERR_FILENO);
        close(kept_);
    }
    quiet_stderr(const quiet_stderr &) = delete;
    quiet_stderr &operator=(const quiet_stderr &) = delete;

  private:
    int kept_;
};

using reader = vtkSmartPointer<vtkAlgorithm>;

template <typename Reader> reader make_plain(const std::string &path)
{
    auto r = vtkSmartPointer<Reader>::New();
    r->SetFileName(path.c_str());
    return r;
}

reader make_legacy(const std::string &path)
{
    auto r = vtkSmartPointer<vtkGenericDataObjectReader>::New();
    r->SetFileName(path.c_str());
    r->ReadAllScalarsOn();
    r->ReadAllVectorsOn();
    r->ReadAllTensorsOn();
    r->ReadAllNormalsOn();
    r->ReadAllTCoordsOn();
    r->ReadAllFieldsOn();
    return r;
}

#ifdef INSITU_VTK_EXODUS
reader make_exodus(const std::string &path)
{
    auto r = vtkSmartPointer<vtkExodusIIReader>::New();
    r->SetFileName(path.c_str());
    r->UpdateInformation();
    r->SetAllArrayStatus(vtkExodusIIReader::NODAL, 1);
    r->SetAllArrayStatus(vtkExodusIIReader::ELEM_BLOCK, 1);
    return r;
}
#endif

#ifdef INSITU_VTK_CGNS
reader make_cgns(const std::string &path)
{
    auto r = vtkSmartPointer<vtkCGNSReader>::New();
    r->SetFileName(path.c_str());
    r->UpdateInformation();
    r->EnableAllBases();
    r->EnableAllPointArrays();
    r->EnableAllCellArrays();
    return r;
}
#endif

struct file_kind {
    const char *ending;
    reader (*make)(const std::string &path);
    bool may_hold_steps;
    const char *piece_tag; // an XML tag the file has once for each piece that can be read apart
};

const file_kind kinds[] = {
    {".vtu", make_plain<vtkXMLUnstructuredGridReader>, false, nullptr},
    {".pvtu", make_plain<vtkXMLPUnstructuredGridReader>, false, "<Piece"},
    {".vtm", make_plain<vtkXMLMultiBlockDataReader>, false, "<DataSet"},
    {".vtmb", make_plain<vtkXMLMultiBlockDataReader>, false, "<DataSet"},
    {".vtpc", make_plain<vtkXMLPartitionedDataSetCollectionReader>, false, nullptr},
    {".vtk", make_legacy, false, nullptr},
#ifdef INSITU_VTK_HDF
    {".vtkhdf", make_plain<vtkHDFReader>, false, nullptr},
#endif
#ifdef INSITU_VTK_EXODUS
    {".ex2", make_exodus, true, nullptr},
    {".exo", make_exodus, true, nullptr},
    {".exii", make_exodus, true, nullptr},
    {".e", make_exodus, true, nullptr},
    {".g", make_exodus, true, nullptr},
#endif
#ifdef INSITU_VTK_CGNS
    {".cgns", make_cgns, true, nullptr},
#endif
};

const file_kind *kind_of(const std::string &path)
{
    const std::string name = path.substr(path.find_last_of('/') + 1);
    const size_t dot = name.find_last_of('.');
    if (dot == std::string::npos) return nullptr;
    for (const file_kind &kind : kinds)
        if (name.substr(dot) == kind.ending) return &kind;
    return nullptr;
}

int count_tags(const std::string &path, const char *tag)
{
    std::ifstream in(path);
    int count = 0;
    for (std::string line; std::getline(in, line);)
        for (size_t at = line.find(tag); at != std::string::npos; at = line.find(tag, at + 1)) count++;
    return count > 0 ? count : 1;
}

void check_length(const std::string &path)
{
    const int64_t expected = netcdf_bytes(path);
    struct stat info;
    if (expected == 0 || stat(path.c_str(), &info) != 0 || info.st_size >= expected) return;
    throw std::runtime_error(path + ": is cut short: " + std::to_string(info.st_size) + " bytes of " +
                             std::to_string(expected));
}

bool is_empty(vtkDataObject *data)
{
    return !data || (!vtkDataSet::SafeDownCast(data) && !vtkCompositeDataSet::SafeDownCast(data));
}

} // namespace

void catch_vtk_messages()
{
    if (catcher) return;
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
    catcher = message_catcher::New();
    vtkOutputWindow::SetInstance(catcher);
    catcher->UnRegister(nullptr);
}

std::string known_endings()
{
    std::string all;
    for (const file_kind &kind : kinds) all += (all.empty() ? "" : " ") + std::string(kind.ending);
    return all;
}

bool may_hold_steps(const std::string &path)
{
    const file_kind *kind = kind_of(path);
    return kind && kind->may_hold_steps;
}

std::string why_not_data(const std::string &path)
{
    struct stat info;
    if (stat(path.c_str(), &info) != 0) return path + ": " + std::strerror(errno);
    if (S_ISDIR(info.st_mode)) return path + ": is a directory, expected a file";
    if (access(path.c_str(), R_OK) != 0) return path + ": " + std::strerror(errno);
    if (!kind_of(path)) return path + ": unknown ending, expected one of " + known_endings();
    return "";
}

data_file::data_file(const std::string &path) : path_(path)
{
    const std::string why_not = why_not_data(path);
    if (!why_not.empty()) throw std::runtime_error(why_not);
    check_length(path);
    const file_kind *kind = kind_of(path);
    const quiet_stderr quiet;
    reader_ = kind->make(path);
    reader_->UpdateInformation();
    throw_caught(path);
    vtkInformation *info = reader_->GetOutputInformation(0);
    using pipeline = vtkStreamingDemandDrivenPipeline;
    if (info && info->Has(pipeline::TIME_STEPS())) {
        const double *first = info->Get(pipeline::TIME_STEPS());
        times_.assign(first, first + info->Length(pipeline::TIME_STEPS()));
    }
    if (kind->piece_tag) pieces_ = count_tags(path, kind->piece_tag);
}

data_file::~data_file() = default;

vtkSmartPointer<vtkDataObject> data_file::read(size_t step, int piece, int pieces)
{
    const quiet_stderr quiet;
    if (step < times_.size())
        reader_->UpdateTimeStep(times_[step], piece, pieces);
    else
        reader_->UpdatePiece(piece, pieces, 0);
    throw_caught(path_);
    vtkDataObject *output = reader_->GetOutputDataObject(0);
    if (is_empty(output)) throw std::runtime_error(path_ + ": holds no data set");
    /* A copy by reference: the reader may then read its next step while this one is in use. */
    auto kept = vtkSmartPointer<vtkDataObject>::Take(output->NewInstance());
    kept->ShallowCopy(output);
    return kept;
}

double time_of(vtkDataObject *data, double fallback)
{
    vtkFieldData *fields = data ? data->GetFieldData() : nullptr;
    vtkDataArray *time = fields ? fields->GetArray("TimeValue") : nullptr;
    return time && time->GetNumberOfTuples() > 0 ? time->GetComponent(0, 0) : fallback;
}

} // namespace render_tool
