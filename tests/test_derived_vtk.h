/* Runs VTK's gradient filter on a mesh of hexes or tets, for comparison with the library's gradients. */
#ifndef TEST_DERIVED_VTK_H
#define TEST_DERIVED_VTK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Computes Q at the vertices on one thread. type: 10 (tets) or 12 (hexes); velocity: vertex_count × 3; q: vertex_count.
 * Returns the filter's time in seconds, the minimum over `runs` runs. */
double test_vtk_compute_q_criterion(int64_t vertex_count, const double *coordinates, int64_t cell_count, int type,
                                    const int64_t *connectivity, const float *velocity, int runs, double *q);

#ifdef __cplusplus
}
#endif

#endif
