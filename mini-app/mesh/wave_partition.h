/* Computes which rank owns a cube of the lattice. The computation gives the same result on every rank. */
#ifndef WAVE_PARTITION_H
#define WAVE_PARTITION_H

#include "wave_lattice.h"

typedef enum wave_partition_kind {
    WAVE_BLOCK,       /* one box of cubes per rank, as close to a cube as the number of ranks allows */
    WAVE_MORTON,      /* one contiguous range of the Morton curve per rank; the ranges differ by at most one cube in
                         length */
    WAVE_RANDOM,      /* owners chosen by a hash of the cube's id */
    WAVE_CHECKERBOARD /* rank (i + j + k) modulo ranks: cubes that share a face have different owners */
} wave_partition_kind;

typedef struct wave_partition {
    wave_lattice lattice;
    wave_partition_kind kind;
    int ranks;
    int blocks[3]; /* number of blocks along each axis, for WAVE_BLOCK */
} wave_partition;

wave_partition wave_partition_make(const wave_lattice *lattice, wave_partition_kind kind, int ranks);

int wave_partition_owner(const wave_partition *partition, const int ijk[3]);

/* Computes a box of cubes, low .. high - 1, that contains all cubes of the rank, so that only the cubes of the box have
 * to be searched. */
void wave_partition_find_box(const wave_partition *partition, int rank, int low[3], int high[3]);

#endif
