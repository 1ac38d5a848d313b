/* Blending a volume's fragments in an order that the ray alone gives: the same bits on any partition.
 *
 * "Over" is associative, but its roundings are not. So the fragments' places decide which are blended first: the ray is
 * cut into stretches of a fixed length in t, these into halves, and so on. A stretch's fragments are folded along the
 * tree of its halves. Surfaces part a stretch, and the parts are folded separately. An empty half changes no bit.
 *
 *     |       |       |   x   |   x   |  x    |       |   x   |       |      ((x (x)) (x))  (x)
 *
 * So a rank that has all fragments of a half may send what they fold to in their place, and the rank that has the rest
 * goes on from there. Stretches are blended front to back, until next to no light is left at the end of one. */
#ifndef BASE_FRAGMENT_FOLD_H
#define BASE_FRAGMENT_FOLD_H

#include <math.h>
#include <stdint.h>

#include "fragment.h"

/* Stretches in a unit of t, and halvings of each. t is near 1 where the scene is (render.h), so that a ray has some ten
 * stretches and a leaf is 4e-6 of the scene. Fragments that begin in one leaf are folded front to back. */
enum { FRAGMENT_STRETCHES = 8, FRAGMENT_HALVINGS = 15 };

/* A rank may leave out the stretches behind one at whose end its own fragments leave less light than
 * FRAGMENT_DARK_OF_RANK. The pixel leaves out those behind FRAGMENT_DARK, which is larger by more than roundings may
 * add up to. */
#define FRAGMENT_DARK_OF_RANK 1e-7f
#define FRAGMENT_DARK 1.01e-7f

/* The leaf that t is in; leaves rise with t. Those of one stretch differ only in the lowest FRAGMENT_HALVINGS bits. All
 * depths beyond a thousand scenes are in one leaf. */
static inline int32_t fragment_leaf(float t)
{
    const float most = 1024, at = t < -most ? -most : t < most ? t : most; /* NaN too */
    return (int32_t)floorf(at * (float)(FRAGMENT_STRETCHES << FRAGMENT_HALVINGS));
}

static inline int32_t fragment_stretch(float t)
{
    return fragment_leaf(t) >> FRAGMENT_HALVINGS;
}

/* Folds fragments of one stretch to one. They are in order, with no surface among them; count >= 1. */
fragment fragment_fold(const fragment *sorted, int64_t count);

/* Folds on a rank that has all of the pixel's fragments from depth begin to end: only halves that lie between these
 * depths are folded. out may be sorted itself. Returns how many fragments out gets. */
int64_t fragment_fold_between(const fragment *sorted, int64_t count, float begin, float end, fragment *out);

#endif
