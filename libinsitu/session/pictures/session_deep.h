/* Determines whether an image needs a deep picture, and manages the memory of deep pictures on rank 0. A deep
 * picture stores all samples of each pixel, that is, the surfaces and volume intervals along the pixel's ray,
 * sorted by depth. */
#ifndef SESSION_DEEP_H
#define SESSION_DEEP_H

#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "image.h"
#include "render.h"
#include "scene.h"

/* Returns whether an output of the image is deep. */
bool session_needs_deep_samples(const scene_image *image);

/* Initializes a deep picture without samples. Called on rank 0 only. Local. */
insitu_status session_create_deep_image(deep_image *deep, const scene_image *image, base_error *error);

/* Converts depths from the ray parameter t, which compositing uses, to distances along the camera's axis. Local. */
void session_convert_deep_depths(deep_image *deep, const render_space *space, int threads);

/* Returns the size of a deep picture in bytes. */
int64_t session_deep_bytes(const deep_image *deep, int width, int height);

void session_free_deep_image(deep_image *deep);

#endif
