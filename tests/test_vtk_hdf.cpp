/* Checks VTK's HDF files: the steps of unstructured grids must be read as they were written, one at a time, and
 * unsupported types must be refused by name. The test writes the files with the HDF5 library. Each part is a row of
 * unit cubes along x. */
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <vtkCellData.h>
#include <vtkCellType.h>
#include <vtkCompositeDataIterator.h>
#include <vtkCompositeDataSet.h>
#include <vtkDataArray.h>
#include <vtkFieldData.h>
#include <vtkPointData.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>
#include <vtk_hdf5.h>

#include "data_file.h"
#include "grids_of.h"
#include "test_vtk_run.h"
#include "vtk_messages.h"

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
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

using numbers = std::vector<long long>;

/* The arrays of all parts, one after another, as a file stores them. */
struct lists {
    numbers point_counts, cell_counts, id_counts, ids, offsets, types;
    std::vector<double> points, f; // points: coordinates; f: values at points
    std::vector<double> c;         // values of cells
};

/* Adds a part with the cubes `first` to `first` + `count` - 1 of a row at height z. The fields are f = x + 100 step at
 * points and c = cube + 100 step of cells. */
void add_part(lists &all, int first, int count, double z, int step)
{
    const double corners[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                  {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    all.offsets.push_back(0);
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < 8; k++) {
            all.points.insert(all.points.end(), {corners[k][0] + first + i, corners[k][1], corners[k][2] + z});
            all.f.push_back(corners[k][0] + first + i + 100 * step);
            all.ids.push_back(8 * i + k);
        }
        all.offsets.push_back(8 * (i + 1));
        all.types.push_back(VTK_HEXAHEDRON);
        all.c.push_back(first + i + 100 * step);
    }
    all.point_counts.push_back(8 * count);
    all.cell_counts.push_back(count);
    all.id_counts.push_back(8 * count);
}

/* Adds a part that has the points of another part and their values, but reuses cells of an earlier part. */
void add_part_with_earlier_cells(lists &all, const lists &points)
{
    all.points.insert(all.points.end(), points.points.begin(), points.points.end());
    all.f.insert(all.f.end(), points.f.begin(), points.f.end());
    all.point_counts.push_back(points.point_counts[0]);
    all.cell_counts.push_back(points.cell_counts[0]);
    all.id_counts.push_back(points.id_counts[0]);
}

class writer
{
  public:
    writer(const std::string &name, const std::string &type)
        : file_(H5Fcreate((folder + "/" + name).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT))
    {
        create_group("/VTKHDF");
        const long long version[2] = {2, 0};
        H5LTset_attribute_long_long(file_, "/VTKHDF", "Version", version, 2);
        H5LTset_attribute_string(file_, "/VTKHDF", "Type", type.c_str());
    }
    ~writer() { H5Fclose(file_); }
    writer(const writer &) = delete;
    writer &operator=(const writer &) = delete;

