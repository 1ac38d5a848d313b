/* Fields whose values a function of the caller's makes, in the steps that need them. */
#ifndef SESSION_FILLED_H
#define SESSION_FILLED_H

#include "session_catalogue.h"
#include "session_mesh.h"

/* Have the values made that are wanted, or, of images, that scalars in use are of, and were not yet made in this step:
 * all, though some fail, in an order that is the same on all ranks; the first error is told. Local, but what is called
 * may communicate. */
insitu_status session_fill_fields(const session_meshes *meshes, const session_catalogue *catalogue, bool of_images,
                                  base_error *error);

/* The step is over: what was made in it is the caller's again. */
void session_forget_filled(const session_meshes *meshes);

#endif
