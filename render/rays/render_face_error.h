/* Defines the largest distance, along a ray, between two faces that coincide in exact arithmetic but not after
 * rounding. */
#ifndef RENDER_FACE_ERROR_H
#define RENDER_FACE_ERROR_H

/* Upper bound of the difference in t between a ray's crossings of two faces that coincide in exact arithmetic: the face
 * of a coarse cell and the smaller faces on it at a hanging node, or faces whose crossings come in the wrong order
 * beside a vertex. In the scene |t| is at most about 1. There the crossing of a face errs by the rounding of its
 * vertices' depths and of t (6e-8 each), and by the error of its weights or of Newton's method: 2.4e-7 (kernel_cell.h)
 * to 1e-6 times the cell's size (kernel_quad.h). Twice the sum is 3e-6 for a cell as large as the scene. Across the
 * ray, vertices err by 6e-8 of their distance from the tile's centre, which is about the cell's size: for cells of size
 * 0.1 the resulting error in t is below this bound if a face's cosine to the ray is above 1.5e-3. */
#define RENDER_FACE_ERROR 4e-6f

#endif
