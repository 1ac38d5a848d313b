/* Computes the normals of a frame's hits by central differences of the samples of all ranks. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Computes the lighting of the hits in job->waiting, whose normals are not known yet, from the samples of all ranks;
 * adds the hits to the fragments, and frees the list. The time taken is added to *ms. If tracing has failed on this
 * rank, *error contains the error. Collective; all ranks return the same status. An error that occurs on this rank at
 * the very end is only stored in *error, and passed to all ranks in the next phase. */
insitu_status session_light_by_differences(MPI_Comm comm, const render_job *job, fragment_list *fragments, double *ms,
                                           base_error *error);

#endif
