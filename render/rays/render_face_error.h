/* Defines the largest distance between two faces that coincide in exact arithmetic but not after rounding. */
#ifndef RENDER_FACE_ERROR_H
#define RENDER_FACE_ERROR_H

/* Upper bound, in t along a ray, of the distance between two faces that coincide but do not have the same bits: the
 * coarse cell's face and the small faces on it at a hanging node, or faces whose crossings come in the wrong order
 * beside a vertex. All t of the scene are near 1. There the crossing of a face errs by the rounding of its vertices'
 * depths and of t (6e-8 each), and by the error of its weights or of Newton's method: 2.4e-7 (kernel_cell.h) to 1e-6
 * times the cell's size (kernel_quad.h). Twice the sum is 3e-6 for a cell as large as the scene. Across the ray
 * vertices err by 6e-8 of their distance from the tile's centre, which is about the cell's size: for cells of size 0.1
 * the resulting error in t is below this bound if a face's cosine to the ray is above 1.5e-3. */
#define RENDER_FACE_ERROR 4e-6f

#endif
