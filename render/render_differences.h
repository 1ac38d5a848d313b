/* Computes a hit's normal by central differences of the field if some of the six samples around the hit lie in cells of
 * other MPI ranks.
 *
 * First a frame is traced whose job has a list of pending hits (render_job.waiting); its hits with normals by
 * differences are added to that list. The field is then sampled at six points around each hit, by this rank and by
 * every rank whose box contains one of the points. The samples are merged, and their differences give the normal with
 * which the hit is lit. Each rank computes the hit's pixel, tile and ray from the camera, which all ranks have, and
 * takes samples in the same coordinates (tile space, kernel_types.h) as the rank of the hit. So the result is
 * bit-identical to that of one rank that has all cells. If several cells contain a point, on whichever ranks, the
 * sample is the minimum of their values. */
#ifndef RENDER_RENDER_DIFFERENCES_H
#define RENDER_RENDER_DIFFERENCES_H

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "render.h"

/* Returns the bounding box of this rank's cells from which normals by differences may need samples. The hits to which
 * these normals belong may be on any rank. */
render_box render_differences_box(const render_job *job);

/* Returns whether the job has surfaces whose hits may need samples of other ranks. */
bool render_has_differences(const render_job *job);

/* Computes the range of values of each surface's field on this rank. The caller reduces the ranges of all ranks to
 * those over all ranks (render_job.waiting_ranges). */
void render_compute_field_ranges(const render_job *job, double ranges[RENDER_MAX_ISOVALUES][2]);

/* Sorts the hits by tile (16 × 16 pixels) and by block of 4 × 4 pixels in it, so that hits of neighbouring pixels are
 * adjacent in the list. The order only affects speed. Returns false and keeps the order if memory ran out. */
bool render_differences_sort(const render_job *job, render_pending_list *list);

/* Returns whether one of the six sample points of the hit may be in the box. */
bool render_difference_points_meet_box(const render_job *job, const render_pending_hit *hit, const render_box *box);

/* Samples the field in this rank's cells around the hits, which may belong to any rank. out[i]: samples of hits[i].
 * Local. */
insitu_status render_sample_pending_hits(const render_job *job, const render_pending_hit *hits,
                                         render_difference_samples *out, int64_t count, base_error *error);

void render_differences_merge(render_difference_samples *into, const render_difference_samples *other);

/* Computes the normals of `count` hits of the list, from index `first` on, from their samples (samples[0] belongs to
 * hit `first`), and lights the hits as job->paint requests. The fragments are those that render_frame() would have
 * computed. Local. */
insitu_status render_light_pending_hits(const render_job *job, const render_pending_list *list,
                                        render_difference_samples *samples, int64_t first, int64_t count, fragment *out,
                                        base_error *error);

#endif
