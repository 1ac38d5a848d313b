#include "test_vtk_samples.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

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

#include <vtk_cgns.h>
// clang-format off
#include VTK_CGNS(cgnslib.h)
// clang-format on

#include "test_vtk_run.h"

namespace
{

constexpr int size[3] = {6, 5, 4};
constexpr int point_count = 6 * 5 * 4, cell_count = 5 * 4 * 3;

struct place {
    double x, y, z;
};

/* Returns the position of a point. All coordinates are multiples of 1/16, so that neither the sum of an image's steps
 * nor six decimal digits round them. */
place compute_point_position(lattice kind, int i, int j, int k)
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
        const place p = compute_point_position(kind, n % size[0], n / size[0] % size[1], n / (size[0] * size[1]));
        points->InsertNextPoint(p.x, p.y, p.z);
    }
    return points;
}

vtkSmartPointer<vtkDoubleArray> make_axis_coordinates(int a)
{
    auto values = vtkSmartPointer<vtkDoubleArray>::New();
    for (int n = 0; n < size[a]; n++) {
        const place p = compute_point_position(lattice::rectilinear, a == 0 ? n : 0, a == 1 ? n : 0, a == 2 ? n : 0);
        values->InsertNextValue(a == 0 ? p.x : a == 1 ? p.y : p.z);
    }
    return values;
}

template <typename Writer> void write_data_object(const std::string &path, vtkDataObject *data)
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

vtkSmartPointer<vtkDataSet> make_structured_grid(lattice kind)
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
        grid->SetXCoordinates(make_axis_coordinates(0));
        grid->SetYCoordinates(make_axis_coordinates(1));
        grid->SetZCoordinates(make_axis_coordinates(2));
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

vtkSmartPointer<vtkUnstructuredGrid> make_hex_grid(lattice kind)
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

vtkSmartPointer<vtkUnstructuredGrid> make_cubes(int count, int first, bool is_mixed)
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
    write_data_object<vtkXMLUnstructuredGridWriter>(path, grid);
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

/* Writes parallel files of one piece each, because VTK itself reads files of several pieces. */
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

/* Writes C binary files. VTK's writer requires an array of block numbers. VTK also writes a .case file, but closes it
 * only when the program ends. */
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

std::vector<std::string> list_files_with_prefix(const std::string &folder, const std::string &start)
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
    const auto image = make_structured_grid(lattice::image), axes = make_structured_grid(lattice::rectilinear),
               curved = make_structured_grid(lattice::curved);
    write_data_object<vtkXMLImageDataWriter>(folder + "/g.vti", image);
    write_data_object<vtkXMLRectilinearGridWriter>(folder + "/g.vtr", axes);
    write_data_object<vtkXMLStructuredGridWriter>(folder + "/g.vts", curved);
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
    write_data_object<vtkXMLMultiBlockDataWriter>(folder + "/m.vtm", blocks);
    write_ensight(folder, grid);
}

vtkSmartPointer<vtkUnstructuredGrid> join_grids(vtkUnstructuredGrid *first, vtkUnstructuredGrid *second)
{
    auto all = vtkSmartPointer<vtkUnstructuredGrid>::New();
    vtkNew<vtkPoints> points;
    vtkNew<vtkFloatArray> x, c;
    x->SetName("x");
    c->SetName("c");
    all->SetPoints(points);
    for (vtkUnstructuredGrid *grid : {first, second}) {
        const vtkIdType base = points->GetNumberOfPoints();
        for (vtkIdType i = 0; i < grid->GetNumberOfPoints(); i++) {
            points->InsertNextPoint(grid->GetPoint(i));
            x->InsertNextTuple(i, grid->GetPointData()->GetArray("x"));
        }
        for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
            c->InsertNextTuple(i, grid->GetCellData()->GetArray("c"));
            vtkNew<vtkIdList> list;
            if (grid->GetCellType(i) != VTK_POLYHEDRON) {
                grid->GetCellPoints(i, list);
                for (vtkIdType &point : *list) point += base;
            } else {
                grid->GetFaceStream(i, list);
                vtkIdType at = 1;
                while (at < list->GetNumberOfIds())
                    for (vtkIdType left = list->GetId(at++); left > 0; left--, at++)
                        list->SetId(at, list->GetId(at) + base);
            }
            all->InsertNextCell(grid->GetCellType(i), list);
        }
    }
    all->GetPointData()->AddArray(x);
    all->GetCellData()->AddArray(c);
    return all;
}

