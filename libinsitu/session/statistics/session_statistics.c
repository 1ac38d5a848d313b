/* Computes statistics with integer sums, which are the same for any order of summation. A term is the cell's volume as
 * a fraction (0 to 1) of the volume of the largest cell, times 2^52. If there are shells and no cell has a volume,
 * areas are used instead of volumes. A sum consists of two words, the multiples of 2^28 and the remainder, so that the
 * terms of 2^34 cells can be added. The error of a term is at most 2^-53 of the volume of the largest cell. */
#include "session_statistics.h"

#include <math.h>
#include <omp.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_region.h"
#include "session_scalars.h"
#include "session_volume.h"

/* ---- one cell ------------------------------------------------------------------------------------------------ */

typedef struct cell_value {
    /* is_counted: the cell is drawn and all its values are finite; is_shell: it is a shell */
    bool is_counted, is_shell;
    double minimum, maximum, mean; /* of the cell's value, or of the values at its vertices */
    double volume;                 /* volume, or area of a shell */
} cell_value;

static cell_value read_cell_value(const grid *g, const grid_field *field, int64_t cell, volume_buffer *buffer)
{
    cell_value out = {grid_is_seen(g, cell), grid_is_shell(g, cell), INFINITY, -INFINITY, 0, 0};
    if (!out.is_counted) return out;
    out.volume = session_cell_volume(g, cell, buffer);
    const int count = field->is_cell_centred ? 1 : buffer->vertex_count;
    for (int i = 0; i < count; i++) {
        const double value = grid_field_value(field, field->is_cell_centred ? cell : buffer->vertices[i]);
        out.is_counted = out.is_counted && isfinite(value);
        out.minimum = fmin(out.minimum, value);
        out.maximum = fmax(out.maximum, value);
        out.mean += value;
    }
    out.mean /= count;
    out.is_counted = out.is_counted && count > 0 && isfinite(out.mean) && isfinite(out.volume);
    return out;
}

/* ---- sums ---------------------------------------------------------------------------------------------------- */

enum { LOW_BITS = 28, VOLUME = 1, MOMENT = 3, BINS = 5, MAX_SUMS = BINS + 2 * SESSION_MAX_BINS };

static void add_fixed_point(int64_t sum[2], double share)
{
    const int64_t whole = llrint(share * 0x1p52);
    sum[0] += whole >> LOW_BITS;
    sum[1] += whole & ((1 << LOW_BITS) - 1);
}

static double sum_from_fixed_point(const int64_t sum[2])
{
    return ((double)sum[0] * (1 << LOW_BITS) + (double)sum[1]) * 0x1p-52;
}

/* Results of earlier passes over the cells, which a pass uses. */
typedef struct sum_basis {
    const session_statistics *first_pass;
    double largest;          /* volume of the largest cell */
    double approximate_mean; /* mean of the first pass, as a fraction of the range; used by the second pass */
    bool is_second;
    bool is_of_shells; /* set if only shells are counted; otherwise only cells with a volume are */
} sum_basis;

/* Returns a value's position in the range as a fraction, 0 at low and 1 at high. It does not overflow. */
static double share_of_range(double value, double low, double high)
{
    const double share = high > low ? (0.5 * value - 0.5 * low) / (0.5 * high - 0.5 * low) : 0;
    return fmin(fmax(share, 0), 1);
}

static int find_bin(const session_statistics *s, double value)
{
    if (value < s->low || value > s->high) return -1;
    return (int)fmin(share_of_range(value, s->low, s->high) * s->bin_count, s->bin_count - 1);
}

static void add_cell(const sum_basis *b, const cell_value *cell, int64_t *sums)
{
    const session_statistics *s = b->first_pass;
    const double volume = b->largest > 0 ? cell->volume / b->largest : 0;
    const double place = share_of_range(cell->mean, s->minimum, s->maximum) - b->approximate_mean;
    if (b->is_second) {
        add_fixed_point(sums, volume * place * place);
        return;
    }
    add_fixed_point(sums + VOLUME, volume);
    add_fixed_point(sums + MOMENT, volume * place);
    const int bin = s->bin_count ? find_bin(s, cell->mean) : -1;
    if (bin >= 0) add_fixed_point(sums + BINS + 2 * bin, volume);
}

