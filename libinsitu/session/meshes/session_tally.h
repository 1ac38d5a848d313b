/* Sums over a mesh's cells that its check computes: bounds, counts and sizes. */
#ifndef SESSION_TALLY_H
#define SESSION_TALLY_H

#include "session_mesh.h"

typedef struct mesh_tally {
    double lower[3], upper[3];
    int64_t drawn, ghosts, inverted, flat, shells; /* shells are drawn and flat */
    double sizes; /* sum of cube roots of volumes; added block by block, so that it rounds like a sum of few terms */
} mesh_tally;

mesh_tally tally_empty(void);
void tally_merge(mesh_tally *sum, const mesh_tally *part);

/* Adds one valid cell of any type. */
void tally_cell(const grid *g, int64_t cell, mesh_tally *tally);

/* Returns whether the volumes at the corners of a hex, wedge or pyramid, or the areas at those of a quad, have both
 * signs. They do if vertices are read in another order than they are stored in. */
bool tally_has_both_signs(int type, double points[][3]);

/* Returns the mean of the volumes at the corners of a cell of the four types, from its vertices' positions; negative if
 * the cell is left-handed. */
double tally_signed_volume(int type, double points[][3]);

/* Returns whether a valid cell has no volume except for rounding, as shells have none. A ghost never counts. */
bool tally_is_flat(const grid *g, int64_t cell);

/* Checks and tallies cells begin .. end - 1; returns the first bad one, or end. */
typedef int64_t (*tally_run)(const session_mesh *mesh, int64_t begin, int64_t end, mesh_tally *tally);

/* The run for the mesh's layout, NULL where cells are to be taken one by one: where there may be polyhedra, or
 * coordinates that are not all float or all double. */
/* Tallies a uniform or rectilinear lattice at once, from the lengths along its axes. Returns false, with nothing added,
 * if the mesh is of another kind or has ghost flags. */
bool tally_axes(const session_mesh *mesh, mesh_tally *tally);

tally_run tally_choose(const session_mesh *mesh);

#endif
