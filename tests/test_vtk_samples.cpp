/* See the header. */
#include "test_vtk_samples.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <vtkCellData.h>
#include <vtkDoubleArray.h>
#include <vtkEnSightWriter.h>
#include <vtkFloatArray.h>
#include <vtkIdList.h>
#include <vtkImageData.h>
#include <vtkIntArray.h>
#include <vtkMultiBlockDataSet.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkRectilinearGrid.h>
#include <vtkRectilinearGridWriter.h>
#include <vtkStructuredGrid.h>
#include <vtkStructuredGridWriter.h>
#include <vtkStructuredPointsWriter.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLImageDataWriter.h>
#include <vtkXMLMultiBlockDataWriter.h>
#include <vtkXMLRectilinearGridWriter.h>
#include <vtkXMLStructuredGridWriter.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include "test_vtk_run.h"

namespace
{

constexpr int size[3] = {6, 5, 4};
constexpr int point_count = 6 * 5 * 4, cell_count = 5 * 4 * 3;

struct place {
    double x, y, z;
};

/* All are sixteenths, so that neither an image's way to add up its steps nor six decimal digits round them. */
place place_of(lattice kind, int i, int j, int k)
{
    switch (kind) {
    case lattice::image: return {i * 0.25 - 1, j * 0.5 + 0.5, k * 0.25 + 2};
    case lattice::rectilinear: return {i * 0.25 + i * i / 16.0, j * 0.375, k * 0.5 + k * k * k / 16.0};
    default: return {i * 0.3125 + j % 2 * 0.0625, j * 0.25 + k * 0.0625, k * 0.375 - i * 0.0625};
    }
}

void add_fields(vtkDataSet *data)
{
    vtkNew<vtkFloatArray> x, c;
    x->SetName("x");
    c->SetName("c");
    for (vtkIdType i = 0; i < data->GetNumberOfPoints(); i++)
        x->InsertNextValue(static_cast<float>(std::round(16 * std::sin(0.7 * static_cast<double>(i))) / 16));
    for (vtkIdType i = 0; i < data->GetNumberOfCells(); i++) c->InsertNextValue(static_cast<float>(i));
    data->GetPointData()->AddArray(x);
    data->GetCellData()->AddArray(c);
}

vtkSmartPointer<vtkPoints> list_points(lattice kind)
{
    auto points = vtkSmartPointer<vtkPoints>::New();
    points->SetDataType(kind == lattice::curved ? VTK_FLOAT : VTK_DOUBLE);
    for (int n = 0; n < point_count; n++) {
        const place p = place_of(kind, n % size[0], n / size[0] % size[1], n / (size[0] * size[1]));
        points->InsertNextPoint(p.x, p.y, p.z);
    }
    return points;
}

vtkSmartPointer<vtkDoubleArray> axis(int a)
{
    auto values = vtkSmartPointer<vtkDoubleArray>::New();
    for (int n = 0; n < size[a]; n++) {
        const place p = place_of(lattice::rectilinear, a == 0 ? n : 0, a == 1 ? n : 0, a == 2 ? n : 0);
        values->InsertNextValue(a == 0 ? p.x : a == 1 ? p.y : p.z);
    }
    return values;
}

template <typename Writer> void write(const std::string &path, vtkDataObject *data)
{
    vtkNew<Writer> writer;
    writer->SetFileName(path.c_str());
    writer->SetInputDataObject(data);
    writer->Write();
}

template <typename Writer> void write_legacy(const std::string &path, vtkDataObject *data, bool is_text)
{
    vtkNew<Writer> writer;
    writer->SetFileName(path.c_str());
    writer->SetInputDataObject(data);
    writer->SetFileType(is_text ? VTK_ASCII : VTK_BINARY);
    writer->Write();
}

void write_xml(const std::string &path, vtkUnstructuredGrid *grid, int mode, bool is_raw)
{
    vtkNew<vtkXMLUnstructuredGridWriter> writer;
    writer->SetFileName(path.c_str());
    writer->SetInputData(grid);
    writer->SetDataMode(mode);
    writer->SetEncodeAppendedData(!is_raw);
    writer->Write();
}

} // namespace

vtkSmartPointer<vtkDataSet> structured(lattice kind)
{
    vtkSmartPointer<vtkDataSet> data;
    if (kind == lattice::image) {
        auto image = vtkSmartPointer<vtkImageData>::New();
        image->SetDimensions(size);
        image->SetOrigin(-1, 0.5, 2);
        image->SetSpacing(0.25, 0.5, 0.25);
        data = image;
    } else if (kind == lattice::rectilinear) {
        auto grid = vtkSmartPointer<vtkRectilinearGrid>::New();
        grid->SetDimensions(size);
        grid->SetXCoordinates(axis(0));
        grid->SetYCoordinates(axis(1));
        grid->SetZCoordinates(axis(2));
        data = grid;
    } else {
        auto grid = vtkSmartPointer<vtkStructuredGrid>::New();
        grid->SetDimensions(size);
        grid->SetPoints(list_points(kind));
        data = grid;
    }
    add_fields(data);
    return data;
}

