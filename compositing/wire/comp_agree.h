/* One rank's failure is everybody's: no rank waits for another that gave up. */
#ifndef COMP_COMP_AGREE_H
#define COMP_COMP_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "comp_grid.h"
#include "error.h"

/* The memory in which ranks agree on owners, and the operation by which MPI adds claims. Both are made once, because a
 * rank that lacks memory for a picture has to take part in the agreement on its status. */
typedef struct comp_claims {
    MPI_Op add;
    comp_claim items[]; /* one per block, and two more */
} comp_claims;

/* Makes what so many ranks need for any picture; NULL: no memory. Local. May be freed after MPI_Finalize(). */
comp_claims *comp_claims_create(int ranks);
void comp_claims_free(comp_claims *claims);

/* Returns the largest status of all ranks; ranks whose own is another get a message that names the rank. *greatest (may
 * be NULL) becomes the maximum over all ranks. Collective: one reduction. */
insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *greatest, base_error *error);

/* The same, and each of so many claims becomes that of all ranks, in the same reduction. *greatest is taken for
 * INT32_MAX if it is more. Of more than 2^20 ranks some are taken for others in messages. */
insitu_status comp_agree_claims(MPI_Comm comm, insitu_status own, int64_t *greatest, comp_claims *claims, int count,
                                base_error *error);

/* INSITU_OK, or INSITU_ERROR_MPI with MPI's own words. Local. */
insitu_status comp_mpi_status(int code, base_error *error);

#endif
