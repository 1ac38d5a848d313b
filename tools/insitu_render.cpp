/* insitu-render draws files with libinsitu. The steps of a finished simulation are replayed to a session: each step is
 * read, distributed to ranks, passed through the VTK adaptor and drawn.
 *
 * An error may occur on a single rank, for example if only that rank cannot read a file. After each local part all
 * ranks therefore agree on errors before the next collective call. If an error has occurred, all ranks throw its
 * message, and rank 0 prints it. */
#include <chrono>
#include <climits>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <mpi.h>
#include <unistd.h>

#include <vtkDataObject.h>

#include "data_file.h"
#include "data_info.h"
#include "default_scene.h"
#include "grids_of.h"
#include "insitu/insitu.h"
#include "insitu/vtk.h"
#include "render_options.h"
#include "render_progress.h"
#include "step_source.h"
#include "vtk_messages.h"

using namespace render_tool;

namespace
{

const char *const mesh_name = "data";

struct rank_info {
    MPI_Comm comm = MPI_COMM_WORLD;
    int rank = 0, ranks = 1;

    rank_info()
    {
        MPI_Comm_rank(comm, &rank);
        MPI_Comm_size(comm, &ranks);
    }
    bool is_root() const { return rank == 0; }
};

/* Throws the message of the lowest rank that has one, on all ranks. Collective. */
void throw_if_any_failed(const rank_info &w, const std::string &message)
{
    int failing = message.empty() ? INT_MAX : w.rank;
    MPI_Allreduce(MPI_IN_PLACE, &failing, 1, MPI_INT, MPI_MIN, w.comm);
    if (failing == INT_MAX) return;
    int length = static_cast<int>(message.size());
    MPI_Bcast(&length, 1, MPI_INT, failing, w.comm);
    std::string text = message;
    text.resize(static_cast<size_t>(length));
    MPI_Bcast(text.data(), length, MPI_CHAR, failing, w.comm);
    throw std::runtime_error(text);
}

/* Runs a local function on every rank; if it throws on one rank, throws on all. Collective. */
template <typename Body> void run_on_all_ranks(const rank_info &w, Body body)
{
    std::string message;
    try {
        body();
    } catch (const std::exception &e) {
        message = e.what()[0] ? e.what() : "unknown error";
    }
    throw_if_any_failed(w, message);
}

/* A session and its adaptor. The destructor closes the adaptor before the session, because the adaptor uses the
 * session. */
class render_session
{
  public:
    /* scene is a file name, or the text of a scene if is_text; only rank 0 needs the text. */
    render_session(const rank_info &w, const std::string &scene, bool is_text)
    {
        const auto create = is_text ? insitu_create_from_text : insitu_create;
        if (create(w.comm, scene.c_str(), &session_) != INSITU_OK) throw std::runtime_error(insitu_error(nullptr));
        (void)insitu_vtk_create(session_, &adaptor_);
    }
    ~render_session()
    {
        insitu_vtk_destroy(&adaptor_);
        (void)insitu_destroy(&session_);
    }

    /* Waits until all pictures are written; throws if a picture cannot be written. Collective. */
    void close()
    {
        insitu_vtk_destroy(&adaptor_);
        if (insitu_destroy(&session_) != INSITU_OK) throw std::runtime_error(insitu_error(nullptr));
    }
    render_session(const render_session &) = delete;
    render_session &operator=(const render_session &) = delete;

    /* Passes this rank's part of a step to the session. A part without drawable cells is not an error, because the rest
     * of the data may be on other ranks. */
    insitu_vtk_report set(vtkDataObject *data, const std::vector<leaf_mesh> &leaves)
    {
        for (const leaf_mesh &leaf : leaves)
            if (insitu_vtk_draw_by_corners(adaptor_, leaf.name.c_str(), leaf.has_polygons_or_polyhedra) != INSITU_OK)
                throw std::runtime_error(insitu_vtk_error(adaptor_));
        insitu_vtk_report report;
        const insitu_status status = insitu_vtk_set(adaptor_, mesh_name, data, &report);
        const bool has_no_cells = status == INSITU_ERROR_MESH && report.cells == 0 && report.cells_not_drawn > 0;
        if (status != INSITU_OK && !has_no_cells) throw std::runtime_error(insitu_vtk_error(adaptor_));
        return report;
    }

    /* Performs a step. Images that need a field which the step lacks are left out, and `missing` receives the
     * reason. */
    const insitu_report &step(int64_t cycle, double time, std::string &missing)
    {
        const insitu_status status = insitu_step(session_, cycle, time);
        if (status == INSITU_ERROR_FIELD)
            missing = insitu_error(session_);
        else if (status != INSITU_OK)
            throw std::runtime_error(insitu_error(session_));
        return *insitu_last_report(session_);
    }

