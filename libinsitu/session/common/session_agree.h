/* Ranks agree on an error.
 *
 * Every phase of a step is collective and ends here: it returns one status on all ranks, and where that is an error,
 * *error is the same on all of them. */
#ifndef SESSION_AGREE_H
#define SESSION_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* After a phase that may have failed on some ranks: *error becomes that of the lowest rank that failed, on every rank,
 * with "rank N: " in front. INSITU_OK where none did. Collective. */
insitu_status session_agree(MPI_Comm comm, base_error *error);

/* As session_agree(), but without "rank N: " in front, for errors that are no rank's own. Collective. */
insitu_status session_agree_as_is(MPI_Comm comm, base_error *error);

/* Give every rank the error of one. Collective. */
insitu_status session_share_error(MPI_Comm comm, int root, base_error *error);

/* Returns the status of an MPI call. Where the call failed, *error says what was called. Local. */
insitu_status session_mpi(base_error *error, int code, const char *what);

/* Record that memory ran out. Local. */
insitu_status session_no_memory(base_error *error, int64_t bytes, const char *what);

#endif
