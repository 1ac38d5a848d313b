/* The numbers of statuses do not say which is worse, but any fixed choice among several failures will do. The largest
 * status, from the lowest rank that has it, is the maximum of one number: so the same reduction has room for another.
 */
#include "comp_agree.h"

insitu_status comp_mpi_status(int code, base_error *error)
{
    if (code == MPI_SUCCESS) return INSITU_OK;
    char text[MPI_MAX_ERROR_STRING] = "";
    int length = 0;
    MPI_Error_string(code, text, &length);
    return base_fail(error, INSITU_ERROR_MPI, "compositing: %s", text);
}

/* Returns the worst status, and on ranks whose own is another says whose it is. */
static insitu_status tell(insitu_status own, insitu_status worst, int64_t rank, base_error *error)
{
    if (worst == INSITU_OK || worst == own) return worst;
    const char *what = worst == INSITU_ERROR_MEMORY ? "ran out of memory" : "failed";
    return base_fail(error, worst, "compositing: rank %lld %s (status %d)", (long long)rank, what, (int)worst);
}

insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *greatest, base_error *error)
{
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    const int64_t mine[2] = {own ? ((int64_t)own << 32) - rank : 0, greatest ? *greatest : 0};
    int64_t all[2] = {0, 0};
    const insitu_status status = comp_mpi_status(MPI_Allreduce(mine, all, 2, MPI_INT64_T, MPI_MAX, comm), error);
    if (status != INSITU_OK) return status;
    if (greatest) *greatest = all[1];
    const insitu_status worst = (insitu_status)((all[0] + INT32_MAX) >> 32);
    return tell(own, worst, ((int64_t)worst << 32) - all[0], error);
}

insitu_status comp_agree_votes(MPI_Comm comm, insitu_status own, int64_t *greatest, int32_t *votes, int count,
                               base_error *error)
{
    enum { SHIFT = 20, MASK = (1 << SHIFT) - 1 };
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    votes[count] = own ? (int32_t)own << SHIFT | (MASK - (rank & MASK)) : 0;
    votes[count + 1] = (int32_t)(*greatest < INT32_MAX ? *greatest : INT32_MAX);
    const insitu_status status =
        comp_mpi_status(MPI_Allreduce(MPI_IN_PLACE, votes, count + 2, MPI_INT32_T, MPI_MAX, comm), error);
    if (status != INSITU_OK) return status;
    *greatest = votes[count + 1];
    return tell(own, (insitu_status)(votes[count] >> SHIFT), MASK - (votes[count] & MASK), error);
}