/* Writes two pieces: the first has no polyhedra, the second has hexahedra and polyhedra. */
vtkSmartPointer<vtkUnstructuredGrid> write_polyhedra(const std::string &folder)
{
    write_xml(folder + "/p0.vtu", make_cubes(2, 0, false), vtkXMLWriter::Appended, true);
    write_xml(folder + "/p1.vtu", make_cubes(5, 2, true), vtkXMLWriter::Appended, true);
    write_text_pieces(folder + "/p.pvtu", "PUnstructuredGrid", "",
                      "<PPoints><PDataArray type=\"Float32\" NumberOfComponents=\"3\"/></PPoints>",
                      "<Piece Source=\"p0.vtu\"/><Piece Source=\"p1.vtu\"/>");
    return join_grids(make_cubes(2, 0, false), make_cubes(5, 2, true));
}

std::string format_values(vtkDataArray *values, int component)
{
    std::ostringstream text;
    for (vtkIdType i = 0; i < values->GetNumberOfTuples(); i++) text << values->GetComponent(i, component) << '\n';
    return text.str();
}

/* Writes text files in which each number of a point or cell has a line of its own. */
void write_ensight_text(const std::string &folder, vtkUnstructuredGrid *grid)
{
    std::ostringstream cells;
    for (vtkIdType i = 0; i < grid->GetNumberOfCells(); i++) {
        vtkIdType count = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(i, count, points);
        for (vtkIdType k = 0; k < count; k++) cells << ' ' << points[k] + 1;
        cells << '\n';
    }
    vtkDataArray *points = grid->GetPoints()->GetData();
    const std::string part = "part\n         1\n",
                      coordinates = format_values(points, 0) + format_values(points, 1) + format_values(points, 2);
    write_file(folder + "/t.geo", "Hexahedra\nof a lattice\nnode id assign\nelement id assign\n" + part +
                                      "all of them\ncoordinates\n" + std::to_string(point_count) + "\n" + coordinates +
                                      "hexa8\n" + std::to_string(cell_count) + "\n" + cells.str());
    write_file(folder + "/t.x", "x\n" + part + "coordinates\n" + format_values(grid->GetPointData()->GetArray("x"), 0));
    write_file(folder + "/t.c", "c\n" + part + "hexa8\n" + format_values(grid->GetCellData()->GetArray("c"), 0));
    write_file(folder + "/t.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: t.geo\nVARIABLE\n"
                                   "scalar per node: x t.x\nscalar per element: c t.c\n");
}

void write_cgns_coordinates(int file, int base, int zone, vtkUnstructuredGrid *grid)
{
    int number = 0;
    for (int axis = 0; axis < 3; axis++) {
        std::vector<float> values;
        for (vtkIdType i = 0; i < grid->GetNumberOfPoints(); i++)
            values.push_back(static_cast<float>(grid->GetPoint(i)[axis]));
        const std::string name = std::string("Coordinate") + "XYZ"[axis];
        cg_coord_write(file, base, zone, CGNS_ENUMV(RealSingle), name.c_str(), values.data(), &number);
    }
}

void write_cgns_fields(int file, int base, int zone, vtkUnstructuredGrid *grid)
{
    int solution = 0, number = 0;
    cg_sol_write(file, base, zone, "AtVertices", CGNS_ENUMV(Vertex), &solution);
    cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealSingle), "x",
                   grid->GetPointData()->GetArray("x")->GetVoidPointer(0), &number);
    cg_sol_write(file, base, zone, "InCells", CGNS_ENUMV(CellCenter), &solution);
    cg_field_write(file, base, zone, solution, CGNS_ENUMV(RealSingle), "c",
                   grid->GetCellData()->GetArray("c")->GetVoidPointer(0), &number);
}

/* Writes the grid as a structured zone. */
void write_cgns(const std::string &path, vtkUnstructuredGrid *grid)
{
    int file = 0, base = 0, zone = 0;
    const cgsize_t sizes[9] = {size[0], size[1], size[2], size[0] - 1, size[1] - 1, size[2] - 1, 0, 0, 0};
    cg_open(path.c_str(), CG_MODE_WRITE, &file);
    cg_base_write(file, "Base", 3, 3, &base);
    cg_zone_write(file, base, "Zone", sizes, CGNS_ENUMV(Structured), &zone);
    write_cgns_coordinates(file, base, zone, grid);
    write_cgns_fields(file, base, zone, grid);
    cg_close(file);
}

