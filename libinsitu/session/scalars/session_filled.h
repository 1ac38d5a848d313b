/* Computes the values of fields by the caller's fill functions, in the steps that need these values. */
#ifndef SESSION_FILLED_H
#define SESSION_FILLED_H

#include "session_catalogue.h"
#include "session_mesh.h"

/* Calls the fill functions of the fields whose values are needed: if of_images is set, the fields that the images of
 * this step show; otherwise the fields that statistics need; in both cases also the fields from which derived fields
 * are computed. Functions that have been called in this step are not called again. All functions are called, even if
 * some fail, in the same order on all ranks. The first error is returned. Local, but fill functions may communicate. */
insitu_status session_fill_fields(session_meshes *meshes, const session_catalogue *catalogue, bool of_images,
                                  base_error *error);

/* Calls the field's fill function, if it has one, unless it was called in this step; in that case *error receives the
 * error of that call. Local, but the function may communicate. */
insitu_status session_fill_field(session_meshes *meshes, session_mesh *mesh, int index, base_error *error);

/* Must be called at the end of a step. Afterwards the session does not read the arrays that fill functions have set. */
void session_release_filled_arrays(const session_meshes *meshes);

#endif
