/* Computes the weights with which the values of the cells around a vertex are averaged to a value at the vertex. */
#ifndef WAVE_WEIGHTS_H
#define WAVE_WEIGHTS_H

#include <stdint.h>

enum { WAVE_AROUND_MAX = 96 }; /* maximum number of cells around a vertex: 8 cubes of at most 12 cells */

/* Computes weights that add up to 1. They evaluate, at the vertex, the linear function fitted by
 * least squares to the cells' values at their centroids; they are exact for linear functions if there are cells on all
 * sides of the vertex. Values are not extrapolated towards a wall. walls: bits as returned by wave_lattice_walls(). */
void wave_weights_fit(const double vertex[3], unsigned walls, int count, const int32_t *cells,
                      const double (*centroid)[3], double *weight);

#endif
