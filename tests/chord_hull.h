/* A ray and its chord of the cube [-1, 1]^3, which is the hull of the meshes in the test of chords.
 *
 * Lengths are in sides of the hull, which is 1 in the kernels' scaled units. The chord is that of the traced ray: the
 * ray's offset from the middle of its tile is rounded to float32, as in the kernels, and everything else is double. So
 * the only rounding left is that of the hull's vertices. Along the ray, this rounding and that of weights and depths
 * move two crossings by at most 1e-6 in total (kernel_cell.h). Across the ray, a vertex within 1 of the tile's middle
 * is rounded four times by up to 3e-8: when it is transformed, and when its projection computes the ray's origin, the
 * slope's contribution and their difference. The sum is 1.2e-7 along an axis. Most vertices are within 0.5 and are
 * rounded by half of that, so that the sum over both axes is no more. So the planes of the traced hull are off by up to
 * hull_shift = 1.2e-7, and a ray that meets them at an angle of cosine c is longer or shorter by 1.2e-7 / c. Three
 * bounds follow:
 *
 * (1) For every ray, the sum of intervals lies between the chords of the hull shrunk by hull_shift and of the hull
 * swollen by it, to 1e-6. Inside the shrunk hull every end of an interval is shared by two intervals, without gaps, and
 * no end is beyond the swollen hull, each to 5e-7 along the ray.
 *
 * (2) The sum is the chord to 1e-6 if the shift, from shrunk to swollen, changes the chord by at most 3e-6 (the sum of
 * both 1 / c is then up to 12.5), since not all roundings are at their worst at once. Other rays are called slanted.
 *
 * (3) There are exactly two unshared ends, or none, if the shift changes the chord by at most 0.01, that is if c is at
 * least 2.4e-5: rounding tilts the plane of a face a quarter of the hull wide by 1e-6, so that the ray crosses it once.
 * Other rays run within the hull's surface; rounding decides which of its cells they touch, and only the first bound
 * holds for them. */
#ifndef CHORD_HULL_H
#define CHORD_HULL_H

#include "chord_trace.h"

typedef struct chord_line {
    double base[3], direction[3], length; /* length: length of direction */
} chord_line;

/* Depths measured from the eye's plane. */
typedef struct chord_depths {
    double in, out;
} chord_depths;

/* A ray and its chords of the hull, of the shrunk hull and of the swollen hull, as depths and as lengths. */
typedef struct chord_ray {
    chord_line line;
    chord_depths within, about;
    double length, least, most;
} chord_ray;

/* Returns the ray as the kernels trace it: its offset from the middle of its tile is float32, everything else
 * double. */
chord_ray chord_hull_ray(const render_job *job, const chord_rays *rays, int i);

bool chord_is_slanted(const chord_ray *r);
/* Returns whether the chord runs within the hull's surface. */
bool chord_is_touching(const chord_ray *r);
/* Returns whether any depth between low and high is inside the shrunk hull, farther along the ray than rounding. */
bool chord_is_within(const chord_ray *r, double low, double high);
/* Returns whether the depth is beyond the swollen hull. */
bool chord_is_beyond(const chord_ray *r, double depth);

#endif
