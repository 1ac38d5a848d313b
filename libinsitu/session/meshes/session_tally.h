/* Computes the tally of a mesh's cells while the mesh is checked: the bounds, the number of drawn, ghost, left-handed,
 * flat and shell cells, and a sum of sizes. */
#ifndef SESSION_TALLY_H
#define SESSION_TALLY_H

#include "session_mesh.h"

typedef struct mesh_tally {
    double lower[3], upper[3];
    /* number of cells in each class; shells are drawn cells of a type without volume: triangles, quads and polygons */
    int64_t drawn_count, ghost_count, inverted_count, flat_count, shell_count;
    /* sum of the cube roots of the cells' volumes. The sums of blocks of cells are computed first and then added up,
     * which keeps the rounding error small. */
    double size_sum;
} mesh_tally;

mesh_tally tally_empty(void);
void tally_merge(mesh_tally *sum, const mesh_tally *part);

/* Adds a valid cell of any type to *tally. */
void tally_cell(const grid *g, int64_t cell, mesh_tally *tally);

/* Returns whether the corners of a hex, wedge, pyramid or quad have both signs. The sign of a solid cell's corner is
 * that of the determinant of the three edges at the corner. The sign of a quad's corner shows whether the normal there
 * points to the same side as the normal at the quad's first corner. Corners have both signs if the caller stores
 * vertices in another order than the order in which they are read. */
bool tally_has_corners_of_both_signs(int type, double points[][3]);

/* Returns the signed volume of a tet, hex, wedge or pyramid, averaged over the ways to divide the cell into tets
 * (session_corners.h). It is negative if the cell is left-handed. */
double tally_signed_volume(int type, double points[][3]);

/* Returns whether the volume of a valid cell is 0 up to rounding, which includes all shells. Returns false for a
 * ghost. */
bool tally_is_flat(const grid *g, int64_t cell);

/* A function that checks the cells begin .. end - 1 and adds them to *tally. It stops at the first cell that is
 * invalid, or that it cannot check, such as a polygon, and returns the index of this cell; otherwise it returns
 * `end`. */
typedef int64_t (*tally_run)(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally);

/* Adds all cells of a uniform or rectilinear lattice to *tally. Bounds, numbers of cells and sizes are computed only
 * from the coordinates along its axes, without a loop over the cells. Returns false, without adding anything, if the
 * mesh is not such a lattice or has ghost flags. */
bool tally_lattice_by_axes(const session_mesh *mesh, mesh_tally *tally);

/* Returns the function that checks the cells of the mesh's layout. Returns NULL if cells must be checked one by one:
 * there may be polyhedra, all cells are shells of one type, or the coordinates along the three axes differ in type or
 * stride. */
tally_run tally_choose_check_function(const session_mesh *mesh);

#endif
