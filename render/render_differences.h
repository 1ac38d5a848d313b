/* Normals by central differences whose samples lie in the cells of any rank.
 *
 * A frame whose job has a waiting list is traced first: its hits by differences go to that list. Six samples about each
 * are asked of this rank's cells and of every rank whose box one of their points is in, merged, and make the normal
 * that the hit is lit by. A rank that is asked finds the hit's pixel, tile and ray by the camera, which all have, and
 * samples in that tile's space as the rank with the hit does: to the same bits as if all cells were here. A sample of
 * cells that overlap is the least of theirs, on whichever ranks they are. */
#ifndef RENDER_RENDER_DIFFERENCES_H
#define RENDER_RENDER_DIFFERENCES_H

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "render.h"

/* Returns the box of all cells on this rank that may have samples. */
render_box render_differences_box(const render_job *job);

/* Is a hit of the job to wait for others? */
bool render_has_differences(const render_job *job);

/* The ends of each surface's field on this rank, by which those of all are found. */
void render_differences_ranges(const render_job *job, double ranges[RENDER_MAX_ISOVALUES][2]);

/* Brings neighbouring pixels' hits together, for speed alone. False where memory ran out: they are as they were. */
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
