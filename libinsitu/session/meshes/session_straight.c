#include "session_straight.h"

#include <math.h>

#include "memory.h"
#include "session_derivatives.h"
#include "session_region.h"
#include "session_rows.h"
#include "session_shape.h"

/* Largest distance of a node of a straight cell from its position in the linear cell with the same corners. It is a
 * fraction of the extent of the cell's corners divided by the order. The slope of a face is then wrong by at most about
 * 1e-4 times a small factor that depends on the order. This error is less than one of 255 levels of brightness. */
static const double slack = 1e-4;

/* For cells of one type with one number of nodes: the positions that their nodes have in the linear cell with the same
 * corners. */
typedef struct linear_positions {
    session_nodes of;
    int corner_count;
    int corners[8]; /* for each corner, its position in the cell's list of nodes in the connectivity */
    /* For equispaced nodes (index 0) and for Gauss-Lobatto points (index 1): for each node, in the order of the cell's
     * list of nodes, the weights of the corners; the weighted mean of the corners is the node's position in the linear
     * cell. NULL: cells of this type and order cannot have such nodes, or are not checked. */
    double (*weights[2])[8];
} linear_positions;

typedef struct straight_work {
    session_rows rows;
    linear_positions kinds[ROWS_MOST_KINDS];
} straight_work;

/* Computes the weights of the corners at a point of a linear cell. at: coordinates of the point in the reference
 * cell. */
static void find_corner_weights(int type, const double at[3], double out[8])
{
    const session_shape *shape = session_get_cell_shape(type);
    const int simplex_axes = type == GRID_TET ? 3 : type == GRID_TRIANGLE || type == GRID_WEDGE ? 2 : 0;
    const int axes = type == GRID_TRIANGLE || type == GRID_QUAD ? 2 : 3;
    for (int c = 0; c < shape->corner_count; c++) {
        double rest = 1;
        bool is_origin = true;
        out[c] = 1;
        for (int a = 0; a < simplex_axes; a++) {
            rest -= at[a];
            if (!shape->corners[c][a]) continue;
            out[c] = at[a];
            is_origin = false;
        }
        if (simplex_axes && is_origin) out[c] = rest;
        for (int a = simplex_axes; a < axes; a++) out[c] *= shape->corners[c][a] ? at[a] : 1 - at[a];
    }
}

static bool fill_weights(const session_nodes *of, insitu_vertex_order order, bool is_lobatto, double (**out)[8])
{
    const int p = of->order;
    double x[NODES_MOST_ORDER + 1];
    session_compute_node_positions(p, is_lobatto, x);
    *out = base_calloc((size_t)of->count, sizeof **out);
    for (int k = 0; k <= p && *out; k++)
        for (int j = 0; j <= p; j++)
            for (int i = 0; i <= p; i++) {
                if (!session_has_node(of, i, j, k)) continue;
                const int node = session_find_node_in_connectivity(of, order, i, j, k);
                if (node < of->count) find_corner_weights(of->type, (const double[]){x[i], x[j], x[k]}, (*out)[node]);
            }
    return *out;
}

static bool make_linear_positions(const session_nodes *of, insitu_vertex_order order, linear_positions *out)
{
    const session_shape *shape = session_get_cell_shape(of->type);
    *out = (linear_positions){.of = *of, .corner_count = shape->corner_count};
    if (of->order == 1 || of->type == GRID_PYRAMID) return true;
    session_find_corners(of, order, out->corners);
    return fill_weights(of, order, false, &out->weights[0]) &&
           (!session_may_have_lobatto_nodes(of) || fill_weights(of, order, true, &out->weights[1]));
}

static bool create_straight_work(const insitu_mesh *given, straight_work *w)
{
    *w = (straight_work){.rows = session_describe_caller_rows(given)};
    session_list_cell_kinds(&w->rows);
    bool is_made = true;
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        is_made = make_linear_positions(&w->rows.kinds[i].nodes, given->vertex_order, &w->kinds[i]);
    return is_made;
}

static void free_straight_work(straight_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++)
        for (int n = 0; n < 2; n++) base_free(w->kinds[i].weights[n]);
}

/* Returns whether all nodes of a cell are where the linear cell with the same corners has them. first: index in the
 * connectivity of the cell's first node. weights: for each node, the weights of the corners whose weighted mean is the
 * expected position. corners: positions of the corners. */
static bool is_straight(const straight_work *w, const linear_positions *kind, int64_t first, const double (*weights)[8],
                        const double (*corners)[3], double tolerance)
{
    for (int n = 0; n < kind->of.count; n++) {
        double at[3];
        grid_read_vertex_position(&w->rows.cells, session_row_vertex(&w->rows, first + n), at);
        for (int x = 0; x < 3; x++) {
            double expected = 0;
            for (int c = 0; c < kind->corner_count; c++) expected += weights[n][c] * corners[c][x];
            if (!(fabs(at[x] - expected) <= tolerance)) return false;
        }
    }
    return true;
}

static bool is_bent(const straight_work *w, int64_t cell)
{
    const linear_positions *kind = &w->kinds[session_find_kind_of_cell(&w->rows, cell)];
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    double corners[8][3], extent = 0;
    if (!kind->weights[0] || grid_is_ghost(&w->rows.cells, cell)) return false;
    for (int c = 0; c < kind->corner_count; c++) {
        grid_read_vertex_position(&w->rows.cells, session_row_vertex(&w->rows, first + kind->corners[c]), corners[c]);
        for (int x = 0; x < 3; x++) extent = fmax(extent, fabs(corners[c][x] - corners[0][x]));
    }
    const double tolerance = slack * extent / kind->of.order;
    for (int n = 0; n < 2; n++)
        if (kind->weights[n] &&
            is_straight(w, kind, first, (const double(*)[8])kind->weights[n], (const double(*)[3])corners, tolerance))
            return false;
    return true;
}

bool session_has_bent_cells(const session_mesh *mesh, int threads)
{
    straight_work *w = base_alloc(sizeof *w);
    bool is_any = !w || !create_straight_work(mesh->finer.parts ? &mesh->finer.nodal : &mesh->given, w);
    if (w && !is_any) {
        const int64_t cells = w->rows.cells.cell_count;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells)) reduction(|| : is_any)
        {
            region_enter();
#pragma omp for schedule(static) nowait
            for (int64_t cell = 0; cell < cells; cell++) is_any = is_any || is_bent(w, cell);
            region_leave();
        }
    }
    if (w) free_straight_work(w);
    base_free(w);
    return is_any;
}
