/* Normals by central differences of a frame's hits, over all ranks. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Lights the hits of job->waiting by the samples of all ranks and adds them to fragments; the list is freed. *ms grows
 * by what it took. *error may have come from tracing on some ranks. Collective, agreed, but for what fails on this rank
 * at the very end: then *error alone has it, for the next phase to agree on. */
insitu_status session_differ_fragments(MPI_Comm comm, const render_job *job, fragment_list *fragments, double *ms,
                                       base_error *error);

#endif
