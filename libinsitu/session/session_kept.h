/* Which of a step's images share the cells of isosurfaces (render.h: render_active_cells). */
#ifndef SESSION_KEPT_H
#define SESSION_KEPT_H

#include "session_plan.h"

/* Is an isosurface of the image drawn so often in this step, by this and others of the plan's images or frame by frame,
 * that keeping its cells pays? Looks at the scene alone: the same on every rank. */
bool session_kept_pays(const session_plan *plan, const scene_image *image);

#endif
