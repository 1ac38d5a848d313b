/* The volume of a polyhedron. */
#ifndef SESSION_POLYHEDRON_H
#define SESSION_POLYHEDRON_H

#include "grid.h"

/* Returns the volume: exact if the cell is star-shaped from the mean of its vertices, else somewhat larger. Up to
 * rounding it does not depend on the order of faces and vertices. *is_flat: the cell lies in one plane up to rounding,
 * and its volume is 0. */
double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat);

#endif
