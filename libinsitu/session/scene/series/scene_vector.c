/* Normalises and compares the direction vectors that scenes give. */
#include <math.h>

#include "scene_convert.h"

/* The vector is scaled by its largest component first, so that squares of very small or large components, such as
 * 1e-200 and 1e200, neither underflow nor overflow. */
bool scene_normalize_vector(double v[3])
{
    const double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(largest > 0)) return false;
    for (int i = 0; i < 3; i++) v[i] /= largest;
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++) v[i] /= length;
    return true;
}

/* The limit is a millionth of a radian: at smaller angles the image's right direction would mostly consist of rounding
 * errors. */
bool scene_are_vectors_parallel(const double a[3], const double b[3])
{
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    return sqrt(x * x + y * y + z * z) < 1e-6;
}
