/* The weights of the cells around a vertex in the value at the vertex. */
#ifndef WAVE_WEIGHTS_H
#define WAVE_WEIGHTS_H

#include <stdint.h>

enum { WAVE_AROUND_MAX = 96 }; /* 8 cubes of at most 12 cells */

/* Fits weights that add up to 1. They give the value at the vertex of the least-squares linear function through the
 * cells' values at their centroids, and so are exact for linear functions where cells lie on all sides of the vertex.
 * Across a wall (bits as wave_lattice_walls()) nothing is extrapolated. */
void wave_weights_fit(const double vertex[3], unsigned walls, int count, const int32_t *cells,
                      const double (*centroid)[3], double *weight);

#endif
