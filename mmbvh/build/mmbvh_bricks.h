/* Builds trees over the cells of a lattice (structured grid) by halving boxes of cell indices. Nothing is sorted, and
 * no cell is read. */
#ifndef MMBVH_BRICKS_H
#define MMBVH_BRICKS_H

#include "grid.h"
#include "mmbvh_topology.h"

/* Returns the number of cells of a tree over all drawn cells of the lattice. Ghost flags are ignored. */
int64_t bricks_count(const grid_lattice *lattice);

/* Builds the tree over the bricks_count() cells of the lattice of g, all of which must be drawn; `cells` receives their
 * indices in the order of the leaves. Returns NULL if memory ran out. */
topology *bricks_build(topology_build *build, const grid *g, uint32_t *cells);

#endif
