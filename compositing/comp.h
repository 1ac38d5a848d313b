/* Compositing: fragments of many ranks to one image on rank 0. Knows no cells, no trees, no scene.
 *
 * Blocks of pixels are owned by ranks that have much there (comp_grid.h). Every rank sends each owner its fragments (on
 * the ways of comp_route.h), owners sort them by t and blend front to back, and rank 0 gathers the finished pixels.
 * Fragments need not be sorted; none that can show is dropped; a rank may have any number in a pixel, or none. The
 * result depends on the set of fragments alone, not on ranks, order of arrival or threads.
 *
 * Sorting by t makes the right picture where fragments do not overlap. Volume fragments that overlap, because cells do,
 * can be put right only by the room that made them: comp_composite_overlaps() tells the pixels in which they do. Any
 * number of volume fragments of no length may be at one t: they are samples of one place, and share what all absorb
 * together in proportion to what each would, in any order. Volume fragments that overlap over a length are mixed, each
 * as a homogeneous medium: that is the right picture where they are short enough to be homogeneous. */
#ifndef COMP_COMP_H
#define COMP_COMP_H

#include <mpi.h>
#include <stdbool.h>

#include "comp_agree.h"
#include "comp_route.h"
#include "error.h"
#include "fragment.h"
#include "image.h"
#include "pixel_set.h"

/* Who composites, and how. */
typedef struct comp_group {
    MPI_Comm comm; /* used by compositing alone */
    comp_nodes nodes;
    comp_schedule schedule; /* COMP_AUTOMATIC: chosen for each picture */
    int longest_dense;      /* rounds of more ranks are sparse (comp_mail.h); 0: as comp_route.h has it */
    comp_claims *claims;    /* comp_claims_create()'s */
} comp_group;

/* Blend one pixel's fragments in place: sorted by (t_in, surface before volume, then bits), blended front to back over
 * background (linear premultiplied RGBA). out_rgba gets 4 floats, out_depth the nearest surface's t_in or +infinity.
 * Local. This is the whole rule of merging. */
void comp_merge_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4], float *out_depth);

/* The same for volume fragments that ranks have partly folded (fragment_fold.h): here they are folded to the end. */
void comp_merge_folded_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4],
                             float *out_depth);

/* Tells whether a pixel's fragments, as comp_merge_pixel() left them, overlap in front of what is opaque. Two volume
 * fragments that hold the same t overlap. A volume's fragment that holds a surface's t overlaps that surface, unless it
 * begins there, within the rounding of a face's depth. A fragment that ends before it begins, being shorter than
 * rounding, overlaps nothing, nor do samples on their own (fragment.h) of two volumes, or of two cells at their common
 * face. Local. */
bool comp_pixel_overlaps(const fragment *sorted, int64_t count);

/* The same for fragments as comp_merge_folded_pixel() left them; those behind the place where it stops do not count.
 * Local. */
bool comp_folded_pixel_overlaps(const fragment *sorted, int64_t count);

typedef struct comp_statistics {
    int64_t sent_fragments; /* by this rank, own ones included */
    int64_t sent_bytes;     /* by this rank to others: fragments and finished pixels, passed-on ones included */
    int64_t sent_messages;
    double merge_ms;
    comp_schedule schedule;
    bool has_failed; /* the error is this rank's own */
} comp_statistics;

/* Collective over group->comm: two reductions, and a barrier where a round is sparse (comp_mail.h). out's width and
 * height are set on all ranks; on rank 0 out->rgba must be allocated, out->depth may be, and both are filled; elsewhere
 * they are not touched. out->deep may be given, on all ranks: rank 0's, whose first and counts are allocated, gets the
 * samples of the pixels that have fragments (comp_deep.h), with t as depth. Where out->is_folded, the same on all
 * ranks, pixels are merged by comp_merge_folded_pixel(). The list is always emptied and its memory given back. An error
 * on one rank (memory) is an error on all, and so is one that *error holds before the call: so a rank that could make
 * no fragments reports it here. threads is this rank's number; 0: as many as OpenMP would take. statistics may be NULL.
 */
insitu_status comp_composite(const comp_group *group, fragment_list *items, const float background[4], int threads,
                             image *out, comp_statistics *statistics, base_error *error);

/* Pixels whose fragments overlap; the same on every rank. */
typedef struct comp_overlaps {
    int64_t count;
    unsigned char *pixels; /* pixel_set.h, of the whole image; the caller's to base_free(). NULL where count is 0 */
} comp_overlaps;

/* The same, and tells every rank the overlaps. Where there are any, it costs one more reduction, of a bit a pixel. On
 * an error overlaps is empty. */
insitu_status comp_composite_overlaps(const comp_group *group, fragment_list *items, const float background[4],
                                      int threads, image *out, comp_overlaps *overlaps, comp_statistics *statistics,
                                      base_error *error);

#endif
