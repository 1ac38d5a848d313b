/* The reference for volumes: emission and absorption are integrated along a ray through every cell, adaptively, in
 * double, without a tree. If there are several layers, or cells overlap, all of them emit and absorb together. The hits
 * of surfaces come from reference_trace(). */
#ifndef REFERENCE_INTEGRAL_H
#define REFERENCE_INTEGRAL_H

#include "reference_render.h"

typedef struct reference_integral reference_integral;

/* Creates the reference of a job, which is borrowed. tolerance is the error allowed in a cell's interval, in colour and
 * optical depth. */
reference_integral *reference_integral_create(const render_job *job, double tolerance);
void reference_integral_free(reference_integral *scene);

/* Computes the pixel over the background, including hits (by depth; the last one may be opaque). To follow the clips of
 * the job's volumes, the caller passes a transparent hit at each end of a clip, where the ray is cut too. */
void reference_integral_trace(const reference_integral *scene, int x, int y, const float background[4],
                              const reference_hit *hits, int hit_count, double rgba[4]);

#endif
