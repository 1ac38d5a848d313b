/* The value in a cell is the polynomial through the values at the cell's own nodes. For a field of the caller, these
 * are the caller's values, or a component or the magnitude of them. A derived field has values only at the vertices of
 * the session's mesh (session_mesh.cells). If these vertices form finer lattices with n pieces between two nodes, the
 * values at every n-th point of a lattice are used, because these points are the cell's own nodes.
 *
 * The functions of pyramids of an order above INTERPOLATION_MOST_PYRAMID are not implemented. Integrals over their
 * linear pieces are added up instead, and a mesh with such pyramids has no finer lattices. The value of a linear cell
 * is the mean of the values at its vertices, as in meshes of linear cells.
 *
 * Each cell's results depend only on its own nodes, and therefore not on the partition. */
#include "session_order_values.h"

#include "memory.h"
#include "session_agree.h"
#include "session_cell_rules.h"
#include "session_deviation.h"
#include "session_indexed.h"
#include "session_region.h"
#include "session_rows.h"
#include "session_scalars.h"
#include "session_tally.h"

/* A pass over the cells of a mesh: computes their values or, if `binned` is given, the volumes that they have in the
 * bins of a histogram. */
typedef struct order_pass {
    const session_order_field *of;
    const session_binned_volumes *binned;
    const session_cell_value *cells; /* the values of all cells, if `binned` is given */
    session_cell_value *out;         /* receives the values of all cells, if `binned` is NULL */
    session_rows rows;               /* access to each cell's list of the caller's nodes */
    /* access to each cell's list of the nodes whose values are read. In refined cells these are the nodes of a finer
     * lattice (session_finer.h), which include the cell's own nodes. */
    session_rows lattice;
    const session_node_values *values; /* the caller's values at nodes; NULL: of->values is read */
    session_cell_rules rules[ROWS_MOST_KINDS];
} order_pass;

/* Memory of one thread. */
typedef struct order_buffer {
    double *tuple, *values, *tuples, *work; /* tuple: a tuple of the field; values: values at the nodes of a cell;
                                               tuples: x, y, z and value at the nodes; work: working memory */
    volume_buffer volume;
} order_buffer;

/* ---- values at nodes --------------------------------------------------------------------------------------------- */

/* Returns the component of a tuple, or its magnitude, bitwise equal to the result of grid_field_value(). */
static double find_component_of_tuple(const grid_field *field, const double *tuple)
{
    if (field->component >= 0) return tuple[field->component];
    double sum = 0;
    for (int c = 0; c < field->component_count; c++) sum += tuple[c] * tuple[c];
    return sqrt(sum);
}

static void read_caller_values(const order_pass *p, int64_t cell, int count, double *tuple, double *out)
{
    const session_node_values *values = p->values;
    const int64_t first = session_find_first_entry_of_cell(&p->rows, cell);
    for (int n = 0; n < count; n++) {
        values->read(values->of,
                     values->is_by_entry ? session_row_entry(&p->rows, cell, n)
                                         : session_row_vertex(&p->rows, first + n),
                     tuple);
        out[n] = find_component_of_tuple(&p->of->values, tuple);
    }
}

/* Reads the values at a cell's own nodes, if the vertices of the session's mesh are the nodes of a finer lattice in the
 * cell. Every step-th node of this lattice is a node of the cell. */
static void read_lattice_values(const order_pass *p, const session_interpolation *nodes, int64_t cell, double *out)
{
    const session_nodes *of = &nodes->complete;
    const int finest = of->order * p->of->mesh->finer.parts;
    session_nodes fine = session_describe_complete_nodes(of->type, finest);
    if (session_count_nodes_of_cell(&p->lattice, cell) != fine.count) fine = *of;
    const int step = fine.order / of->order, size = of->order + 1;
    for (int n = 0; n < size * size * size; n++) {
        const int at[3] = {n % size, n / size % size, n / size / size};
        if (!session_has_node(of, at[0], at[1], at[2])) continue;
        const int node = session_find_node_in_connectivity(of, INSITU_ORDER_LEXICOGRAPHIC, at[0], at[1], at[2]);
        const int position = nodes->positions[node];
        if (position >= nodes->of.count) continue;
        const int finer = session_find_node_in_connectivity(&fine, INSITU_ORDER_LEXICOGRAPHIC, step * at[0],
                                                            step * at[1], step * at[2]);
        out[position] = grid_field_value(&p->of->values, session_find_vertex_of_node(&p->lattice, cell, finer));
    }
}

