/* Computes the number of cores that a rank has for itself on its node. */
#ifndef SESSION_CORES_H
#define SESSION_CORES_H

#include <mpi.h>
#include <stdint.h>

/* Returns a rank's share of the cores on which it may run, rounded down, but at least 1. A core on which N ranks may
 * run counts as 1/N for each of them. may_run[k] is set if this rank may run on core k; rank_counts[k] is the number of
 * ranks that may run on it. Local. */
int session_compute_share_of_cores(const int32_t *may_run, const int32_t *rank_counts, int cores);

/* Returns this rank's share of the cores among the ranks of its node. If the operating system does not tell on which
 * cores the rank may run, the number of cores that OpenMP finds is used: it is divided by the number of ranks on the
 * node or, if OpenMP finds fewer cores than the node has, not divided, because these cores are then assumed to belong
 * to this rank alone. Collective over the communicator node. */
int session_count_cores_of_rank(MPI_Comm node);

#endif
