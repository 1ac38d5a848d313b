/* Computes a hit's position in the scene, the directions of its rays into the hemisphere above the surface, and the
 * bounding box of the cells that may affect hits. */
#ifndef RENDER_RENDER_HITS_H
#define RENDER_RENDER_HITS_H

#include "render.h"

/* start: point at which a hit's rays begin, in scene units; view: unit vector to the eye; axes: orthonormal axes right,
 * up and forward, with the surface's normal as forward. The components of all vectors are along the world axes. */
typedef struct hit_frame {
    double start[3], view[3], axes[3][3];
} hit_frame;

static inline double hit_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns a bounding box in the scene's coordinates: that of this rank's mesh parts that have the field of a surface
 * layer for which is_wanted() returns true. */
render_box hit_box(const render_job *job, bool (*is_wanted)(const render_surface_layer *layer));

/* Computes an orthonormal set of axes (right, up, forward) whose last one is the unit vector n. */
void hit_axes_around(const double n[3], double axes[3][3]);

/* Unpacks the unit normal of an unlit fragment from its octahedral encoding. */
void hit_normal(const float folded[2], double n[3]);

/* Computes the position, the view direction and the axes of a hit at depth t on the pixel's ray. normal: the encoded
 * normal (hit_normal()); lift: height above the surface, in scaled units, at which the hit's rays begin. */
hit_frame hit_frame_of(const render_job *job, uint32_t pixel, float t, const float normal[2], double lift);

/* Computes the unit directions of the rays for ambient occlusion of the pixel's hit (job->occlusion->samples of them),
 * in axes whose third one is the surface's normal. */
void hit_hemisphere(const render_job *job, uint32_t pixel, double (*out)[3]);
/* Computes the unit directions of hit_hemisphere(), rotated into the world axes. axes: those of the hit_frame. */
void hit_directions(const render_job *job, uint32_t pixel, const double (*axes)[3], double (*out)[3]);

#endif
