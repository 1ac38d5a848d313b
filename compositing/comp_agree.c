/* Statuses rise with no gravity, but any fixed choice among several failures will do: the largest, and of its ranks the
 * lowest, is what MPI_MAXLOC gives in one small reduction. */
#include "comp_agree.h"

insitu_status comp_mpi_status(int code, base_error *error)
{
    if (code == MPI_SUCCESS) return INSITU_OK;
    char text[MPI_MAX_ERROR_STRING] = "";
    int length = 0;
    MPI_Error_string(code, text, &length);
    return base_fail(error, INSITU_ERROR_MPI, "compositing: %s", text);
}

insitu_status comp_agree(MPI_Comm comm, insitu_status own, base_error *error)
{
    struct {
        int status, rank;
    } mine = {(int)own, 0}, worst = {0, 0};
    MPI_Comm_rank(comm, &mine.rank);
    const insitu_status status = comp_mpi_status(MPI_Allreduce(&mine, &worst, 1, MPI_2INT, MPI_MAXLOC, comm), error);
    if (status != INSITU_OK) return status;
    if (worst.status == INSITU_OK || (insitu_status)worst.status == own) return (insitu_status)worst.status;
    const char *what = worst.status == INSITU_ERROR_MEMORY ? "ran out of memory" : "failed";
    return base_fail(error, (insitu_status)worst.status, "compositing: rank %d %s (status %d)", worst.rank, what,
                     worst.status);
}
