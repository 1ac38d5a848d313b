/* Computes VTK's contour lines on a plane through a mesh of hexes or tets, for comparison with the library's lines. */
#ifndef TEST_CONTOUR_VTK_H
#define TEST_CONTOUR_VTK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Cuts the mesh by the plane through `origin` and computes the contour lines of the values. Stores 5 points of each
 * line segment, including its ends, in memory from malloc() that the caller frees. type: 10 (tets) or 12 (hexes).
 * Returns the number of points, or -1 if memory runs out. */
int64_t test_vtk_compute_contours(int64_t vertex_count, const double *coordinates, int64_t cell_count, int type,
                                  const int64_t *connectivity, const double *field, const double origin[3],
                                  const double normal[3], int value_count, const double *values, double **points);

#ifdef __cplusplus
}
#endif

#endif
