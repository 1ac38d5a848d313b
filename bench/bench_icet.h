/* IceT's compositing (Debian's paraview-dev) of the same pictures: one RGBA image of floats a rank, with depths or in a
 * given order. */
#ifndef BENCH_ICET_H
#define BENCH_ICET_H

#include <mpi.h>
#include <stdbool.h>

enum { BENCH_ICET_STRATEGIES = 5 };

typedef struct bench_icet bench_icet;

/* One rank's picture: height × width × 4 premultiplied colours and, for surfaces, depths from 0 to 1, bottom row first.
 */
typedef struct bench_icet_picture {
    int width, height;
    const float *rgba, *depth; /* depth NULL: blended in order */
    const int *order;          /* ranks from front to back */
    int viewport[4];           /* x, y, width, height of the pixels that hold something */
} bench_icet_picture;

/* NULL: this program was built without IceT. Collective, as all functions here. */
bench_icet *bench_icet_create(MPI_Comm comm);
void bench_icet_free(bench_icet *icet);

const char *bench_icet_strategy(int strategy);

/* Composites to rank 0. Returns the bytes that this rank sent, or -1 where the strategy cannot do it. On rank 0 *rgba
 * is the picture, valid until the next call. */
double bench_icet_composite(bench_icet *icet, int strategy, const bench_icet_picture *picture, const float **rgba);

#endif
