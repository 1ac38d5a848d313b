/* The field of a polyhedron in double, used by reference_cell.c. */
#ifndef REFERENCE_POLYHEDRON_H
#define REFERENCE_POLYHEDRON_H

#include "grid.h"
#include "reference_cell.h"

/* Reads the faces and the distinct vertices of a polyhedral cell of the grid. Ends the process if the cell has too
 * many. */
void reference_polyhedron_read(const grid *g, int64_t index, reference_cell *cell,
                               int64_t vertices[REFERENCE_MAX_VERTICES]);

/* Evaluates the interpolant at a point of a polyhedron. Returns false if no sum over tets is found (reference_cell.h).
 * gradient may be NULL. */
bool reference_polyhedron_interpolate(const reference_cell *cell, const double point[3], const double *values,
                                      double *value, double gradient[3]);

#endif
