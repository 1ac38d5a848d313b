/* Measures vtkTessellatorFilter as a peer: it divides quadratic tets into linear ones, as finely as a bound of the
 * field's error requires. */
#ifndef BENCH_ORDER_VTK_H
#define BENCH_ORDER_VTK_H

#include "test_data_cells.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bench_tessellator bench_tessellator;

/* Copies the cells, quadratic tets in VTK's order of nodes. The filter divides an edge if the field at its midpoint is
 * more than `error` from the mean of its ends. Returns NULL if this program was built without VTK; data_cells_read()
 * then always returns false. */
bench_tessellator *bench_tessellator_create(const data_cells *cells, double error);
void bench_tessellator_destroy(bench_tessellator *tessellator);

/* Makes all linear cells anew. */
void bench_tessellator_update(bench_tessellator *tessellator);

/* bench_tessellator_cell_count() returns the number of linear cells; bench_tessellator_longest_squared() returns the
 * squared length of their longest edge. */
int64_t bench_tessellator_cell_count(bench_tessellator *tessellator);
double bench_tessellator_longest_squared(bench_tessellator *tessellator);

#ifdef __cplusplus
}
#endif

#endif
