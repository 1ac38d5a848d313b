/* Computes products and lengths of vectors with three components, and compares points lexicographically. */
#ifndef BASE_VECTOR3_H
#define BASE_VECTOR3_H

#include <math.h>

static inline double vector3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Computes the cross product a × b. out must be neither a nor b. */
static inline void vector3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Returns the length of v. The result is correct even if the squares of the components overflow. */
static inline double vector3_length(const double v[3])
{
    return hypot(hypot(v[0], v[1]), v[2]);
}

/* Compares two points lexicographically: by x, then by y, then by z. Returns -1, 0 or 1. */
static inline int vector3_compare(const double a[3], const double b[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (a[axis] != b[axis]) return a[axis] < b[axis] ? -1 : 1;
    return 0;
}

#endif
