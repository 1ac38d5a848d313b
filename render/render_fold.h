/* What a rank sends of a volume that is to be the same to the bit on any partition. */
#ifndef RENDER_RENDER_FOLD_H
#define RENDER_RENDER_FOLD_H

#include <stdbool.h>

#include "fragment.h"
#include "render.h"

/* A thread's; all else is its own. */
typedef struct render_folding {
    const render_job *job;
    bool has_segments; /* else samples */
    fragment *items;
    int64_t capacity, *starts;
} render_folding;

/* A tile's fragments, of the list from the first on, where each sample or segment is one: those of volumes that a pixel
 * has of one half of a stretch, all of which this rank has, become one (fragment_fold.h). FRAGMENT_EARLY says that
 * something of another rank, or a surface, may come before, FRAGMENT_LATE that it marks where cells overlap. False
 * where memory ran out. */
bool render_fold(render_folding *folding, const pixel_area *area, fragment_list *list, int64_t first);

void render_folding_free(render_folding *folding);

#endif
