/* Computes a hit's position in the scene, the directions of its rays into the hemisphere, and the box that they may
 * meet. */
#ifndef RENDER_RENDER_HITS_H
#define RENDER_RENDER_HITS_H

#include "render.h"

typedef struct hit_axes {
    double right[3], up[3], forward[3];
} hit_axes;

/* The point at which a hit's rays begin, the direction to the eye, and the normal with two directions perpendicular to
 * it. */
typedef struct hit_place {
    double start[3], view[3];
    hit_axes a;
} hit_place;

static inline double hit_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the bounding box of this rank's cells in the trees of the job's wanted surfaces. */
render_box hit_box(const render_job *job, bool (*is_wanted)(const render_surface_layer *layer));

/* Returns two unit vectors perpendicular to a third, which is forward. */
hit_axes hit_axes_around(const double n[3]);

/* Unpacks the unit normal of an unlit fragment. */
void hit_normal(const float folded[2], double n[3]);

/* Computes the axes of a hit at depth t on the pixel's ray. Its rays begin `lift` scaled units above it. */
hit_place hit_place_of(const render_job *job, uint32_t pixel, float t, const float normal[2], double lift);

/* Computes the directions of the job's samples for the pixel: occlusion->samples of unit length, with z along the
 * normal. */
void hit_hemisphere(const render_job *job, uint32_t pixel, double (*out)[3]);
/* As hit_hemisphere(), with directions in the scene's axes. */
void hit_directions(const render_job *job, uint32_t pixel, const hit_axes *a, double (*out)[3]);

#endif
