/* Computes volumes, centroids and face areas of cells in double precision. */
#ifndef WAVE_GEOMETRY_H
#define WAVE_GEOMETRY_H

#include "wave_lattice.h"

typedef struct wave_cell_geometry {
    double volume;
    double centroid[3];
    /* outward area vector of each face; the vectors of the two cells of a face are exactly opposite */
    double area[6][3];
} wave_cell_geometry;

/* Measures a cell. position and id belong to the shape's vertices; ids must be the same on every rank. */
void wave_cell_measure(const wave_cell_shape *shape, const double position[8][3], const int64_t id[8],
                       wave_cell_geometry *out);

#endif
