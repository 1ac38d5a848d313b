/* Which of a step's images share their active cells: those that isosurfaces cross (render.h: render_active_cells). */
#ifndef SESSION_ACTIVE_CELLS_H
#define SESSION_ACTIVE_CELLS_H

#include "session_plan.h"

/* Is an isosurface of the image drawn so often in this step, by this and others of the plan's images or frame by frame,
 * that storing its active cells pays? Looks at the scene alone: the same on every rank. */
bool session_active_cells_pay(const session_plan *plan, const scene_image *image);

#endif
