/* Computes how many of its node's cores a rank has for itself. */
#ifndef SESSION_CORES_H
#define SESSION_CORES_H

#include <mpi.h>
#include <stdint.h>

/* Returns a rank's share of the cores on which it may run, rounded down, and at least 1. A core on which several ranks
 * may run counts for each of them in part. may_run[k]: whether this rank may run on core k; rank_counts[k]: number of
 * ranks that may. Local. */
int session_share_of_cores(const int32_t *may_run, const int32_t *rank_counts, int cores);

/* Returns this rank's share among the ranks of its node. If the system does not provide the cores on which a rank may
 * run, the cores that OpenMP counts are divided by the ranks. Collective over node. */
int session_cores_of_rank(MPI_Comm node);

#endif
