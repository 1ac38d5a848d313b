/* Defines an upper bound of the distance, along a ray, between two faces that coincide in exact arithmetic but not
 * after rounding. */
#ifndef RENDER_FACE_ERROR_H
#define RENDER_FACE_ERROR_H

/* Upper bound of the difference in t between a ray's crossings of two faces that coincide in exact arithmetic. Examples
 * are the face of a coarse cell and the smaller faces on it at a hanging node. The bound also holds for two faces at a
 * vertex whose crossings come in the wrong order because of rounding.
 *
 * In the scene |t| is at most about 1. A crossing errs by the rounding of the depths of the face's vertices and of t,
 * 6e-8 each. It also errs by the error of weights, 2.4e-7 (kernel_cell.h), or by that of Newton's method, up to 1e-6
 * times the cell's size (kernel_quad.h). Twice the sum is 3e-6 for a cell as large as the scene.
 *
 * Across the ray, vertices err by 6e-8 of their distance from the tile's centre, which is about the cell's size. For
 * cells of size 0.1, the resulting error in t is below this bound if the cosine of the angle between the face's normal
 * and the ray is above 1.5e-3. */
#define RENDER_FACE_ERROR 4e-6f

#endif
