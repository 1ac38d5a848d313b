/* Small files of every format that insitu-render reads, and the grids that they hold, built apart from them. */
#ifndef TEST_VTK_SAMPLES_H
#define TEST_VTK_SAMPLES_H

#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkDataSet;
class vtkUnstructuredGrid;

/* A lattice of 6 × 5 × 4 points as VTK has it: coordinates by axes, by one array an axis, by a list of points. */
enum class lattice { image, rectilinear, curved };

/* A grid with the point field "x", and the cell field "c", which counts cells. */
vtkSmartPointer<vtkDataSet> structured(lattice kind);

/* As above, but a list of hexahedra made from the lattice's indices alone. */
vtkSmartPointer<vtkUnstructuredGrid> hexes(lattice kind);

/* A row of unit cubes along x from `first` on, every second a polyhedron if is_mixed, else all hexahedra. */
vtkSmartPointer<vtkUnstructuredGrid> cubes(int count, int first, bool is_mixed);

struct sample {
    std::string name;               // of the file to open, within the folder
    std::vector<std::string> files; // that may be cut: it and those it names
    vtkSmartPointer<vtkUnstructuredGrid> expected;
};

/* Write the files of all formats that this VTK can write into folder. */
std::vector<sample> write_samples(const std::string &folder);

void write_vtu(const std::string &path, vtkUnstructuredGrid *grid);

/* How the elements of a CGNS zone are numbered. */
enum class cgns_order {
    cells_first,  // the hexes, then the quads at the bottom
    wall_first,   // the quads, then the hexes
    wall_between, // 20 hexes, the quads, the other hexes
    wall_long,    // the quads four times, more than there are hexes, then the hexes
    wall_stored,  // as cells_first, but the quads' section is the file's first
    mixed,        // one section of both: a quad before each of the first hexes
    curved,       // as wall_first, with HEXA_27 whose nodes beyond the corners are the first corner
    gap           // as wall_first, but the hexes' numbers begin one too late
};

/* Writes hexes() as each of the unstructured zones of a CGNS file. claimed: the number of cells that a zone says it
 * has. */
void write_cgns_elements(const std::string &path, vtkUnstructuredGrid *grid, cgns_order order, int claimed = 60,
                         const std::vector<std::string> &zones = {"Zone"});

/* Writes an OpenFOAM case to folder: a cube that begins at x = first and, beside it, two wedges whose triangles
 * together are the cube's face, so that the cube has seven faces. The field p is the cell's number at time 0, twice
 * that at 0.5.
 */
void write_foam(const std::string &folder, int first = 0);

#endif
