/* A ray and its chord: the segment of the ray inside the cube [-1, 1]^3. This cube is the hull of the meshes in
 * test_chords.c.
 *
 * * Lengths are in units of the hull's side. This side is 1 in the kernels' scaled coordinates. The chord is that of
 * the traced ray: the ray's offset from the middle of its tile is rounded to float32, as in the kernels, and all other
 * computations are in double. So only the rounding of the hull's vertices remains.
 *
 * * Along the ray, the rounding of vertices, weights and depths moves two crossings by at most 1e-6 in total
 * (kernel_cell.h). Across the ray, a vertex within 1 of the tile's middle is rounded four times by up to 3e-8: when it
 * is transformed, and when its projection computes the ray's origin, the contribution of the slope and their
 * difference. The sum is 1.2e-7 along an axis. Most vertices are within 0.5 and are rounded by half as much, so that
 * the sum over both axes is no larger than 1.2e-7. So the planes of the traced hull are off by up to hull_shift =
 * 1.2e-7. If c is the cosine of the angle between the ray and a plane's normal, the chord becomes longer or shorter by
 * 1.2e-7 / c. Three bounds follow:
 *
 * * (1) For every ray, the sum of the lengths of intervals lies, to 1e-6, between the chords of the hull shrunk by
 * hull_shift and of the hull swollen by hull_shift. Inside the shrunk hull every end of an interval is shared by two
 * intervals, without gaps, and no end lies beyond the swollen hull; both hold to 5e-7 along the ray.
 *
 * * (2) The sum equals the chord to 1e-6 if the chords of the shrunk and of the swollen hull differ by at most 3e-6
 * (the sum of 1 / c over both ends is then up to 12.5), because not all roundings are at their worst at once. All other
 * rays are called slanted.
 *
 * * (3) There are exactly two unshared ends, or none, if the chords of the shrunk and of the swollen hull differ by at
 * most 0.01, that is if c is at least 2.4e-5. Rounding tilts the plane of a face whose width is a quarter of the hull
 * by 1e-6, so that the ray crosses the plane once. All other rays are called touching: they run within the hull's
 * surface, rounding decides which of its cells they touch, and only the first bound holds for them. */
#ifndef CHORD_HULL_H
#define CHORD_HULL_H

#include "chord_trace.h"

typedef struct chord_line {
    double base[3], direction[3], length; /* length: length of `direction` */
} chord_line;

/* Depths at which a ray enters and leaves a cube, measured from the eye's plane along the view direction. */
typedef struct chord_depths {
    double in, out;
} chord_depths;

/* A ray and its chords. within, least: depths and length in the shrunk hull; about, most: depths and length in the
 * swollen hull; length: length in the exact hull. */
typedef struct chord_ray {
    chord_line line;
    chord_depths within, about;
    double length, least, most;
} chord_ray;

/* Returns the ray as the kernels trace it: its offset from the middle of its tile is float32, everything else
 * double. */
chord_ray chord_compute_hull_ray(const render_job *job, const chord_rays *rays, int i);

bool chord_is_slanted(const chord_ray *r);
/* Returns whether the ray runs within the hull's surface: the chords of the shrunk and the swollen hull differ by more
 * than 0.01. */
bool chord_is_touching(const chord_ray *r);
/* Returns whether some depth between low and high is inside the shrunk hull by more than the rounding along the ray. */
bool chord_is_within(const chord_ray *r, double low, double high);
/* Returns whether the depth is outside the swollen hull by more than the rounding along the ray. */
bool chord_is_beyond(const chord_ray *r, double depth);

#endif
