/* The field of a polyhedron in double: for reference_cell.c. */
#ifndef REFERENCE_POLYHEDRON_H
#define REFERENCE_POLYHEDRON_H

#include "grid.h"
#include "reference_cell.h"

/* The faces of a polyhedral cell of the grid, and its distinct vertices. A cell too large ends the process. */
void reference_polyhedron_read(const grid *g, int64_t index, reference_cell *cell,
                               int64_t vertices[REFERENCE_MAX_VERTICES]);

/* reference_interpolate() of polyhedra. */
bool reference_polyhedron_interpolate(const reference_cell *cell, const double point[3], const double *values,
                                      double *value, double gradient[3]);

#endif