/* Writes sections of a CGNS zone, which contain the grid's hexes and the quads at its bottom. */
struct section_writer {
    int file, base, zone;
    vtkUnstructuredGrid *grid;
    cgsize_t quads = (size[0] - 1) * (size[1] - 1);

    /* Adds the vertices of a hex, counted from 1. Then repeats the hex's first vertex until there are `count` nodes. */
    void add_hex(vtkIdType cell, int count, std::vector<cgsize_t> &nodes) const
    {
        vtkIdType corners = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(cell, corners, points);
        for (int k = 0; k < count; k++) nodes.push_back(points[k < corners ? k : 0] + 1);
    }
    void add_quad(vtkIdType cell, std::vector<cgsize_t> &nodes) const
    {
        vtkIdType corners = 0;
        const vtkIdType *points = nullptr;
        grid->GetCellPoints(cell, corners, points);
        for (int k = 3; k >= 0; k--) nodes.push_back(points[k] + 1);
    }

    /* write_hex_section() and write_wall_section() return the number that follows the one of their last element. */
    cgsize_t write_hex_section(const char *name, cgsize_t number, cgsize_t begin, cgsize_t end,
                               int nodes_each = 8) const
    {
        std::vector<cgsize_t> nodes;
        for (cgsize_t i = begin; i < end; i++) add_hex(i, nodes_each, nodes);
        int section = 0;
        cg_section_write(file, base, zone, name, nodes_each == 8 ? CGNS_ENUMV(HEXA_8) : CGNS_ENUMV(HEXA_27), number,
                         number + end - begin - 1, 0, nodes.data(), &section);
        return number + end - begin;
    }
    cgsize_t write_wall_section(cgsize_t number, int times = 1) const
    {
        std::vector<cgsize_t> nodes;
        for (cgsize_t i = 0; i < times * quads; i++) add_quad(i % quads, nodes);
        int section = 0;
        cg_section_write(file, base, zone, "Wall", CGNS_ENUMV(QUAD_4), number, number + times * quads - 1, 0,
                         nodes.data(), &section);
        return number + times * quads;
    }
    void write_mixed_section() const
    {
        std::vector<cgsize_t> nodes, starts = {0};
        for (cgsize_t i = 0; i < cell_count; i++) {
            if (i < quads) {
                nodes.push_back(CGNS_ENUMV(QUAD_4));
                add_quad(i, nodes);
                starts.push_back(static_cast<cgsize_t>(nodes.size()));
            }
            nodes.push_back(CGNS_ENUMV(HEXA_8));
            add_hex(i, 8, nodes);
            starts.push_back(static_cast<cgsize_t>(nodes.size()));
        }
        int section = 0;
        cg_poly_section_write(file, base, zone, "All", CGNS_ENUMV(MIXED), 1, cell_count + quads, 0, nodes.data(),
                              starts.data(), &section);
    }

    void write_section(cgns_order order) const
    {
        const cgsize_t hexes = cell_count;
        switch (order) {
        case cgns_order::cells_first: write_wall_section(write_hex_section("Fluid", 1, 0, hexes)); break;
        case cgns_order::wall_first: write_hex_section("Fluid", write_wall_section(1), 0, hexes); break;
        case cgns_order::wall_stored:
            write_wall_section(hexes + 1);
            write_hex_section("Fluid", 1, 0, hexes);
            break;
        case cgns_order::gap: write_hex_section("Fluid", write_wall_section(1) + 1, 0, hexes); break;
        case cgns_order::wall_between:
            write_hex_section("Rest", write_wall_section(write_hex_section("Fluid", 1, 0, quads)), quads, hexes);
            break;
        case cgns_order::wall_long: write_hex_section("Fluid", write_wall_section(1, 4), 0, hexes); break;
        case cgns_order::mixed: write_mixed_section(); break;
        case cgns_order::curved: write_hex_section("Fluid", write_wall_section(1), 0, hexes, 27); break;
        }
    }
};

std::string make_foam_file(const std::string &kind, const std::string &name, const std::string &body)
{
    return "FoamFile\n{\n    version 2.0;\n    format ascii;\n    class " + kind + ";\n    object " + name + ";\n}\n" +
           body;
}

} // namespace