static void read_values(const order_pass *p, const session_interpolation *nodes, int64_t cell, double *tuple,
                        double *out)
{
    const int count = nodes->of.count;
    if (p->of->values.is_cell_centred) {
        const double value = grid_field_value(&p->of->values, session_first_piece(p->of->mesh, cell));
        for (int n = 0; n < count; n++) out[n] = value;
    } else if (p->values) {
        read_caller_values(p, cell, count, tuple, out);
    } else if (p->of->mesh->finer.parts) {
        read_lattice_values(p, nodes, cell, out);
    } else {
        for (int n = 0; n < count; n++)
            out[n] = grid_field_value(&p->of->values, session_find_vertex_of_node(&p->lattice, cell, n));
    }
}

/* ---- linear cells and pyramids of high order --------------------------------------------------------------------- */

static grid_array make_array_of_doubles(const double *data, int stride)
{
    return (grid_array){.data = (const char *)data, .stride = stride * (int64_t)sizeof *data, .is_wide = true};
}

/* Computes the value of a linear cell by reading it as a mesh of one cell. */
static session_cell_value find_linear_value(const order_pass *p, const session_interpolation *nodes, int64_t cell,
                                            order_buffer *buffer)
{
    static const int32_t identity[GRID_MAX_CELL_VERTICES] = {0, 1, 2, 3, 4, 5, 6, 7};
    const int64_t first = session_find_first_entry_of_cell(&p->rows, cell);
    double points[GRID_MAX_CELL_VERTICES][3] = {{0}}, values[GRID_MAX_CELL_VERTICES] = {0};
    const int count = grid_type_vertex_count(nodes->of.type);
    read_values(p, nodes, cell, buffer->tuple, buffer->values);
    for (int c = 0; c < count; c++) {
        grid_read_vertex_position(&p->rows.cells, session_row_vertex(&p->rows, first + nodes->corners[c]), points[c]);
        values[c] = buffer->values[nodes->corners[c]];
    }
    grid one = {.vertex_count = count, .cell_count = 1, .cell_type = nodes->of.type};
    one.connectivity =
        (grid_array){.data = (const char *)identity, .stride = (int64_t)sizeof *identity, .is_integer = true};
    for (int axis = 0; axis < 3; axis++) one.coordinates[axis] = make_array_of_doubles(points[0] + axis, 3);
    const uint64_t flat = tally_is_flat(&one, 0);
    one.flat = &flat;
    const grid_field field = {.values = make_array_of_doubles(values, 1),
                              .component_count = 1,
                              .is_cell_centred = p->of->values.is_cell_centred};
    return session_read_cell_value(&one, &field, 0, &buffer->volume);
}

/* Returns whether integrals over the cell are computed as sums over its linear pieces, because its nodal functions are
 * not implemented. Such cells are never refined (session_finer.c). */
static bool is_integrated_over_pieces(const session_nodes *nodes)
{
    return nodes->type == GRID_PYRAMID && nodes->order > INTERPOLATION_MOST_PYRAMID;
}

/* Adds up the integrals over the linear pieces of a cell whose nodal functions are not implemented. */
static session_cell_value sum_pieces(const order_pass *p, int64_t cell, order_buffer *buffer)
{
    const session_mesh *mesh = p->of->mesh;
    const int64_t first = session_first_piece(mesh, cell), end = session_first_piece(mesh, cell + 1);
    session_cell_value out = {.is_integral = true, .minimum = INFINITY, .maximum = -INFINITY};
    if (end - first == 1) return session_read_cell_value(&mesh->cells, &p->of->values, first, &buffer->volume);
    double squares = 0;
    for (int64_t piece = first; piece < end; piece++) {
        const session_cell_value value = session_read_cell_value(&mesh->cells, &p->of->values, piece, &buffer->volume);
        if (!value.is_counted) continue;
        out.is_counted = true;
        out.minimum = fmin(out.minimum, value.minimum);
        out.maximum = fmax(out.maximum, value.maximum);
        /* the mean and the sum of squares around it are updated, which avoids cancellation (Welford, 1962) */
        out.volume += value.volume;
        const double share = out.volume > 0 ? value.volume / out.volume : 0;
        const double half = 0.5 * value.mean - 0.5 * out.mean;
        squares += (1 - share) * value.volume * half * half;
        out.mean = (1 - share) * out.mean + share * value.mean;
    }
    out.half_deviation = out.volume > 0 ? sqrt(squares / out.volume) : 0;
    return out;
}

