/* Determines the boxes whose edges are drawn as the outline of an image: around all data, around each mesh, or around
 * each rank's data. */
#ifndef SESSION_OUTLINE_H
#define SESSION_OUTLINE_H

#include "insitu/image_output.h"
#include "scene.h"
#include "session_catalogue.h"
#include "session_neighbours.h"
#include "session_space.h"
#include "session_team.h"

typedef struct session_outline {
    int count; /* number of boxes; set on rank 0 only; 0: there is no outline */
    session_box *boxes;
} session_outline;

/* Computes the boxes of the outline. Collective if there is a box per mesh or per rank. After an error there is nothing
 * to free. */
insitu_status session_find_outline(const scene_decorations *decorations, const session_catalogue *catalogue,
                                   const session_meshes *meshes, const session_extent *extent, const session_team *team,
                                   session_outline *out, base_error *error);

void session_free_outline(session_outline *outline);

#endif
