/* Who works on a step: all ranks, and this rank's threads. */
#ifndef SESSION_TEAM_H
#define SESSION_TEAM_H

#include <mpi.h>

#include <stdbool.h>

#include "error.h"

typedef struct session_team {
    MPI_Comm comm;              /* the session's own; MPI's errors are returned */
    MPI_Comm compositing_comm;  /* on which compositing alone talks */
    struct comp_claims *claims; /* compositing's (comp.h); the session's */
    int rank, ranks;
    int node_ranks;      /* ranks on this rank's node, itself among them */
    int cores;           /* this rank's share of the node's (session_cores.h) */
    int each_node_ranks; /* ranks on every node, if all nodes have as many and ranks are placed node by node or in turn;
                            else 1 */
    bool is_round_nodes; /* ranks are placed in turn: neighbours in rank are on different nodes */
    int threads;         /* this rank's threads in this step; 0 before the first */
} session_team;

/* Duplicates the caller's communicator, twice. What was duplicated when an error came is in *out, to be freed.
 * Collective. */
insitu_status session_team_create(MPI_Comm comm, session_team *out, base_error *error);

/* Counts the ranks of this rank's node and its share of the cores, and finds how ranks lie on nodes. Collective. */
void session_team_count_node(session_team *team);

/* Frees the communicators. Collective, while MPI is running. */
void session_team_free(session_team *team);

#endif
