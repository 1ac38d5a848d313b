/* Converts the clips of an image to the renderer's form. A clip is a half space, box or sphere that cuts away a part of
 * layers. */
#ifndef SESSION_CLIPS_H
#define SESSION_CLIPS_H

#include "render.h"
#include "scene.h"
#include "session_report.h"
#include "session_space.h"

/* Converts the image's clips to the renderer's form. Local. */
void session_make_clips(const session_extent *extent, const scene_image *image, render_clip out[RENDER_MAX_CLIPS]);

/* Warns of layers that are cut away completely: the clips leave no point within the bounds of all cells. Local; the
 * result is the same on every rank. */
void session_warn_of_layers_clipped_away(const session_extent *extent, const scene_image *image,
                                         const render_clip *clips, session_report *report);

#endif
