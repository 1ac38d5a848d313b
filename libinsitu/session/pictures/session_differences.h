/* Normals by central differences of a frame's hits, over all ranks. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Lights the hits of job->waiting by the samples of all ranks, adds them to fragments, and frees the list. Adds the
 * time taken to *ms. *error may hold an error of tracing on some ranks. Collective, agreed; an error of this rank at
 * the very end is stored only in *error, for the next phase to agree on. */
insitu_status session_differ_fragments(MPI_Comm comm, const render_job *job, fragment_list *fragments, double *ms,
                                       base_error *error);

#endif
