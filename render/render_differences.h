/* Normals by central differences whose samples lie in the cells of any rank.
 *
 * A frame whose job has a waiting list is traced first: its hits by differences go to that list. Six samples about each
 * are taken in this rank's cells and by every rank whose box holds one of their points. They are merged and make the
 * normal that the hit is lit by. A rank that is asked finds the hit's pixel, tile and ray from the camera, which all
 * ranks have, and samples in that tile's space as the rank with the hit does. So the bits are those of a rank that has
 * all cells. Where cells overlap, the sample is the least of their values, on whichever ranks they are. */
#ifndef RENDER_RENDER_DIFFERENCES_H
#define RENDER_RENDER_DIFFERENCES_H

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "render.h"

/* Returns the box of all cells on this rank that may have samples. */
render_box render_differences_box(const render_job *job);

/* Does a hit of the job wait for samples of other ranks? */
bool render_has_differences(const render_job *job);

/* Finds the ends of each surface's field on this rank, from which those over all ranks are made. */
void render_differences_ranges(const render_job *job, double ranges[RENDER_MAX_ISOVALUES][2]);

/* Brings neighbouring pixels' hits together, for speed alone. Returns false, and leaves their order, where memory ran
 * out. */
bool render_differences_sort(const render_job *job, render_waiting_list *list);

/* May one of the hit's points be in the box? */
bool render_differences_meet(const render_job *job, const render_waiting_hit *hit, const render_box *box);

/* Samples this rank's cells about the hits, which may be of any rank. Local. */
insitu_status render_differences_sample(const render_job *job, const render_waiting_hit *hits,
                                        render_samples_about *out, int64_t count, base_error *error);

void render_differences_merge(render_samples_about *into, const render_samples_about *other);

/* Lights count hits of the list from the first on by their samples, samples[0] being that of the first, as the job
 * paints them: fragments as render_frame() would have made them. Local. */
insitu_status render_differences_light(const render_job *job, const render_waiting_list *list,
                                       const render_samples_about *samples, int64_t first, int64_t count, fragment *out,
                                       base_error *error);

#endif