/* Data of a pass over one mesh. */
typedef struct statistics_pass {
    const session_mesh *mesh;
    const grid *g; /* the mesh's cells */
    grid_field field;
    const session_team *team;
    volume_buffer *buffers; /* one per thread, for computing the volumes of cells */
} statistics_pass;

/* Adds one of the caller's cells, all of whose pieces together count as one cell. */
static void add_whole_cell(const statistics_pass *p, const sum_basis *b, int64_t cell, int64_t *sums)
{
    const int64_t end = session_first_piece(p->mesh, cell + 1);
    bool is_counted = false;
    for (int64_t piece = session_first_piece(p->mesh, cell); piece < end; piece++) {
        const cell_value value = read_cell_value(p->g, &p->field, piece, &p->buffers[omp_get_thread_num()]);
        if (!value.is_counted || value.is_shell != b->is_of_shells) continue;
        add_cell(b, &value, sums);
        is_counted = true;
    }
    if (!b->is_second) sums[0] += is_counted;
}

static void add_cells(const statistics_pass *p, const sum_basis *b, int64_t *sums, int count)
{
    const int64_t cells = session_whole_count(p->mesh);
#pragma omp parallel num_threads(session_region_threads(p->team->threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : sums[:count]) nowait
        for (int64_t cell = 0; cell < cells; cell++) add_whole_cell(p, b, cell, sums);
        region_leave();
    }
}

/* Layout of the array that is reduced by minimum: minimum of the values, negated maximum, negated largest volume (ENDS
 * entries); first for cells with a volume, then for shells (KINDS). */
enum { ENDS = 3, KINDS = 2 };

static void find_cell_extremes(const statistics_pass *p, int64_t cell, double ends[KINDS * ENDS])
{
    const int64_t end = session_first_piece(p->mesh, cell + 1);
    for (int64_t piece = session_first_piece(p->mesh, cell); piece < end; piece++) {
        const cell_value value = read_cell_value(p->g, &p->field, piece, &p->buffers[omp_get_thread_num()]);
        if (!value.is_counted) continue;
        double *of = ends + (value.is_shell ? ENDS : 0);
        of[0] = fmin(of[0], value.minimum);
        of[1] = fmin(of[1], -value.maximum);
        of[2] = fmin(of[2], -value.volume);
    }
}

static void find_extremes(const statistics_pass *p, double ends[KINDS * ENDS])
{
    const int64_t cells = session_whole_count(p->mesh);
#pragma omp parallel num_threads(session_region_threads(p->team->threads, cells))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : ends[:KINDS * ENDS]) nowait
        for (int64_t cell = 0; cell < cells; cell++) find_cell_extremes(p, cell, ends);
        region_leave();
    }
}

/* ---- passes -------------------------------------------------------------------------------------------------- */

typedef struct statistics_work {
    const session_meshes *meshes;
    const session_team *team;
    const session_statistics_request *requests;
    int count;
    /* KINDS * ENDS entries per request, then one entry that is -1 if memory ran out on a rank, and otherwise 0 */
    double *extremes;
    int64_t *sums; /* MAX_SUMS entries per request */
    /* one buffer per thread; they are large enough after the first pass, since each thread always processes the same
     * cells */
    volume_buffer *buffers;
} statistics_work;

/* Sets up a pass over the field of the request on a mesh of this rank. Returns false if the mesh does not have the
 * field. */
static bool set_up_pass(const statistics_work *w, int request, int mesh, statistics_pass *pass)
{
    const session_mesh *of = w->meshes->items[mesh];
    *pass = (statistics_pass){.mesh = of, .g = &of->cells, .team = w->team, .buffers = w->buffers};
    return of->is_given && !of->source && session_find_values(of, w->requests[request].field, &pass->field);
}

/* Stores an error if a thread's buffer could not be allocated on any rank. */
static insitu_status check_buffers(const statistics_work *w, base_error *error)
{
    if (w->extremes[KINDS * ENDS * w->count] == 0) return INSITU_OK;
    for (int thread = 0; thread < w->team->threads; thread++)
        if (w->buffers[thread].is_out_of_memory)
            session_fail_for_memory(error, (int64_t)w->buffers[thread].requested_size, "a polyhedron");
    return session_agree(w->team->comm, error);
}

