/* Agreement of all ranks on an error.
 *
 * Every phase of a step is collective and ends here: it returns one status on all ranks, and if that is an error,
 * *error is the same on all of them. */
#ifndef SESSION_AGREE_H
#define SESSION_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* Ends a phase that may have failed on some ranks: *error becomes that of the lowest rank that failed, on every rank,
 * preceded by "rank N: ". Returns INSITU_OK if no rank failed. Collective. */
insitu_status session_agree(MPI_Comm comm, base_error *error);

/* As session_agree(), but without "rank N: ", for errors that do not belong to a rank. Collective. */
insitu_status session_agree_as_is(MPI_Comm comm, base_error *error);

/* Copies one rank's error to every rank. Collective. */
insitu_status session_share_error(MPI_Comm comm, int root, base_error *error);

/* Returns the status of an MPI call. If the call failed, *error names `what` and MPI's reason. Local. */
insitu_status session_mpi(base_error *error, int code, const char *what);

/* Records that memory ran out. Local. */
insitu_status session_no_memory(base_error *error, int64_t bytes, const char *what);

#endif
