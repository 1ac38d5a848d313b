/* Trees over a lattice's cells: boxes of indices are halved, so that nothing is sorted and no cell is read. */
#ifndef MMBVH_BRICKS_H
#define MMBVH_BRICKS_H

#include "grid.h"
#include "mmbvh_topology.h"

/* Returns how many cells a tree over all drawn cells has, ghost flags aside. */
int64_t bricks_count(const grid_lattice *lattice);

/* Builds the tree over the bricks_count() cells of g's lattice, which are all drawn; cells gets them in the order of
 * the leaves. NULL: out of memory. */
topology *bricks_build(topology_build *build, const grid *g, uint32_t *cells);

#endif
