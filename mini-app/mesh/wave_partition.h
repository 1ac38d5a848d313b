/* Tells which rank owns a cube of the lattice, by arithmetic that is the same on every rank. */
#ifndef WAVE_PARTITION_H
#define WAVE_PARTITION_H

#include "wave_lattice.h"

typedef enum wave_partition_kind {
    WAVE_BLOCK,       /* boxes, as near to cubes as the number of ranks allows */
    WAVE_MORTON,      /* equal pieces of the Morton curve through the lattice */
    WAVE_RANDOM,      /* by a hash of the cube */
    WAVE_CHECKERBOARD /* (i + j + k) modulo ranks: no two cubes that share a face belong together */
} wave_partition_kind;

typedef struct wave_partition {
    wave_lattice lattice;
    wave_partition_kind kind;
    int ranks;
    int blocks[3]; /* the numbers of blocks of WAVE_BLOCK */
} wave_partition;

wave_partition wave_partition_make(const wave_lattice *lattice, wave_partition_kind kind, int ranks);

int wave_partition_owner(const wave_partition *partition, const int ijk[3]);

/* A box of cubes, low .. high - 1, that holds all that rank owns, so that it need not look elsewhere. */
void wave_partition_box(const wave_partition *partition, int rank, int low[3], int high[3]);

#endif
