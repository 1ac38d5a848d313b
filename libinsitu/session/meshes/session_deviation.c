#include "session_deviation.h"

#include <math.h>

#include "memory.h"
#include "session_agree.h"
#include "session_region.h"
#include "session_rows.h"

static void read_values(const session_rows *rows, const session_deviation_request *request, int64_t cell, int count,
                        double *tuple, double *out)
{
    const session_node_values *values = request->values;
    const int64_t first = session_find_first_entry_of_cell(rows, cell);
    for (int n = 0; n < count; n++) {
        values->read(values->of,
                     values->is_by_entry ? session_row_entry(rows, cell, n) : session_row_vertex(rows, first + n),
                     tuple);
        out[n] = tuple[request->component];
    }
}

static void read_distances(const session_rows *rows, const session_plane *plane, int64_t cell, int count, double *out)
{
    const int64_t first = session_find_first_entry_of_cell(rows, cell);
    for (int n = 0; n < count; n++) {
        double at[3];
        grid_read_vertex_position(&rows->cells, session_row_vertex(rows, first + n), at);
        out[n] = 0;
        for (int x = 0; x < 3; x++) out[n] += plane->normal[x] * (at[x] - plane->point[x]);
    }
}

void session_read_request_values(const session_rows *rows, const session_deviation_request *request, int64_t cell,
                                 int count, double *tuple, double *out)
{
    if (request->values)
        read_values(rows, request, cell, count, tuple, out);
    else
        read_distances(rows, request->plane, cell, count, out);
}

/* The input from which the error bounds of a mesh's cells are computed. */
typedef struct deviation_work {
    session_rows rows; /* access to each cell's list of nodes */
    const session_deviation_request *request;
    int field_size; /* number of components of the request's field; 1 if the request has no field */
    /* for each kind of cell (type and number of nodes), the matrices from which error bounds are computed; empty for
     * kinds that are not measured */
    session_bound bounds[ROWS_MOST_KINDS];
} deviation_work;

/* Returns whether session_make_bound() supports cells with these nodes. The result is also true for linear cells, which
 * have no error. They must be marked if a surface may cross them, since their neighbours may be of higher order. */
static bool can_bound_cell_errors(const session_nodes *of)
{
    return of->order <= (of->type == GRID_PYRAMID ? (int)INTERPOLATION_MOST_PYRAMID : (int)BOUND_MOST_ORDER);
}

static bool create_deviation_work(const session_mesh *mesh, const session_deviation_request *request, deviation_work *w)
{
    const insitu_mesh *nodal = session_get_mesh_of_caller_nodes(mesh);
    bool is_made = true;
    *w = (deviation_work){.rows = session_describe_caller_rows(nodal),
                          .request = request,
                          .field_size = request->values ? request->values->component_count : 1};
    session_list_cell_kinds(&w->rows);
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        if (can_bound_cell_errors(&w->rows.kinds[i].nodes))
            is_made =
                session_make_bound(&w->rows.kinds[i].nodes, nodal->vertex_order, request->is_lobatto, &w->bounds[i]);
    return is_made;
}

static void free_deviation_work(deviation_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++) session_drop_bound(&w->bounds[i]);
}

/* Returns the number of doubles in a thread's buffer, which contains one tuple of the field, the values at a cell's
 * nodes, the tuples (x, y, z, value) at these nodes, and working memory. */
static size_t find_buffer_size(const deviation_work *w)
{
    size_t most = 0;
    for (int i = 0; i < w->rows.kind_count; i++) {
        if (!w->bounds[i].level_count) continue;
        const size_t own = 5 * (size_t)w->bounds[i].nodes.of.count + session_bound_work_size(&w->bounds[i]);
        most = own > most ? own : most;
    }
    return most + (size_t)w->field_size;
}

/* Returns whether the cell is measured: an isosurface or the plane may cross it, or the request measures cells
 * regardless of crossings. Marks the cell if it may be crossed. If the request has a field or a plane, the values at
 * the cell's nodes are stored in the buffer. */
