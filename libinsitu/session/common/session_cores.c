/* Ranks that are bound to no cores share all, ranks of a socket or a container those of it, and a rank bound to its own
 * cores has these for itself. What they may run on tells all these apart, whoever has bound them. */
#define _GNU_SOURCE 1
#include "session_cores.h"

#include <omp.h>
#include <sched.h>
#include <stdbool.h>

enum { MOST_CORES = CPU_SETSIZE };

int session_share_of_cores(const int32_t *may_run, const int32_t *rank_counts, int cores)
{
    double share = 0;
    for (int k = 0; k < cores; k++)
        if (may_run[k]) share += 1 / (double)rank_counts[k];
    share += 1e-6; /* eight eighths may be a little less than one */
    return share > 1 ? (int)share : 1;
}

/* False: the system does not say. */
static bool find_cores(int32_t may_run[MOST_CORES])
{
    cpu_set_t set;
    CPU_ZERO(&set);
    const bool is_known = sched_getaffinity(0, sizeof set, &set) == 0;
    for (int k = 0; k < MOST_CORES; k++) may_run[k] = is_known && CPU_ISSET((size_t)k, &set);
    return is_known;
}

int session_cores_of_rank(MPI_Comm node)
{
    int32_t own[MOST_CORES], all[MOST_CORES];
    int ranks = 1;
    MPI_Comm_size(node, &ranks);
    const bool is_known = find_cores(own);
    if (MPI_Allreduce(own, all, MOST_CORES, MPI_INT32_T, MPI_SUM, node) == MPI_SUCCESS && is_known)
        return session_share_of_cores(own, all, MOST_CORES);
    const int share = omp_get_num_procs() / ranks;
    return share > 1 ? share : 1;
}
