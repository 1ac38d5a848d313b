/* Computes statistics with integer sums, which are the same for any order of summation (session_fixed_sums.h). Before a
 * cell's volume is added to a sum, it is divided by the volume of the largest cell; the result (0 to 1) is multiplied
 * by 2^52 and rounded. The rounding error is therefore at most 2^-53 of the volume of the largest cell. If there are
 * shells and no cell has a volume, areas are used instead of volumes.
 *
 * The values of the caller's cells of higher order are computed once, in the first pass (session_order_values.h). */
#include "session_statistics.h"

#include <math.h>
#include <omp.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_cell_value.h"
#include "session_finer.h"
#include "session_fixed_sums.h"
#include "session_order_values.h"
#include "session_region.h"
#include "session_scalars.h"

/* ---- sums over the cells of one mesh ------------------------------------------------------------------------- */

/* Indices of the sums of the first pass in their array. Entry 0 is the number of cells. All other sums have two words
 * each. VOLUME: sum of the volumes; MOMENT: sum of the volumes times the positions (0 to 1) of the cells' values in the
 * range of all values; BINS: for each bin of the histogram, the sum of the volumes in the bin. */
enum { VOLUME = 1, MOMENT = 3, BINS = 5, MAX_SUMS = BINS + 2 * SESSION_MAX_BINS };

/* Results of earlier passes that a pass over the cells needs. */
typedef struct sum_basis {
    const session_statistics *first_pass; /* the statistics that earlier passes have computed */
    double largest;                       /* volume of the largest cell */
    /* mean of the values from the first pass, as a position in the range of values (0 to 1); used by the second pass */
    double approximate_mean;
    bool is_second;    /* set in the second pass, which adds up squared deviations from approximate_mean */
    bool is_of_shells; /* true: only shells are counted; false: only cells with a volume are counted */
} sum_basis;

/* Returns the position of a cell's mean in the range of the values. The mean of a polynomial may be outside the range,
 * but not far enough to make sums overflow. */
static double find_position_of_mean(const session_statistics *s, const session_cell_value *cell)
{
    static const double most = 1024;
    if (!cell->is_integral) return clamped_position_in_range(cell->mean, s->minimum, s->maximum);
    return fmin(fmax(position_in_range(cell->mean, s->minimum, s->maximum), -most), most);
}

static session_bins get_bins_of_statistics(const session_statistics *s)
{
    return (session_bins){s->bin_count, s->low, s->high};
}

static void add_cell_value_to_sums(const sum_basis *b, const session_cell_value *cell, int64_t *sums)
{
    const session_statistics *s = b->first_pass;
    const double volume = b->largest > 0 ? cell->volume / b->largest : 0;
    const double place = find_position_of_mean(s, cell) - b->approximate_mean;
    if (b->is_second) {
        const double half_range = 0.5 * s->maximum - 0.5 * s->minimum;
        const double deviation = half_range > 0 ? fmin(cell->half_deviation / half_range, 1024) : 0;
        add_fixed_point(sums, volume * place * place);
        if (cell->is_integral) add_fixed_point(sums, volume * deviation * deviation);
        return;
    }
    add_fixed_point(sums + VOLUME, volume);
    add_fixed_point(sums + MOMENT, volume * place);
    const session_bins bins = get_bins_of_statistics(s);
    const int bin = bins.count && !cell->is_integral ? find_bin(&bins, cell->mean) : -1;
    if (bin >= 0) add_fixed_point(sums + BINS + 2 * bin, volume);
}

/* The input of a pass over one mesh. */
typedef struct statistics_pass {
    const session_mesh *mesh;
    const grid *g; /* the mesh's cells */
    grid_field field;
    const session_cell_value *cells; /* values of the caller's cells, if they are of higher order; otherwise NULL */
    const session_team *team;
    volume_buffer *buffers; /* one per thread, for computing the volumes of cells */
} statistics_pass;

static session_cell_value find_cell_value(const statistics_pass *p, int64_t cell)
{
    if (p->cells) return p->cells[cell];
    return session_read_cell_value(p->g, &p->field, cell, &p->buffers[omp_get_thread_num()]);
}

static void add_counted_cell(const statistics_pass *p, const sum_basis *b, int64_t cell, int64_t *sums)
{
    const session_cell_value value = find_cell_value(p, cell);
    if (!value.is_counted || value.is_shell != b->is_of_shells) return;
    add_cell_value_to_sums(b, &value, sums);
    if (!b->is_second) sums[0]++;
}

