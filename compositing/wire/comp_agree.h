/* One rank's failure is everybody's: no rank waits for another that gave up. */
#ifndef COMP_COMP_AGREE_H
#define COMP_COMP_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* Returns the largest status of all ranks; ranks whose own is another get a message that names the rank. *greatest (may
 * be NULL) becomes the maximum over all ranks. Collective: one reduction. */
insitu_status comp_agree(MPI_Comm comm, insitu_status own, int64_t *greatest, base_error *error);

/* INSITU_OK, or INSITU_ERROR_MPI with MPI's own words. Local. */
insitu_status comp_mpi_status(int code, base_error *error);

#endif
