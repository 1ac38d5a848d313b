/* VTK's contour lines on a plane through a mesh of hexes or tets, to compare with. */
#ifndef TEST_CONTOUR_VTK_H
#define TEST_CONTOUR_VTK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Cuts by the plane through origin and finds the lines of the values: 5 points of each of their pieces, ends included,
 * from malloc(), for the caller to free. type: 10 or 12. Returns how many points; -1: no memory. */
int64_t test_vtk_contour(int64_t vertex_count, const double *coordinates, int64_t cell_count, int type,
                         const int64_t *connectivity, const double *field, const double origin[3],
                         const double normal[3], int value_count, const double *values, double **points);

#ifdef __cplusplus
}
#endif

#endif