static void add_all_cells_to_sums(const statistics_pass *p, const sum_basis *b, int64_t *sums, int count)
{
    const int64_t cells = session_count_whole_cells(p->mesh);
#pragma omp parallel num_threads(session_choose_loop_threads(p->team->threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : sums[:count]) nowait
        for (int64_t cell = 0; cell < cells; cell++) add_counted_cell(p, b, cell, sums);
        region_leave();
    }
}

/* Layout of the array that is reduced by MPI_MIN. It has ENDS entries for cells with a volume, and then ENDS entries
 * for shells (KINDS): minimum of the values, negated maximum of the values, negated largest volume. */
enum { ENDS = 3, KINDS = 2 };

static void find_cell_extremes(const statistics_pass *p, int64_t cell, double ends[KINDS * ENDS])
{
    const session_cell_value value = find_cell_value(p, cell);
    if (!value.is_counted) return;
    double *of = ends + (value.is_shell ? ENDS : 0);
    of[0] = fmin(of[0], value.minimum);
    of[1] = fmin(of[1], -value.maximum);
    of[2] = fmin(of[2], -value.volume);
}

static void find_extremes(const statistics_pass *p, double ends[KINDS * ENDS])
{
    const int64_t cells = session_count_whole_cells(p->mesh);
#pragma omp parallel num_threads(session_choose_loop_threads(p->team->threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : ends[:KINDS * ENDS]) nowait
        for (int64_t cell = 0; cell < cells; cell++) find_cell_extremes(p, cell, ends);
        region_leave();
    }
}

/* ---- passes over all meshes ---------------------------------------------------------------------------------- */

typedef struct statistics_work {
    const session_meshes *meshes;
    const session_team *team;
    const session_statistics_request *requests;
    int count;
    bool *are_lobatto; /* for each mesh, set if the nodes of its cells of higher order are Gauss-Lobatto points */
    /* for each request and mesh, the values of the caller's cells if the mesh has cells of higher order; otherwise
     * NULL */
    session_cell_value **order_values;
    /* KINDS * ENDS entries per request, in the order that is described at KINDS. The last entry of the array is -1 if
     * memory ran out on a rank, and otherwise 0 */
    double *extremes;
    int64_t *sums; /* MAX_SUMS entries per request. The entry after the sums of all requests is the number of ranks on
                      which memory ran out */
    /* One buffer per thread. The buffers are large enough after the first pass, since each thread always processes the
     * same cells. */
    volume_buffer *buffers;
} statistics_work;

static session_cell_value **get_order_values_of_request(const statistics_work *w, int request, int mesh)
{
    return &w->order_values[request * w->meshes->count + mesh];
}

/* Fills *pass with the input for a pass over the request's field on one of this rank's meshes. Returns false if the
 * mesh does not have the field. */
static bool fill_statistics_pass(const statistics_work *w, int request, int mesh, statistics_pass *pass)
{
    const session_mesh *of = w->meshes->items[mesh];
    *pass = (statistics_pass){.mesh = of,
                              .g = &of->cells,
                              .cells = *get_order_values_of_request(w, request, mesh),
                              .team = w->team,
                              .buffers = w->buffers};
    return of->is_given && !of->source && session_find_values(of, w->requests[request].field, &pass->field);
}

static session_order_field describe_order_field(const statistics_work *w, int request, int mesh)
{
    const session_mesh *of = w->meshes->items[mesh];
    const scene_field *field = w->requests[request].field;
    session_order_field out = {.mesh = of, .is_lobatto = w->are_lobatto[mesh], .threads = w->team->threads};
    session_find_values(of, field, &out.values);
    out.given = session_find_field_with_caller_nodes(of, session_find_field(of, field->name));
    return out;
}

/* Computes the values of the caller's cells if the mesh has cells of higher order. */
static void compute_order_values_of_request(const statistics_work *w, int request, int mesh, statistics_pass *pass,
                                            base_error *error)
{
    session_cell_value **values = get_order_values_of_request(w, request, mesh);
    const session_order_field of = describe_order_field(w, request, mesh);
    if (of.mesh->topology.is_split && !error->status) session_compute_higher_order_cell_values(&of, values, error);
    pass->cells = *values;
}

