/* AMR by the VTK adaptor: each place of the domain is drawn by one cell, the finest there. The oracle looks for a point
 * of each cell in the bounds of the finer grids, and compares the volume of the drawn cells with the domain's. */
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <vtkAMRBox.h>
#include <vtkAMRUtilities.h>
#include <vtkCellData.h>
#include <vtkDataSetAttributes.h>
#include <vtkDoubleArray.h>
#include <vtkNew.h>
#include <vtkNonOverlappingAMR.h>
#include <vtkOverlappingAMR.h>
#include <vtkStructuredData.h>
#include <vtkUniformGrid.h>
#include <vtkUnsignedCharArray.h>

// cmocka defines fail as a macro, so it comes after all C++ headers.
extern "C" {
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
}

#include "test_vtk_fixture.h"

namespace
{

/* A grid of an AMR: its level, its first cell in that level's counting, and how many cells it has. */
struct block {
    unsigned level;
    std::array<int, 3> low, cells;
    int ratio; // of level 0's cells to those of its level
};

const std::array<double, 3> origin = {-3, 1, 0.5}, spacing = {1, 0.5, 0.25}; // of level 0

/* Three levels of ratios 2 and 4; blocks that touch, one across two coarser ones, and one at negative places. */
const std::vector<block> blocks = {{0, {0, 0, 0}, {4, 6, 4}, 1},   {0, {4, 0, 0}, {3, 6, 4}, 1},
                                   {0, {-2, 0, 0}, {2, 6, 4}, 1},  {1, {4, 2, 2}, {6, 4, 4}, 2},
                                   {1, {-4, 4, 0}, {2, 6, 4}, 2},  {1, {-2, 4, 0}, {4, 2, 2}, 2},
                                   {2, {16, 12, 8}, {12, 8, 8}, 8}};
constexpr double domain = 9 * 6 * 4; // cells of level 0

vtkSmartPointer<vtkUniformGrid> grid_of(const block &b, bool is_flat = false)
{
    auto grid = vtkSmartPointer<vtkUniformGrid>::New();
    double at[3], h[3];
    for (size_t a = 0; a < 3; a++) h[a] = spacing[a] / b.ratio, at[a] = origin[a] + h[a] * b.low[a];
    if (is_flat) at[2] = origin[2];
    grid->SetOrigin(at);
    grid->SetSpacing(h);
    grid->SetDimensions(b.cells[0] + 1, b.cells[1] + 1, is_flat ? 1 : b.cells[2] + 1);
    vtkNew<vtkDoubleArray> values;
    values->SetName("f");
    values->SetNumberOfTuples(grid->GetNumberOfCells());
    values->Fill(b.level);
    grid->GetCellData()->AddArray(values);
    return grid;
}

enum class given { spacings, ratios };

enum class held { all, some }; // held by a rank; where some, the grids of level 1 and the first one are another rank's

vtkSmartPointer<vtkOverlappingAMR> make_amr(given what, bool is_flat = false, held grids = held::all)
{
    auto amr = vtkSmartPointer<vtkOverlappingAMR>::New();
    const int counts[3] = {3, 3, 1};
    amr->Initialize(3, counts);
    amr->SetOrigin(origin.data());
    amr->SetGridDescription(is_flat ? VTK_XY_PLANE : VTK_XYZ_GRID);
    const int ratios[3] = {2, 4, 4};
    unsigned number[3] = {0, 0, 0};
    for (const block &b : blocks) {
        const std::array<double, 3> h = {spacing[0] / b.ratio, spacing[1] / b.ratio, spacing[2] / b.ratio};
        if (what == given::spacings) amr->SetSpacing(b.level, h.data());
        if (what == given::ratios) amr->SetRefinementRatio(b.level, ratios[b.level]);
        std::array<int, 3> low = b.low, high{};
        for (size_t a = 0; a < 3; a++) high[a] = low[a] + b.cells[a] - 1;
        if (is_flat) low[2] = 0, high[2] = -1;
        amr->SetAMRBox(b.level, number[b.level], vtkAMRBox(low.data(), high.data()));
        const unsigned at = number[b.level]++;
        if (grids == held::all || (b.level != 1 && b.low[0] != 0)) amr->SetDataSet(b.level, at, grid_of(b, is_flat));
    }
    return amr;
}

/* Tells whether a finer block covers the middle of the cell of block b. */
bool is_covered(const block &b, const std::array<int, 3> &cell, bool is_flat)
{
    for (const block &finer : blocks) {
        if (finer.level != b.level + 1) continue;
        bool is_within = true;
        for (size_t a = 0; a < (is_flat ? 2 : 3); a++) {
            const double middle = (b.low[a] + cell[a] + 0.5) / b.ratio;
            is_within = is_within && middle > static_cast<double>(finer.low[a]) / finer.ratio &&
                        middle < static_cast<double>(finer.low[a] + finer.cells[a]) / finer.ratio;
        }
        if (is_within) return true;
    }
    return false;
}

/* Each mesh against its block; returns the volume that is drawn, in cells of level 0. */
double check(const fixture &f, bool is_flat = false)
{
    double drawn = 0;
    for (size_t n = 0; n < blocks.size(); n++) {
        const block &b = blocks[n];
        const auto found = f.session.meshes.find("m/" + std::to_string(n));
        if (found == f.session.meshes.end()) continue;
        const insitu_mesh &mesh = found->second.mesh;
        const auto *ghosts = static_cast<const uint8_t *>(mesh.ghosts.data);
        const int layers = is_flat ? 1 : b.cells[2];
        assert_int_equal(mesh.cell_count, b.cells[0] * b.cells[1] * layers);
        int64_t i = 0;
        for (int z = 0; z < layers; z++)
            for (int y = 0; y < b.cells[1]; y++)
                for (int x = 0; x < b.cells[0]; x++, i++) {
                    const bool is_hidden = ghosts && ghosts[i];
                    assert_int_equal(is_hidden, is_covered(b, {x, y, z}, is_flat));
                    drawn += is_hidden ? 0 : std::pow(b.ratio, is_flat ? -2 : -3);
                }
    }
    return drawn;
}

void refined_cells_are_ghosts_by_spacings_or_ratios(void **)
{
    for (const given what : {given::spacings, given::ratios}) {
        const auto amr = make_amr(what);
        fixture f;
        assert_int_equal(f.set(amr), INSITU_OK);
        assert_int_equal(f.report.meshes, blocks.size());
        assert_string_equal(f.report.warnings, "");
        assert_true(check(f) == domain); // sums of powers of two
        assert_non_null(strstr(f.report.copied_why, "refined, flagged"));
        for (unsigned i = 0; i < 3; i++) assert_null(amr->GetDataSet(0, i)->GetCellGhostArray()); // left as it is
    }
}

void refined_cells_are_the_same_where_vtk_has_flagged_them(void **)
{
    const auto amr = make_amr(given::spacings);
    amr->SetRefinementRatio(0, 2);
    amr->SetRefinementRatio(1, 4);
    amr->SetRefinementRatio(2, 4);
    amr->GenerateParentChildInformation();
    vtkAMRUtilities::BlankCells(amr);
    assert_non_null(amr->GetDataSet(0, 0)->GetCellGhostArray());
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_true(check(f) == domain);
}

void finer_grids_of_other_ranks_hide_cells_too(void **)
{
    const auto amr = make_amr(given::spacings, false, held::some);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.report.meshes, 3);
    assert_int_equal(f.session.meshes.count("m/1"), 1); // numbers are those of all ranks
    assert_int_equal(f.session.meshes.count("m/6"), 1);
    (void)check(f);
}