  private:
    insitu_session *session_ = nullptr;
    insitu_vtk_adaptor *adaptor_ = nullptr;
};

/* Makes all ranks agree on the numbers of leaves in the blocks of a multiblock; blocks that a rank has not read have
 * the number -1 there. Collective. */
void agree_on_leaf_counts(const rank_info &w, std::vector<int> &leaf_counts)
{
    int count = static_cast<int>(leaf_counts.size());
    MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT, MPI_MAX, w.comm);
    leaf_counts.resize(static_cast<size_t>(count), -1);
    MPI_Allreduce(MPI_IN_PLACE, leaf_counts.data(), count, MPI_INT, MPI_MAX, w.comm);
}

/* Makes all ranks agree on which leaves have polygons or polyhedra, beside which cells of higher order are drawn by
 * their corners. A rank may have none of the polyhedra of a leaf, or no part of the data at all. Collective. */
void agree_on_polygons_and_polyhedra(const rank_info &w, std::vector<leaf_mesh> &leaves)
{
    int count = static_cast<int>(leaves.size());
    MPI_Allreduce(MPI_IN_PLACE, &count, 1, MPI_INT, MPI_MAX, w.comm);
    std::vector<unsigned char> flags(static_cast<size_t>(count));
    for (size_t i = 0; i < leaves.size(); i++) flags[i] = leaves[i].has_polygons_or_polyhedra;
    MPI_Allreduce(MPI_IN_PLACE, flags.data(), count, MPI_UNSIGNED_CHAR, MPI_MAX, w.comm);
    for (size_t i = 0; i < leaves.size(); i++) leaves[i].has_polygons_or_polyhedra = flags[i] != 0;
}

/* Returns, on rank 0, the lines in the texts of all ranks that are not in `seen` yet. Collective. */
std::vector<std::string> new_lines(const rank_info &w, const std::string &text, std::set<std::string> &seen)
{
    int length = static_cast<int>(text.size());
    std::vector<int> lengths(static_cast<size_t>(w.ranks)), starts(static_cast<size_t>(w.ranks));
    MPI_Gather(&length, 1, MPI_INT, lengths.data(), 1, MPI_INT, 0, w.comm);
    size_t total = 0;
    for (size_t r = 0; w.is_root() && r < lengths.size(); r++) {
        starts[r] = static_cast<int>(total);
        total += static_cast<size_t>(lengths[r]);
    }
    std::string all(total, '\0');
    MPI_Gatherv(text.data(), length, MPI_CHAR, all.data(), lengths.data(), starts.data(), MPI_CHAR, 0, w.comm);
    std::vector<std::string> fresh;
    std::istringstream in(all);
    for (std::string line; std::getline(in, line);)
        if (!line.empty() && seen.insert(line).second) fresh.push_back(line);
    return fresh;
}

/* The warnings printed so far, the number of images, and the number of steps that had all fields. */
struct run_state {
    const options &given;
    std::set<std::string> shown_warnings;
    int images = 0;
    int complete_steps = 0;
    std::string missing; // reason why the last incomplete step was not drawn completely
};

constexpr size_t warnings_at_once = 8;

void show_warnings(const rank_info &w, const std::string &text, run_state &run, progress &bar)
{
    const std::vector<std::string> fresh = new_lines(w, text, run.shown_warnings);
    for (size_t i = 0; i < fresh.size() && i < warnings_at_once; i++) bar.note("warning: " + fresh[i]);
    if (fresh.size() > warnings_at_once)
        bar.note("warning: and " + std::to_string(fresh.size() - warnings_at_once) + " more");
}

/* Returns warnings about cells that are not drawn as they are. sums: numbers of cells over all ranks; [0]: drawn, [1]:
 * drawn as linear cells, [2]: points and lines, [3]: other cells that are not drawn. */
std::string cell_warnings(const int64_t sums[4])
{
    std::string text;
    const char *const what[] = {"", " higher-order cells drawn by their corners as linear ones",
                                " points and lines are not drawn",
                                " cells left out, of types that cannot be drawn (see --info)"};
    for (int i = 1; i < 4; i++)
        if (sums[i] > 0) text += std::to_string(sums[i]) + what[i] + "\n";
    return text;
}

