/* The ranks and threads that work on a step. */
#ifndef SESSION_TEAM_H
#define SESSION_TEAM_H

#include <mpi.h>

#include <stdbool.h>

#include "error.h"

typedef struct session_team {
    MPI_Comm comm;              /* the session's own communicator; its error handler returns errors */
    MPI_Comm compositing_comm;  /* communicator that is used only by compositing */
    struct comp_claims *claims; /* buffer in which the ranks agree, during compositing, on the rank that blends each
                                 * block of pixels (comp.h); owned by the session */
    int rank, ranks;
    int node_ranks; /* number of ranks on this rank's node, including itself */
    int cores;      /* this rank's share of the node's cores (session_cores.h) */
    /* number of ranks on every node, if it is the same on all nodes and ranks are placed node by node or
     * round-robin; otherwise 1 */
    int ranks_per_node;
    bool is_round_robin; /* set if ranks are placed round-robin, so that consecutive ranks are on different nodes */
    int threads;         /* number of this rank's threads in this step; 0 before the first step */
} session_team;

/* Returns whether MPI has been initialized and not been finalized. Local. */
bool session_is_mpi_running(void);

/* Stores the error that `call` needs MPI, if MPI is not running. Calls that communicate must check this first, because
 * MPI aborts the process if it is called at any other time. Local. */
insitu_status session_require_mpi(const char *call, base_error *error);

/* Creates two duplicates of the caller's communicator. Even after an error, the caller must free *out, which then
 * contains the communicators that were created. Collective. */
insitu_status session_team_create(MPI_Comm comm, session_team *out, base_error *error);

/* Determines the number of ranks on this rank's node, its share of the cores, and how ranks are placed on nodes.
 * Collective. */
void session_team_find_node_layout(session_team *team);

/* Frees the communicators. MPI must not have been finalized. Collective. */
void session_team_free(session_team *team);

#endif
