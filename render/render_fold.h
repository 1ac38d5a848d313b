/* Folds a rank's samples and segments of a volume: blends them in the fixed order that fragment_fold.h defines, so that
 * the picture has the same bits on any partition. */
#ifndef RENDER_RENDER_FOLD_H
#define RENDER_RENDER_FOLD_H

#include <stdbool.h>

#include "fragment.h"
#include "render.h"

/* The state of one thread while it folds tiles. It owns its buffers; the job is borrowed. */
typedef struct render_folding {
    const render_job *job;
    bool has_segments; /* set if volumes are integrated by segments, else by samples */
    fragment *items;
    int64_t capacity, *starts;
} render_folding;

/* Folds the list of a tile's fragments, each of which is one sample or segment. If this rank has
 * all of a pixel's volume fragments in a halved interval of fragment_fold.h, they become one fragment. FRAGMENT_EARLY
 * marks a fragment in front of which a surface or another rank's fragment may lie; FRAGMENT_LATE marks overlapping
 * cells. Returns false if memory ran out. */
bool render_fold(render_folding *folding, const pixel_area *area, fragment_list *list);

void render_folding_free(render_folding *folding);

#endif
