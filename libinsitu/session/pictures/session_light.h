/* Computes shadows and ambient occlusion at a frame's hits (points at which rays meet surfaces), from the surfaces of
 * all ranks. */
#ifndef SESSION_LIGHT_H
#define SESSION_LIGHT_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"
#include "render_light.h"

/* Computes the lighting of the fragments that were traced with RENDER_UNLIT, from the light that is not blocked by
 * opaque surfaces of any rank. *occluders are the occluders of this rank. They are created if *occluders is NULL, can
 * be used again for jobs that differ only in their pixels, and must be freed by the caller. The time taken is added to
 * *ms. Collective; all ranks return the same status. */
insitu_status session_light_fragments(MPI_Comm comm, const render_job *job, render_occluders **occluders,
                                      fragment_list *fragments, double *ms, base_error *error);

#endif
