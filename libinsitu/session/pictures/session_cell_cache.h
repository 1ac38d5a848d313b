/* Which of a step's images share a cache of the cells that isosurfaces cross (render.h: render_active_cells). */
#ifndef SESSION_CELL_CACHE_H
#define SESSION_CELL_CACHE_H

#include "session_plan.h"

/* Is an isosurface of the image drawn so often in this step, by this and others of the plan's images or frame by frame,
 * that caching its cells pays? Looks at the scene alone: the same on every rank. */
bool session_cell_cache_pays(const session_plan *plan, const scene_image *image);

#endif
