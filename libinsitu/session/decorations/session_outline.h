/* The boxes that an image's outline shows: around all data, around each mesh, or around each rank's data. */
#ifndef SESSION_OUTLINE_H
#define SESSION_OUTLINE_H

#include "insitu/image_output.h"
#include "scene.h"
#include "session_catalogue.h"
#include "session_neighbours.h"
#include "session_space.h"
#include "session_team.h"

typedef struct session_outline {
    int count; /* only on rank 0; 0: there is none */
    session_box *boxes;
} session_outline;

/* Finds the outline's boxes. Collective if they are those of meshes or of ranks. On an error nothing is left to
 * free. */
insitu_status session_find_outline(const scene_decorations *decorations, const session_catalogue *catalogue,
                                   const session_meshes *meshes, const session_extent *extent, const session_team *team,
                                   session_outline *out, base_error *error);

void session_free_outline(session_outline *outline);

#endif
