/* Fragments put in order by a small whole number, where they lie. */
#ifndef COMP_COMP_BUCKET_H
#define COMP_COMP_BUCKET_H

#include <stdbool.h>

#include "comp_schedule.h"
#include "fragment.h"

/* Pixels are merged a slice at a time: so many consecutive owned pixels that their counters and, as a rule, their
 * fragments stay in a core's cache. */
enum { comp_slice_shift = 12, comp_slice_pixels = 1 << comp_slice_shift };

/* By owner. starts has ranks + 1 entries; owner r's fragments end up at starts[r] .. starts[r + 1]. False where a
 * pixel lies outside the image: then nothing has moved. */
bool comp_bucket_by_owner(const comp_layout *layout, fragment *items, int64_t count, int64_t *starts);

/* By slice of the owned index. All of one owner. starts has slices + 1 entries. */
void comp_bucket_by_slice(const comp_layout *layout, fragment *items, int64_t count, int64_t *starts, int64_t slices);

/* By pixel. All of one owner's slice. Returns how many pixels there are. */
int64_t comp_bucket_by_pixel(const comp_layout *layout, fragment *items, int64_t count);

#endif