vtkSmartPointer<vtkUnstructuredGrid> hexes(lattice kind)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    grid->SetPoints(list_points(kind));
    auto number = [](int i, int j, int k) -> vtkIdType { return i + size[0] * (j + size[1] * k); };
    for (int n = 0; n < cell_count; n++) {
        const int i = n % 5, j = n / 5 % 4, k = n / 20;
        const vtkIdType corners[8] = {
            number(i, j, k),     number(i + 1, j, k),     number(i + 1, j + 1, k),     number(i, j + 1, k),
            number(i, j, k + 1), number(i + 1, j, k + 1), number(i + 1, j + 1, k + 1), number(i, j + 1, k + 1)};
        grid->InsertNextCell(VTK_HEXAHEDRON, 8, corners);
    }
    add_fields(grid);
    return grid;
}

vtkSmartPointer<vtkUnstructuredGrid> cubes(int count, int first, bool is_mixed)
{
    auto grid = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    const double corner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    for (int i = 0; i <= count; i++)
        for (const auto &yz : corner) points->InsertNextPoint(first + i, yz[0], yz[1]);
    grid->SetPoints(points);
    for (int i = 0; i < count; i++) {
        const vtkIdType o = 4 * i;
        const vtkIdType corners[8] = {o, o + 1, o + 2, o + 3, o + 4, o + 5, o + 6, o + 7};
        if (!is_mixed || (first + i) % 2 == 0) {
            grid->InsertNextCell(VTK_HEXAHEDRON, 8, corners);
            continue;
        }
        vtkNew<vtkIdList> faces;
        const int sides[6][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
        faces->InsertNextId(6);
        for (const auto &side : sides) {
            faces->InsertNextId(4);
            for (const int corner : side) faces->InsertNextId(corners[corner]);
        }
        grid->InsertNextCell(VTK_POLYHEDRON, faces);
    }
    add_fields(grid);
    return grid;
}

void write_vtu(const std::string &path, vtkUnstructuredGrid *grid)
{
    write<vtkXMLUnstructuredGridWriter>(path, grid);
}

namespace
{

void write_text_pieces(const std::string &path, const std::string &list, const std::string &attributes,
                       const std::string &points, const std::string &pieces)
{
    write_file(path, "<VTKFile type=\"" + list + "\" version=\"0.1\"><" + list + " GhostLevel=\"0\" " + attributes +
                         "><PPointData><PDataArray type=\"Float32\" Name=\"x\"/></PPointData>"
                         "<PCellData><PDataArray type=\"Float32\" Name=\"c\"/></PCellData>" +
                         points + pieces + "</" + list + "></VTKFile>\n");
}

/* One piece each; the readers of several pieces are VTK's. */
void write_parallel_lattices(const std::string &folder)
{
    const std::string whole = "WholeExtent=\"0 5 0 4 0 3\"", piece = "<Piece Extent=\"0 5 0 4 0 3\" Source=\"g.",
                      axis_type = "<PDataArray type=\"Float64\"/>";
    write_text_pieces(folder + "/g.pvti", "PImageData", whole + " Origin=\"-1 0.5 2\" Spacing=\"0.25 0.5 0.25\"", "",
                      piece + "vti\"/>");
    write_text_pieces(folder + "/g.pvtr", "PRectilinearGrid", whole,
                      "<PCoordinates>" + axis_type + axis_type + axis_type + "</PCoordinates>", piece + "vtr\"/>");
    write_text_pieces(folder + "/g.pvts", "PStructuredGrid", whole,
                      "<PPoints><PDataArray type=\"Float32\" NumberOfComponents=\"3\"/></PPoints>", piece + "vts\"/>");
}

/* In C binary. VTK's writer wants numbers of blocks; it writes a .case too, but closes that only when the program ends.
 */
void write_ensight(const std::string &folder, vtkUnstructuredGrid *grid)
{
    vtkNew<vtkUnstructuredGrid> numbered;
    numbered->ShallowCopy(grid);
    vtkNew<vtkIntArray> block;
    block->SetName("BlockId");
    block->SetNumberOfValues(grid->GetNumberOfCells());
    block->FillValue(1);
    numbered->GetCellData()->AddArray(block);
    vtkNew<vtkEnSightWriter> writer;
    writer->SetFileName((folder + "/e").c_str());
    writer->SetInputData(numbered);
    writer->Write();
    write_file(folder + "/e.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: e.0.00000.geo\nVARIABLE\n"
                                   "scalar per node: x e.0.00000_n.x\nscalar per element: c e.0.00000_c.c\n");
}

std::vector<std::string> files_like(const std::string &folder, const std::string &start)
{
    std::vector<std::string> names;
    for (const auto &entry : std::filesystem::directory_iterator(folder)) {
        const std::string name = entry.path().filename().string();
        if (name.compare(0, start.size(), start) == 0) names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
}

void write_lattices(const std::string &folder)
{
    const auto image = structured(lattice::image), axes = structured(lattice::rectilinear),
               curved = structured(lattice::curved);
    write<vtkXMLImageDataWriter>(folder + "/g.vti", image);
    write<vtkXMLRectilinearGridWriter>(folder + "/g.vtr", axes);
    write<vtkXMLStructuredGridWriter>(folder + "/g.vts", curved);
    write_parallel_lattices(folder);
    for (const bool is_text : {false, true}) {
        const std::string start = folder + (is_text ? "/text_" : "/binary_");
        write_legacy<vtkStructuredPointsWriter>(start + "image.vtk", image, is_text);
        write_legacy<vtkRectilinearGridWriter>(start + "axes.vtk", axes, is_text);
        write_legacy<vtkStructuredGridWriter>(start + "curved.vtk", curved, is_text);
    }
}

void write_unstructured(const std::string &folder, vtkUnstructuredGrid *grid)
{
    write_xml(folder + "/raw.vtu", grid, vtkXMLWriter::Appended, true);
    write_xml(folder + "/encoded.vtu", grid, vtkXMLWriter::Appended, false);
    write_xml(folder + "/binary.vtu", grid, vtkXMLWriter::Binary, false);
    write_xml(folder + "/text.vtu", grid, vtkXMLWriter::Ascii, false);
    write_legacy<vtkUnstructuredGridWriter>(folder + "/binary_hexes.vtk", grid, false);
    write_legacy<vtkUnstructuredGridWriter>(folder + "/text_hexes.vtk", grid, true);
    write_text_pieces(folder + "/g.pvtu", "PUnstructuredGrid", "",
                      "<PPoints><PDataArray type=\"Float32\" NumberOfComponents=\"3\"/></PPoints>",
                      "<Piece Source=\"raw.vtu\"/>");
    write_file(folder + "/g.pvd", "<VTKFile type=\"Collection\" version=\"0.1\"><Collection><DataSet timestep=\"0.5\" "
                                  "part=\"0\" file=\"raw.vtu\"/></Collection></VTKFile>\n");
    write_file(folder + "/g.vtu.series",
               "{\"file-series-version\": \"1.0\", \"files\": [{\"name\": \"raw.vtu\", \"time\": 0.5}]}\n");
    vtkNew<vtkMultiBlockDataSet> blocks;
    blocks->SetBlock(0, grid);
    write<vtkXMLMultiBlockDataWriter>(folder + "/m.vtm", blocks);
    write_ensight(folder, grid);
}

} // namespace

std::vector<sample> write_samples(const std::string &folder)
{
    const auto image = hexes(lattice::image), axes = hexes(lattice::rectilinear), curved = hexes(lattice::curved);
    write_lattices(folder);
    write_unstructured(folder, curved);
    std::vector<sample> all = {{"g.vti", {"g.vti"}, image},
                               {"g.vtr", {"g.vtr"}, axes},
                               {"g.vts", {"g.vts"}, curved},
                               {"g.pvti", {"g.pvti", "g.vti"}, image},
                               {"g.pvtr", {"g.pvtr", "g.vtr"}, axes},
                               {"g.pvts", {"g.pvts", "g.vts"}, curved},
                               {"g.pvtu", {"g.pvtu", "raw.vtu"}, curved},
                               {"g.pvd", {"g.pvd", "raw.vtu"}, curved},
                               {"g.vtu.series", {"g.vtu.series"}, curved},
                               {"m.vtm", {"m.vtm", "m/m_0.vtu"}, curved},
                               {"e.case", files_like(folder, "e."), curved}};
    for (const std::string start : {"binary_", "text_"}) {
        all.push_back({start + "image.vtk", {start + "image.vtk"}, image});
        all.push_back({start + "axes.vtk", {start + "axes.vtk"}, axes});
        all.push_back({start + "curved.vtk", {start + "curved.vtk"}, curved});
        all.push_back({start + "hexes.vtk", {start + "hexes.vtk"}, curved});
    }
    for (const std::string name : {"raw.vtu", "encoded.vtu", "binary.vtu", "text.vtu"})
        all.push_back({name, {name}, curved});
    return all;
}
