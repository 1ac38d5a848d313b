/* Adds derived fields to meshes. The session computes derived fields from the caller's fields as the scene defines.
 * They are stored among the fields of the meshes and of the catalogue; layers, statistics and conditions use them like
 * other fields. */
#ifndef SESSION_DERIVED_H
#define SESSION_DERIVED_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_plan.h"

/* Adds the scene's derived fields to the catalogue and to this rank's meshes, unless they have been added before. A
 * derived field is added to each mesh that has all fields on which it depends. If the field cannot be computed on a
 * mesh, the error is stored as its fault in the catalogue. Must be called whenever the catalogue or the scene may be
 * new. Collective; all ranks return the same status. */
insitu_status session_add_derived_fields(const scene *scene, const char *scene_path, session_catalogue *catalogue,
                                         session_meshes *meshes, const session_team *team, base_error *error);

/* Both functions return a set of derived fields as a bit mask with one bit per field, including the fields on which
 * these depend. session_find_derived_fields_of_plan() returns the fields that the images of the plan need.
 * session_find_derived_fields_of_events() returns the fields that the statistics of a step need and, if `images` is
 * set, those that the conditions of images need. Local, the same on all ranks. */
uint64_t session_find_derived_fields_of_plan(const scene *scene, const session_plan *plan);
uint64_t session_find_derived_fields_of_events(const scene *scene, int64_t cycle, bool images);

/* Marks on this rank's meshes the fields from which the needed derived fields are computed (session_field.is_source).
 * The values of marked fields are later requested from fill functions and copied if necessary. needed: one bit per
 * derived field. */
void session_mark_source_fields(const scene *scene, uint64_t needed, const session_meshes *meshes);

/* Returns whether the derived field is computed from the gradients of all components of a single vector field. Returns
 * false if the scene gives these components as a list of scalars. */
bool session_uses_gradient_of_vector_field(const scene_derived *derived);

#endif