    void create_group(const std::string &name)
    {
        H5Gclose(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    }
    void write_dataset(const std::string &name, const numbers &values)
    {
        const hsize_t size = values.size();
        H5LTmake_dataset(file_, ("/VTKHDF/" + name).c_str(), 1, &size, H5T_NATIVE_LLONG, values.data());
    }
    void write_dataset(const std::string &name, const std::vector<double> &values, hsize_t components = 1)
    {
        const hsize_t size[2] = {values.size() / components, components};
        H5LTmake_dataset(file_, ("/VTKHDF/" + name).c_str(), components > 1 ? 2 : 1, size, H5T_NATIVE_DOUBLE,
                         values.data());
    }
    void write_dataset(const lists &all)
    {
        write_dataset("NumberOfPoints", all.point_counts);
        write_dataset("NumberOfCells", all.cell_counts);
        write_dataset("NumberOfConnectivityIds", all.id_counts);
        write_dataset("Points", all.points, 3);
        write_dataset("Connectivity", all.ids);
        write_dataset("Offsets", all.offsets);
        const std::vector<unsigned char> types(all.types.begin(), all.types.end());
        const hsize_t size = types.size();
        H5LTmake_dataset(file_, "/VTKHDF/Types", 1, &size, H5T_NATIVE_UCHAR, types.data());
        create_group("/VTKHDF/PointData");
        create_group("/VTKHDF/CellData");
        write_dataset("PointData/f", all.f);
        write_dataset("CellData/c", all.c);
    }
    void write_steps(const std::vector<double> &times)
    {
        create_group("/VTKHDF/Steps");
        const int count = static_cast<int>(times.size());
        H5LTset_attribute_int(file_, "/VTKHDF/Steps", "NSteps", &count, 1);
        write_dataset("Steps/Values", times);
    }

  private:
    hid_t file_;
};

std::string describe_step(const std::string &path, size_t step)
{
    const auto file = open_data_file(path);
    const auto data = grids_of(file->read(step, 0, 1), path);
    std::string text;
    const auto add = [&](vtkUnstructuredGrid *grid) {
        if (!grid) return;
        const double *b = grid->GetBounds();
        double f[2], c[2];
        grid->GetPointData()->GetArray("f")->GetRange(f);
        grid->GetCellData()->GetArray("c")->GetRange(c);
        char line[200];
        std::snprintf(line, sizeof line, "%d cells x %g..%g z %g..%g f %g..%g c %g..%g; ",
                      static_cast<int>(grid->GetNumberOfCells()), b[0], b[1], b[4], b[5], f[0], f[1], c[0], c[1]);
        text += line;
    };
    auto *composite = vtkCompositeDataSet::SafeDownCast(data);
    if (!composite) {
        add(vtkUnstructuredGrid::SafeDownCast(data));
        return text;
    }
    const auto it = vtkSmartPointer<vtkCompositeDataIterator>::Take(composite->NewIterator());
    for (it->InitTraversal(); !it->IsDoneWithTraversal(); it->GoToNextItem())
        add(vtkUnstructuredGrid::SafeDownCast(it->GetCurrentDataObject()));
    return text;
}

void expect_step(const std::string &name, size_t step, const std::string &expected)
{
    const std::string found = describe_step(folder + "/" + name, step);
    if (found == expected) return;
    print_error("%s step %zu: %s\nexpected %s\n", name.c_str(), step, found.c_str(), expected.c_str());
    assert_true(false);
}

void expect_refusal(const std::string &name, const std::string &why)
{
    try {
        (void)describe_step(folder + "/" + name, 0);
    } catch (const std::exception &e) {
        const std::string what = e.what();
        if (what.find(name) != std::string::npos && what.find(why) != std::string::npos) return;
        print_error("%s\n", e.what());
    }
    print_error("%s: not refused by \"%s\"\n", name.c_str(), why.c_str());
    assert_true(false);
}

/* Checks three parts with 2, 0 and 3 cells: the reader must return the cells of all parts. */
void parts_of_one_step_are_all_read(void **)
{
    {
        writer w("parts.vtkhdf", "UnstructuredGrid");
        lists all;
        add_part(all, 0, 2, 0, 0);
        add_part(all, 0, 0, 0, 0);
        add_part(all, 2, 3, 0, 0);
        w.write_dataset(all);
    }
    const auto file = open_data_file(folder + "/parts.vtkhdf");
    assert_int_equal(file->times().size(), 0);
    assert_int_equal(file->pieces(0), 3);
    const std::string found = describe_step(folder + "/parts.vtkhdf", 0);
    assert_true(found.find("2 cells x 0..2 z 0..1 f 0..2 c 0..1; ") == 0);
    assert_true(found.find("3 cells x 2..5 z 0..1 f 2..5 c 2..4; ") != std::string::npos);
}

/* Checks that the field data of a file without steps state its time, for one part and for two. */
void time_of_a_file_without_steps_is_in_its_field_data(void **)
{
    for (const int parts : {1, 2}) {
        {
            writer w("time.vtkhdf", "UnstructuredGrid");
            lists all;
            for (int i = 0; i < parts; i++) add_part(all, 2 * i, 2, 0, 0);
            w.write_dataset(all);
            w.create_group("/VTKHDF/FieldData");
            w.write_dataset("FieldData/TimeValue", std::vector<double>{2.5});
        }
        for (int piece = 0; piece < parts; piece++) {
            const auto data = open_data_file(folder + "/time.vtkhdf")->read(0, piece, parts);
            vtkDataArray *time = data->GetFieldData()->GetArray("TimeValue");
            assert_true(time && time->GetComponent(0, 0) == 2.5);
        }
    }
}

/* Checks steps in which everything changes, including the number of parts. The second step begins with a part without
 * cells. */
void steps_of_a_mesh_that_changes_are_read_one_by_one(void **)
{
    {
        writer w("changing.vtkhdf", "UnstructuredGrid");
        lists all;
        add_part(all, 0, 2, 0, 0);
        add_part(all, 0, 0, 1, 1);
        add_part(all, 1, 4, 1, 1);
        add_part(all, 7, 1, 2, 2);
        w.write_dataset(all);
        w.write_steps({0.5, 0.75, 1.5});
        w.write_dataset("Steps/PartOffsets", numbers{0, 1, 3});
        w.write_dataset("Steps/NumberOfParts", numbers{1, 2, 1});
        w.write_dataset("Steps/PointOffsets", numbers{0, 16, 48});
        w.write_dataset("Steps/CellOffsets", numbers{0, 2, 6});
        w.write_dataset("Steps/ConnectivityIdOffsets", numbers{0, 16, 48});
    }
    const auto file = open_data_file(folder + "/changing.vtkhdf");
    assert_int_equal(file->times().size(), 3);
    assert_true(file->times()[1] == 0.75);
    assert_int_equal(file->pieces(1), 2);
    assert_true(may_hold_steps(folder + "/changing.vtkhdf"));
    expect_step("changing.vtkhdf", 0, "2 cells x 0..2 z 0..1 f 0..2 c 0..1; ");
    assert_true(describe_step(folder + "/changing.vtkhdf", 1).find("4 cells x 1..5 z 1..2 f 101..105 c 101..104; ") !=
                std::string::npos);
    expect_step("changing.vtkhdf", 2, "1 cells x 7..8 z 2..3 f 207..208 c 207..207; ");
}

/* Checks steps that share one mesh: only the values change, and each field has offsets of its own. */
void steps_of_values_share_their_mesh(void **)
{
    {
        writer w("values.vtkhdf", "UnstructuredGrid");
        lists all, later;
        add_part(all, 0, 3, 0, 0);
        add_part(later, 0, 3, 0, 1);
        all.f.insert(all.f.end(), later.f.begin(), later.f.end());
        all.c.insert(all.c.end(), later.c.begin(), later.c.end());
        w.write_dataset(all);
        w.write_steps({0, 1});
        for (const char *name : {"PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"})
            w.write_dataset(std::string("Steps/") + name, numbers{0, 0});
        w.create_group("/VTKHDF/Steps/PointDataOffsets");
        w.create_group("/VTKHDF/Steps/CellDataOffsets");
        w.write_dataset("Steps/PointDataOffsets/f", numbers{0, 24});
        w.write_dataset("Steps/CellDataOffsets/c", numbers{3, 0});
    }
    expect_step("values.vtkhdf", 0, "3 cells x 0..3 z 0..1 f 0..3 c 100..102; ");
    expect_step("values.vtkhdf", 1, "3 cells x 0..3 z 0..1 f 100..103 c 0..2; ");
}

/* Checks points that move from step to step. Each step has a part of its own, but its cells are those of the first
 * step. */
void points_that_move_keep_their_cells(void **)
{
    {
        writer w("moving.vtkhdf", "UnstructuredGrid");
        lists all, later;
        add_part(all, 0, 3, 0, 0);
        add_part(later, 5, 3, 1, 1);
        add_part_with_earlier_cells(all, later);
        w.write_dataset(all);
        w.write_steps({0, 1});
        w.write_dataset("Steps/PartOffsets", numbers{0, 1});
        w.write_dataset("Steps/PointOffsets", numbers{0, 24});
        w.write_dataset("Steps/CellOffsets", numbers{0, 0});
        w.write_dataset("Steps/ConnectivityIdOffsets", numbers{0, 0});
    }
    expect_step("moving.vtkhdf", 1, "3 cells x 5..8 z 1..2 f 105..108 c 0..2; ");
}

/* Checks a step that reuses the cells of the second step. The first step has no cells, but has an entry in the list of
 * offsets. */
void cells_are_found_behind_a_step_without_cells(void **)
{
    {
        writer w("late.vtkhdf", "UnstructuredGrid");
        lists all, later;
        add_part(all, 0, 0, 0, 0);
        add_part(all, 0, 3, 0, 0);
        add_part(later, 5, 3, 1, 1);
        add_part_with_earlier_cells(all, later);
        w.write_dataset(all);
        w.write_steps({0, 1, 2});
        w.write_dataset("Steps/PartOffsets", numbers{0, 1, 2});
        w.write_dataset("Steps/PointOffsets", numbers{0, 0, 24});
        w.write_dataset("Steps/CellOffsets", numbers{0, 0, 0});
        w.write_dataset("Steps/ConnectivityIdOffsets", numbers{0, 0, 0});
    }
    expect_step("late.vtkhdf", 1, "3 cells x 0..3 z 0..1 f 0..3 c 0..2; ");
    expect_step("late.vtkhdf", 2, "3 cells x 5..8 z 1..2 f 105..108 c 0..2; ");
}

/* Checks a step with cells of its own after steps that reuse the cells of the first, whose parts are not in the lists
 * of cells and offsets, and a step without cells, which is in the list of offsets. */
void cells_are_found_behind_steps_that_reuse_cells(void **)
{
    {
        writer w("reused.vtkhdf", "UnstructuredGrid");
        lists all;
        add_part(all, 0, 1, 0, 0);
        for (int i = 0; i < 4; i++) {
            all.point_counts.push_back(8);
            all.cell_counts.push_back(1);
            all.id_counts.push_back(8);
        }
        add_part(all, 0, 0, 0, 0);
        add_part(all, 2, 3, 1, 1);
        add_part(all, 5, 2, 2, 2);
        w.write_dataset(all);
        w.write_steps({0, 1, 2, 3, 4, 5, 6, 7});
        w.write_dataset("Steps/PartOffsets", numbers{0, 1, 2, 3, 4, 5, 6, 7});
        w.write_dataset("Steps/PointOffsets", numbers{0, 0, 0, 0, 0, 8, 8, 32});
        w.write_dataset("Steps/CellOffsets", numbers{0, 0, 0, 0, 0, 1, 1, 4});
        w.write_dataset("Steps/ConnectivityIdOffsets", numbers{0, 0, 0, 0, 0, 8, 8, 32});
    }
    for (const size_t step : {0, 1, 4}) expect_step("reused.vtkhdf", step, "1 cells x 0..1 z 0..1 f 0..1 c 0..0; ");
    expect_step("reused.vtkhdf", 6, "3 cells x 2..5 z 1..2 f 102..105 c 102..104; ");
    expect_step("reused.vtkhdf", 7, "2 cells x 5..7 z 2..3 f 205..207 c 205..206; ");
}

void unsupported_types_are_refused_by_name(void **)
{
    for (const char *type :
         {"PolyData", "PartitionedDataSetCollection", "MultiBlockDataSet", "OverlappingAMR", "HyperTreeGrid"}) {
        {
            const writer w("other.vtkhdf", type);
        }
        expect_refusal("other.vtkhdf", std::string("Type ") + type);
    }
    {
        writer w("images.vtkhdf", "ImageData");
        w.write_steps({0, 1});
    }
    expect_refusal("images.vtkhdf", "images with steps");
    {
        writer w("short.vtkhdf", "UnstructuredGrid");
        lists all;
        add_part(all, 0, 2, 0, 0);
        all.points.resize(24);
        w.write_dataset(all);
    }
    expect_refusal("short.vtkhdf", "/VTKHDF/Points has 8 entries, expected 16 from 0 on");
    {
        writer w("unfit.vtkhdf", "UnstructuredGrid");
        lists all;
        add_part(all, 0, 2, 0, 0);
        all.offsets.back()--;
        w.write_dataset(all);
    }
    expect_refusal("unfit.vtkhdf", "Offsets of part 0 do not fit");
    write_file(folder + "/none.vtkhdf", "no HDF file");
    expect_refusal("none.vtkhdf", "is no HDF file");
}

int set_up_test_group(void **)
{
    folder = make_empty_folder("vtk_hdf");
    catch_vtk_messages();
    return 0;
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(parts_of_one_step_are_all_read),
        cmocka_unit_test(time_of_a_file_without_steps_is_in_its_field_data),
        cmocka_unit_test(steps_of_a_mesh_that_changes_are_read_one_by_one),
        cmocka_unit_test(steps_of_values_share_their_mesh),
        cmocka_unit_test(points_that_move_keep_their_cells),
        cmocka_unit_test(cells_are_found_behind_a_step_without_cells),
        cmocka_unit_test(cells_are_found_behind_steps_that_reuse_cells),
        cmocka_unit_test(unsupported_types_are_refused_by_name),
    };
    return cmocka_run_group_tests(tests, set_up_test_group, nullptr);
}
