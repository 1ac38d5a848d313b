/* Computes the true colours and depths of a subject (accuracy_subject.h) in a few chosen pixels of its picture, in
 * double, and the error of a picture against them. The brute-force renderer of the tests finds the hits of isosurfaces;
 * volumes are integrated adaptively through every cell. */
#ifndef ACCURACY_TRUTH_H
#define ACCURACY_TRUTH_H

#include "accuracy_subject.h"
#include "bench_error.h"

/* The two meanings of the opacity `a` of a transfer function, which is given per unit distance. */
typedef enum accuracy_opacity {
    ACCURACY_OPACITY,   /* extinction -ln(1 - a), `a` being linear between knots: libinsitu, VTK's image mappers */
    ACCURACY_EXTINCTION /* extinction itself is linear between the knots: VTK's mappers of unstructured grids */
} accuracy_opacity;

typedef struct accuracy_reference accuracy_reference;

/* Chooses one pixel in each block of block × block pixels. The subject is borrowed, and its tree must have been
 * built. */
accuracy_reference *accuracy_reference_create(const accuracy_subject *subject, int block);
void accuracy_reference_free(accuracy_reference *truth);

const bench_pixels *accuracy_reference_pixels(const accuracy_reference *truth);

typedef struct accuracy_error {
    /* Number of chosen pixels whose true value is not empty, except rays through polyhedra that even the reference
     * cannot decide (`ambiguous` of reference_ray). */
    int pixels;
    /* Volumes: error of linear premultiplied red, green, blue and opacity. Surfaces: error of depth, relative to the
     * size of the true hit's cell, over the pixels in which it is at most 1. */
    double rms, max;
    /* Surfaces: number of pixels in which only the picture or only the reference has a hit, or in which the depths
     * differ by more than the size of a cell. */
    int wrong;
    /* Surfaces: largest |field at the hit - isovalue|, divided by the range of the cell's values; NaN for meshes with
     * polyhedra. */
    double residual;
} accuracy_error;

/* accuracy_compute_volume_error() and accuracy_compute_surface_error() compute the error of a picture from its values
 * in the chosen pixels: rgba (count × 4) or depths (count). */
accuracy_error accuracy_compute_volume_error(const accuracy_reference *truth, accuracy_opacity meaning,
                                             const float *rgba);
accuracy_error accuracy_compute_surface_error(const accuracy_reference *truth, const double *depths);

#endif
