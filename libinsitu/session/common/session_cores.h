/* Counts how many of its node's cores a rank has for itself. */
#ifndef SESSION_CORES_H
#define SESSION_CORES_H

#include <mpi.h>
#include <stdint.h>

/* A rank's share of the cores that it may run on: a core on which several ranks may run counts for each of them in
 * part. may_run[k] tells whether this rank may run on core k; rank_counts[k] is the number of ranks that may. Rounded
 * down, and at least 1. Local. */
int session_share_of_cores(const int32_t *may_run, const int32_t *rank_counts, int cores);

/* Finds this rank's share among the ranks of its node. Where the system does not say on which cores a rank may run, the
 * cores that OpenMP counts are divided by the ranks. Collective over node. */
int session_cores_of_rank(MPI_Comm node);

#endif