/* Throws if no rank has a cell to draw; otherwise returns warnings about cells. Collective. */
std::string check_cells(const rank_info &w, const insitu_vtk_report &report, const std::string &name)
{
    int64_t sums[4] = {report.cells, report.cells_linear, report.cells_flat, report.cells_not_drawn};
    MPI_Allreduce(MPI_IN_PLACE, sums, 4, MPI_INT64_T, MPI_SUM, w.comm);
    if (sums[0] > 0) return w.is_root() ? cell_warnings(sums) : "";
    std::string why = name + ": no cells to draw";
    if (sums[3] > 0) why += "; " + std::to_string(sums[3]) + " cells of types that cannot be drawn (see --info)";
    if (sums[2] > 0) why += "; " + std::to_string(sums[2]) + " points and lines";
    throw std::runtime_error(why);
}

/* Returns the time of the lowest rank that has one, because some ranks may have read a part without a time. If no rank
 * has a time, returns the cycle. Collective. */
double agree_on_time(const rank_info &w, const std::optional<double> &of_part, int64_t cycle)
{
    int rank = of_part ? w.rank : w.ranks;
    MPI_Allreduce(MPI_IN_PLACE, &rank, 1, MPI_INT, MPI_MIN, w.comm);
    double time = of_part.value_or(static_cast<double>(cycle));
    if (rank < w.ranks) MPI_Bcast(&time, 1, MPI_DOUBLE, rank, w.comm);
    return time;
}

std::string milliseconds(double ms)
{
    char text[32];
    std::snprintf(text, sizeof text, ms < 10 ? "%.1f" : "%.0f", ms);
    return text;
}

/* Returns the line that describes the step: cells that are not hidden are summed over ranks, and times are the maximum
 * over ranks. Collective. */
std::string format_step_line(const rank_info &w, const insitu_report &r, const std::string &name, double time,
                             double read_ms)
{
    const char *const names[] = {"prepare", "build", "refit", "surface", "volume", "composite", "write"};
    double times[9] = {r.prepare_ms,   r.build_ms, r.refit_ms, r.surface_ms, r.volume_ms,
                       r.composite_ms, r.write_ms, r.total_ms, read_ms};
    MPI_Allreduce(MPI_IN_PLACE, times, 9, MPI_DOUBLE, MPI_MAX, w.comm);
    int64_t cells = r.cells - r.cells_ghost;
    MPI_Allreduce(MPI_IN_PLACE, &cells, 1, MPI_INT64_T, MPI_SUM, w.comm);
    std::ostringstream line;
    line << name << "  cycle " << r.cycle << "  time " << time << "  " << cells << " cells  read "
         << milliseconds(times[8]) << " ms  insitu " << milliseconds(times[7]) << " ms";
    const char *before = ": ";
    for (int i = 0; i < 7; i++) {
        if (times[i] < 0.05) continue;
        line << before << names[i] << ' ' << milliseconds(times[i]);
        before = ", ";
    }
    if (r.images == 0) line << "  (nothing due)";
    return line.str();
}

/* If there is no scene file, replaces the message about a missing field by one that names the option --field. */
std::string suggest_field_option(const options &o, const std::string &missing)
{
    const size_t reason = missing.find("no mesh has the field");
    if (!o.scene.empty() || reason == std::string::npos) return missing;
    if (o.field.empty()) return missing.substr(reason) + "; other steps have it, and --field takes another";
    return "--field " + o.field + ": " + missing.substr(reason);
}

void draw_step(const rank_info &w, step_source &source, render_session &on, size_t index, run_state &run, progress &bar)
{
    const std::string name = source.name(index);
    bar.begin(index, name);
    step_source::result part;
    std::vector<int> leaf_counts;
    std::vector<leaf_mesh> leaves;
    insitu_vtk_report report{};
    const auto start = std::chrono::steady_clock::now();
    run_on_all_ranks(w, [&] {
        part = source.read(index);
        leaf_counts = count_leaves_of_blocks(part.data);
    });
    agree_on_leaf_counts(w, leaf_counts);
    run_on_all_ranks(w, [&] {
        add_empty_leaves(part.data, leaf_counts);
        leaves = list_leaf_meshes(part.data, mesh_name);
    });
    agree_on_polygons_and_polyhedra(w, leaves);
    run_on_all_ranks(w, [&] { report = on.set(part.data, leaves); });
    const std::chrono::duration<double, std::milli> read_time = std::chrono::steady_clock::now() - start;
    const double time = agree_on_time(w, part.time, source.cycle(index));
    std::string warnings = part.warnings + check_cells(w, report, name) + report.warnings + "\n", missing;
    const insitu_report &done = on.step(source.cycle(index), time, missing);
    if (missing.empty()) {
        run.complete_steps++;
    } else {
        run.missing = suggest_field_option(run.given, missing);
        if (source.count() > 1 && w.is_root()) warnings += name + ": not drawn: " + run.missing + "\n";
    }
    if (done.warnings) warnings += done.warnings;
    run.images += done.images;
    bar.line(format_step_line(w, done, name, time, read_time.count()));
    show_warnings(w, warnings, run, bar);
}