/* Returns whether only shells are counted, which is the case if there are shells and no cell has a volume. */
static bool is_of_shells(const statistics_work *w, int request)
{
    const double *ends = w->extremes + KINDS * ENDS * request;
    return !(ends[0] <= -ends[1]) && ends[ENDS] <= -ends[ENDS + 1];
}

static const double *find_request_extremes(const statistics_work *w, int request)
{
    return w->extremes + KINDS * ENDS * request + (is_of_shells(w, request) ? ENDS : 0);
}

static insitu_status reduce_ends(const statistics_work *w, base_error *error)
{
    const int size = KINDS * ENDS * w->count;
    for (int i = 0; i < w->count; i++) {
        double *ends = w->extremes + KINDS * ENDS * i;
        for (int k = 0; k < KINDS * ENDS; k++) ends[k] = k % ENDS == 2 ? 0 : INFINITY;
        for (int m = 0; m < w->meshes->count; m++) {
            statistics_pass pass;
            if (set_up_pass(w, i, m, &pass)) find_extremes(&pass, ends);
        }
    }
    w->extremes[size] = 0;
    for (int thread = 0; thread < w->team->threads; thread++)
        if (w->buffers[thread].is_out_of_memory) w->extremes[size] = -1;
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, w->extremes, size + 1, MPI_DOUBLE, MPI_MIN, w->team->comm), "MPI_Allreduce");
    return status ? status : check_buffers(w, error);
}

static insitu_status reduce_sums(const statistics_work *w, const session_statistics *known, bool is_second,
                                 base_error *error)
{
    const int size = is_second ? 2 : MAX_SUMS;
    memset(w->sums, 0, (size_t)(size * w->count) * sizeof *w->sums);
    for (int i = 0; i < w->count; i++) {
        const double range = known[i].maximum - known[i].minimum;
        const double about =
            is_second && range > 0 ? share_of_range(known[i].mean, known[i].minimum, known[i].maximum) : 0;
        const sum_basis basis = {&known[i], -find_request_extremes(w, i)[2], about, is_second, known[i].is_of_shells};
        for (int m = 0; m < w->meshes->count; m++) {
            statistics_pass pass;
            if (set_up_pass(w, i, m, &pass)) add_cells(&pass, &basis, w->sums + size * i, size);
        }
    }
    return session_check_mpi(error,
                             MPI_Allreduce(MPI_IN_PLACE, w->sums, size * w->count, MPI_INT64_T, MPI_SUM, w->team->comm),
                             "MPI_Allreduce");
}

static void begin_statistics(const statistics_work *w, int request, session_statistics *out)
{
    const session_statistics_request *of = &w->requests[request];
    const double *ends = find_request_extremes(w, request);
    const bool has_range = of->low <= of->high;
    *out = (session_statistics){
        .is_of_shells = is_of_shells(w, request), .minimum = ends[0], .maximum = -ends[1], .bin_count = of->bin_count};
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
    insitu_status status = reduce_ends(w, error);
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

insitu_status session_find_statistics(const session_meshes *meshes, const session_team *team,
                                      const session_statistics_request *requests, int count, session_statistics *out,
                                      base_error *error)
{
    statistics_work work = {.meshes = meshes, .team = team, .requests = requests, .count = count};
    if (count == 0) return INSITU_OK;
    work.extremes = base_alloc(((size_t)count * KINDS * ENDS + 1) * sizeof *work.extremes);
    work.sums = base_alloc((size_t)count * MAX_SUMS * sizeof *work.sums);
    work.buffers = base_calloc((size_t)team->threads, sizeof *work.buffers);
    if (!work.extremes || !work.sums || !work.buffers)
        session_fail_for_memory(error, count * MAX_SUMS * (int64_t)sizeof *work.sums, "statistics of fields");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = find_all_statistics(&work, out, error);
    for (int thread = 0; work.buffers && thread < team->threads; thread++) session_volume_free(&work.buffers[thread]);
    base_free(work.extremes);
    base_free(work.sums);
    base_free(work.buffers);
    return status;
}
