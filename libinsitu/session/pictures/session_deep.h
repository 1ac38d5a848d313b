/* Deep pictures: whether one is wanted, and rank 0's memory of it. */
#ifndef SESSION_DEEP_H
#define SESSION_DEEP_H

#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "image.h"
#include "render.h"
#include "scene.h"

/* Tells whether an output of the image is deep. */
bool session_wants_deep(const scene_image *image);

/* Begins a deep picture without samples. On rank 0; local. */
insitu_status session_begin_deep(deep_image *deep, const scene_image *image, base_error *error);

/* Turns depths, which compositing has as the rays' t, into distances along the camera's axis. Local. */
void session_finish_deep(deep_image *deep, const render_space *space, int threads);

/* Bytes that a deep picture of this size holds. */
int64_t session_deep_bytes(const deep_image *deep, int width, int height);

void session_free_deep(deep_image *deep);

#endif
