/* Computes the normals of a frame's hits (points at which rays meet isosurfaces) by central differences of the field. A
 * difference needs samples of the field beside the hit, which may lie in cells of other ranks. */
#ifndef SESSION_DIFFERENCES_H
#define SESSION_DIFFERENCES_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"

/* Computes the normals and the lighting of the hits in job->waiting, the list of hits whose normals are not known yet,
 * from the samples of all ranks. Then adds the hits to the fragments, and frees the list. The time taken is added to
 * *ms. If tracing has failed on this rank, *error must contain the error before the call. Collective; all ranks return
 * the same status. An error that occurs on this rank after the last exchange of messages is only stored in *error; the
 * next phase passes it to all ranks. */
insitu_status session_light_hits_by_differences(MPI_Comm comm, const render_job *job, fragment_list *fragments,
                                                double *ms, base_error *error);

#endif
