/* Checks AMR data in the VTK adaptor: grids become blocks of the levels of one mesh, at the positions of their AMR
 * boxes. That the session draws the finest cell at each position is checked by session_levels and vtk_structured. */
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

// cmocka.h is included after all C++ headers, as it defines fail as a macro.
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

/* A grid of an AMR data set: its level, the indices of its first cell in that level, and its number of cells. */
struct block {
    unsigned level;
    std::array<int, 3> low, cells;
    int ratio; // number of this level's cells per cell of level 0, along an axis
};

const std::array<double, 3> origin = {-3, 1, 0.5}, spacing = {1, 0.5, 0.25}; // origin and spacing of level 0

/* Three levels with refinement ratios of 2 and 4. Some blocks are adjacent, one overlaps two coarser ones, and some
 * have negative indices. */
const std::vector<block> blocks = {{0, {0, 0, 0}, {4, 6, 4}, 1},   {0, {4, 0, 0}, {3, 6, 4}, 1},
                                   {0, {-2, 0, 0}, {2, 6, 4}, 1},  {1, {4, 2, 2}, {6, 4, 4}, 2},
                                   {1, {-4, 4, 0}, {2, 6, 4}, 2},  {1, {-2, 4, 0}, {4, 2, 2}, 2},
                                   {2, {16, 12, 8}, {12, 8, 8}, 8}};
vtkSmartPointer<vtkUniformGrid> make_uniform_grid(const block &b, bool is_flat = false)
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

enum class held { all, some }; // grids that a rank has; some: all except the first grid and those of level 1

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
        if (grids == held::all || (b.level != 1 && b.low[0] != 0))
            amr->SetDataSet(b.level, at, make_uniform_grid(b, is_flat));
    }
    return amr;
}

/* Returns whether a block of the next finer level covers the centre of a cell of block b. */
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

std::string make_block_name(size_t n)
{
    return "m[" + std::to_string(n) + "]";
}

/* Compares the lattice of each block with the block's position in its level. */
void check_block_lattices(const fixture &f, bool is_flat = false)
{
    for (size_t n = 0; n < blocks.size(); n++) {
        const block &b = blocks[n];
        const auto found = f.session.meshes.find(make_block_name(n));
        if (found == f.session.meshes.end()) continue;
        const insitu_mesh &mesh = found->second.mesh;
        const insitu_lattice &l = *mesh.lattice;
        assert_int_equal(mesh.cell_count, b.cells[0] * b.cells[1] * (is_flat ? 1 : b.cells[2]));
        for (size_t a = 0; a < 3; a++) {
            if (is_flat && a == 2) {
                assert_int_equal(l.cells[a], 0);
                continue;
            }
            assert_int_equal(l.cells[a], b.cells[a]);
            assert_int_equal(l.first[a], b.low[a]);
            assert_int_equal(l.refinement[a], b.ratio);
            assert_true(l.origin[a] == origin[a] && l.spacing[a] == spacing[a] / b.ratio);
        }
    }
}

void grids_are_blocks_of_levels_by_spacings_or_ratios(void **)
{
    for (const given what : {given::spacings, given::ratios}) {
        const auto amr = make_amr(what);
        fixture f;
        assert_int_equal(f.set(amr), INSITU_OK);
        assert_int_equal(f.report.meshes, blocks.size());
        assert_int_equal(f.session.meshes.size(), blocks.size());
        assert_string_equal(f.report.warnings, "");
        check_block_lattices(f);
        for (const auto &[name, mesh] : f.session.meshes) assert_null(mesh.mesh.ghosts.data);
        assert_int_equal(f.report.bytes_copied, 0);
        for (unsigned i = 0; i < 3; i++) assert_null(amr->GetDataSet(0, i)->GetCellGhostArray()); // input is unchanged
    }
}

void refined_cells_that_vtk_has_flagged_are_ghosts_too(void **)
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
    check_block_lattices(f);
    const block &b = blocks[0];
    const auto *ghosts = static_cast<const uint8_t *>(f.session.meshes.at(make_block_name(0)).mesh.ghosts.data);
    for (int i = 0; i < b.cells[0] * b.cells[1] * b.cells[2]; i++) {
        const int x = i % b.cells[0], y = i / b.cells[0] % b.cells[1], z = i / b.cells[0] / b.cells[1];
        assert_int_equal(ghosts[i] != 0, is_covered(b, {x, y, z}, false));
    }
}

void grids_keep_their_numbers_on_ranks_without_others(void **)
{
    const auto amr = make_amr(given::spacings, false, held::some);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.report.meshes, 3);
    assert_int_equal(f.session.meshes.count(make_block_name(1)), 1);
    assert_int_equal(f.session.meshes.count(make_block_name(6)), 1);
    check_block_lattices(f);
}

