/* Folds a rank's samples and segments of a volume so that the picture is the same to the bit on any partition. */
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

/* Folds a tile's fragments, those of the list from `first` on, each of which is one sample or segment. The volume
 * fragments of a pixel in a halved interval become one fragment if this rank has all of them (fragment_fold.h).
 * FRAGMENT_EARLY marks a fragment in front of which a surface or another rank's fragment may lie; FRAGMENT_LATE marks
 * overlapping cells. Returns false if memory ran out. */
bool render_fold(render_folding *folding, const pixel_area *area, fragment_list *list, int64_t first);

void render_folding_free(render_folding *folding);

#endif
