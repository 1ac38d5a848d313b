/* Deep images contain all samples of every pixel, sorted by t, in addition to the ordinary picture, which has one
 * colour per pixel.
 *
 * The owner of a pixel converts the pixel's fragments to samples. The owner sorts and splits the samples so that they
 * do not overlap, and sends them to rank 0. Blending the samples front to back gives the picture without its
 * background. */
#ifndef COMP_COMP_DEEP_H
#define COMP_COMP_DEEP_H

#include <mpi.h>

#include "error.h"
#include "fragment.h"
#include "image.h"

typedef struct comp_deep_pixel {
    uint32_t pixel, count; /* index of the pixel, and the number of its samples */
} comp_deep_pixel;

/* The samples that one thread of an owner has made, pixel after pixel. A zeroed struct is empty. */
typedef struct comp_deep_list {
    comp_deep_pixel *pixels;
    insitu_deep_sample *samples;
    int64_t pixel_count, pixel_capacity, sample_count, sample_capacity;
    bool lacks_memory; /* set if samples are missing because memory ran out */
} comp_deep_list;

/* Adds the samples of one pixel. Its fragments must be in the order of comp_merge_pixel(). If is_folded is set, ranks
 * have blended several fragments of a volume into one (fragment_fold.h), and the order is that of
 * comp_merge_folded_pixel(). Each sample's z and z_back are the values of t at which its fragment begins and ends,
 * but never less than the previous sample's z_back. If memory runs out, lacks_memory is set. Local. */
void comp_deep_add_pixel(comp_deep_list *list, fragment *sorted, int64_t count, bool is_folded);

/* Frees the lists' samples. The pointers in a list may be NULL. */
void comp_deep_free(comp_deep_list *lists, int count);

/* Sends every rank's lists to rank 0. There, each pixel in the lists gets the samples in the lists, which replace the
 * samples that the pixel has in `out`. The lists are freed. Collective; returns the same on all ranks. *sent_bytes is
 * increased by the number of bytes that this rank sent to rank 0. */
insitu_status comp_deep_gather(MPI_Comm comm, comp_deep_list *lists, int list_count, deep_image *out,
                               int64_t *sent_bytes, base_error *error);

#endif
