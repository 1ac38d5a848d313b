/* Computes the values of the caller's cells in meshes with cells of higher order, as integrals of the cells'
 * polynomials. The results do not depend on the linear pieces into which the cells are divided. */
#ifndef SESSION_ORDER_VALUES_H
#define SESSION_ORDER_VALUES_H

#include "error.h"
#include "session_cell_value.h"
#include "session_fixed_sums.h"
#include "session_mesh.h"

/* A field on a mesh whose cells are split into pieces. */
typedef struct session_order_field {
    const session_mesh *mesh;
    grid_field values; /* values at the vertices or cells of session_mesh.cells */
    int given;         /* index of the field whose values at the caller's nodes are read; -1: only `values` are read */
    /* set if nodes along the axes of hexes and quads are Gauss-Lobatto points; otherwise they are equispaced */
    bool is_lobatto;
    int threads;
} session_order_field;

/* Returns the index of a mesh's field if its values at the caller's nodes can be read (session_order_field.given);
 * returns -1 if the field is derived, has values in cells, or belongs to a mirror image. */
int session_find_field_with_caller_nodes(const session_mesh *mesh, int field);

/* Computes the value of each of the caller's cells. The caller must free *out in any case. Parallel. Local. */
insitu_status session_compute_higher_order_cell_values(const session_order_field *of, session_cell_value **out,
                                                       base_error *error);

/* The volumes that cells have in the bins of a histogram. */
typedef struct session_binned_volumes {
    session_bins bins;
    bool is_whole;     /* true: the range of the bins is the range of all values, and values beyond it are added to the
                          first or last bin */
    bool is_of_shells; /* true: only shells are counted; false: only cells with a volume are counted */
    double largest;    /* the volume of the largest cell, by which volumes are divided */
    int64_t *sums;     /* for each bin, a sum in fixed point (session_fixed_sums.h) */
} session_binned_volumes;

/* Adds the volumes of cells to the bins in out->sums. Only cells in which the value varies are added
 * (session_cell_value.is_integral). cells: the values from session_compute_higher_order_cell_values(). Parallel. Local.
 */
insitu_status session_add_higher_order_cells_to_bins(const session_order_field *of, const session_cell_value *cells,
                                                     const session_binned_volumes *out, base_error *error);

#endif
