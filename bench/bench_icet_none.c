#include "bench_icet.h"

#include <stddef.h>

bench_icet *bench_icet_create(MPI_Comm comm)
{
    (void)comm;
    return NULL;
}

void bench_icet_free(bench_icet *icet)
{
    (void)icet;
}

const char *bench_icet_strategy(int strategy)
{
    (void)strategy;
    return "";
}

double bench_icet_composite(bench_icet *icet, int strategy, const bench_icet_picture *picture, const float **rgba)
{
    (void)icet, (void)strategy, (void)picture, (void)rgba;
    return -1;
}
