/* Gradients of fields at vertices, from the cells around them. Their bits do not depend on the order of the cells or on
 * the ranks that have them. */
#ifndef SESSION_GRADIENTS_H
#define SESSION_GRADIENTS_H

#include "grid.h"

enum { SESSION_GRADIENTS = 3 /* maximum number of scalars whose gradients one pass sums */ };

/* Input of sums. The values are at the vertices. */
typedef struct session_gradient_basis {
    const grid *cells;
    const grid_field *fields; /* field_count scalars */
    int field_count;          /* 1 .. SESSION_GRADIENTS */
    bool of_shells;           /* sums are of shells, in whose planes their gradients lie; else of cells with volume */
    const int32_t *entries;   /* for each vertex the index of its sum, or -1 */
    double length;            /* a power of two near the size of the scene; the same on all ranks */
    int threads;
} session_gradient_basis;

/* A sum over the cells around a vertex consists of integer words: adding two sums word by word is exact, and so
 * independent of the order. The words are the high words of three components for each scalar, of the weights, and of
 * padding, and then the low words. */
static inline int session_sum_numbers(int field_count)
{
    return field_count == 1 ? 4 : field_count == 2 ? 8 : 10;
}

static inline int session_sum_words(int field_count)
{
    return 2 * session_sum_numbers(field_count);
}

/* Bounds of the numbers that cells add to sums; over several grids or ranks the maximum of each is taken. */
typedef struct session_gradient_bounds {
    double rise; /* largest rise along an edge of a corner */
    /* largest 1 / (sum of the squares of a corner's edges, in units of `length`); 0: there are no corners */
    double sharpness;
} session_gradient_bounds;

/* The cells with a vertex that has a sum, in any order. */
typedef struct session_cell_list {
    int64_t count;
    int64_t *cells;
} session_cell_list;

/* Lists the cells. Returns false if memory ran out. The caller frees out->cells. Local. */
bool session_list_cells(const session_gradient_basis *basis, session_cell_list *out);

/* Computes the bounds of the numbers that the cells add to any sum. Returns false if memory ran out. Local. */
bool session_bound_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                             session_gradient_bounds *out);

/* Returns a byte per sum, in which threads note which of them adds to it, from base_alloc(); NULL if memory ran out.
 * Local. */
unsigned char *session_sum_owners(int64_t sum_count, int threads);

/* Adds the cells' contributions. bounds: over all grids and ranks; owners: those of the sums, shared by all grids;
 * sums: session_sum_words() for each. Returns false if memory ran out. Local. */
bool session_add_gradients(const session_gradient_basis *basis, const session_cell_list *list,
                           const session_gradient_bounds *bounds, unsigned char *owners, int64_t *sums);

/* Computes the mean gradients of a sum, in the units of values over those of coordinates; NaN if no cell contributed.
 * length: that of the basis. */
void session_mean_gradients(const int64_t *sum, int field_count, const session_gradient_bounds *bounds, double length,
                            double out[][3]);

#endif
