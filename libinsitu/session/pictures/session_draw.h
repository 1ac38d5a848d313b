/* The plan's images to pictures on rank 0. */
#ifndef SESSION_DRAW_H
#define SESSION_DRAW_H

#include "session_mesh.h"
#include "session_picture.h"
#include "session_plan.h"
#include "session_report.h"
#include "session_space.h"
#include "session_team.h"

/* What images are drawn of. */
typedef struct session_drawing {
    const session_team *team;
    const char *scene_path; /* for messages */
    int64_t cycle;
    const session_meshes *meshes; /* with their trees */
    const mmbvh *parent;          /* over these trees (session_trees.h) */
    const session_space *space;
    session_report *report;
} session_drawing;

/* Draw and write the plan's images. One that fails is left out; the first reason, the plan's refusal before all others,
 * is the error. Collective. */
insitu_status session_draw_images(const session_drawing *d, const session_plan *plan, session_picture *picture,
                                  base_error *error);

#endif