std::string working_folder()
{
    char path[PATH_MAX];
    return getcwd(path, sizeof path) ? path : ".";
}

/* Returns the extent of all steps of the source, on every rank. Collective. */
data_extent find_extent(const rank_info &w, step_source &source, const std::string &field)
{
    data_extent extent;
    run_on_all_ranks(w, [&] {
        for (size_t i = 0; i < source.count(); i++)
            if (const auto data = source.read(i).data) add_extent(grids_of(data, source.name(i)), field, extent);
    });
    MPI_Allreduce(MPI_IN_PLACE, extent.low, 4, MPI_DOUBLE, MPI_MIN, w.comm);
    MPI_Allreduce(MPI_IN_PLACE, extent.high, 4, MPI_DOUBLE, MPI_MAX, w.comm);
    return extent;
}

/* Returns the text of the default scene, on rank 0. All steps are read in advance, so that the colour range and the
 * camera are the same for all of them. Collective. */
std::string make_default_scene_text(const rank_info &w, const options &o, step_source &source)
{
    default_look look;
    run_on_all_ranks(w, [&] {
        if (w.is_root()) look = choose_look(o, source);
    });
    int length = static_cast<int>(look.field.size());
    MPI_Bcast(&length, 1, MPI_INT, 0, w.comm);
    look.field.resize(static_cast<size_t>(length));
    MPI_Bcast(look.field.data(), length, MPI_CHAR, 0, w.comm);
    if (source.count() == 1) return default_scene(o, look, nullptr);
    if (w.is_root()) std::printf("reading %zu steps ahead, for one range of colours and one camera\n", source.count());
    const data_extent extent = find_extent(w, source, look.field);
    return default_scene(o, look, &extent);
}

void draw(const rank_info &w, const options &o)
{
    std::unique_ptr<step_source> source;
    run_on_all_ranks(w, [&] { source = std::make_unique<step_source>(o, w.rank, w.ranks); });
    const bool is_text = o.scene.empty();
    render_session on(w, is_text ? make_default_scene_text(w, o, *source) : o.scene, is_text);
    run_state run{o, {}, 0, 0, ""};
    progress bar(w.is_root(), source->count());
    for (size_t i = 0; i < source->count(); i++) draw_step(w, *source, on, i, run, bar);
    on.close();
    if (run.complete_steps == 0 && !run.missing.empty()) throw std::runtime_error(run.missing);
    bar.line(std::to_string(source->count()) + (source->count() == 1 ? " step, " : " steps, ") +
             std::to_string(run.images) + (run.images == 1 ? " picture" : " pictures") + " in " + working_folder());
}

void show_info(const options &o)
{
    for (const std::string &path : o.files) {
        const auto file = open_data_file(path);
        const auto step = static_cast<size_t>(o.first_step);
        if (step > 0 && step >= file->times().size())
            throw std::runtime_error(path + ": has no step " + std::to_string(step));
        const auto data = file->read(step, 0, 1);
        print_info(path + ": " + data->GetClassName(), grids_of(data, path), file->times());
        std::istringstream notes(file->take_warnings());
        for (std::string line; std::getline(notes, line);) std::printf("  note   %s\n", line.c_str());
    }
}

void run(const rank_info &w, int argc, char **argv)
{
    const options o = parse_options(argc, argv);
    if (o.help || o.version) {
        if (!w.is_root()) return;
        if (o.help)
            std::fputs(help_text().c_str(), stdout);
        else
            std::printf("insitu-render %d.%d.%d\n", INSITU_VERSION_MAJOR, INSITU_VERSION_MINOR, INSITU_VERSION_PATCH);
        return;
    }
    catch_vtk_messages();
    if (o.info)
        run_on_all_ranks(w, [&] {
            if (w.is_root()) show_info(o);
        });
    else
        draw(w, o);
}

} // namespace

int main(int argc, char **argv)
{
    int provided;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
    int status = 0;
    {
        const rank_info w;
        try {
            run(w, argc, argv);
        } catch (const std::exception &e) {
            status = 1;
            if (w.is_root()) std::fprintf(stderr, "insitu-render: %s\n", e.what());
        }
    }
    MPI_Finalize();
    return status;
}