/* ---- integrals of polynomials ------------------------------------------------------------------------------------ */

/* A cell is treated as flat if its volume is at most this fraction of the volume of its bounding box. The fraction
 * covers rounding errors of products of derivatives, each of which is a sum over the nodes. */
static const double flat_share = 0x1p-40;

typedef struct cell_integrals {
    double volume, size; /* integrals over the cell of the volume (or area) element, and of its absolute value */
    /* integrals of v and of v^2, where v is the value's position (0 to 1) in the range of the values at the cell's
     * nodes, minus 1/2 */
    double first, second;
} cell_integrals;

static void add_integrals(void *of, int count, const double *measures, const double *values)
{
    cell_integrals *sums = of;
    for (int i = 0; i < count; i++) {
        const double value = values[i] - 0.5;
        sums->volume += measures[i];
        sums->size += fabs(measures[i]);
        sums->first += measures[i] * value;
        sums->second += measures[i] * value * value;
    }
}

/* The range of the values at a cell's nodes. In computations, values are scaled so that this range becomes 0 .. 1. */
typedef struct scaled_cell {
    bool is_finite;
    double minimum, maximum;
    double box; /* volume of the bounding box of the cell's nodes */
} scaled_cell;

/* Reads the positions and values at a cell's nodes. The values are scaled, so that squares of large values do not
 * overflow. */
static scaled_cell read_tuples(const order_pass *p, const session_interpolation *nodes, int64_t cell,
                               order_buffer *buffer)
{
    const int64_t first = session_find_first_entry_of_cell(&p->rows, cell);
    scaled_cell out = {true, INFINITY, -INFINITY, 1};
    double lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY};
    read_values(p, nodes, cell, buffer->tuple, buffer->values);
    for (int n = 0; n < nodes->of.count; n++) {
        double *tuple = buffer->tuples + 4 * n;
        const double value = buffer->values[n];
        out.is_finite = out.is_finite && isfinite(value);
        out.minimum = fmin(out.minimum, value);
        out.maximum = fmax(out.maximum, value);
        grid_read_vertex_position(&p->rows.cells, session_row_vertex(&p->rows, first + n), tuple);
        for (int x = 0; x < 3; x++) {
            lower[x] = fmin(lower[x], tuple[x]);
            upper[x] = fmax(upper[x], tuple[x]);
        }
    }
    for (int n = 0; n < nodes->of.count; n++)
        buffer->tuples[4 * n + 3] = position_in_range(buffer->values[n], out.minimum, out.maximum);
    for (int x = 0; x < 3; x++) out.box *= upper[x] - lower[x];
    return out;
}

static session_cell_value integrate_cell(const order_pass *p, const session_cell_rules *rules, int64_t cell,
                                         order_buffer *buffer)
{
    const scaled_cell scaled = read_tuples(p, &rules->nodes, cell, buffer);
    session_cell_value out = {.is_shell = grid_is_shell_type(rules->nodes.of.type),
                              .is_integral = true,
                              .minimum = scaled.minimum,
                              .maximum = scaled.maximum};
    cell_integrals sums = {0};
    if (!scaled.is_finite) return out;
    session_visit_quadrature_points(rules, buffer->tuples, buffer->work, add_integrals, &sums);
    const double mean = sums.volume != 0 ? sums.first / sums.volume : 0;
    const double variance = sums.volume != 0 ? sums.second / sums.volume - mean * mean : 0;
    out.volume = fabs(sums.volume);
    out.mean = (0.5 - mean) * scaled.minimum + (0.5 + mean) * scaled.maximum;
    out.half_deviation = (0.5 * scaled.maximum - 0.5 * scaled.minimum) * sqrt(fmax(variance, 0));
    out.is_counted = isfinite(out.mean) && isfinite(out.half_deviation) && isfinite(out.volume) &&
                     (out.is_shell || sums.size > flat_share * scaled.box);
    return out;
}

