/* Blending a volume's fragments in an order that the ray alone gives: the same bits on any partition.
 *
 * "Over" is associative, but its roundings are not. So which fragments are blended first is a matter of where they are:
 * the ray is cut into stretches of a fixed length in t, these into halves, and so on. A stretch's fragments are folded
 * as the tree of its halves says; between surfaces, for what they part is folded apart. An empty half changes no bit.
 *
 *     |       |       |   x   |   x   |  x    |       |   x   |       |      ((x (x)) (x))  (x)
 *
 * So a rank may send, in the place of its fragments in a half that it has all of, what they fold to, and whoever has the
 * rest goes on from there. Stretches follow each other front to back, until next to no light is left at the end of one. */
#ifndef BASE_FRAGMENT_FOLD_H
#define BASE_FRAGMENT_FOLD_H

#include <math.h>
#include <stdint.h>

#include "fragment.h"

/* Stretches in a unit of t, and halvings of each. t is near 1 where the scene is (render.h), so that a ray has some ten
 * stretches and a leaf is 4e-6 of the scene. What begins in one leaf is folded front to back. */
enum { FRAGMENT_STRETCHES = 8, FRAGMENT_HALVINGS = 15 };

/* A rank that has less light left where a stretch ends may leave out those behind; what is behind this, which is more by
 * more than roundings may add up to, is left out of the pixel. */
#define FRAGMENT_DARK_OF_RANK 1e-7f
#define FRAGMENT_DARK 1.01e-7f

/* The leaf that t is in; they rise with t. Those of one stretch are the same but for the lowest bits. Rays of depths
 * beyond a thousand scenes have their ends in one. */
static inline int32_t fragment_leaf(float t)
{
    const float most = 1024, at = t < -most ? -most : t < most ? t : most; /* NaN too */
    return (int32_t)floorf(at * (float)(FRAGMENT_STRETCHES << FRAGMENT_HALVINGS));
}

static inline int32_t fragment_stretch(float t)
{
    return fragment_leaf(t) >> FRAGMENT_HALVINGS;
}

/* Fragments of one stretch, in their order, no surface among them, to one. count >= 1. */
fragment fragment_fold(const fragment *sorted, int64_t count);

/* The same of a rank that has all there is from depth begin to end: halves that lie between are folded. out may be
 * sorted itself; returns how many fragments it gets. */
int64_t fragment_fold_between(const fragment *sorted, int64_t count, float begin, float end, fragment *out);

#endif
