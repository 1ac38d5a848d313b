/* Deep images keep the samples of every pixel, one behind the other, beside the flat picture.
 *
 * The owner of a pixel makes samples of its fragments, sorted and cut until none overlaps another, and sends them to
 * rank 0. Blended front to back they give the picture without its background. */
#ifndef COMP_COMP_DEEP_H
#define COMP_COMP_DEEP_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "image.h"

typedef struct comp_deep_pixel {
    uint32_t pixel, count; /* count: the number of samples */
} comp_deep_pixel;

/* A thread's samples on one owner, pixel after pixel. All zero: empty. */
typedef struct comp_deep_list {
    comp_deep_pixel *pixels;
    insitu_deep_sample *samples;
    int64_t pixel_count, pixel_capacity, sample_count, sample_capacity;
    bool lacks_memory; /* something was left out */
} comp_deep_list;

/* Adds one pixel's fragments as comp_merge_pixel() left them, or where is_folded comp_merge_folded_pixel(). z and
 * z_back are t. Where memory runs out it sets lacks_memory. Local. */
void comp_deep_add(comp_deep_list *list, fragment *sorted, int64_t count, bool is_folded);

/* NULL items are fine. */
void comp_deep_free(comp_deep_list *lists, int count);

/* Sends every rank's lists to rank 0's out, where they replace the samples that these pixels had. The lists are freed.
 * Collective; returns the same on all ranks. *sent_bytes grows by the bytes sent to rank 0. */
insitu_status comp_deep_gather(MPI_Comm comm, comp_deep_list *lists, int list_count, deep_image *out,
                               int64_t *sent_bytes, base_error *error);

#endif