static bool may_surface_cross_cell(const deviation_work *w, const session_bound *of, int64_t cell, double *buffer)
{
    const session_deviation_request *request = w->request;
    const int count = of->nodes.of.count;
    double *values = buffer + w->field_size;
    if (!request->values && !request->plane) return !request->measured || request->measured[cell];
    session_read_request_values(&w->rows, request, cell, count, buffer, values);
    if (request->is_of_values) return true;
    if (!session_may_isosurface_cross_cell(of, values, &request->isovalues, values + 5 * count)) return false;
    if (request->marks) request->marks[cell] = 1;
    return true;
}

/* Computes the bounds of a cell. If the request has a field, may_surface_cross_cell() must have stored the cell's
 * values in the buffer. */
static session_cell_bound bound_errors_of_cell(const deviation_work *w, const session_bound *of, int64_t cell,
                                               int level, double *buffer)
{
    const bool has_values = w->request->values != NULL;
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    const int count = of->nodes.of.count;
    double *values = buffer + w->field_size, *tuples = values + count;
    for (int n = 0; n < count; n++) {
        grid_read_vertex_position(&w->rows.cells, session_row_vertex(&w->rows, first + n), tuples + 4 * n);
        tuples[4 * n + 3] = has_values ? values[n] : 0;
    }
    const bool has_isovalues = has_values && !w->request->is_of_values;
    return session_bound_cell_errors(of, tuples, has_isovalues ? &w->request->isovalues : NULL, level,
                                     tuples + 4 * count);
}

/* Returns the largest surface error that is reported for a cell: half the distance between two nodes, plus the error of
 * positions. Half the distance is the error if the exact surface between two nodes is half a circle. If a surface bends
 * more, the nodes do not resolve it. */
static double find_largest_reported_error(const session_cell_bound *bound)
{
    return 0.5 * bound->node_distance + bound->position_error;
}

/* Returns a bound of the isosurfaces' error in a cell. first: the bounds that the coarsest lattice gives. As long as
 * the bound exceeds `enough` or find_largest_reported_error(), it is also computed on the next finer lattice, and the
 * smallest of these bounds is returned. */
static double find_surface_error(const deviation_work *w, const session_bound *of, int64_t cell, double enough,
                                 const session_cell_bound *first, double *buffer)
{
    double least = first->surface_error;
    for (int level = 1; level < of->level_count; level++)
        if (!(least <= enough && least <= find_largest_reported_error(first)))
            least = fmin(least, bound_errors_of_cell(w, of, cell, level, buffer).surface_error);
    return least;
}

/* Extends the range in *out by the cell's values, which may_surface_cross_cell() has stored in the buffer, and passes
 * the cell to the request's use_cell(). */
static void extend_range_by_cell_values(const deviation_work *w, const session_bound *of, int64_t cell, double *buffer,
                                        session_deviation *out)
{
    const session_deviation_request *request = w->request;
    const int count = of->nodes.of.count;
    const double *values = buffer + w->field_size;
    for (int n = 0; n < count; n++) {
        out->low = fmin(out->low, values[n]);
        out->high = fmax(out->high, values[n]);
    }
    if (!request->use_cell) return;
    const session_cell_bound bound = bound_errors_of_cell(w, of, cell, 0, buffer);
    const session_value_cell read = {count, (const double(*)[4])(values + count), &bound};
    if (bound.is_crossed) request->use_cell(request->of_values, &read);
}

/* Returns the estimated number of pixels in which an isosurface is seen in a cell, in units of 1/16 of a pixel. If a
 * plane with a random position and direction crosses a cell, the part of the plane in the cell has the mean area V / B,
 * where V is the cell's volume and B its mean width. A quarter of the area of a closed surface is seen: on average the
 * projected area is half of the area, and the front half of the surface hides the back half. The result is a whole
 * number, so that sums over cells do not depend on their order. size: the size of a pixel. */
