/* Computes the camera, the lights and the sampling distance of an image, which depend on the global bounds. */
#ifndef SESSION_VIEW_H
#define SESSION_VIEW_H

#include "render.h"
#include "scene.h"
#include "session_report.h"
#include "session_space.h"
#include "session_team.h"

typedef struct session_view {
    render_camera camera;
    render_space space;
    render_light lights[RENDER_MAX_LIGHTS];
    render_occlusion occlusion; /* parameters of ambient occlusion and shadows */
    double step;                /* distance between the samples of volumes, in scene units */
    int clip_count;
    render_clip clips[RENDER_MAX_CLIPS];
} session_view;

/* Computes the view. If the camera has no direction of view, returns an error, which is the same on all ranks. If the
 * samples of the image's volumes are estimated to take longer than max_seconds, only *error is set; since the estimate
 * may differ between ranks, the next phase passes the error to all ranks. Warns of a camera that has no cells in view.
 * scene_path: path for messages. Local. */
insitu_status session_make_view(const session_space *space, const char *scene_path, const scene_image *image,
                                const session_team *team, session_report *report, session_view *out, base_error *error);

#endif
