/* A counting sort without a second copy, for lists that may be most of a rank's spare memory.
 *
 * Keys are counted, and ends[k] becomes the end of bucket k. Then a cursor i walks the list. The fragment it meets is
 * lifted, goes to --ends[its key], the one that lay there is lifted in turn, and so on until one lands at i:
 *
 *     | placed           | i | not yet met      ...  bucket k:  not yet filled | filled |
 *                                                                              ^ ends[k]
 *
 * Left of i all is placed. A fragment met at i >= ends[its key] lies in the filled part of its bucket: were it beyond
 * the bucket, the bucket would lie left of i and be full, so nothing of that key would be left to meet. So one array of
 * counters suffices, and in the end it holds each bucket's start.
 *
 * Order within a bucket is arbitrary; comp_merge_pixel() orders a pixel's fragments totally. */
#include "comp_bucket.h"

#include <string.h>

typedef uint32_t key_function(const comp_layout *layout, uint32_t slice_shift, uint32_t pixel);

static inline uint32_t owner_of(const comp_layout *layout, uint32_t slice_shift, uint32_t pixel)
{
    (void)slice_shift;
    return comp_layout_owner(layout, pixel);
}

static inline uint32_t slice_of(const comp_layout *layout, uint32_t slice_shift, uint32_t pixel)
{
    return comp_layout_index(layout, pixel) >> slice_shift;
}

static inline void count_keys(const comp_layout *layout, uint32_t shift, const fragment *items, int64_t count,
                              int64_t *ends, int64_t keys, key_function *key)
{
    memset(ends, 0, (size_t)keys * sizeof *ends);
    for (int64_t i = 0; i < count; i++) ends[key(layout, shift, items[i].pixel)]++;
    for (int64_t k = 1; k < keys; k++) ends[k] += ends[k - 1];
}

static inline void place(const comp_layout *layout, uint32_t shift, fragment *items, int64_t count, int64_t *ends,
                         key_function *key)
{
    for (int64_t i = 0; i < count; i++) {
        if (i >= ends[key(layout, shift, items[i].pixel)]) continue;
        fragment lifted = items[i];
        for (int64_t to = -1; to != i;) {
            to = --ends[key(layout, shift, lifted.pixel)];
            const fragment next = items[to];
            items[to] = lifted;
            lifted = next;
        }
    }
}

bool comp_bucket_fits(const comp_layout *layout, const fragment *items, int64_t count)
{
    bool fits = true;
#pragma omp parallel for num_threads(layout->threads) schedule(static) reduction(&& : fits)
    for (int64_t i = 0; i < count; i++) fits = fits && items[i].pixel < layout->pixel_count;
    return fits;
}

void comp_bucket_by_owner(const comp_layout *layout, fragment *items, int64_t count, int64_t *starts)
{
    starts[layout->ranks] = count;
    count_keys(layout, 0, items, count, starts, layout->ranks, owner_of);
    place(layout, 0, items, count, starts, owner_of);
}

void comp_bucket_by_slice(const comp_layout *layout, uint32_t slice_shift, fragment *items, int64_t count,
                          int64_t *starts, int64_t slices)
{
    starts[slices] = count;
    count_keys(layout, slice_shift, items, count, starts, slices, slice_of);
    place(layout, slice_shift, items, count, starts, slice_of);
}
