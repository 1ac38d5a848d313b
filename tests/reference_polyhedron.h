/* The field of a polyhedron in double: for reference_cell.c. */
#ifndef REFERENCE_POLYHEDRON_H
#define REFERENCE_POLYHEDRON_H

#include "reference_cell.h"

/* reference_interpolate() of polyhedra. */
bool reference_polyhedron_interpolate(const reference_cell *cell, const double point[3], const double *values,
                                      double *value, double gradient[3]);

#endif
