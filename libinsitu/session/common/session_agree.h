/* Functions by which all ranks agree on an error.
 *
 * Every phase of a step is collective and ends with one of these functions. They return the same status on all ranks;
 * if it is an error, *error is also the same on all of them. */
#ifndef SESSION_AGREE_H
#define SESSION_AGREE_H

#include <mpi.h>
#include <stdint.h>

#include "error.h"

/* Ends a phase that may have failed on some ranks. *error becomes, on every rank, the error of the lowest rank that
 * failed, preceded by "rank N: ". Returns INSITU_OK if no rank failed. Collective. */
insitu_status session_agree(MPI_Comm comm, base_error *error);

/* Ends a phase in the same way as session_agree(), but does not put "rank N: " in front of the message. It is used for
 * errors that are not specific to a rank. Collective. */
insitu_status session_agree_without_rank(MPI_Comm comm, base_error *error);

/* Copies the error of the rank `root` to every rank. Collective. */
insitu_status session_broadcast_error(MPI_Comm comm, int root, base_error *error);

/* Converts the return code of an MPI call to a status. If the call failed, *error contains `what` and MPI's reason.
 * Local. */
insitu_status session_check_mpi(base_error *error, int code, const char *what);

/* Stores the error that there was no memory for `bytes` bytes of `what`, and returns its status. Local. */
insitu_status session_fail_for_memory(base_error *error, int64_t bytes, const char *what);

#endif
