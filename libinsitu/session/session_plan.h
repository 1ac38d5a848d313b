/* From the due images to what they need of the meshes. */
#ifndef SESSION_PLAN_H
#define SESSION_PLAN_H

#include "session.h"

/* Cell values that a layer wants at vertices; one item a mesh, field and component. */
typedef struct session_recentring {
    const session_catalogue_mesh *mesh;
    const char *field;
    int component; /* as grid_field.component */
} session_recentring;

/* The same on every rank. Borrows from the scene and the catalogue. */
typedef struct session_plan {
    int image_count; /* that can be drawn */
    const scene_image **images;
    int recentring_count;
    session_recentring *recentrings;
} session_plan;

/* Which of the due images can be drawn, and marks on this rank's meshes and scalars what they need. refusal gets the
 * reason of the first image that cannot be drawn; it is the same on every rank. Collective. */
insitu_status session_make_plan(insitu_session *session, const scene_image *const *due, int count, session_plan *out,
                                base_error *refusal, base_error *error);

void session_plan_free(session_plan *plan);

/* This rank's scalar for a layer's field: NULL where the mesh does not have it. */
session_scalar *session_find_scalar(const session_mesh *mesh, const scene_field *field);

/* The values of a scalar. */
grid_field session_scalar_field(const session_mesh *mesh, const session_scalar *scalar);

#endif
