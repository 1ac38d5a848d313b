/* The true values of a subject's chosen pixels, in double: isosurface hits by the brute-force renderer, volumes by
 * adaptive integration through every cell; and the error of a picture against them. */
#ifndef ACCURACY_TRUTH_H
#define ACCURACY_TRUTH_H

#include "accuracy_subject.h"
#include "bench_error.h"

/* The meaning of opacity a per unit distance. */
typedef enum accuracy_opacity {
    ACCURACY_OPACITY,   /* extinction -ln(1 - a), a linear between the knots: libinsitu, VTK's image mappers */
    ACCURACY_EXTINCTION /* extinction linear between the knots: VTK's mappers of unstructured grids */
} accuracy_opacity;

typedef struct accuracy_truth accuracy_truth;

/* One pixel is chosen in each block × block. The subject is borrowed; its tree has been built. */
accuracy_truth *accuracy_truth_create(const accuracy_subject *subject, int block);
void accuracy_truth_free(accuracy_truth *truth);

const bench_pixels *accuracy_truth_pixels(const accuracy_truth *truth);

typedef struct accuracy_error {
    int pixels;      /* chosen pixels whose truth shows something, without polyhedra's rays that even the reference
                        cannot decide (reference_ray's ambiguous) */
    double rms, max; /* for volumes of linear premultiplied red, green, blue and opacity; for surfaces of depth, in
                        sizes of the truth's cell, where both hit the same sheet */
    int wrong;       /* surface: pixels where only one of the two hits, or where depths differ by more than a cell */
    double residual; /* surface: the largest |field at the hit - isovalue| over the range of the cell's values; NaN for
                        meshes with polyhedra */
} accuracy_error;

/* rgba: count × 4 */
accuracy_error accuracy_volume_error(const accuracy_truth *truth, accuracy_opacity meaning, const float *rgba);
accuracy_error accuracy_surface_error(const accuracy_truth *truth, const double *depths);

#endif
