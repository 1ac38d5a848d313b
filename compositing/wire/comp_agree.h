/* One rank's failure is everybody's: no rank waits for another that gave up. */
#ifndef COMP_COMP_AGREE_H
#define COMP_COMP_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* Collective, one reduction. The worst status of all ranks, with a message that names the rank on those that were well.
 * *greatest (may be NULL) becomes the greatest of all ranks'. */
insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *greatest, base_error *error);

/* INSITU_OK, or INSITU_ERROR_MPI with MPI's own words. Local. */
insitu_status comp_mpi_status(int code, base_error *error);

#endif
