/* What of an image depends on the global bounds: camera, lights, sample distance; and transfer functions. */
#ifndef SESSION_VIEW_H
#define SESSION_VIEW_H

#include "session.h"

typedef struct session_view {
    render_camera camera;
    render_space space;
    render_light lights[RENDER_MAX_LIGHTS];
    double step;
} session_view;

typedef struct session_transfer {
    render_transfer transfer; /* points into this */
    double opacity_values[RENDER_MAX_OPACITY_POINTS];
    float opacities[RENDER_MAX_OPACITY_POINTS];
} session_transfer;

/* The same on every rank; fails where the camera looks nowhere. Local. */
insitu_status session_make_view(const insitu_session *session, const scene_image *image, session_view *out,
                                base_error *error);

/* Fails where the samples of the image's volumes would take longer than its max_seconds, by estimate. Local. */
insitu_status session_check_time(const insitu_session *session, const scene_image *image, const session_view *view,
                                 base_error *error);

/* low > high: there are no values. Local. */
insitu_status session_make_transfer(const insitu_session *session, scene_colour_map map, double low, double high,
                                    const scene_volume *volume, session_transfer *out, base_error *error);

#endif
