/* The largest distance between two faces that are one in truth. */
#ifndef RENDER_FACE_ERROR_H
#define RENDER_FACE_ERROR_H

/* Two faces that are one in truth, but not the same to the bit, may be so far apart along a ray, in t: of a hanging
 * node the coarse cell's face and the small ones on it, and faces whose crossings come in the wrong order beside a
 * vertex. Near 1, where t of the scene is, each face's crossing is off by a rounding of its vertices' depths and one of
 * t, 6e-8 each, and by its weights' or Newton's, 2.4e-7 (kernel_cell.h) to 1e-6 times the cell's size (kernel_quad.h):
 * twice that is 3e-6 for a cell as large as the scene. Across the ray vertices are off by 6e-8 of their distance from
 * the tile's centre, a cell's size: of cells of 0.1 that is no more than this where a face's cosine to the ray is above
 * 1.5e-3. */
#define RENDER_FACE_ERROR 4e-6f

#endif
