/* Computes the normals of a frame's hits by central differences, over all ranks. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Computes the lighting of the hits in job->waiting from the samples of all ranks, adds them to the fragments, and
 * frees the list. The time taken is added to *ms. If tracing has failed on this rank, *error contains the error.
 * Collective; all ranks return the same status. An error that occurs on this rank at the very end is only stored in
 * *error, and is shared in the next phase. */
insitu_status session_differ_fragments(MPI_Comm comm, const render_job *job, fragment_list *fragments, double *ms,
                                       base_error *error);

#endif
