/* Computes those parts of an image that depend on the global bounds: camera, lights and sampling distance. */
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
    render_occlusion occlusion; /* parameters of ambient occlusion; all 0 if the image has none */
    double step;
    int clip_count;
    render_clip clips[RENDER_MAX_CLIPS];
} session_view;

/* Computes the view. Fails, on all ranks alike, if the camera has no direction of view. If the samples of the image's
 * volumes are estimated to take longer than its max_seconds, *error is set; as the estimate may differ between ranks,
 * it is shared in the next phase. Warns of a camera that has no cells in view. scene_path is used in messages.
 * Local. */
insitu_status session_make_view(const session_space *space, const char *scene_path, const scene_image *image,
                                const session_team *team, session_report *report, session_view *out, base_error *error);

#endif
