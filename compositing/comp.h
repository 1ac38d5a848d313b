/* Compositing: combines the fragments of many ranks into one picture on rank 0. A fragment is what one rank contributes
 * to a pixel: a surface hit, or a volume between two points of the ray (fragment.h). This module has no access to
 * cells, trees or the scene.
 *
 * Blocks of pixels are owned by ranks that have many fragments there (comp_grid.h). Every rank sends each owner its
 * fragments (on the routes of comp_route.h), owners sort them by t and blend front to back, and rank 0 gathers the
 * finished pixels. Fragments need not be sorted; no visible fragment is dropped; a rank may have any number of
 * fragments in a pixel, or none. The result depends only on the set of fragments, not on ranks, order of arrival or
 * threads.
 *
 * Sorting by t, the parameter along the ray, gives the correct picture if fragments do not overlap. Volume fragments
 * that overlap, because cells overlap, can be corrected only by the renderer, which made them:
 * comp_composite_overlaps() returns the pixels that contain such fragments. Volume fragments of length zero are
 * samples. Any number of them may have the same t; each contributes to their common absorption in proportion to its
 * own absorption, in any order. Volume fragments whose intervals overlap are mixed as homogeneous media, which is
 * correct if the intervals are short enough for the media to be homogeneous. */
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

/* The communicator of the ranks that take part in compositing, and the settings that they share. */
typedef struct comp_group {
    MPI_Comm comm; /* communicator that only compositing uses */
    comp_nodes nodes;
    comp_schedule schedule; /* schedule by which messages are sent; COMP_AUTOMATIC chooses the fastest one for each
                               picture */
    /* largest number of ranks among which every rank sends a message to every other, even an empty one (a dense round,
     * comp_messages.h); 0: the default of comp_route.h */
    int max_dense_ranks;
    comp_claims *claims; /* buffer in which ranks agree on the owners of blocks, created by comp_claims_create(); one
                            buffer serves all pictures */
} comp_group;

/* Blends one pixel's fragments in place: they are sorted by t_in, at equal t_in with surfaces before volumes, and then
 * by all other bits of a fragment (fragment_order.h). They are then blended front to back over background (linear
 * premultiplied RGBA). out_rgba receives 4 floats, out_depth the nearest surface's t_in or +infinity. Local. The result
 * of this function defines the picture; faster code must give the same result. */
void comp_merge_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4], float *out_depth);

/* Blends one pixel's fragments in place over background, like comp_merge_pixel(), for pictures whose volume fragments
 * are folded. Folding combines all volume fragments in an interval of the ray into one, in an order that depends only
 * on the ray (fragment_fold.h). Ranks may have folded a part of the fragments; this function folds the remaining ones.
 * Unlike there, a surface is placed in front of a segment that ends behind it and begins in front of it by no more than
 * the rounding error of a crossing, because the surface then lies on the face at which the segment begins. Local. */
void comp_merge_folded_pixel(fragment *items, int64_t count, const float background[4], float out_rgba[4],
                             float *out_depth);

/* Returns whether a pixel's fragments, in the order of comp_merge_pixel(), overlap in front of the first opaque
 * fragment. Two volume fragments overlap if both contain some t. A volume fragment overlaps a surface if it contains
 * the surface's t and begins before this t. If it begins before this t by no more than the rounding error of the t at
 * which a ray crosses a face, it does not overlap the surface. A fragment whose end precedes its start, because its
 * length is below rounding, overlaps nothing. Two samples (volume fragments of length zero) at the same t do not
 * overlap if they belong to two volumes, or to two cells at the common face of these cells. Local. */
bool comp_pixel_overlaps(const fragment *sorted, int64_t count);

/* Returns whether a pixel's fragments overlap (comp_pixel_overlaps()), for fragments that ranks may have folded. They
 * must be in the order of comp_merge_folded_pixel(). comp_merge_folded_pixel() stops where almost no light is left;
 * fragments behind this point of the ray are ignored. Local. */
bool comp_folded_pixel_overlaps(const fragment *sorted, int64_t count);

typedef struct comp_statistics {
    int64_t sent_fragments; /* number of fragments sent by this rank, including those to itself */
    int64_t sent_bytes; /* bytes sent by this rank to other ranks: fragments and finished pixels, including forwarded
                           ones */
    int64_t sent_messages;
    double merge_ms;
    comp_schedule schedule;
    bool has_failed; /* true if the error occurred on this rank */
} comp_statistics;

/* Composites an image. Performs two reductions over group->comm, and a barrier for each round in which only ranks with
 * fragments send messages (a sparse round, comp_messages.h). threads is the number of threads of this rank, or 0 for
 * the default of OpenMP. statistics may be NULL. Collective.
 *
 * out->width and out->height must be set on all ranks. Rank 0 must allocate out->rgba and may allocate out->depth; both
 * are filled on rank 0 and ignored on other ranks. out->deep must be given on all ranks or on none. On rank 0,
 * out->deep->first and out->deep->counts must be allocated, and out->deep receives the samples of the pixels that have
 * fragments (comp_deep.h), with t as depth. If out->is_folded, which must be the same on all ranks, pixels are merged
 * by comp_merge_folded_pixel().
 *
 * The fragment list is always emptied and its memory released. An error on one rank (lack of memory) is an error on all
 * ranks. If *error contains an error before the call, because this rank could not make its fragments, this error is
 * also returned on all ranks. */
insitu_status comp_composite(const comp_group *group, fragment_list *items, const float background[4], int threads,
                             image *out, comp_statistics *statistics, base_error *error);

/* The set of pixels whose fragments overlap. It is the same on every rank. */
typedef struct comp_overlaps {
    int64_t count;
    /* set of pixels of the whole image (pixel_set.h); NULL if count is 0. The caller must free it with base_free(). */
    unsigned char *pixels;
} comp_overlaps;

/* Composites an image like comp_composite(). In addition, *overlaps receives, on every rank, the pixels in which
 * fragments overlap. If there are any, one more reduction is performed, with one bit per pixel. On an error *overlaps
 * is empty. Collective. */
insitu_status comp_composite_overlaps(const comp_group *group, fragment_list *items, const float background[4],
                                      int threads, image *out, comp_overlaps *overlaps, comp_statistics *statistics,
                                      base_error *error);

#endif
