/* The values of the caller's cells in meshes with cells of higher order, as integrals of the cells' polynomials. They
 * do not depend on the linear pieces into which the cells are divided. */
#ifndef SESSION_ORDER_VALUES_H
#define SESSION_ORDER_VALUES_H

#include "error.h"
#include "session_cell_value.h"
#include "session_fixed_sums.h"
#include "session_mesh.h"

/* A field on a mesh whose cells are split into pieces. */
typedef struct session_order_field {
    const session_mesh *mesh;
    grid_field values; /* the values at the vertices or cells that are read in place of the caller's nodes */
    int given;         /* the field whose values the caller gives at nodes, or -1: only `values` are read */
    bool is_lobatto;   /* as in session_make_interpolation() */
    int threads;
} session_order_field;

/* Returns the index of a mesh's field if its values at the caller's nodes can be read (session_order_field.given);
 * otherwise -1: it is derived, at cells, or on a mirror image. */
int session_find_caller_nodes(const session_mesh *mesh, int field);

/* Computes the value of each of the caller's cells. The caller must free *out in any case. Parallel. Local. */
insitu_status session_find_order_values(const session_order_field *of, session_cell_value **out, base_error *error);

/* The volumes that cells have in the bins of a histogram. */
typedef struct session_binned_volumes {
    session_bins bins;
    bool is_whole;     /* set if the range of the bins is that of the values; values beyond it are in the end bins */
    bool is_of_shells; /* set if only shells are counted; otherwise only cells with a volume are */
    double largest;    /* the volume of the largest cell, by which volumes are divided */
    int64_t *sums;     /* for each bin, a sum in fixed point (session_fixed_sums.h) */
} session_binned_volumes;

/* Adds the volumes in bins of those cells whose values vary (session_cell_value.is_integral). cells: those from
 * session_find_order_values(). Parallel. Local. */
insitu_status session_bin_order_values(const session_order_field *of, const session_cell_value *cells,
                                       const session_binned_volumes *out, base_error *error);

#endif
