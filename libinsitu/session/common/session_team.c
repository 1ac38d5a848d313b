#include "session_team.h"

#include "session_agree.h"

static insitu_status duplicate(MPI_Comm comm, MPI_Comm *out, base_error *error)
{
    const insitu_status status = session_mpi(error, MPI_Comm_dup(comm, out), "MPI_Comm_dup");
    if (status) return status;
    return session_mpi(error, MPI_Comm_set_errhandler(*out, MPI_ERRORS_RETURN), "MPI_Comm_set_errhandler");
}

insitu_status session_team_create(MPI_Comm comm, session_team *out, base_error *error)
{
    *out = (session_team){.comm = MPI_COMM_NULL, .compositing_comm = MPI_COMM_NULL, .node_ranks = 1};
    insitu_status status = duplicate(comm, &out->comm, error);
    if (!status) status = duplicate(out->comm, &out->compositing_comm, error);
    if (status) return status;
    MPI_Comm_rank(out->comm, &out->rank);
    MPI_Comm_size(out->comm, &out->ranks);
    return INSITU_OK;
}

void session_team_count_node(session_team *team)
{
    MPI_Comm node = MPI_COMM_NULL;
    team->node_ranks = 1;
    if (MPI_Comm_split_type(team->comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node) != MPI_SUCCESS) return;
    MPI_Comm_size(node, &team->node_ranks);
    MPI_Comm_free(&node);
}

void session_team_free(session_team *team)
{
    if (team->compositing_comm != MPI_COMM_NULL) MPI_Comm_free(&team->compositing_comm);
    if (team->comm != MPI_COMM_NULL) MPI_Comm_free(&team->comm);
}
