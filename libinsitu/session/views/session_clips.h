/* What cuts the layers of an image. */
#ifndef SESSION_CLIPS_H
#define SESSION_CLIPS_H

#include "render.h"
#include "scene.h"
#include "session_report.h"
#include "session_space.h"

/* Make the renderer's clips of the image's. Local. */
void session_make_clips(const session_extent *extent, const scene_image *image, render_clip out[RENDER_MAX_CLIPS]);

/* Warn of layers that the clips leave nothing of: no place within the bounds of all cells. Local, the same everywhere.
 */
void session_warn_of_clips(const session_extent *extent, const scene_image *image, const render_clip *clips,
                           session_report *report);

#endif
