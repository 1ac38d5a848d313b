/* The contour lines of a layer: where their levels are. */
#ifndef SESSION_CONTOURS_H
#define SESSION_CONTOURS_H

#include "error.h"
#include "render.h"
#include "scene.h"
#include "session_mesh.h"
#include "session_team.h"

typedef struct session_contours {
    render_lines lines; /* count 0: there are none, as the field has no range */
    double values[RENDER_MAX_LINES];
    float colours[3 * RENDER_MAX_LINES];
} session_contours;

/* Makes all but the fields. colours: the transfer function of the layer's colours, whose range lines without values
 * cut; NULL: that of the field does. Collective, the same on all ranks. */
insitu_status session_make_contours(const session_meshes *meshes, const session_team *team, const scene_lines *in,
                                    const render_transfer *colours, session_contours *out, base_error *error);

#endif