static int64_t estimate_area(const session_cell_bound *bound, const session_nodes *of, double size)
{
    /* for regular cells whose edges have the length 1: a quarter of the mean area of a plane's part in the cell */
    static const double tet = 0.032, pyramid = 0.055, wedge = 0.09, hex = 0.167;
    const int type = of->type;
    const double share = type == GRID_TET ? tet : type == GRID_PYRAMID ? pyramid : type == GRID_WEDGE ? wedge : hex;
    const double edge = bound->node_distance * of->order / size;
    return (int64_t)fmin(16 * share * edge * edge, 1e12);
}

/* Computes the error bound or the values of a cell, as requested, and updates *out. The bound of isosurfaces is first
 * computed on the coarsest lattice, and finer lattices can only lower it. They are tried only while the bound exceeds
 * the largest bound of the cells before or find_largest_reported_error(); a smaller bound cannot change the result. The
 * result therefore does not depend on the order of cells. */
static void measure_error_of_cell(const deviation_work *w, int64_t cell, double *buffer, session_deviation *out)
{
    const session_bound *of = &w->bounds[session_find_kind_of_cell(&w->rows, cell)];
    const session_pixels *pixels = &w->request->pixels;
    if (!of->level_count || grid_is_ghost(&w->rows.cells, cell) || !may_surface_cross_cell(w, of, cell, buffer)) return;
    if (w->request->is_of_values) extend_range_by_cell_values(w, of, cell, buffer, out);
    if (w->request->is_of_values || w->request->marks_only || of->nodes.of.order < 2) return;
    const session_cell_bound bound = bound_errors_of_cell(w, of, cell, 0, buffer);
    const double size = bound.is_crossed ? pixels->size(pixels->of, bound.centre, bound.radius) : INFINITY;
    if (size == INFINITY) return;
    double error = bound.position_error;
    if (w->request->values) {
        error = find_surface_error(w, of, cell, out->error * size, &bound, buffer);
        out->cell_count++;
        out->unbounded_count += error > find_largest_reported_error(&bound);
        out->area += estimate_area(&bound, &of->nodes.of, size);
        error = fmin(error, find_largest_reported_error(&bound));
    }
    out->error = fmax(out->error, error / size);
}

static bool measure_errors_of_all_cells(const deviation_work *w, int threads, session_deviation *out)
{
    const int64_t cells = w->rows.cells.cell_count;
    const size_t buffer_size = find_buffer_size(w);
    bool is_lacking = false;
    double error = out->error, low = out->low, high = out->high;
    int64_t count = 0, unbounded = 0, area = 0;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells)) reduction(|| : is_lacking)                    \
    reduction(max : error, high) reduction(min : low) reduction(+ : count, unbounded, area)
    {
        region_enter();
        double *buffer = base_alloc(buffer_size * sizeof *buffer);
        session_deviation own = {.error = error, .low = low, .high = high};
        is_lacking = !buffer;
#pragma omp for schedule(static)
        for (int64_t cell = 0; cell < cells; cell++)
            if (buffer) measure_error_of_cell(w, cell, buffer, &own);
        error = own.error;
        low = own.low;
        high = own.high;
        count = own.cell_count;
        unbounded = own.unbounded_count;
        area = own.area;
        base_free(buffer);
        region_leave();
    }
    out->error = error;
    out->low = low;
    out->high = high;
    out->cell_count += count;
    out->unbounded_count += unbounded;
    out->area += area;
    return !is_lacking;
}

insitu_status session_measure_linearization_error(const session_mesh *mesh, const session_deviation_request *request,
                                                  int threads, session_deviation *out, base_error *error)
{
    deviation_work *w = base_alloc(sizeof *w);
    const bool is_made = w && create_deviation_work(mesh, request, w) && measure_errors_of_all_cells(w, threads, out);
    if (w) free_deviation_work(w);
    base_free(w);
    if (is_made) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for the bound of its cells of higher order",
                     mesh->label);
}
