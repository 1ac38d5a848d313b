/* Gradients of fields at vertices, from the cells around them. They have the same bits for any order of the cells and
 * any ranks that have them. */
#ifndef SESSION_GRADIENTS_H
#define SESSION_GRADIENTS_H

#include "grid.h"

enum { SESSION_GRADIENTS = 3 /* scalars at most whose gradients one pass sums */ };

/* Input that sums are made from. The values are at the vertices. */
typedef struct session_gradient_basis {
    const grid *cells;
    const grid_field *fields; /* field_count scalars */
    int field_count;          /* 1 .. SESSION_GRADIENTS */
    bool of_shells;           /* sums are of shells, in whose planes their gradients lie; else of cells with volume */
    const int32_t *entries;   /* for each vertex the index of its sum, or -1 */
    double length;            /* a power of two near the size of the scene; the same on all ranks */
    int threads;
} session_gradient_basis;

/* A sum over the cells around a place is so many words, in whole numbers: adding two, word by word, is exact, and so
 * in any order. They are the high words of three components for each scalar, of the weights, and of none, and then the
 * low words. */
static inline int session_sum_numbers(int field_count)
{
    return field_count == 1 ? 4 : field_count == 2 ? 8 : 10;
}

static inline int session_sum_words(int field_count)
{
    return 2 * session_sum_numbers(field_count);
}

/* Bounds for what cells add to sums; over several grids or ranks they are the maximum of each. */
typedef struct session_gradient_bounds {
    double rise;      /* along an edge of a corner */
    double sharpness; /* one over the sum of the squares of a corner's edges, in lengths; 0: there are no corners */
} session_gradient_bounds;

/* Cells with a vertex that has a sum, in any order. */
typedef struct session_cell_list {
    int64_t count;
    int64_t *cells;
} session_cell_list;

/* False where memory ran out. The caller frees out->cells. Local. */
bool session_list_cells(const session_gradient_basis *basis, session_cell_list *out);

/* The bounds of what the cells add to any sum. False where memory ran out. Local. */
bool session_bound_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                             session_gradient_bounds *out);

/* Add what the cells give. bounds: of all grids and ranks; sums: session_sum_words() for each of entry_count. False
 * where memory ran out. Local. */
bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                           const session_gradient_bounds *bounds, int64_t entry_count, int64_t *sums);

/* The mean gradients of a sum, in the units of values over lengths of coordinates; NaN where no cell gave one. length:
 * that of the basis. */
void session_mean_gradients(const int64_t *sum, int field_count, const session_gradient_bounds *bounds, double length,
                            double out[][3]);

#endif
