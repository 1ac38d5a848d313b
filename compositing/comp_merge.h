/* Merges as comp_merge.c does, but returns the intervals of a pixel instead of its colour. */
#ifndef COMP_COMP_MERGE_H
#define COMP_COMP_MERGE_H

#include "fragment.h"

typedef void comp_interval_callback(void *state, const fragment *stretch);

/* Passes to the callback the intervals that comp_merge_pixel() blends, front to back: for overlapping intervals their
 * mixtures between cuts, for samples at one position their sum, and nothing behind an opaque interval. sorted are a
 * pixel's fragments as sorted by comp_merge_pixel(); their order is the same afterwards. Local. */
void comp_merge_cut(fragment *sorted, int64_t count, comp_interval_callback *callback, void *state);

/* Same as comp_merge_cut(), for comp_merge_folded_pixel(), which blends one fragment per folded interval. */
void comp_merge_folded_cut(const fragment *sorted, int64_t count, comp_interval_callback *callback, void *state);

#endif
