/* Folds a rank's samples and segments of a volume: blends them in the fixed order that fragment_fold.h defines, so that
 * the picture is bit-identical for any partition of the mesh. */
#ifndef RENDER_RENDER_FOLD_H
#define RENDER_RENDER_FOLD_H

#include <stdbool.h>

#include "fragment.h"
#include "render.h"

/* The state of one thread while it folds tiles (blends the volume fragments of their pixels). items, starts: buffers,
 * freed by render_folding_free(). The caller owns the job. */
typedef struct render_folding {
    const render_job *job;
    bool has_segments; /* set if volumes are integrated by segments, else by samples */
    fragment *items;
    int64_t capacity, *starts;
} render_folding;

/* Folds a tile's list of fragments: blends volume fragments in a fixed order, and replaces the list by the result.
 * Before, each sample or segment of the volume is one fragment of the list. fragment_fold.h divides a ray into
 * intervals and halves of intervals. If this rank certainly has all volume fragments that a pixel has in such an
 * interval or half, they are blended into one fragment.
 *
 * On input, the kind FRAGMENT_EARLY marks a fragment in front of which there may be a surface or fragments of other
 * ranks. A fragment of the kind FRAGMENT_LATE is an extra fragment that marks a ray on which cells overlap. Returns
 * false if memory ran out. */
bool render_fold(render_folding *folding, const pixel_area *area, fragment_list *list);

void render_folding_free(render_folding *folding);

#endif
