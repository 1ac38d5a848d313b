/* Agreement on a status over all ranks: an error on one rank becomes an error on all, so that no rank waits for another
 * that has stopped. */
#ifndef COMP_COMP_AGREE_H
#define COMP_COMP_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "comp_grid.h"
#include "error.h"

/* The buffer in which ranks agree on the owners of blocks, and the MPI operation that adds claims. Both are allocated
 * once per session, so that a rank that runs out of memory for a picture can still take part in the agreement on its
 * status. */
typedef struct comp_claims {
    MPI_Op add;
    comp_claim items[]; /* one claim per block; two further entries serve to reduce the status and the maximum together
                           with the claims */
} comp_claims;

/* Allocates a buffer that is large enough for the claims to any picture shared by this number of ranks. Returns NULL if
 * memory ran out. Local. comp_claims_free() may be called after MPI_Finalize(). */
comp_claims *comp_claims_create(int ranks);
void comp_claims_free(comp_claims *claims);

/* Returns the largest status of all ranks. Ranks whose own status differs get a message that names the failed rank.
 * *maximum is replaced by its maximum over all ranks; maximum may be NULL. Collective: one reduction. */
insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *maximum, base_error *error);

/* Returns the largest status of all ranks and replaces *maximum by its maximum over all ranks, like comp_agree(). The
 * same reduction adds up the first `count` claims over all ranks. *maximum is limited to INT32_MAX. With more than 2^20
 * ranks the error message may name a wrong rank. Collective. */
insitu_status comp_agree_claims(MPI_Comm comm, insitu_status own, int64_t *maximum, comp_claims *claims, int count,
                                base_error *error);

/* Converts an MPI error code: returns INSITU_OK, or INSITU_ERROR_MPI with the text of MPI_Error_string(). Local. */
insitu_status comp_convert_mpi_error(int code, base_error *error);

#endif