/* Adds the volumes of cells of higher order to the bins of the histogram. */
static void add_higher_order_volumes_to_bins(const statistics_work *w, int request, int mesh, const sum_basis *basis,
                                             base_error *error)
{
    const session_statistics_request *of = &w->requests[request];
    const session_order_field field = describe_order_field(w, request, mesh);
    const session_binned_volumes binned = {.bins = get_bins_of_statistics(basis->first_pass),
                                           .is_whole = of->low > of->high,
                                           .is_of_shells = basis->is_of_shells,
                                           .largest = basis->largest,
                                           .sums = w->sums + (ptrdiff_t)MAX_SUMS * request + BINS};
    const session_cell_value *values = *get_order_values_of_request(w, request, mesh);
    if (values && binned.bins.count && !error->status)
        session_add_higher_order_cells_to_bins(&field, values, &binned, error);
}

/* Stores an error if memory ran out on any rank. */
static insitu_status check_memory(const statistics_work *w, base_error *error)
{
    if (w->extremes[KINDS * ENDS * w->count] == 0) return INSITU_OK;
    for (int thread = 0; thread < w->team->threads; thread++)
        if (w->buffers[thread].is_out_of_memory)
            session_fail_for_memory(error, (int64_t)w->buffers[thread].requested_size, "a polyhedron");
    return session_agree(w->team->comm, error);
}

/* Returns whether shells are counted for this request. This is the case if the field is on shells, but on no cell with
 * a volume. */
static bool is_of_shells(const statistics_work *w, int request)
{
    const double *ends = w->extremes + KINDS * ENDS * request;
    return !(ends[0] <= -ends[1]) && ends[ENDS] <= -ends[ENDS + 1];
}

static const double *find_request_extremes(const statistics_work *w, int request)
{
    return w->extremes + KINDS * ENDS * request + (is_of_shells(w, request) ? ENDS : 0);
}

static insitu_status reduce_extremes(const statistics_work *w, base_error *error)
{
    const int size = KINDS * ENDS * w->count;
    for (int i = 0; i < w->count; i++) {
        double *ends = w->extremes + KINDS * ENDS * i;
        for (int k = 0; k < KINDS * ENDS; k++) ends[k] = k % ENDS == 2 ? 0 : INFINITY;
        for (int m = 0; m < w->meshes->count; m++) {
            statistics_pass pass;
            if (!fill_statistics_pass(w, i, m, &pass)) continue;
            compute_order_values_of_request(w, i, m, &pass, error);
            if (!error->status) find_extremes(&pass, ends);
        }
    }
    w->extremes[size] = error->status ? -1 : 0;
    for (int thread = 0; thread < w->team->threads; thread++)
        if (w->buffers[thread].is_out_of_memory) w->extremes[size] = -1;
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, w->extremes, size + 1, MPI_DOUBLE, MPI_MIN, w->team->comm), "MPI_Allreduce");
    return status ? status : check_memory(w, error);
}

static insitu_status reduce_sums(const statistics_work *w, const session_statistics *known, bool is_second,
                                 base_error *error)
{
    const int size = is_second ? 2 : MAX_SUMS, all = size * w->count;
    memset(w->sums, 0, ((size_t)all + 1) * sizeof *w->sums);
    for (int i = 0; i < w->count; i++) {
        const double range = known[i].maximum - known[i].minimum;
        const double about =
            is_second && range > 0 ? position_in_range(known[i].mean, known[i].minimum, known[i].maximum) : 0;
        const sum_basis basis = {&known[i], -find_request_extremes(w, i)[2], about, is_second, known[i].is_of_shells};
        for (int m = 0; m < w->meshes->count; m++) {
            statistics_pass pass;
            if (!fill_statistics_pass(w, i, m, &pass)) continue;
            add_all_cells_to_sums(&pass, &basis, w->sums + size * i, size);
            if (!is_second) add_higher_order_volumes_to_bins(w, i, m, &basis, error);
        }
    }
    w->sums[all] = error->status != INSITU_OK;
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, w->sums, all + 1, MPI_INT64_T, MPI_SUM, w->team->comm), "MPI_Allreduce");
    return status || !w->sums[all] ? status : session_agree(w->team->comm, error);
}

static void begin_statistics(const statistics_work *w, int request, session_statistics *out)
{
    const session_statistics_request *of = &w->requests[request];
    const double *ends = find_request_extremes(w, request);
    const bool has_range = of->low <= of->high;
    /* if values are 0 and -0, it depends on the partition which of them the reductions return; the sums with 0.0 are 0
     * in both cases */
    *out = (session_statistics){.is_of_shells = is_of_shells(w, request),
                                .minimum = ends[0] + 0.0,
                                .maximum = -ends[1] + 0.0,
                                .bin_count = of->bin_count};
    out->low = has_range ? of->low : out->minimum;
    out->high = has_range ? of->high : out->maximum;
}

