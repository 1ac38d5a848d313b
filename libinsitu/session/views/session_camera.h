/* Turns a scene's camera into the renderer's. */
#ifndef SESSION_CAMERA_H
#define SESSION_CAMERA_H

#include "render.h"
#include "scene.h"
#include "session_space.h"

/* Where the data is flat (session_flat_axis()), an automatic camera looks along that axis, is orthographic and fits the
 * box, as far as the scene does not say otherwise.
 *
 * False where the camera stands at its focal point, or looks along its up direction. Local; the same on every rank. */
bool session_make_camera(const session_extent *extent, const scene_image *image, render_camera *out);

#endif
