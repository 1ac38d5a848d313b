/* Makes an owner's fragments into its finished pixels. */
#ifndef COMP_COMP_PIXELS_H
#define COMP_COMP_PIXELS_H

#include "comp_deep.h"
#include "comp_schedule.h"
#include "error.h"
#include "fragment.h"
#include "image.h"

/* A finished pixel, as it travels to rank 0. */
typedef struct comp_pixel {
    uint32_t pixel; /* its owned index */
    float depth;
    float rgba[4];
} comp_pixel;

typedef struct comp_pixel_list {
    comp_pixel *items; /* base_free() */
    int64_t count;
} comp_pixel_list;

/* An owner's fragments, pixel by pixel. */
typedef struct comp_owned {
    fragment *items;  /* .pixel is the owned index */
    uint32_t *starts; /* where those of each owned index begin, and one more */
} comp_owned;

/* An error unless the image has pixels, and no more than fragments can name. */
insitu_status comp_check_size(const image *out, base_error *error);

/* Adds the pixel to a set that other threads add to at the same time. */
void comp_add_overlap(unsigned char *overlaps, uint32_t pixel);

/* Every pixel of out becomes background, without depth. Local. */
void comp_pixels_clear(const comp_layout *layout, image *out, const float background[4]);

/* Writes pixel from->pixel of the image. */
void comp_pixels_store(image *out, const comp_pixel *from);

/* Where merged pixels go: to out, or, where that is NULL, to *finished, by rising owned index. */
typedef struct comp_merged {
    const float *background; /* 4 */
    bool is_folded;          /* by comp_merge_folded_pixel() */
    image *out;
    comp_pixel_list *finished;
    unsigned char *overlaps; /* pixel_set.h: pixels whose fragments overlap are added. NULL: not wanted */
    comp_deep_list *deep;    /* one for each of the layout's threads: samples are added. NULL: not wanted */
} comp_merged;

/* For a single rank: merge the pixels that have fragments into merged->out; the fragments are reordered. Local. On an
 * error out and deep may hold some pixels. */
insitu_status comp_pixels_merge(const comp_layout *layout, fragment_list *fragments, const comp_merged *merged,
                                base_error *error);

/* Merge owner's fragments, which are reordered within pixels. Local; on an error *finished is empty. */
insitu_status comp_pixels_blend(const comp_layout *layout, uint32_t owner, const comp_owned *owned,
                                const comp_merged *merged, base_error *error);

#endif
