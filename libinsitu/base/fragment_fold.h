/* Blends a volume's fragments in an order that depends only on the ray, so that the result is bit-identical for any
 * partition. Folding means to blend several fragments into one.
 *
 * The operation "over" is associative, but its rounding errors are not. The positions of the fragments therefore
 * determine the order of blending: the ray is cut into intervals of a fixed length in t, these into halves, and so on.
 * The fragments of an interval are folded along the binary tree of its halves, whose leaves are the smallest halves. If
 * surfaces divide an interval, the parts between them are folded separately. An empty half does not change any bit
 * of the result.
 *
 *     |       |       |   x   |   x   |  x    |       |   x   |       |      ((x (x)) (x))  (x)
 *
 * A rank that has all fragments of a half may therefore send the folded fragment instead of them, and the rank that
 * has the remaining fragments continues from there. Intervals are blended front to back, until almost no light is
 * left at the end of one. */
#ifndef BASE_FRAGMENT_FOLD_H
#define BASE_FRAGMENT_FOLD_H

#include <math.h>
#include <stdint.h>

#include "fragment.h"

/* The number of intervals per unit of the ray parameter t, and the number of times that an interval is halved. The
 * scene has a size near 1 in t (render.h), so that a ray has about ten intervals, and a smallest half (leaf) has a
 * length of 4e-6 of the scene. Fragments that start in the same leaf are blended front to back. */
enum { FRAGMENT_INTERVALS = 8, FRAGMENT_HALVINGS = 15 };

/* If the transmittance of a rank's own fragments up to the end of an interval is below FRAGMENT_DARK_OF_RANK, the rank
 * may omit all intervals behind it. When a pixel is merged, blending stops at the end of the first interval at which
 * the transmittance is below FRAGMENT_DARK. FRAGMENT_DARK is the larger of the two limits, by more than the sum of
 * possible rounding errors, so that merging never needs an omitted interval. */
#define FRAGMENT_DARK_OF_RANK 1e-7f
#define FRAGMENT_DARK 1.01e-7f

/* Returns the index of the leaf that contains the ray parameter t; indices increase with t. The leaves of one interval
 * differ only in the lowest FRAGMENT_HALVINGS bits of their indices. All t above 1024, about a thousand times the
 * size of the scene, are in one leaf, and so are all t below -1024. */
static inline int32_t fragment_find_leaf(float t)
{
    /* NaN becomes `most`, because both comparisons are false */
    const float most = 1024, at = t < -most ? -most : t < most ? t : most;
    return (int32_t)floorf(at * (float)(FRAGMENT_INTERVALS << FRAGMENT_HALVINGS));
}

static inline int32_t fragment_interval_number(float t)
{
    return fragment_find_leaf(t) >> FRAGMENT_HALVINGS;
}

/* Blends the fragments of one interval into one, along the interval's binary tree (top of this file). The fragments
 * must be sorted (fragment_order.h) and must not contain a surface; count >= 1. */
fragment fragment_fold(const fragment *sorted, int64_t count);

/* Blends the fragments of one interval on a rank that has all of the pixel's fragments between the ray parameters
 * `begin` and `end`. The interval is divided into halves, these into halves, and so on. The fragments of a half are
 * blended into one only if the half lies completely between begin and end; all others are copied. out may be the same
 * as sorted. Returns the number of fragments in out. */
int64_t fragment_fold_between(const fragment *sorted, int64_t count, float begin, float end, fragment *out);

#endif
