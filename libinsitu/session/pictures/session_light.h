/* Shadows and ambient occlusion of a frame's hits, over all ranks. */
#ifndef SESSION_LIGHT_H
#define SESSION_LIGHT_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "render.h"
#include "render_light.h"

/* Makes fragments that were painted RENDER_UNLIT what they are by the light that comes to them past the opaque surfaces
 * of all ranks. *occluders: this rank's, made here if it is NULL, of this job or of one that differs from it in its
 * pixels alone; the caller frees them. *ms grows by what it took. Collective; agreed. */
insitu_status session_light_fragments(MPI_Comm comm, const render_job *job, render_occluders **occluders,
                                      fragment_list *fragments, double *ms, base_error *error);

#endif