void hidden_cells_stay_hidden(void **)
{
    const auto amr = make_amr(given::spacings);
    const block &b = blocks[0];
    amr->GetDataSet(0, 0)->BlankCell(0);
    amr->GetDataSet(2, 0)->BlankPoint(0);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    const auto *coarse = static_cast<const uint8_t *>(f.session.meshes.at(make_block_name(0)).mesh.ghosts.data);
    const auto *fine = static_cast<const uint8_t *>(f.session.meshes.at(make_block_name(6)).mesh.ghosts.data);
    assert_true(coarse[0] && !coarse[1]);
    assert_true(fine[0] && !fine[1]);
    int64_t hidden = 0;
    for (int i = 0; i < b.cells[0] * b.cells[1] * b.cells[2]; i++) hidden += coarse[i] != 0;
    assert_int_equal(hidden, 1);
}

void flat_amr_submits_quads(void **)
{
    const auto amr = make_amr(given::spacings, true);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.session.meshes.at(make_block_name(0)).mesh.cell_type, INSITU_QUAD);
    assert_int_equal(f.report.cells_flat + f.report.cells_not_drawn, 0);
    assert_string_equal(f.report.warnings, "");
    check_block_lattices(f, true);
}

bool is_on_level(const fixture &f, size_t n)
{
    return f.session.meshes.at(make_block_name(n)).mesh.lattice->refinement[0] != 0;
}

void boxes_that_do_not_fit_are_reported(void **)
{
    const auto amr = make_amr(given::spacings);
    const int low[3] = {0, 0, 0}, high[3] = {1, 1, 1};
    amr->SetAMRBox(0, 0, vtkAMRBox(low, high));
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_non_null(strstr(f.report.warnings, "mesh 'm[0]': the AMR's boxes"));
    assert_null(strstr(f.report.warnings, "mesh 'm[1]'"));
    assert_true(!is_on_level(f, 0) && is_on_level(f, 1));
}

/* Checks a box of level 1 that begins inside a cell of level 0, and a grid whose position differs from its box. */
void boxes_within_cells_make_no_levels(void **)
{
    auto amr = make_amr(given::spacings);
    const int low[3] = {5, 2, 2}, high[3] = {10, 5, 5};
    amr->SetAMRBox(1, 0, vtkAMRBox(low, high));
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    for (size_t n = 0; n < blocks.size(); n++) {
        assert_false(is_on_level(f, n));
        assert_non_null(strstr(f.report.warnings, ("mesh '" + make_block_name(n) + "': the AMR's boxes").c_str()));
    }
    amr = make_amr(given::spacings);
    amr->GetDataSet(1, 1)->SetOrigin(0, 0, 0);
    assert_int_equal(f.set(amr), INSITU_OK);
    for (size_t n = 0; n < blocks.size(); n++) assert_int_equal(is_on_level(f, n), n != 4);
}

void levels_that_do_not_overlap_are_drawn_whole(void **)
{
    vtkNew<vtkNonOverlappingAMR> amr;
    const int counts[2] = {1, 1};
    amr->Initialize(2, counts);
    amr->SetDataSet(0, 0, make_uniform_grid(blocks[0]));
    amr->SetDataSet(1, 0, make_uniform_grid(blocks[3]));
    amr->GetDataSet(1, 0)->BlankCell(5);
    fixture f;
    assert_int_equal(f.set(amr), INSITU_OK);
    assert_int_equal(f.report.meshes, 2);
    assert_null(f.session.meshes.at("m/blocks of f (cells)[0]").mesh.ghosts.data);
    assert_int_equal(f.session.meshes.at("m/blocks of f (cells)[1]").mesh.lattice->refinement[0], 0);
    assert_true(static_cast<const uint8_t *>(f.session.meshes.at("m/blocks of f (cells)[1]").mesh.ghosts.data)[5] != 0);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {
        cmocka_unit_test(grids_are_blocks_of_levels_by_spacings_or_ratios),
        cmocka_unit_test(refined_cells_that_vtk_has_flagged_are_ghosts_too),
        cmocka_unit_test(grids_keep_their_numbers_on_ranks_without_others),
        cmocka_unit_test(hidden_cells_stay_hidden),
        cmocka_unit_test(flat_amr_submits_quads),
        cmocka_unit_test(boxes_that_do_not_fit_are_reported),
        cmocka_unit_test(boxes_within_cells_make_no_levels),
        cmocka_unit_test(levels_that_do_not_overlap_are_drawn_whole),
    };
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