static session_cell_value find_value(const order_pass *p, int64_t cell, order_buffer *buffer)
{
    const int kind = session_find_kind_of_cell(&p->rows, cell);
    const session_nodes *nodes = &p->rows.kinds[kind].nodes;
    if (grid_is_ghost(&p->rows.cells, cell) ||
        !grid_has_finite_cell_value(&p->of->values, session_first_piece(p->of->mesh, cell)))
        return (session_cell_value){.is_counted = false};
    if (is_integrated_over_pieces(nodes)) return sum_pieces(p, cell, buffer);
    if (nodes->order == 1) return find_linear_value(p, &p->rules[kind].nodes, cell, buffer);
    return integrate_cell(p, &p->rules[kind], cell, buffer);
}

/* ---- volumes in the bins of a histogram -------------------------------------------------------------------------- */

/* The parts of one cell's volume in which the value lies in each bin of a histogram. */
typedef struct cell_bins {
    const session_binned_volumes *binned;
    /* range of the values at the cell's nodes; scaled values are 0 at the minimum and 1 at the maximum */
    double minimum, maximum;
    double total;                     /* signed volume of the whole cell, including the parts whose values lie
                                         outside of all bins */
    double volumes[SESSION_MAX_BINS]; /* signed volume in each bin */
} cell_bins;

static void bin_volume(cell_bins *out, double value, double volume)
{
    const session_bins *bins = &out->binned->bins;
    const int bin = out->binned->is_whole ? find_nearest_bin(bins, value) : find_bin(bins, value);
    out->total += volume;
    if (bin >= 0) out->volumes[bin] += volume;
}

static void bin_points(void *of, int count, const double *measures, const double *values)
{
    cell_bins *out = of;
    for (int i = 0; i < count; i++)
        bin_volume(out, (1 - values[i]) * out->minimum + values[i] * out->maximum, measures[i]);
}

static void bin_pieces(const order_pass *p, int64_t cell, order_buffer *buffer, cell_bins *out)
{
    const session_mesh *mesh = p->of->mesh;
    for (int64_t piece = session_first_piece(mesh, cell); piece < session_first_piece(mesh, cell + 1); piece++) {
        const session_cell_value value = session_read_cell_value(&mesh->cells, &p->of->values, piece, &buffer->volume);
        if (value.is_counted) bin_volume(out, value.mean, value.volume);
    }
}

static void bin_cell(const order_pass *p, int64_t cell, order_buffer *buffer, int64_t *sums)
{
    const session_binned_volumes *binned = p->binned;
    const session_cell_value *value = &p->cells[cell];
    const int kind = session_find_kind_of_cell(&p->rows, cell);
    if (!value->is_counted || !value->is_integral || value->is_shell != binned->is_of_shells) return;
    cell_bins own = {.binned = binned, .minimum = value->minimum, .maximum = value->maximum};
    if (is_integrated_over_pieces(&p->rows.kinds[kind].nodes)) {
        bin_pieces(p, cell, buffer, &own);
    } else {
        read_tuples(p, &p->rules[kind].nodes, cell, buffer);
        session_visit_quadrature_points(&p->rules[kind], buffer->tuples, buffer->work, bin_points, &own);
    }
    const double scale = binned->largest > 0 ? (own.total < 0 ? -1 : 1) / binned->largest : 0;
    for (int bin = 0; bin < binned->bins.count; bin++)
        if (own.volumes[bin] != 0) add_fixed_point(sums + (ptrdiff_t)2 * bin, own.volumes[bin] * scale);
}

/* ---- passes over all cells --------------------------------------------------------------------------------------- */

