/* Computes gradients of fields at vertices from the cells around each vertex. The results are bit-identical for any
 * order of the cells and any distribution over ranks. */
#ifndef SESSION_GRADIENTS_H
#define SESSION_GRADIENTS_H

#include "grid.h"
#include "session_derivatives.h"

enum { SESSION_GRADIENTS = 3 /* maximum number of scalars whose gradients one pass sums */ };

/* Input for computing sums of gradients at vertices. The fields have their values at vertices. */
typedef struct session_gradient_basis {
    const grid *cells;
    const grid_field *fields; /* array of field_count scalars, with values at vertices */
    int field_count;          /* number of scalars: 1 .. SESSION_GRADIENTS */
    /* true: sums are computed over shells, so that gradients lie in the planes of the shells; false: over cells with a
     * volume */
    bool of_shells;
    const int32_t *sum_indices; /* for each vertex, the index of its sum; -1: no gradient is computed at the vertex */
    double length;              /* a power of two near the size of the scene, the same on all ranks */
    int threads;
    /* polynomials of the caller's cells; their gradients are added instead of the linear pieces' gradients; NULL: all
     * cells are linear */
    const session_polynomials *polynomials;
} session_gradient_basis;

/* Returns how many numbers the sum at a vertex, over the cells around it, has. Each number is stored as a high and a
 * low integer word, so that adding two sums word by word is exact and does not depend on the order. The high words come
 * first: three components of the gradient for each scalar, then the weight, and padding to an even number. The low
 * words follow in the same order. */
static inline int session_count_sum_numbers(int field_count)
{
    return field_count == 1 ? 4 : field_count == 2 ? 8 : 10;
}

static inline int session_count_sum_words(int field_count)
{
    return 2 * session_count_sum_numbers(field_count);
}

/* Bounds of the numbers that cells add to sums. The bounds for several grids or ranks are the maxima of each member. */
typedef struct session_gradient_bounds {
    double largest_difference; /* largest difference of a field's values along an edge at a cell's corner */
    /* largest value of 1 / (sum of the squared lengths of the edges at a cell's corner), with lengths as multiples of
     * the `length` that scales all gradients; 0: there are no corners */
    double largest_inverse_square;
} session_gradient_bounds;

/* The cells that have a vertex at which a sum is computed, in any order. If the basis has polynomials, these are the
 * caller's cells; otherwise they are cells of the grid. */
typedef struct session_cell_list {
    int64_t count;
    int64_t *cells;
} session_cell_list;

/* Lists the cells that have a vertex at which a sum is computed. Returns false if memory runs out. The caller must free
 * out->cells. Local. */
bool session_list_cells_with_sums(const session_gradient_basis *basis, session_cell_list *out);

/* Computes the bounds of the numbers that the cells add to any sum. Returns false if memory runs out. Local. */
bool session_bound_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                             session_gradient_bounds *out);

/* Returns an array with one byte per sum. In the byte of a sum, session_add_gradients() records which thread adds to
 * this sum, or that several threads do. It is allocated by base_alloc(); NULL if memory runs out. Local. */
unsigned char *session_create_sum_owners(int64_t sum_count, int threads);

/* Adds the cells' contributions to the sums. Each sum has session_count_sum_words() words. bounds: the bounds over all
 * grids and ranks; owners: the array for these sums, shared by all grids. Returns false if memory runs out. Local. */
bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                           const session_gradient_bounds *bounds, unsigned char *owners, int64_t *sums);

/* Computes the mean gradients from a sum, in units of values divided by coordinates. They are NaN if no cell
 * contributed. length: session_gradient_basis.length of the sums. */
void session_compute_mean_gradients(const int64_t *sum, int field_count, const session_gradient_bounds *bounds,
                                    double length, double out[][3]);

#endif
