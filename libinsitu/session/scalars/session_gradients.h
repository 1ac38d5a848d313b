/* Gradients of a field at vertices, from the cells around them. They have the same bits for any order of the cells and
 * any ranks that have them. */
#ifndef SESSION_GRADIENTS_H
#define SESSION_GRADIENTS_H

#include "grid.h"

/* Words of a vertex's sum: three components of the weighted gradients and the weights, each in two words. */
enum { SESSION_SUM_WORDS = 8 };

/* A sum over the cells around a place, in whole numbers: adding two is exact, and so in any order. */
typedef struct session_gradient_sum {
    int64_t words[SESSION_SUM_WORDS];
} session_gradient_sum;

/* Input that sums are made from. The values are at the vertices. */
typedef struct session_gradient_basis {
    const grid *cells;
    const grid_field *field;
    const int32_t *entries; /* of each vertex: which of the sums, or -1 */
    double length;          /* a power of two near the size of the scene; the same on all ranks */
    int threads;
} session_gradient_basis;

/* Cells with a vertex that has a sum, in any order. */
typedef struct session_cell_list {
    int64_t count;
    int64_t *cells;
} session_cell_list;

/* False where memory ran out. The caller frees out->cells. Local. */
bool session_list_cells(const session_gradient_basis *basis, session_cell_list *out);

/* The largest component and the largest weight that the cells add to any sum; 0 where there are none. False where
 * memory ran out. Local. */
bool session_largest_gradients(const session_gradient_basis *basis, const session_cell_list *list, double largest[2]);

/* Add what the cells give. largest: of all ranks. False where memory ran out. Local. */
bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list, const double largest[2],
                           session_gradient_sum *sums);

/* The mean gradient, to a scale that all sums share; 0 where no cell gave one. */
void session_mean_gradient(const session_gradient_sum *sum, float out[3]);

#endif