static bool begin_pass(order_pass *p)
{
    const session_mesh *mesh = p->of->mesh;
    bool is_made = true;
    p->rows = session_describe_caller_rows(session_get_mesh_of_caller_nodes(mesh));
    p->lattice = session_describe_rows(mesh);
    session_list_cell_kinds(&p->rows);
    for (int i = 0; i < p->rows.kind_count && is_made; i++) {
        const session_nodes *nodes = &p->rows.kinds[i].nodes;
        const insitu_vertex_order order = session_get_mesh_of_caller_nodes(mesh)->vertex_order;
        if (is_integrated_over_pieces(nodes)) continue;
        is_made = nodes->order == 1 ? session_map_nodes_to_connectivity(nodes, order, &p->rules[i].nodes)
                                    : session_make_cell_rules(nodes, order, p->of->is_lobatto, &p->rules[i]);
    }
    return is_made;
}

static void end_pass(order_pass *p)
{
    for (int i = 0; i < p->rows.kind_count; i++) session_drop_cell_rules(&p->rules[i]);
}

static bool begin_buffer(const order_pass *p, order_buffer *buffer)
{
    size_t nodes = 1, work = 1;
    for (int i = 0; i < p->rows.kind_count; i++) {
        const session_cell_rules *rules = &p->rules[i];
        const size_t own = rules->bent.first.node_count ? session_cell_rules_work_size(rules) : 0;
        const size_t count = (size_t)p->rows.kinds[i].nodes.count;
        nodes = count > nodes ? count : nodes;
        work = own > work ? own : work;
    }
    const size_t components = (size_t)p->of->values.component_count;
    *buffer = (order_buffer){.tuple = base_alloc((components + 5 * nodes + work) * sizeof(double))};
    if (!buffer->tuple) return false;
    buffer->values = buffer->tuple + components;
    buffer->tuples = buffer->values + nodes;
    buffer->work = buffer->tuples + 4 * nodes;
    return true;
}

static bool visit_cells(const order_pass *p, int64_t *sums, int sum_count)
{
    const int64_t cells = p->rows.cells.cell_count;
    bool is_lacking = false;
#pragma omp parallel num_threads(session_choose_loop_threads(p->of->threads, cells)) reduction(|| : is_lacking)             \
    reduction(+ : sums[:sum_count])
    {
        region_enter();
        order_buffer buffer;
        is_lacking = !begin_buffer(p, &buffer);
#pragma omp for schedule(static)
        for (int64_t cell = 0; cell < cells; cell++) {
            if (is_lacking) continue;
            if (p->binned)
                bin_cell(p, cell, &buffer, sums);
            else
                p->out[cell] = find_value(p, cell, &buffer);
        }
        session_volume_free(&buffer.volume);
        base_free(buffer.tuple);
        region_leave();
    }
    return !is_lacking;
}

static insitu_status run_pass(void *of, const session_node_values *values, base_error *error)
{
    order_pass *p = of;
    int64_t none[1] = {0};
    p->values = values;
    const bool is_made =
        begin_pass(p) && visit_cells(p, p->binned ? p->binned->sums : none, p->binned ? 2 * p->binned->bins.count : 1);
    end_pass(p);
    if (is_made) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for integrals over its cells of higher order",
                     p->of->mesh->label);
}

int session_find_field_with_caller_nodes(const session_mesh *mesh, int field)
{
    const session_field *of = &mesh->fields[field];
    return mesh->source || of->is_derived || of->given.centring == INSITU_CELL ? -1 : field;
}

/* Runs the pass with the caller's values at nodes or, if they cannot be read, with the session's values. */
static insitu_status run_pass_with_caller_values(order_pass *p, base_error *error)
{
    if (p->of->given < 0) return run_pass(p, NULL, error);
    return session_pass_node_values(p->of->mesh, p->of->given, run_pass, p, error);
}

insitu_status session_compute_higher_order_cell_values(const session_order_field *of, session_cell_value **out,
                                                       base_error *error)
{
    const int64_t cells = session_count_whole_cells(of->mesh);
    *out = base_calloc((size_t)cells + 1, sizeof **out);
    if (!*out)
        return session_fail_for_memory(error, cells * (int64_t)sizeof **out, "integrals over cells of higher order");
    order_pass p = {.of = of, .out = *out};
    return run_pass_with_caller_values(&p, error);
}

insitu_status session_add_higher_order_cells_to_bins(const session_order_field *of, const session_cell_value *cells,
                                                     const session_binned_volumes *out, base_error *error)
{
    order_pass p = {.of = of, .binned = out, .cells = cells};
    return run_pass_with_caller_values(&p, error);
}
