/* Computes the renderer's camera from a scene's. */
#ifndef SESSION_CAMERA_H
#define SESSION_CAMERA_H

#include "render.h"
#include "scene.h"
#include "session_space.h"

/* Computes the camera. If the data has no extent along an axis (session_flat_axis()), an automatic camera looks along
 * this axis, is orthographic and fits the box, unless the scene sets something else.
 *
 * Returns false if the camera's position is equal to its focal point, or if the camera looks along its up direction.
 * Local; the result is the same on every rank. */
bool session_make_camera(const session_extent *extent, const scene_image *image, render_camera *out);

#endif
