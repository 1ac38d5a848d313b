/* Builds trees along a space-filling curve. Cells are sorted by Morton keys, in which the bits of a cell's centroid are
 * interleaved. A node is split where the highest bit that differs between its keys changes. */
#ifndef MMBVH_MORTON_H
#define MMBVH_MORTON_H

#include "mmbvh_bounds.h"
#include "mmbvh_topology.h"

enum { MORTON_PART_BITS = 7, MORTON_PARTS = 3, MORTON_AXIS_BITS = MORTON_PART_BITS * MORTON_PARTS };

/* Converts positions to Morton keys. A grid divides each axis into a power of two of equal steps; a code interleaves
 * the bits of the three integer coordinates in this grid. A key has the code in its high bits and the cell's index in
 * the index_bits low ones, so that no two keys are equal. */
typedef struct morton_coder {
    double origin[3];
    double factor[3];    /* number of grid steps per unit length on each axis */
    double last_step[3]; /* largest integer coordinate on each axis */
    int index_bits;
    int code_bits;
    uint64_t parts[3][MORTON_PARTS][1 << MORTON_PART_BITS]; /* lookup tables that spread an axis's bits over the code */
} morton_coder;

/* Prepares keys of cells with indices below index_count and centres in the given box (in the tree's coordinates). */
void morton_coder_init(morton_coder *coder, const double lower[3], const double upper[3], int64_t index_count);

/* Replaces the cell indices in `keys` by Morton keys, and extends *exact by the boxes of these cells in the source's
 * coordinates. */
void morton_make_keys(const bounds_source *source, const morton_coder *coder, uint64_t *keys, int64_t count,
                      fetch_box *exact);

/* Sorts the keys in ascending order. `other` is scratch space of the same size. Returns false if memory ran out. */
bool morton_sort(const morton_coder *coder, uint64_t *keys, uint64_t *other, int64_t count, int threads);

/* Builds the tree over keys in ascending order; returns NULL if an allocation failed. */
topology *morton_build(topology_build *build, const uint64_t *keys, int64_t count);

#endif
