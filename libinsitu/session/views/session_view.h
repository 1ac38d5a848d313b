/* The parts of an image that depend on the global bounds: camera, lights, sample distance. */
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
    render_occlusion occlusion; /* without lights and samples if the image has no occlusion */
    double step;
    int clip_count;
    render_clip clips[RENDER_MAX_CLIPS];
} session_view;

/* Computes the view. Fails, on all ranks alike, if the camera has no direction of view. If samples of the image's
 * volumes would take longer than its max_seconds by an estimate, which may differ between ranks, *error is set for the
 * next agreement. Warns of a camera that has no cells in view. scene_path: for messages. Local. */
insitu_status session_make_view(const session_space *space, const char *scene_path, const scene_image *image,
                                const session_team *team, session_report *report, session_view *out, base_error *error);

#endif