void hidden_cells_stay_hidden(void **)
{
    const auto amr = make_amr(given::spacings);
    const block &b = blocks[0];
    amr->GetDataSet(0, 0)->BlankCell(0);
    amr->GetDataSet(2, 0)->BlankPoint(0);
    assert_false(is_covered(b, {0, 0, 0}, false));
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    const auto *coarse = static_cast<const uint8_t *>(f.session.meshes.at("m/0").mesh.ghosts.data);
    const auto *fine = static_cast<const uint8_t *>(f.session.meshes.at("m/6").mesh.ghosts.data);
    assert_true(coarse[0] && !coarse[1]);
    assert_true(fine[0] && !fine[1]);
    int64_t hidden = 0, expected = 1;
    for (int i = 0; i < b.cells[0] * b.cells[1] * b.cells[2]; i++) {
        const int x = i % b.cells[0], y = i / b.cells[0] % b.cells[1], z = i / b.cells[0] / b.cells[1];
        hidden += coarse[i] != 0;
        expected += is_covered(b, {x, y, z}, false);
    }
    assert_int_equal(hidden, expected);
}

void flat_amr_is_quads(void **)
{
    const auto amr = make_amr(given::spacings, true);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.session.meshes.at("m/0").mesh.cell_type, INSITU_QUAD);
    assert_int_equal(f.report.cells_flat + f.report.cells_not_drawn, 0);
    assert_true(check(f, true) == 9 * 6);
}

void boxes_that_do_not_fit_are_reported(void **)
{
    const auto amr = make_amr(given::spacings);
    const int low[3] = {0, 0, 0}, high[3] = {1, 1, 1};
    amr->SetAMRBox(0, 0, vtkAMRBox(low, high));
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_non_null(strstr(f.report.warnings, "mesh 'm/0': the AMR's boxes"));
    assert_null(strstr(f.report.warnings, "mesh 'm/1'"));
    assert_null(f.session.meshes.at("m/0").mesh.ghosts.data);
}

void levels_that_do_not_overlap_are_drawn_whole(void **)
{
    vtkNew<vtkNonOverlappingAMR> amr;
    const int counts[2] = {1, 1};
    amr->Initialize(2, counts);
    amr->SetDataSet(0, 0, grid_of(blocks[0]));
    amr->SetDataSet(1, 0, grid_of(blocks[3]));
    amr->GetDataSet(1, 0)->BlankCell(5);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.report.meshes, 2);
    assert_null(f.session.meshes.at("m/0").mesh.ghosts.data);
    assert_true(static_cast<const uint8_t *>(f.session.meshes.at("m/1").mesh.ghosts.data)[5] != 0);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(refined_cells_are_ghosts_by_spacings_or_ratios),
        cmocka_unit_test(refined_cells_are_the_same_where_vtk_has_flagged_them),
        cmocka_unit_test(finer_grids_of_other_ranks_hide_cells_too),
        cmocka_unit_test(hidden_cells_stay_hidden),
        cmocka_unit_test(flat_amr_is_quads),
        cmocka_unit_test(boxes_that_do_not_fit_are_reported),
        cmocka_unit_test(levels_that_do_not_overlap_are_drawn_whole),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
