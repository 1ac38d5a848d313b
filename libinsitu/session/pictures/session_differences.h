/* Computes the normals of a frame's hits by central differences of the field, which all ranks sample in their cells. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Computes the normals and the lighting of the hits in job->waiting from the samples of all ranks, adds the hits to the
 * fragments, and frees the list. The time taken is added to *ms. If tracing has failed on this rank, *error must
 * contain the error before the call. Collective; all ranks return the same status. An error that occurs on this rank
 * after the last exchange of messages is only stored in *error; the next phase passes it to all ranks. */
insitu_status session_light_by_differences(MPI_Comm comm, const render_job *job, fragment_list *fragments, double *ms,
                                           base_error *error);

#endif
