/* Computes the volume of a polyhedron. */
#ifndef SESSION_POLYHEDRON_H
#define SESSION_POLYHEDRON_H

#include "grid.h"

/* Returns the volume of a polyhedron. It is exact if the cell is star-shaped with respect to the mean of its vertices,
 * and otherwise somewhat too large. Up to rounding it does not depend on the order of faces and vertices. *is_flat is
 * set if the cell lies in one plane up to rounding; its volume is then 0. */
double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat);

#endif
