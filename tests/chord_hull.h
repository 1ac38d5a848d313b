/* A ray and its chord of the cube [-1, 1]^3, the hull of the meshes that the test of chords has.
 *
 * Lengths are in sides of the hull, 1 in the kernels' scaled units. The chord is that of the traced ray: its offset
 * from its tile's middle is rounded to float32, as in the kernels, and all else is double. So only the rounding of the
 * hull's vertices is left. Along the ray it and that of weights and depths cost 1e-6 at most in two crossings
 * (kernel_cell.h). Across the ray a vertex within 1 of the tile's middle is rounded by up to 3e-8 four times: when it
 * is placed, and the ray's origin, its slope's share and their difference when it is projected: by 1.2e-7 along an
 * axis; most are within 0.5 and are rounded by half of that, so that both axes together are no more. So the hull is one
 * whose planes lie up to hull_shift = 1.2e-7 off, and a ray that meets them at an angle of the cosine c is longer or
 * shorter by 1.2e-7 / c. From that come three bounds: - Of every ray the sum is between the chords of the hull shrunk
 * by hull_shift and swollen by it, to 1e-6; every end within the shrunk hull is that of two intervals, no gap is there,
 * and no end is beyond the swollen one, each to 5e-7 along the ray. - It is the chord to 1e-6 wherever the shift, from
 * shrunk to swollen, changes that by no more than 3e-6 (the sum of both 1 / c is up to 12.5): roundings are not all at
 * their worst at once. Rays beyond that are called slanted. - There are two ends alone, or none, wherever the shift
 * changes the chord by no more than 0.01, so c is 2.4e-5 and more: rounding tilts the plane of a face a quarter of the
 * hull wide by 1e-6, so that it is crossed once. Rays beyond that run within the hull's surface; which cells of it they
 * touch rounding decides, and the first bound is all that holds. */
#ifndef CHORD_HULL_H
#define CHORD_HULL_H

#include "chord_trace.h"

typedef struct chord_line {
    double base[3], direction[3], length; /* of the direction */
} chord_line;

/* Depths from the eye's plane. */
typedef struct chord_depths {
    double in, out;
} chord_depths;

/* A ray with its chords of the hull, of the shrunk and of the swollen one, as depths and as lengths. */
typedef struct chord_ray {
    chord_line line;
    chord_depths within, about;
    double length, least, most;
} chord_ray;

/* The ray as in the kernels: its offset from its tile's middle is float32, all else double. */
chord_ray chord_hull_ray(const render_job *job, const chord_rays *rays, int i);

bool chord_is_slanted(const chord_ray *r);
/* Tells whether the chord runs within the hull's surface. */
bool chord_is_touching(const chord_ray *r);
/* Tells whether anything between depths low and high is in the shrunk hull, deeper along the ray than rounding. */
bool chord_is_within(const chord_ray *r, double low, double high);
/* Tells whether the chord is beyond the swollen hull. */
bool chord_is_beyond(const chord_ray *r, double depth);

#endif
