/* Declares functions that write small files of every format that insitu-render reads, and that make the grids in these
 * files without reading them. */
#ifndef TEST_VTK_SAMPLES_H
#define TEST_VTK_SAMPLES_H

#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataSet;
class vtkUnstructuredGrid;

/* A lattice of 6 × 5 × 4 points in VTK's three forms: coordinates by origin and spacing, by one array per axis, and by
 * a list of points. */
enum class lattice { image, rectilinear, curved };

/* Returns a grid with the point field "x" and the cell field "c", whose values are the cells' numbers. */
vtkSmartPointer<vtkDataSet> make_structured_grid(lattice kind);

/* Returns the grid of make_structured_grid() as a list of hexahedra, whose vertices are computed from the indices i, j
 * and k without VTK's structured grids. */
vtkSmartPointer<vtkUnstructuredGrid> make_hex_grid(lattice kind);

/* Returns a row of unit cubes along x, beginning at `first`. If is_mixed is set, every second cube is a polyhedron;
 * otherwise all cubes are hexahedra. */
vtkSmartPointer<vtkUnstructuredGrid> make_cubes(int count, int first, bool is_mixed);

struct sample {
    std::string name;               // name of the file to open, in the directory
    std::vector<std::string> files; // files that tests may truncate: that file and those that it names
    vtkSmartPointer<vtkUnstructuredGrid> expected;
};

/* Writes the files of all formats that this version of VTK can write into a directory. */
std::vector<sample> write_samples(const std::string &folder);

void write_vtu(const std::string &path, vtkUnstructuredGrid *grid);

/* How the elements of a CGNS zone are numbered. */
enum class cgns_order {
    cells_first,  // the hexes, then the quads at the bottom
    wall_first,   // the quads, then the hexes
    wall_between, // 20 hexes, then the quads, then the other hexes
    wall_long,    // the quads, four times, so that they are more than the hexes, then the hexes
    wall_stored,  // numbered like cells_first, but the section of the quads is stored first
    mixed,        // one section of both types: a quad before each of the first hexes
    curved,       // like wall_first, but with HEXA_27 elements, whose nodes beyond the corners repeat the first corner
    gap           // like wall_first, but the hexes' numbers begin one too high
};

/* Writes make_hex_grid() as each of the unstructured zones of a CGNS file. `claimed` is the number of cells that each
 * zone states. */
void write_cgns_elements(const std::string &path, vtkUnstructuredGrid *grid, cgns_order order, int claimed = 60,
                         const std::vector<std::string> &zones = {"Zone"});

/* Writes an OpenFOAM case into a directory: a cube that begins at x = `first`, and two adjacent wedges. Their triangles
 * together are one side of the cube, so that the cube has seven faces. The field p is the cell's number at time 0, and
 * twice this number at time 0.5. */
void write_foam(const std::string &folder, int first = 0);

#endif
