/* Shadows and ambient occlusion of a frame's hits, over all ranks. */
#ifndef SESSION_LIGHT_H
#define SESSION_LIGHT_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"
#include "render_light.h"

/* Lights fragments that were painted RENDER_UNLIT by the light that reaches them past the opaque surfaces of all ranks.
 * *occluders: this rank's; created here if NULL, and valid for jobs that differ only in their pixels; the caller frees
 * them. Adds the time taken to *ms. Collective; agreed. */
insitu_status session_light_fragments(MPI_Comm comm, const render_job *job, render_occluders **occluders,
                                      fragment_list *fragments, double *ms, base_error *error);

#endif
