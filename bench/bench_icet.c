#include "bench_icet.h"

#include <IceT.h>
#include <IceTMPI.h>
#include <stdlib.h>

struct bench_icet {
    IceTCommunicator communicator;
    IceTContext context;
};

static const struct {
    const char *name;
    IceTEnum strategy;
} strategies[BENCH_ICET_STRATEGIES] = {{"binary swap", ICET_SINGLE_IMAGE_STRATEGY_BSWAP},
                                       {"tree", ICET_SINGLE_IMAGE_STRATEGY_TREE},
                                       {"radix-k", ICET_SINGLE_IMAGE_STRATEGY_RADIXK},
                                       {"radix-kr", ICET_SINGLE_IMAGE_STRATEGY_RADIXKR},
                                       {"folding", ICET_SINGLE_IMAGE_STRATEGY_BSWAP_FOLDING}};

bench_icet *bench_icet_create(MPI_Comm comm)
{
    bench_icet *icet = malloc(sizeof *icet);
    if (!icet) abort();
    icet->communicator = icetCreateMPICommunicator(comm);
    icet->context = icetCreateContext(icet->communicator);
    icetDiagnostics(ICET_DIAG_ERRORS);
    return icet;
}

void bench_icet_free(bench_icet *icet)
{
    if (!icet) return;
    icetDestroyContext(icet->context);
    icetDestroyMPICommunicator(icet->communicator);
    free(icet);
}

const char *bench_icet_strategy(int strategy)
{
    return strategies[strategy].name;
}

static void set_state(int strategy, const bench_icet_picture *p)
{
    icetResetTiles();
    icetAddTile(0, 0, p->width, p->height, 0);
    icetStrategy(ICET_STRATEGY_SEQUENTIAL);
    icetSingleImageStrategy(strategies[strategy].strategy);
    icetSetColorFormat(ICET_IMAGE_COLOR_RGBA_FLOAT);
    icetSetDepthFormat(p->depth ? ICET_IMAGE_DEPTH_FLOAT : ICET_IMAGE_DEPTH_NONE);
    icetCompositeMode(p->depth ? ICET_COMPOSITE_MODE_Z_BUFFER : ICET_COMPOSITE_MODE_BLEND);
    if (p->depth) {
        icetDisable(ICET_ORDERED_COMPOSITE);
    } else {
        icetEnable(ICET_ORDERED_COMPOSITE);
        icetCompositeOrder(p->order);
    }
}

double bench_icet_composite(bench_icet *icet, int strategy, const bench_icet_picture *p, const float **rgba)
{
    static const IceTDouble identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    static const IceTFloat background[4] = {0, 0, 0, 0};
    IceTInt bytes = 0, rank = 0;
    icetSetContext(icet->context);
    set_state(strategy, p);
    const IceTImage image = icetCompositeImage(p->rgba, p->depth, p->viewport, identity, identity, background);
    if (icetGetError() != ICET_NO_ERROR) return -1;
    icetGetIntegerv(ICET_BYTES_SENT, &bytes);
    icetGetIntegerv(ICET_RANK, &rank);
    *rgba = rank == 0 ? icetImageGetColorcf(image) : NULL;
    return (double)bytes;
}
