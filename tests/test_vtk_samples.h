/* Writes small files of every format that insitu-render reads, and makes the grids that they contain without reading
 * the files. */
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

/* Returns a grid with the point field "x" and the cell field "c", which counts cells. */
vtkSmartPointer<vtkDataSet> make_structured_grid(lattice kind);

/* Returns the grid of make_structured_grid() as a list of hexahedra, made only from the lattice's indices. */
vtkSmartPointer<vtkUnstructuredGrid> make_hex_grid(lattice kind);

/* Returns a row of unit cubes along x, beginning at `first`. If is_mixed, every second cube is a polyhedron, otherwise
 * all cubes are hexahedra. */
vtkSmartPointer<vtkUnstructuredGrid> make_cubes(int count, int first, bool is_mixed);

struct sample {
    std::string name;               // name of the file to open, within the folder
    std::vector<std::string> files; // files that may be truncated: that file and those that it names
    vtkSmartPointer<vtkUnstructuredGrid> expected;
};

/* Writes into folder the files of all formats that this version of VTK can write. */
std::vector<sample> write_samples(const std::string &folder);

void write_vtu(const std::string &path, vtkUnstructuredGrid *grid);

/* The numbering of the elements of a CGNS zone. */
enum class cgns_order {
    cells_first,  // the hexes, then the quads at the bottom
    wall_first,   // the quads, then the hexes
    wall_between, // 20 hexes, then the quads, then the other hexes
    wall_long,    // four times the quads, which are more than the hexes, then the hexes
    wall_stored,  // like cells_first, but the section of the quads is stored first
    mixed,        // one section of both types: a quad before each of the first hexes
    curved,       // like wall_first, with HEXA_27 whose nodes beyond the corners repeat the first corner
    gap           // like wall_first, but the hexes' numbers begin one too high
};

/* Writes make_hex_grid() as each of the unstructured zones of a CGNS file. `claimed` is the number of cells that each
 * zone states. */
void write_cgns_elements(const std::string &path, vtkUnstructuredGrid *grid, cgns_order order, int claimed = 60,
                         const std::vector<std::string> &zones = {"Zone"});

/* Writes an OpenFOAM case to folder: a cube that begins at x = first and, beside it, two wedges whose triangles
 * together are the cube's face, so that the cube has seven faces. The field p is the cell's number at time 0, and twice
 * this number at time 0.5. */
void write_foam(const std::string &folder, int first = 0);

#endif
