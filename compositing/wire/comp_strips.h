/* Groups a rank's fragments by strip of the picture. */
#ifndef COMP_COMP_STRIPS_H
#define COMP_COMP_STRIPS_H

#include <stdbool.h>

#include "comp_grid.h"
#include "comp_sheet.h"
#include "error.h"
#include "fragment.h"

/* Consecutive fragments of the list that belong to the same strip. */
typedef struct comp_range {
    uint32_t strip, first, count;
} comp_range;

typedef struct comp_strips {
    const comp_grid *grid;
    const fragment *items; /* fragments, borrowed from the fragment list */
    comp_range *ranges;    /* ranges of fragments, sorted by strip */
    uint32_t *starts; /* for each strip, the index of its first range in `ranges`; the last entry is the total number of
                         ranges */
} comp_strips;

/* Finds the ranges of each strip's fragments. The list and the grid must outlive *out. A fragment whose pixel is not in
 * the picture is an error. Local. */
insitu_status comp_strips_make(const comp_grid *grid, const fragment_list *items, comp_strips *out, base_error *error);

void comp_strips_free(comp_strips *strips);

/* Returns the number of the strip's fragments. */
int64_t comp_strips_count_fragments(const comp_strips *strips, uint32_t strip);

/* Buffers of one thread for comp_strips_pass_sheets(). A zeroed struct is empty. */
typedef struct comp_layers {
    comp_sheet sheet;
    /* for each pixel of the strip, the index of its first fragment in `order`; while fragments are listed, the index
     * behind its last fragment */
    uint32_t ends[COMP_STRIP_PIXELS + 1];
    const fragment **order;
    int64_t capacity;
} comp_layers;

void comp_layers_free(comp_layers *layers);

/* Callback that receives a sheet with `count` fragments; a return value of false ends the iteration. */
typedef bool comp_sheet_callback(void *state, const comp_sheet *sheet, int count);

/* Passes a strip's fragments to the callback in sheets: first the nearest fragment of every pixel, then the second
 * fragment of every pixel that has several, and so on. Returns false if memory ran out or the callback returned false.
 * Local; several threads may call it at once. */
bool comp_strips_pass_sheets(const comp_strips *strips, uint32_t strip, comp_layers *layers, comp_sheet_callback *take,
                             void *state);

#endif
