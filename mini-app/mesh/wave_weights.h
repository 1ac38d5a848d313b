/* Computes the weights with which the values of the cells around a vertex are averaged to a value at the vertex. */
#ifndef WAVE_WEIGHTS_H
#define WAVE_WEIGHTS_H

#include <stdint.h>

enum { WAVE_AROUND_MAX = 96 }; /* maximum number of cells around a vertex: 8 cubes of at most 12 cells */

/* Computes weights that add up to 1. The weighted sum of the cells' values is the value, at the vertex, of the linear
 * function that is fitted by least squares to these values at the cells' centroids. It is exact for linear functions if
 * there are cells on all sides of the vertex. Values are not extrapolated towards a wall. walls: bits as returned by
 * wave_lattice_find_walls(). */
void wave_weights_fit(const double vertex[3], unsigned walls, int count, const int32_t *cells,
                      const double (*centroid)[3], double *weight);

#endif
