/* Computes schedules of compositing (comp_cost.h) for any number of ranks: the messages, bytes and time of the rank
 * that sends most, for a picture in which a block partition over P ranks has P^(1/3) layers of fragments. Prints CSV;
 * does not use MPI.
 *
 *     bench_schedules [RANKS_PER_NODE] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "comp_cost.h"
#include "comp_grid.h"

/* Returns the load for 1920 × 1080 pixels. The object covers half of the pixels, and the busiest rank has twice the
 * mean load. */
static comp_load make_load(int ranks)
{
    const double covered = 0.5 * 1920 * 1080, layers = cbrt(ranks);
    const comp_grid grid = comp_make_grid(1920, 1080, ranks);
    return (comp_load){(int64_t)(2 * covered * layers / ranks), 11, comp_grid_block_pixels(&grid)};
}

static void print_costs(const char *name, const comp_route *route, const comp_load *load)
{
    const comp_cost cost = comp_estimate_cost(route, load, &comp_default_machine);
    printf("%d,%d,%s,%d,%.0f,%.0f,%.3f\n", route->ranks, route->nodes.ranks, name, route->round_count, cost.messages,
           cost.bytes, 1e3 * cost.seconds);
}

int main(int argc, char **argv)
{
    static const int counts[] = {8, 64, 512, 4096, 32768, 98304};
    const int node = argc > 1 ? atoi(argv[1]) : 64;
    if (node < 1) return 1;
    puts("ranks,ranks a node,schedule,rounds,messages,bytes,ms");
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const comp_nodes nodes = {counts[i] % node == 0 ? node : 1, false};
        const comp_load load = make_load(counts[i]);
        for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT; s++) {
            const comp_route route = comp_make_route(s, counts[i], nodes, 8);
            print_costs(comp_schedule_name(s), &route, &load);
        }
        const comp_route best = comp_find_fastest_route(counts[i], nodes, &load, &comp_default_machine);
        print_costs("chosen", &best, &load);
    }
    return 0;
}
