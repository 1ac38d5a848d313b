#include "session_team.h"

#include "session_agree.h"
#include "session_cores.h"

bool session_is_mpi_running(void)
{
    int is_initialized = 0, is_finalized = 0;
    MPI_Initialized(&is_initialized);
    if (is_initialized) MPI_Finalized(&is_finalized);
    return is_initialized && !is_finalized;
}

insitu_status session_require_mpi(const char *call, base_error *error)
{
    if (session_is_mpi_running()) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MPI, "%s: MPI is not running", call);
}

static insitu_status duplicate_communicator(MPI_Comm comm, MPI_Comm *out, base_error *error)
{
    const insitu_status status = session_check_mpi(error, MPI_Comm_dup(comm, out), "MPI_Comm_dup");
    if (status) return status;
    return session_check_mpi(error, MPI_Comm_set_errhandler(*out, MPI_ERRORS_RETURN), "MPI_Comm_set_errhandler");
}

insitu_status session_team_create(MPI_Comm comm, session_team *out, base_error *error)
{
    *out = (session_team){
        .comm = MPI_COMM_NULL, .compositing_comm = MPI_COMM_NULL, .node_ranks = 1, .cores = 1, .ranks_per_node = 1};
    insitu_status status = duplicate_communicator(comm, &out->comm, error);
    if (!status) status = duplicate_communicator(out->comm, &out->compositing_comm, error);
    if (status) return status;
    MPI_Comm_rank(out->comm, &out->rank);
    MPI_Comm_size(out->comm, &out->ranks);
    return INSITU_OK;
}

/* Determines whether all nodes have the same number of ranks, and whether ranks are placed node by node or round-robin.
 * The results are stored only if all ranks find the same ones. */
static void find_rank_placement(session_team *team, MPI_Comm node)
{
    int within = 0, first = team->rank, all[4];
    MPI_Comm_rank(node, &within);
    MPI_Bcast(&first, 1, MPI_INT, 0, node);
    const int size = team->node_ranks, nodes = team->ranks / size;
    const bool is_after = first % size == 0 && team->rank == first + within;
    const bool is_round = first < nodes && team->rank == first + within * nodes;
    const int own[4] = {size, -size, !is_after, !is_round};
    if (MPI_Allreduce(own, all, 4, MPI_INT, MPI_MAX, team->comm) != MPI_SUCCESS) return;
    if (all[0] != -all[1] || team->ranks % size || (all[2] && all[3])) return;
    team->ranks_per_node = size;
    team->is_round_robin = all[2];
}

void session_team_find_node_layout(session_team *team)
{
    MPI_Comm node = MPI_COMM_NULL;
    team->node_ranks = 1;
    if (MPI_Comm_split_type(team->comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node) != MPI_SUCCESS) return;
    MPI_Comm_size(node, &team->node_ranks);
    team->cores = session_count_cores_of_rank(node);
    find_rank_placement(team, node);
    MPI_Comm_free(&node);
}

void session_team_free(session_team *team)
{
    if (team->compositing_comm != MPI_COMM_NULL) MPI_Comm_free(&team->compositing_comm);
    if (team->comm != MPI_COMM_NULL) MPI_Comm_free(&team->comm);
}