void write_cgns_elements(const std::string &path, vtkUnstructuredGrid *grid, cgns_order order, int claimed,
                         const std::vector<std::string> &zones)
{
    int file = 0, base = 0, zone = 0;
    const cgsize_t sizes[3] = {point_count, claimed, 0};
    cg_open(path.c_str(), CG_MODE_WRITE, &file);
    cg_base_write(file, "Base", 3, 3, &base);
    for (const std::string &name : zones) {
        cg_zone_write(file, base, name.c_str(), sizes, CGNS_ENUMV(Unstructured), &zone);
        write_cgns_coordinates(file, base, zone, grid);
        section_writer{file, base, zone, grid}.write_section(order);
        write_cgns_fields(file, base, zone, grid);
    }
    cg_close(file);
}

void write_foam(const std::string &folder, int first)
{
    namespace fs = std::filesystem;
    const std::string mesh = folder + "/constant/polyMesh/";
    for (const char *inside : {"/constant/polyMesh", "/system", "/0", "/0.5"}) fs::create_directories(folder + inside);
    write_file(folder + "/case.foam", "");
    write_file(folder + "/system/controlDict",
               make_foam_file("dictionary", "controlDict",
                              "application none;\nstartFrom startTime;\nstartTime 0;\nstopAt endTime;\nendTime 0.5;\n"
                              "deltaT 0.5;\nwriteControl timeStep;\nwriteInterval 1;\nwriteFormat ascii;\n"));
    std::string points = "12\n(\n";
    for (int x = first; x < first + 3; x++)
        for (const char *yz : {" 0 0)\n", " 1 0)\n", " 1 1)\n", " 0 1)\n"}) points += "(" + std::to_string(x) + yz;
    write_file(mesh + "points", make_foam_file("vectorField", "points", points + ")\n"));
    /* Interior faces are first: the two triangles, then the quad between the wedges. */
    write_file(mesh + "faces",
               make_foam_file("faceList", "faces",
                              "14\n(\n3(4 5 6)\n3(4 6 7)\n4(4 8 10 6)\n4(0 3 2 1)\n4(0 1 5 4)\n4(1 2 6 5)\n"
                              "4(2 3 7 6)\n4(3 0 4 7)\n4(4 5 9 8)\n4(5 6 10 9)\n3(8 9 10)\n4(6 7 11 10)\n"
                              "4(7 4 8 11)\n3(8 10 11)\n)\n"));
    write_file(mesh + "owner",
               make_foam_file("labelList", "owner", "14\n(\n0\n0\n1\n0\n0\n0\n0\n0\n1\n1\n1\n2\n2\n2\n)\n"));
    write_file(mesh + "neighbour", make_foam_file("labelList", "neighbour", "3\n(\n1\n2\n2\n)\n"));
    write_file(mesh + "boundary",
               make_foam_file("polyBoundaryMesh", "boundary",
                              "1\n(\nwall\n{\n    type wall;\n    nFaces 11;\n    startFace 3;\n}\n)\n"));
    for (const int step : {0, 1}) {
        std::string values;
        for (int i = 1; i <= 3; i++) values += std::to_string(i << step) + "\n";
        write_file(folder + (step ? "/0.5/p" : "/0/p"),
                   make_foam_file("volScalarField", "p",
                                  "dimensions [0 2 -2 0 0 0 0];\ninternalField nonuniform List<scalar>\n3\n(\n" +
                                      values +
                                      ");\nboundaryField\n{\n    wall\n    {\n        type zeroGradient;\n    }\n}\n"));
    }
}

std::vector<sample> write_samples(const std::string &folder)
{
    const auto image = make_hex_grid(lattice::image), axes = make_hex_grid(lattice::rectilinear),
               curved = make_hex_grid(lattice::curved);
    write_lattices(folder);
    write_unstructured(folder, curved);
    write_ensight_text(folder, curved);
    write_cgns(folder + "/g.cgns", curved);
    write_cgns_elements(folder + "/elements.cgns", curved, cgns_order::cells_first);
    write_cgns_elements(folder + "/wall.cgns", curved, cgns_order::wall_first);
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
                               {"e.case", list_files_with_prefix(folder, "e."), curved},
                               {"t.case", list_files_with_prefix(folder, "t."), curved},
                               {"g.cgns", {"g.cgns"}, curved},
                               {"elements.cgns", {"elements.cgns"}, curved},
                               {"wall.cgns", {"wall.cgns"}, curved},
                               {"p.pvtu", {"p.pvtu", "p0.vtu", "p1.vtu"}, write_polyhedra(folder)}};
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
