/* Derived fields: fields that the session makes of the caller's, by the scene's word. They stand among the fields of
 * the meshes and of the catalogue, and layers, statistics and conditions know no difference. */
#ifndef SESSION_DERIVED_H
#define SESSION_DERIVED_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_plan.h"

/* Puts the scene's derived fields into the catalogue, on the meshes that have all that they are made of, and onto this
 * rank's meshes, where they are not there already. What is wrong with one is its fault in the catalogue. Call this
 * wherever the catalogue or the scene may be new. Collective, agreed. */
insitu_status session_name_derived(const scene *scene, const char *scene_path, session_catalogue *catalogue,
                                   session_meshes *meshes, const session_team *team, base_error *error);

/* The derived fields, a bit each, that the images of the plan need, or the statistics and conditions of a step, with
 * those that they are made of. images: conditions count. Local, the same on all ranks. */
uint64_t session_derived_of_plan(const scene *scene, const session_plan *plan);
uint64_t session_derived_of_events(const scene *scene, int64_t cycle, bool images);

/* Marks on this rank's meshes the fields that the derived ones are made of, so that they are filled and copied. */
void session_mark_sources(const scene *scene, uint64_t needed, const session_meshes *meshes);

/* Tells whether the field is made of one vector, whose components' gradients are taken. */
bool session_takes_vector(const scene_derived *derived);

/* The field's place in the scene's derived fields; -1: it is none of them. */
int session_find_derived(const scene *scene, const char *name);

#endif