static void convert_sums(const statistics_work *w, int request, session_statistics *out)
{
    const int64_t *sums = w->sums + MAX_SUMS * request;
    const double largest = -find_request_extremes(w, request)[2], volume = sum_from_fixed_point(sums + VOLUME);
    const double place = volume > 0 ? sum_from_fixed_point(sums + MOMENT) / volume : 0;
    out->cell_count = sums[0];
    out->volume = volume * largest;
    out->mean = (1 - place) * out->minimum + place * out->maximum;
    for (int bin = 0; bin < out->bin_count; bin++)
        out->bin_fractions[bin] = volume > 0 ? sum_from_fixed_point(sums + BINS + 2 * bin) / volume : 0;
}

static insitu_status find_all_statistics(const statistics_work *w, session_statistics *out, base_error *error)
{
    insitu_status status = reduce_extremes(w, error);
    for (int i = 0; i < w->count && !status; i++) begin_statistics(w, i, &out[i]);
    if (!status) status = reduce_sums(w, out, false, error);
    for (int i = 0; i < w->count && !status; i++) convert_sums(w, i, &out[i]);
    if (!status) status = reduce_sums(w, out, true, error);
    for (int i = 0; i < w->count && !status; i++) {
        const double volume = out[i].volume / -find_request_extremes(w, i)[2], range = out[i].maximum - out[i].minimum;
        out[i].deviation = volume > 0 ? range * sqrt(sum_from_fixed_point(w->sums + 2 * i) / volume) : 0;
    }
    return status;
}

/* Finds the meshes in which nodes of cells of higher order are Gauss-Lobatto points, by the rule of
 * session_count_higher_order_cells() (session_finer.h). Collective. */
static insitu_status find_meshes_with_lobatto_nodes(session_meshes *meshes, const session_catalogue *catalogue,
                                                    MPI_Comm comm, bool *are_lobatto, base_error *error)
{
    if (!session_catalogue_has_higher_order(catalogue)) return INSITU_OK;
    session_finer_choice *choices = base_calloc((size_t)catalogue->mesh_count, sizeof *choices);
    if (!choices) session_fail_for_memory(error, catalogue->mesh_count * (int64_t)sizeof *choices, "statistics");
    insitu_status status = session_agree(comm, error);
    if (!status) status = session_count_higher_order_cells(meshes, catalogue, comm, choices, error);
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        for (int i = 0; i < meshes->count; i++)
            if (strcmp(meshes->items[i]->name, catalogue->meshes[m].name) == 0) are_lobatto[i] = choices[m].is_lobatto;
    base_free(choices);
    return status;
}

static void free_work(statistics_work *w)
{
    for (int thread = 0; w->buffers && thread < w->team->threads; thread++) session_volume_free(&w->buffers[thread]);
    for (int i = 0; w->order_values && i < w->count * w->meshes->count; i++) base_free(w->order_values[i]);
    base_free(w->extremes);
    base_free(w->sums);
    base_free(w->buffers);
    base_free(w->are_lobatto);
    base_free(w->order_values);
}

insitu_status session_find_statistics(session_meshes *meshes, const session_catalogue *catalogue,
                                      const session_team *team, const session_statistics_request *requests, int count,
                                      session_statistics *out, base_error *error)
{
    statistics_work work = {.meshes = meshes, .team = team, .requests = requests, .count = count};
    const size_t most = (size_t)count, mesh_count = (size_t)meshes->count;
    if (count == 0) return INSITU_OK;
    work.extremes = base_alloc((most * KINDS * ENDS + 1) * sizeof *work.extremes);
    work.sums = base_alloc((most * MAX_SUMS + 1) * sizeof *work.sums);
    work.buffers = base_calloc((size_t)team->threads, sizeof *work.buffers);
    work.are_lobatto = base_calloc(mesh_count + 1, sizeof *work.are_lobatto);
    work.order_values = base_calloc(most * mesh_count + 1, sizeof(session_cell_value *));
    if (!work.extremes || !work.sums || !work.buffers || !work.are_lobatto || !work.order_values)
        session_fail_for_memory(error, count * MAX_SUMS * (int64_t)sizeof *work.sums, "statistics of fields");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = find_meshes_with_lobatto_nodes(meshes, catalogue, team->comm, work.are_lobatto, error);
    if (!status) status = find_all_statistics(&work, out, error);
    free_work(&work);
    return status;
}
