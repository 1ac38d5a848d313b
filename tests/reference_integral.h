/* The reference for volumes: integrates emission and absorption along a ray through every cell, adaptively, in double,
 * without a tree. If there are several layers, or if cells overlap, all of them emit and absorb together. The hits of
 * surfaces are computed by reference_trace(). */
#ifndef REFERENCE_INTEGRAL_H
#define REFERENCE_INTEGRAL_H

#include "reference_render.h"

typedef struct reference_integral reference_integral;

/* Creates the reference of a job. The job is borrowed. tolerance is the error allowed in colour and in optical depth
 * for the interval of a cell. */
reference_integral *reference_integral_create(const render_job *job, double tolerance);
void reference_integral_free(reference_integral *scene);

/* Computes the colour of a pixel over the background, including hits. The hits are sorted by depth, and the last one
 * may be opaque. If the job clips its volumes, the caller passes a transparent hit at each depth at which the ray
 * enters or leaves a clip, so that the ray is cut there too. */
void reference_integral_trace(const reference_integral *scene, int x, int y, const float background[4],
                              const reference_hit *hits, int hit_count, double rgba[4]);

#endif
