/* If several ranks fail with different statuses, all ranks return the status with the largest number. This status is
 * not the most severe one; the rule only makes the choice deterministic. The status and the lowest rank that has it are
 * encoded in one number, so that a single reduction by maximum finds both and can also reduce a second number. */
#include "comp_agree.h"

#include "memory.h"

insitu_status comp_convert_mpi_error(int code, base_error *error)
{
    if (code == MPI_SUCCESS) return INSITU_OK;
    char text[MPI_MAX_ERROR_STRING] = "";
    int length = 0;
    MPI_Error_string(code, text, &length);
    return base_fail(error, INSITU_ERROR_MPI, "compositing: %s", text);
}

/* Returns the largest status of all ranks, `worst`. If this rank's status `own` is a different one, *error receives a
 * message that names the rank that failed. */
static insitu_status report_status(insitu_status own, insitu_status worst, int64_t rank, base_error *error)
{
    if (worst == INSITU_OK || worst == own) return worst;
    const char *what = worst == INSITU_ERROR_MEMORY ? "ran out of memory" : "failed";
    return base_fail(error, worst, "compositing: rank %lld %s (status %d)", (long long)rank, what, (int)worst);
}

insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *maximum, base_error *error)
{
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    const int64_t mine[2] = {own ? ((int64_t)own << 32) - rank : 0, maximum ? *maximum : 0};
    int64_t all[2] = {0, 0};
    const insitu_status status = comp_convert_mpi_error(MPI_Allreduce(mine, all, 2, MPI_INT64_T, MPI_MAX, comm), error);
    if (status != INSITU_OK) return status;
    if (maximum) *maximum = all[1];
    const insitu_status worst = (insitu_status)((all[0] + INT32_MAX) >> 32);
    return report_status(own, worst, ((int64_t)worst << 32) - all[0], error);
}

/* The MPI_User_function that adds claims, each of which is a pair of int. */
static void add_claims(void *in, void *sum, int *count, MPI_Datatype *type)
{
    const comp_claim *const added = in;
    comp_claim *const sums = sum;
    (void)type;
    for (int i = 0; i < *count; i++) comp_claim_add(&added[i], &sums[i]);
}

_Static_assert(sizeof(comp_claim) == 2 * sizeof(int), "a claim is MPI_2INT");

comp_claims *comp_claims_create(int ranks)
{
    comp_claims *claims = base_alloc(sizeof *claims + (comp_max_blocks(ranks) + 2) * sizeof *claims->items);
    if (!claims || MPI_Op_create(add_claims, 1, &claims->add) == MPI_SUCCESS) return claims;
    base_free(claims);
    return NULL;
}

void comp_claims_free(comp_claims *claims)
{
    int is_finalized = 0;
    MPI_Finalized(&is_finalized);
    if (claims && !is_finalized) MPI_Op_free(&claims->add);
    base_free(claims);
}

insitu_status comp_agree_claims(MPI_Comm comm, insitu_status own, int64_t *maximum, comp_claims *claims, int count,
                                base_error *error)
{
    enum { SHIFT = 20, MASK = (1 << SHIFT) - 1 };
    comp_claim *const items = claims->items;
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    items[count] = (comp_claim){own ? (int32_t)own << SHIFT | (MASK - (rank & MASK)) : 0, 0};
    items[count + 1] = (comp_claim){(int32_t)(*maximum < INT32_MAX ? *maximum : INT32_MAX), 0};
    const insitu_status status =
        comp_convert_mpi_error(MPI_Allreduce(MPI_IN_PLACE, items, count + 2, MPI_2INT, claims->add, comm), error);
    if (status != INSITU_OK) return status;
    *maximum = items[count + 1].priority;
    return report_status(own, (insitu_status)(items[count].priority >> SHIFT), MASK - (items[count].priority & MASK),
                         error);
}
