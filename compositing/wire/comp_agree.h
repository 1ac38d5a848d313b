/* One rank's failure is everybody's: no rank waits for another that gave up. */
#ifndef COMP_COMP_AGREE_H
#define COMP_COMP_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* Returns the largest status of all ranks; ranks whose own is another get a message that names the rank. *greatest (may
 * be NULL) becomes the maximum over all ranks. Collective: one reduction. */
insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *greatest, base_error *error);

/* The same, and each of so many votes becomes its maximum over all ranks (comp_grid.h), in the same reduction.
 * *greatest is taken for INT32_MAX if it is more. votes has room for two more. Of more than 2^20 ranks some are taken
 * for others in messages. */
insitu_status comp_agree_votes(MPI_Comm comm, insitu_status own, int64_t *greatest, int32_t *votes, int count,
                               base_error *error);

/* INSITU_OK, or INSITU_ERROR_MPI with MPI's own words. Local. */
insitu_status comp_mpi_status(int code, base_error *error);

#endif
