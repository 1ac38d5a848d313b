/* Composites the same pictures by IceT (Debian's package paraview-dev), as a peer. Each rank has one RGBA image of
 * floats, with depths or with a given order of the ranks. */
#ifndef BENCH_ICET_H
#define BENCH_ICET_H

#include <mpi.h>
#include <stdbool.h>

enum { BENCH_ICET_STRATEGIES = 5 };

typedef struct bench_icet bench_icet;

/* The picture of one rank: height × width × 4 premultiplied colours and, for surfaces, depths from 0 to 1; the bottom
   row is first. */
typedef struct bench_icet_picture {
    int width, height;
    const float *rgba, *depth; /* if depth is NULL, the pictures are blended in `order` */
    const int *order;          /* ranks, from front to back */
    int viewport[4];           /* x, y, width, height of the rectangle of pixels that are not empty */
} bench_icet_picture;

/* Returns NULL if this program was built without IceT. All functions here are collective. */
bench_icet *bench_icet_create(MPI_Comm comm);
void bench_icet_free(bench_icet *icet);

const char *bench_icet_strategy(int strategy);

/* Composites to rank 0. Returns the number of bytes that this rank sent, or -1 if the strategy does not support the
 * picture. On rank 0, *rgba receives the picture; it is valid until the next call. */
double bench_icet_composite(bench_icet *icet, int strategy, const bench_icet_picture *picture, const float **rgba);

#endif
