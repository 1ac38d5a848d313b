/* Ranks that are not bound to cores share all cores of the node. Ranks that are bound to a socket or a container share
 * its cores, and a rank that is bound to cores of its own does not share them. These cases are distinguished by the
 * sets of cores on which the ranks may run, no matter which program has bound the ranks. */
#define _GNU_SOURCE 1
#include "session_cores.h"

#include <omp.h>
#include <sched.h>
#include <stdbool.h>
#include <string.h>
#include <unistd.h>

enum { MOST_CORES = CPU_SETSIZE };

int session_compute_share_of_cores(const int32_t *may_run, const int32_t *rank_counts, int cores)
{
    double share = 0;
    for (int k = 0; k < cores; k++)
        if (may_run[k]) share += 1 / (double)rank_counts[k];
    share += 1e-6; /* added because rounding can make the sum of eight eighths slightly less than one */
    return share > 1 ? (int)share : 1;
}

/* Sets may_run[k] to 1 for each core k that belongs to an OpenMP place (OMP_PLACES). If there are places, the calling
 * thread's affinity mask cannot be used instead, because OpenMP has already bound this thread to the first place. */
static void mark_openmp_cores(int32_t may_run[MOST_CORES])
{
    for (int place = 0; place < omp_get_num_places(); place++) {
        int cores[MOST_CORES];
        const int count = omp_get_place_num_procs(place);
        if (count > MOST_CORES) continue;
        omp_get_place_proc_ids(place, cores);
        for (int k = 0; k < count; k++)
            if (cores[k] >= 0 && cores[k] < MOST_CORES) may_run[cores[k]] = 1;
    }
}

/* Sets may_run[k] to 1 for each core k on which this rank may run, and to 0 for all other cores. Returns false if the
 * operating system does not tell which cores these are. */
static bool find_allowed_cores(int32_t may_run[MOST_CORES])
{
    cpu_set_t set;
    CPU_ZERO(&set);
    memset(may_run, 0, MOST_CORES * sizeof *may_run);
    if (omp_get_num_places() > 0) {
        mark_openmp_cores(may_run);
        return true;
    }
    if (sched_getaffinity(0, sizeof set, &set)) return false;
    for (int k = 0; k < MOST_CORES; k++) may_run[k] = CPU_ISSET((size_t)k, &set);
    return true;
}

int session_count_cores_of_rank(MPI_Comm node)
{
    int32_t own[MOST_CORES] = {0}, all[MOST_CORES];
    int ranks = 1;
    MPI_Comm_size(node, &ranks);
    const bool is_known = find_allowed_cores(own);
    if (MPI_Allreduce(own, all, MOST_CORES, MPI_INT32_T, MPI_SUM, node) == MPI_SUCCESS && is_known)
        return session_compute_share_of_cores(own, all, MOST_CORES);
    /* a rank that may not run on all cores of the node is assumed to be bound to its own cores */
    const int cores = omp_get_num_procs(), share = cores / ranks;
    if (cores < sysconf(_SC_NPROCESSORS_ONLN)) return cores;
    return share > 1 ? share : 1;
}
