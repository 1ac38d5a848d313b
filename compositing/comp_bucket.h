/* Sorts fragments in place by a small whole number. */
#ifndef COMP_COMP_BUCKET_H
#define COMP_COMP_BUCKET_H

#include <stdbool.h>

#include "comp_schedule.h"
#include "fragment.h"

/* Tells whether every fragment's pixel lies in the image. */
bool comp_bucket_fits(const comp_layout *layout, const fragment *items, int64_t count);

/* Sorts fragments by owner. starts has ranks + 1 entries; owner r's fragments end up at starts[r] .. starts[r + 1]. */
void comp_bucket_by_owner(const comp_layout *layout, fragment *items, int64_t count, int64_t *starts);

/* Sorts one owner's fragments by slice: 2^slice_shift consecutive owned indices. starts has slices + 1 entries. */
void comp_bucket_by_slice(const comp_layout *layout, uint32_t slice_shift, fragment *items, int64_t count,
                          int64_t *starts, int64_t slices);

#endif
