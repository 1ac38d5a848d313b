/* What insitu-render's readers make of files of every format: the cells and values that are in them, and, of files that
 * are cut short, an error or the same cells and values, never others. */
#include <cstdint>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <vtkCellData.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkIdList.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>

#include "data_file.h"
#include "grids_of.h"
#include "test_vtk_run.h"
#include "test_vtk_samples.h"
#include "vtk_messages.h"

// cmocka defines fail as a macro, so it comes after all C++ headers.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

using namespace render_tool;

namespace
{

std::string folder;
std::vector<sample> samples;

int write_all(void **)
{
    folder = fresh_folder("vtk_files");
    samples = write_samples(folder);
    catch_vtk_messages();
    return 0;
}

/* The only grid with cells in data. */
vtkSmartPointer<vtkUnstructuredGrid> only_grid(vtkDataObject *data)
{
    if (auto *grid = vtkUnstructuredGrid::SafeDownCast(data)) return grid;
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) throw std::runtime_error("no grid");
    vtkSmartPointer<vtkUnstructuredGrid> found;
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem()) {
        auto *grid = vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject());
        if (!grid || grid->GetNumberOfCells() == 0) continue;
        if (found) throw std::runtime_error("several grids");
        found = grid;
    }
    return found;
}

vtkSmartPointer<vtkUnstructuredGrid> read_grid(const std::string &name)
{
    const std::string path = folder + "/" + name;
    return only_grid(grids_of(open_data_file(path)->read(0, 0, 1), path));
}

/* "" or where the two differ. */
std::string differing_cells(vtkUnstructuredGrid *a, vtkUnstructuredGrid *b)
{
    if (a->GetNumberOfPoints() != b->GetNumberOfPoints()) return "number of points";
    if (a->GetNumberOfCells() != b->GetNumberOfCells()) return "number of cells";
    for (vtkIdType i = 0; i < a->GetNumberOfPoints(); i++) {
        double p[3], q[3];
        a->GetPoint(i, p);
        b->GetPoint(i, q);
        if (std::memcmp(p, q, sizeof p) != 0) return "point " + std::to_string(i);
    }
    for (vtkIdType i = 0; i < a->GetNumberOfCells(); i++) {
        vtkIdType m = 0, n = 0;
        const vtkIdType *p = nullptr, *q = nullptr;
        a->GetCellPoints(i, m, p);
        b->GetCellPoints(i, n, q);
        if (a->GetCellType(i) != b->GetCellType(i) || m != n || !std::equal(p, p + m, q))
            return "cell " + std::to_string(i);
    }
    return "";
}

/* An array that is not there can be drawn by no picture. */
std::string differing_values(vtkDataSetAttributes *a, vtkDataSetAttributes *b, const std::string &name, bool must_exist)
{
    vtkDataArray *x = a->GetArray(name.c_str()), *y = b->GetArray(name.c_str());
    if (!x) return must_exist ? "no field " + name : "";
    if (x->GetNumberOfTuples() != y->GetNumberOfTuples()) return "length of " + name;
    for (vtkIdType i = 0; i < x->GetNumberOfTuples(); i++)
        if (!(x->GetComponent(i, 0) == y->GetComponent(i, 0))) return name + " " + std::to_string(i);
    return "";
}

std::string difference(vtkUnstructuredGrid *a, vtkUnstructuredGrid *b, bool must_exist)
{
    std::string where = differing_cells(a, b);
    if (where.empty()) where = differing_values(a->GetPointData(), b->GetPointData(), "x", must_exist);
    if (where.empty()) where = differing_values(a->GetCellData(), b->GetCellData(), "c", must_exist);
    return where;
}

void every_format_gives_its_cells_and_values(void **)
{
    for (const sample &s : samples) {
        std::string where;
        try {
            where = difference(read_grid(s.name), s.expected, true);
        } catch (const std::exception &e) {
            where = e.what();
        }
        if (!where.empty()) print_error("%s: %s\n", s.name.c_str(), where.c_str());
        assert_true(where.empty());
    }
}

/* "" or what a cut file was taken for. */
std::string taken_for(const sample &s)
{
    try {
        const auto grid = read_grid(s.name);
        return grid ? difference(grid, s.expected, false) : "";
    } catch (const std::runtime_error &) {
        return "";
    }
}

std::vector<size_t> cuts_of(size_t size, int random_count)
{
    std::vector<size_t> cuts = {0, size / 2, size * 9 / 10, size * 95 / 100, size * 99 / 100, size - 2, size - 1};
    uint64_t state = size;
    for (int i = 0; i < random_count; i++) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        cuts.push_back((state >> 33) % size);
    }
    return cuts;
}

void cut_files_are_errors_or_the_same(void **)
{
    int wrong = 0;
    for (const sample &s : samples)
        for (const std::string &file : s.files) {
            const std::string whole = read_file(folder + "/" + file);
            for (const size_t cut : cuts_of(whole.size(), 40)) {
                write_file(folder + "/" + file, whole.substr(0, cut));
                const std::string where = taken_for(s);
                if (where.empty()) continue;
                print_error("%s with %s cut at %zu of %zu: %s\n", s.name.c_str(), file.c_str(), cut, whole.size(),
                            where.c_str());
                wrong++;
            }
            write_file(folder + "/" + file, whole);
        }
    assert_int_equal(wrong, 0);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(every_format_gives_its_cells_and_values),
        cmocka_unit_test(cut_files_are_errors_or_the_same),
    };
    return cmocka_run_group_tests(tests, write_all, nullptr);
}
