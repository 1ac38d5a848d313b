/* A rank that returned early would leave the others blocked in their next collective call. Therefore, after each phase
 * of a step, either all ranks end the step, or no rank does. If no error occurred, the agreement costs one
 * reduction of an integer. */
#include "session_agree.h"

#include <stdio.h>
#include <string.h>

insitu_status session_check_mpi(base_error *error, int code, const char *what)
{
    if (code == MPI_SUCCESS) return INSITU_OK;
    char reason[MPI_MAX_ERROR_STRING] = "";
    int length = 0;
    MPI_Error_string(code, reason, &length);
    return base_fail(error, INSITU_ERROR_MPI, "%s: %s", what, reason);
}

insitu_status session_fail_for_memory(base_error *error, int64_t bytes, const char *what)
{
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld bytes of %s", (long long)bytes, what);
}

insitu_status session_broadcast_error(MPI_Comm comm, int root, base_error *error)
{
    base_error shared = *error;
    const int code = MPI_Bcast(&shared, (int)sizeof shared, MPI_BYTE, root, comm);
    if (code != MPI_SUCCESS) return session_check_mpi(error, code, "MPI_Bcast");
    *error = shared;
    return error->status;
}

static void prefix_message_with_rank(int rank, base_error *error)
{
    char message[sizeof error->message];
    memcpy(message, error->message, sizeof message);
    const int prefix = snprintf(error->message, sizeof error->message, "rank %d: ", rank);
    snprintf(error->message + prefix, sizeof error->message - (size_t)prefix, "%.*s", (int)sizeof message - prefix - 1,
             message);
}

static insitu_status agree_on_error(MPI_Comm comm, base_error *error, int with_rank)
{
    int rank = 0, ranks = 1, first = 0;
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &ranks);
    const int mine = error->status == INSITU_OK ? ranks : rank;
    const int code = MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, comm);
    if (code != MPI_SUCCESS) return session_check_mpi(error, code, "MPI_Allreduce");
    if (first == ranks) return INSITU_OK;
    if (rank == first && with_rank) prefix_message_with_rank(rank, error);
    return session_broadcast_error(comm, first, error);
}

insitu_status session_agree(MPI_Comm comm, base_error *error)
{
    return agree_on_error(comm, error, 1);
}

insitu_status session_agree_without_rank(MPI_Comm comm, base_error *error)
{
    return agree_on_error(comm, error, 0);
}
