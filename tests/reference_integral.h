/* The truth of volumes: emission and absorption are integrated along a ray through every cell, adaptively, in double,
 * without a tree. Where there are several layers, or cells overlap, all of them emit and absorb together. Surfaces'
 * hits come from reference_trace(). */
#ifndef REFERENCE_INTEGRAL_H
#define REFERENCE_INTEGRAL_H

#include "reference_render.h"

typedef struct reference_integral reference_integral;

/* job is borrowed. tolerance is the error allowed to a cell's interval, in colour and optical depth. */
reference_integral *reference_integral_create(const render_job *job, double tolerance);
void reference_integral_free(reference_integral *scene);

/* The pixel over the background, hits (by depth, the last one may be opaque) included. Clips of the job's volumes are
 * followed where the ray is cut at their ends as well, by hits that are clear. */
void reference_integral_trace(const reference_integral *scene, int x, int y, const float background[4],
                              const reference_hit *hits, int hit_count, double rgba[4]);

#endif
