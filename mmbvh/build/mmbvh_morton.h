/* Trees along a space-filling curve: cells sorted by a key that interleaves the bits of their centroids, and halved
 * where the keys' highest bit changes. */
#ifndef MMBVH_MORTON_H
#define MMBVH_MORTON_H

#include "mmbvh_bounds.h"
#include "mmbvh_topology.h"

enum { MORTON_PART_BITS = 7, MORTON_PARTS = 3, MORTON_AXIS_BITS = MORTON_PART_BITS * MORTON_PARTS };

/* A key: the code in the high bits, the cell's index in the index_bits low ones, so that no two are equal. */
typedef struct morton_coder {
    double origin[3];
    double factor[3]; /* to steps of the axis */
    double most[3];   /* the last step */
    int index_bits;
    int code_bits;
    uint64_t parts[3][MORTON_PARTS][1 << MORTON_PART_BITS]; /* where an axis's bits go in a key, so many at a time */
} morton_coder;

/* Prepares for cells below index_count, within a box in the tree's coordinates. */
void morton_coder_init(morton_coder *coder, const double lower[3], const double upper[3], int64_t index_count);

/* Replaces the cell indices in keys by Morton keys, and extends exact by these cells' boxes in source coordinates. */
void morton_place(const bounds_source *source, const morton_coder *coder, uint64_t *keys, int64_t count,
                  fetch_box *exact);

/* Sorts keys in ascending order. other has as much room as keys. Returns false where memory runs out. */
bool morton_sort(const morton_coder *coder, uint64_t *keys, uint64_t *other, int64_t count, int threads);

/* The tree over ascending keys. NULL where an allocation failed. */
topology *morton_build(topology_build *build, const uint64_t *keys, int64_t count);

#endif
