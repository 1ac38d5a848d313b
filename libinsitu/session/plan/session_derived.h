/* Adds derived fields, which the session computes from the caller's fields as the scene defines them. They are stored
 * among the fields of the meshes and of the catalogue; layers, statistics and conditions use them like other fields. */
#ifndef SESSION_DERIVED_H
#define SESSION_DERIVED_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_plan.h"

/* Adds the scene's derived fields to the catalogue, for the meshes that have all fields on which they depend, and to
 * this rank's meshes, unless they have been added before. A derived field's error is stored as its fault in the
 * catalogue. Must be called whenever the catalogue or the scene may be new. Collective; all ranks return the same
 * status. */
insitu_status session_add_derived_fields(const scene *scene, const char *scene_path, session_catalogue *catalogue,
                                         session_meshes *meshes, const session_team *team, base_error *error);

/* Return sets of derived fields, one bit each, including the fields on which they depend. session_derived_of_plan()
 * returns those that the images of the plan need; session_derived_of_events() those that are needed by the statistics
 * of a step and, if `images` is set, by the conditions of images. Local, the same on all ranks. */
uint64_t session_derived_of_plan(const scene *scene, const session_plan *plan);
uint64_t session_derived_of_events(const scene *scene, int64_t cycle, bool images);

/* Marks on this rank's meshes the fields on which the needed derived fields depend, so that they are filled and
 * copied. */
void session_mark_sources(const scene *scene, uint64_t needed, const session_meshes *meshes);

/* Returns whether the derived field is computed from the gradients of a vector's components. */
bool session_needs_vector(const scene_derived *derived);

#endif
