/* Merges a pixel's fragments by the rules of comp_merge.c, but passes the resulting intervals to a callback instead of
 * computing a colour. */
#ifndef COMP_COMP_MERGE_H
#define COMP_COMP_MERGE_H

#include "fragment.h"

typedef void comp_interval_callback(void *state, const fragment *interval);

/* Calls the callback for each interval that comp_merge_pixel() blends, front to back. Overlapping intervals are split
 * at all of their starts and ends, and each of the resulting shorter intervals is passed as the mixture of the
 * fragments that span it. Samples at the same position are passed as one sample. Nothing behind an opaque interval is
 * passed. sorted: the pixel's fragments in the order of comp_merge_pixel(); the order is the same on return. Local. */
void comp_merge_intervals(fragment *sorted, int64_t count, comp_interval_callback *callback, void *state);

/* Calls the callback for each fragment that comp_merge_folded_pixel() blends, front to back. The ray is divided into
 * intervals of fixed length; all volume fragments in one of these intervals, or between two surfaces that divide it,
 * are blended into one fragment before it is passed (fragment_fold.h). Surface hits are passed unchanged. Local. */
void comp_merge_folded_intervals(const fragment *sorted, int64_t count, comp_interval_callback *callback, void *state);

#endif
