/* How much each cell around a vertex counts in the value at the vertex. */
#ifndef WAVE_WEIGHTS_H
#define WAVE_WEIGHTS_H

#include <stdint.h>

enum { WAVE_AROUND_MAX = 96 }; /* 8 cubes of at most 12 cells */

/* Weights that add up to 1 and, where the cells lie around the vertex on all sides, give linear functions exactly: the
 * value at the vertex of the least-squares line through the cells' values at their centroids. Across a wall (bits as
 * wave_lattice_walls()) nothing is extrapolated. */
void wave_weights_fit(const double vertex[3], unsigned walls, int count, const int32_t *cells,
                      const double (*centroid)[3], double *weight);

#endif
