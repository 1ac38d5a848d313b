/* The light of a ray is the integral of c s T over the ray's length. Here c is the colour of the value v at a point, s
 * is its extinction, and T is the transmittance between the eye and the point. If the values are off by e, the light
 * changes, to first order, by the integral of
 *
 *     (d(c s)/dv - b ds/dv) T e,
 *
 * where b is the light, between 0 and 1, that arrives at the point from behind: a larger extinction adds c to the
 * light, but hides a part of b. In a cell, e is replaced by its root mean square over the cell (session_bound.h). The
 * mean of the bracket's absolute value over the cell is computed as the variation of c s - b s, as a function of v
 * between the cell's least and largest value, divided by the difference of these values.
 *
 * The light b is not known at each point. The variation is a convex function of b, so that linear interpolation between
 * the variations for b = 0 and for b = 1 gives an upper bound for each b between them. The bound for b = light of the
 * whole ray is used, or the variation for b = 0 if it is larger.
 *
 * The integrals along rays are found by a grid over the picture. Each cell's integrals over its volume are distributed
 * over the cells of the grid that it covers. Let A and D be the integrals of the bracket and of s along a ray. If cells
 * with a large bracket are distributed evenly along the ray, the change of light is A (1 - exp(-D)) / D. The light
 * itself is computed from the integral of c s in the same way.
 *
 * The result is an estimate. It may be too large, because errors of opposite signs are added up, or too small, because
 * it is a mean over each cell of the grid. */
#include "session_volume_errors.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_deviation.h"
#include "session_indexed.h"
#include "session_scalars.h"
#include "session_transfer.h"
#include "vector3.h"

enum {
    GRID_SIZE = 32,  /* number of cells, along each axis, of the grid over a picture */
    POSITIONS = 1024 /* number of equal steps into which tables divide the range of values */
};

/* Sums are integers, in units of sum_unit. The contribution of a cell to a sum is limited to most_of_cell; a cell
 * above the limit is opaque, or its error exceeds any allowed error by far. The sum of fewer than 2^23 cells at
 * the limit is below 2^63. */
static const double sum_unit = 1.0 / (1 << 30), most_of_cell = 1024;
/* Factor from the mean error in a cell of the grid to the error of the worst pixels in it. In the test
 * session_order_volumes, whose cells are 25 to 55 pixels wide, the error of 99.9 % of the pixels was 0.8 to 2.5 times
 * that mean, and 3 times in one case where the opacity has a steep step. */
static const double worst_pixel = 2.75;
/* product of extinction and unit distance that represents an opacity of 1, whose true extinction is infinite
 * (render_pieces.c) */
static const double largest_extinction = 1e6;

/* Indices of the quantities that are integrated over the range of values and along rays. */
enum {
    /* change of light by errors of values, in three colour channels, if no light arrives from behind (b = 0) */
    IN_DARK = 0,
    IN_LIGHT = 3, /* the same change if the light that arrives from behind is 1 (b = 1) */
    EMISSION = 6, /* colour times extinction, in three colour channels */
    EXTINCTION = 9,
    QUANTITIES = 10
};

/* The estimate for one volume on one mesh. It must not be moved in memory. */
typedef struct volume_errors {
    const session_error_request *request;
    session_transfer transfer;
    /* table with an entry for each of POSITIONS + 1 equidistant positions in the range of values (0: low end, 1: high
     * end): the integrals of all quantities from the low end to the position */
    double (*integrals)[QUANTITIES];
    /* increase of the integrals per unit of position, below the range (index 0) and above it (index 1) */
    double slopes[2][QUANTITIES];
    int view_count; /* number of due views that show the volume */
    int *views;
    /* For each view and each cell of the grid over its picture, the integrals of all quantities along rays, for one
     * piece between two nodes. They are sums of integers, so that they do not depend on the order of the mesh's cells
     * or on the partition. */
    int64_t *sums;
    int64_t sum_count;
} volume_errors;

/* ---- ranges of values -------------------------------------------------------------------------------------------- */

static bool is_same_field(const scene_field *a, const scene_field *b)
{
    if (strcmp(a->name, b->name) != 0 || a->component != b->component || a->mesh_count != b->mesh_count) return false;
    for (int m = 0; m < a->mesh_count; m++)
        if (strcmp(a->meshes[m], b->meshes[m]) != 0) return false;
    return true;
}

static session_value_range *find_value_range_of_field(const session_value_ranges *ranges, const scene_field *field)
{
    for (int i = 0; i < ranges->count; i++)
        if (is_same_field(ranges->items[i].field, field)) return &ranges->items[i];
    return NULL;
}

/* Lists the fields whose ranges are needed: fields of volumes without a fixed range. Returns false if memory runs
 * out. */
static bool list_fields_that_need_ranges(const scene *scene, const session_due_views *views, session_value_ranges *out)
{
    size_t most = 1;
    for (int i = 0; i < views->count; i++) most += (size_t)scene->images[i].volume_count;
    out->items = base_alloc(most * sizeof *out->items);
    for (int i = 0; i < views->count && out->items; i++)
        for (int layer = 0; views->are_due[i] && layer < scene->images[i].volume_count; layer++) {
            const scene_volume *volume = &scene->images[i].volumes[layer];
            if (!volume->colour_map.range.is_fixed && !find_value_range_of_field(out, &volume->field))
                out->items[out->count++] = (session_value_range){&volume->field, -INFINITY, -INFINITY};
        }
    return out->items != NULL;
}

/* The task of extending a range by the values of one part of a mesh. */
typedef struct range_work {
    const session_mesh *mesh;
    int threads;
    session_value_range *range;
} range_work;

static insitu_status extend_range_by_node_values(void *of, const session_node_values *values, base_error *error)
{
    const range_work *work = of;
    const session_deviation_request request = {
        .values = values,
        .component = session_resolve_component(work->range->field, values->component_count),
        .is_of_values = true,
    };
    session_deviation own = {.low = INFINITY, .high = -INFINITY};
    if (request.component < 0) return INSITU_OK;
    session_measure_linearization_error(work->mesh, &request, work->threads, &own, error);
    work->range->minus_low = fmax(work->range->minus_low, -own.low);
    work->range->high = fmax(work->range->high, own.high);
    return error->status;
}

static void find_value_range_on_this_rank(const session_meshes *meshes, int threads, session_value_range *range,
                                          base_error *error)
{
    for (int m = 0; m < meshes->count && !error->status; m++) {
        range_work work = {meshes->items[m], threads, range};
        const bool is_shown = scene_field_selects_mesh(range->field, work.mesh->label);
        const int field = is_shown ? session_find_field(work.mesh, range->field->name) : -1;
        if (field >= 0 && !work.mesh->source)
            session_pass_node_values(work.mesh, field, extend_range_by_node_values, &work, error);
    }
}

insitu_status session_find_volume_ranges(const scene *scene, const session_due_views *views,
                                         const session_meshes *meshes, const session_team *team,
                                         session_value_ranges *out, base_error *error)
{
    *out = (session_value_ranges){0};
    if (!list_fields_that_need_ranges(scene, views, out))
        session_fail_for_memory(error, sizeof *out->items, "ranges of volumes");
    if (session_agree(team->comm, error)) return error->status;
    double *ends = base_alloc(((size_t)out->count + 1) * 2 * sizeof *ends);
    if (!ends) session_fail_for_memory(error, (int64_t)sizeof *ends * 2 * out->count, "ranges of volumes");
    for (int i = 0; i < out->count; i++) {
        find_value_range_on_this_rank(meshes, team->threads, &out->items[i], error);
        if (ends) memcpy(ends + 2 * i, (const double[]){out->items[i].minus_low, out->items[i].high}, 2 * sizeof *ends);
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status && out->count > 0)
        status = session_check_mpi(
            error, MPI_Allreduce(MPI_IN_PLACE, ends, 2 * out->count, MPI_DOUBLE, MPI_MAX, team->comm), "MPI_Allreduce");
    for (int i = 0; i < out->count && !status; i++) {
        out->items[i].minus_low = ends[2 * i];
        out->items[i].high = ends[2 * i + 1];
    }
    base_free(ends);
    return status;
}

void session_free_volume_ranges(session_value_ranges *ranges)
{
    base_free(ranges->items);
    *ranges = (session_value_ranges){0};
}

/* ---- transfer functions ------------------------------------------------------------------------------------------ */

static double compute_position_in_range(const render_transfer *t, double value)
{
    const double low = render_scaled(t->scale, t->threshold, t->low);
    const double high = render_scaled(t->scale, t->threshold, t->high);
    const double at = (render_scaled(t->scale, t->threshold, value) - low) / (high - low);
    return fmin(fmax(at, -1), 2); /* limited, because values that are not positive have no logarithm */
}

static double compute_extinction_at_position(const render_transfer *t, double position)
{
    int i = 0;
    while (i < t->opacity_count && compute_position_in_range(t, t->opacity_values[i]) <= position) i++;
    double opacity = (double)t->opacities[i < t->opacity_count ? i : i - 1];
    if (i > 0 && i < t->opacity_count) {
        const double from = compute_position_in_range(t, t->opacity_values[i - 1]),
                     to = compute_position_in_range(t, t->opacity_values[i]);
        const double share = (position - from) / (to - from), before = (double)t->opacities[i - 1];
        opacity = before + share * (opacity - before);
    }
    return (opacity < 1 ? fmin(-log1p(-opacity), largest_extinction) : largest_extinction) / t->unit_distance;
}

static void interpolate_colour_at_position(const render_transfer *t, double position, double out[3])
{
    const double at = fmin(fmax(position, 0), 1) * (t->colour_count - 1);
    const int i = at < t->colour_count - 2 ? (int)at : t->colour_count - 2;
    for (int c = 0; c < 3; c++) {
        const double from = (double)t->colours[3 * i + c], to = (double)t->colours[3 * i + 3 + c];
        out[c] = from + (at - i) * (to - from);
    }
}

/* Integrates the transfer function from the position `from` in the range of values to the position `to`. The integrals
 * are added to `before`, which are those up to `from`; the result `after` contains those up to `to`. */
static void integrate_transfer_over_interval(const render_transfer *t, double from, double to, const double *before,
                                             double *after)
{
    const double extinctions[2] = {compute_extinction_at_position(t, from), compute_extinction_at_position(t, to)};
    double colours[2][3];
    interpolate_colour_at_position(t, from, colours[0]);
    interpolate_colour_at_position(t, to, colours[1]);
    for (int c = 0; c < 3; c++) {
        const double change = colours[1][c] * extinctions[1] - colours[0][c] * extinctions[0];
        const double emission = 0.5 * (colours[1][c] * extinctions[1] + colours[0][c] * extinctions[0]);
        after[IN_DARK + c] = before[IN_DARK + c] + fabs(change);
        after[IN_LIGHT + c] = before[IN_LIGHT + c] + fabs(change - (extinctions[1] - extinctions[0]));
        after[EMISSION + c] = before[EMISSION + c] + emission * (to - from);
    }
    after[EXTINCTION] = before[EXTINCTION] + 0.5 * (extinctions[0] + extinctions[1]) * (to - from);
}

/* Fills the table of the integrals over the range of values, and their slopes outside of the range. */
static void tabulate_transfer_integrals(const render_transfer *t, volume_errors *out)
{
    static const double none[QUANTITIES];
    memset(out->integrals[0], 0, sizeof out->integrals[0]);
    for (int i = 0; i < POSITIONS; i++)
        integrate_transfer_over_interval(t, (double)i / POSITIONS, (i + 1.0) / POSITIONS, out->integrals[i],
                                         out->integrals[i + 1]);
    integrate_transfer_over_interval(t, -2, -1, none, out->slopes[0]);
    integrate_transfer_over_interval(t, 2, 3, none, out->slopes[1]);
}

/* Begins the estimate for a volume. Returns false if memory runs out; the caller must end the estimate in any case. */
static bool prepare_volume_error_estimate(const session_error_request *request, const session_value_ranges *ranges,
                                          volume_errors *out)
{
    const scene_volume *volume = request->volume;
    const scene_range *fixed = &volume->colour_map.range;
    const session_value_range *found = fixed->is_fixed ? NULL : find_value_range_of_field(ranges, &volume->field);
    double low = found ? -found->minus_low : fixed->low, high = found ? found->high : fixed->high;
    *out = (volume_errors){.request = request};
    if (found && fixed->source == SCENE_RANGE_SYMMETRIC) {
        high = fmax(fabs(low), fabs(high));
        low = -high;
    }
    for (int i = 0; i < request->views->count; i++) out->view_count += request->images[i];
    out->sum_count = QUANTITIES * GRID_SIZE * GRID_SIZE * (int64_t)out->view_count;
    out->views = base_alloc(((size_t)out->view_count + 1) * sizeof *out->views);
    out->integrals = base_alloc((POSITIONS + 1) * sizeof *out->integrals);
    out->sums = base_calloc((size_t)out->sum_count + 1, sizeof *out->sums);
    if (!out->views || !out->integrals || !out->sums) return false;
    for (int i = 0, n = 0; i < request->views->count; i++)
        if (request->images[i]) out->views[n++] = i;
    if (!session_make_transfer(request->views->extent.half_diagonal, &volume->colour_map, low, high, volume,
                               &out->transfer))
        return false;
    tabulate_transfer_integrals(&out->transfer.transfer, out);
    return true;
}

static void free_volume_error_estimate(volume_errors *errors)
{
    session_transfer_free(&errors->transfer);
    base_free(errors->views);
    base_free(errors->integrals);
    base_free(errors->sums);
    *errors = (volume_errors){0};
}

/* ---- contributions of cells to the estimate ---------------------------------------------------------------------- */

/* Returns the integral of a quantity from the low end of the range of values (position 0) to a position. */
static double interpolate_transfer_integral(const volume_errors *of, int quantity, double position)
{
    if (position <= 0) return position * of->slopes[0][quantity];
    if (position >= 1) return of->integrals[POSITIONS][quantity] + (position - 1) * of->slopes[1][quantity];
    const double at = position * POSITIONS;
    const int i = (int)at < POSITIONS - 1 ? (int)at : POSITIONS - 1;
    const double *before = &of->integrals[i][quantity], *after = &of->integrals[i + 1][quantity];
    return *before + (at - i) * (*after - *before);
}

/* Computes all quantities per unit of length of a ray in a cell of the mesh. For changes of light, this is the mean
 * over the cell of the bracketed factor in the formula at the top of this file, times the root mean square of the error
 * of the cell's values. For the other quantities, it is their mean over the cell. All values between the cell's
 * smallest and largest one are assumed to be equally frequent. */
static void compute_ray_integrals_per_unit_length(const volume_errors *of, const session_value_cell *cell,
                                                  double out[QUANTITIES])
{
    static const double least_width = 1e-6;
    const render_transfer *t = &of->transfer.transfer;
    const double error = isfinite(cell->bound->value_error) ? cell->bound->value_error : 0;
    double low = INFINITY, high = -INFINITY;
    for (int n = 0; n < cell->count; n++) {
        low = fmin(low, cell->tuples[n][3] - error);
        high = fmax(high, cell->tuples[n][3] + error);
    }
    const double from = compute_position_in_range(t, low) - least_width,
                 to = compute_position_in_range(t, high) + least_width;
    for (int q = 0; q < QUANTITIES; q++)
        out[q] = interpolate_transfer_integral(of, q, to) - interpolate_transfer_integral(of, q, from);
    for (int q = EMISSION; q < QUANTITIES; q++) out[q] /= to - from;
    for (int q = 0; q < EMISSION; q++) out[q] *= error > 0 ? error / (high - low) : 0;
}

/* The part of the grid over a picture that a cell of the mesh covers. low, high: a rectangle, in units of cells of the
 * grid. area: area that one cell of the grid covers at the depth of the mesh's cell, in square scene units. */
typedef struct covered_part {
    double low[2], high[2], area;
} covered_part;

/* Finds the part of the grid that a cell of the mesh covers. If the cell's distance from the eye along the camera's
 * axis is smaller than the cell's radius, the distance is taken to be the radius. Returns false if the cell is behind
 * the eye. */
static bool project_cell_onto_pixel_grid(const render_camera *camera, const session_value_cell *cell, covered_part *out)
{
    const double half[2] = {camera->half_height * camera->width / camera->height, camera->half_height};
    const double radius = cell->bound->radius;
    double to[3];
    for (int x = 0; x < 3; x++) to[x] = cell->bound->centre[x] - camera->eye[x];
    const double depth = vector3_dot(to, camera->forward);
    if (depth + radius < 0) return false;
    out->area = 4 * half[0] * half[1] / (GRID_SIZE * GRID_SIZE);
    if (!camera->is_orthographic) out->area *= fmax(depth, radius) * fmax(depth, radius);
    for (int a = 0; a < 2; a++) {
        out->low[a] = INFINITY;
        out->high[a] = -INFINITY;
    }
    for (int n = 0; n < cell->count; n++) {
        for (int x = 0; x < 3; x++) to[x] = cell->tuples[n][x] - camera->eye[x];
        const double near = fmax(vector3_dot(to, camera->forward), radius);
        for (int a = 0; a < 2; a++) {
            const double across = vector3_dot(to, a ? camera->up : camera->right);
            const double at = 0.5 * GRID_SIZE * (1 + across / (half[a] * (camera->is_orthographic ? 1 : near)));
            out->low[a] = fmin(out->low[a], at);
            out->high[a] = fmax(out->high[a], at);
        }
    }
    return true;
}

static double compute_covered_fraction(const covered_part *part, int axis, int at)
{
    const double width = part->high[axis] - part->low[axis];
    return (fmin(part->high[axis], at + 1) - fmax(part->low[axis], at)) / width;
}

static void add_atomically_in_fixed_point(int64_t *sum, double value)
{
    const int64_t more = (int64_t)llrint(fmin(value, most_of_cell) / sum_unit);
#pragma omp atomic
    *sum += more;
}

/* Adds the contributions of a cell of the mesh to the estimate `of`, which is a volume_errors. */
static void add_volume_error_of_cell(void *of, const session_value_cell *cell)
{
    enum { LAST = GRID_SIZE - 1 };
    const volume_errors *errors = of;
    double light[QUANTITIES];
    compute_ray_integrals_per_unit_length(errors, cell, light);
    for (int v = 0; v < errors->view_count; v++) {
        covered_part part;
        if (!project_cell_onto_pixel_grid(&errors->request->views->cameras[errors->views[v]], cell, &part)) continue;
        const double length = cell->bound->volume / part.area;
        for (int a = 0; a < 2; a++) part.high[a] = fmax(part.high[a], part.low[a] + 1e-6);
        int first[2], last[2];
        for (int a = 0; a < 2; a++) {
            first[a] = (int)fmin(fmax(part.low[a], 0), GRID_SIZE);
            last[a] = (int)fmax(fmin(part.high[a], LAST), -1);
        }
        for (int j = first[1]; j <= last[1]; j++)
            for (int i = first[0]; i <= last[0]; i++) {
                const double share =
                    length * compute_covered_fraction(&part, 0, i) * compute_covered_fraction(&part, 1, j);
                int64_t *sums = errors->sums + QUANTITIES * ((v * GRID_SIZE + j) * GRID_SIZE + i);
                for (int q = 0; q < QUANTITIES; q++) add_atomically_in_fixed_point(&sums[q], share * light[q]);
            }
    }
}

/* Returns the estimated error of the worst pixels in a cell of a picture's grid, the largest of the three channels. */
static double compute_error_of_worst_pixel(const int64_t sums[QUANTITIES], const float background[4])
{
    const double depth = (double)sums[EXTINCTION] * sum_unit, through = exp(-depth);
    const double share = depth > 1e-6 ? -expm1(-depth) / depth : 1; /* mean transmittance along the ray */
    double most = 0;
    for (int c = 0; c < 3; c++) {
        const double light = share * (double)sums[EMISSION + c] * sum_unit + through * (double)background[c];
        const double dark = (double)sums[IN_DARK + c] * sum_unit, lit = (double)sums[IN_LIGHT + c] * sum_unit;
        most = fmax(most, share * fmax(dark, dark + fmin(light, 1) * (lit - dark)));
    }
    return worst_pixel * most;
}

static double find_largest_error_of_views(const volume_errors *errors)
{
    const int64_t of_view = errors->sum_count / (errors->view_count > 0 ? errors->view_count : 1);
    double most = 0;
    for (int v = 0; v < errors->view_count; v++) {
        const scene_image *image = &errors->request->views->scene->images[errors->views[v]];
        for (int64_t i = 0; i < of_view; i += QUANTITIES)
            most = fmax(most, compute_error_of_worst_pixel(errors->sums + v * of_view + i, image->background));
    }
    return most;
}

/* ---- estimate over all cells of a mesh --------------------------------------------------------------------------- */

/* The task of adding the cells of one part of a mesh to an estimate. */
typedef struct estimate_work {
    const session_mesh *mesh;
    int threads;
    bool is_lobatto;
    volume_errors *errors;
} estimate_work;

static insitu_status add_volume_errors_of_cells(void *of, const session_node_values *values, base_error *error)
{
    const estimate_work *work = of;
    const session_deviation_request request = {.values = values,
                                               .component = work->errors->request->component,
                                               .is_of_values = true,
                                               .use_cell = add_volume_error_of_cell,
                                               .of_values = work->errors,
                                               .is_lobatto = work->is_lobatto};
    session_deviation unused = {.low = INFINITY, .high = -INFINITY};
    return session_measure_linearization_error(work->mesh, &request, work->threads, &unused, error);
}

insitu_status session_estimate_volume_error(const session_error_request *request, const session_value_ranges *ranges,
                                            const session_parts *parts, bool is_lobatto, const session_team *team,
                                            double *out, base_error *error)
{
    volume_errors errors;
    if (!prepare_volume_error_estimate(request, ranges, &errors))
        session_fail_for_memory(error, sizeof errors, "errors of volumes");
    for (int i = 0; i < parts->count && !error->status; i++) {
        estimate_work work = {parts->items[i], team->threads, is_lobatto, &errors};
        const int field = session_find_field(work.mesh, request->field);
        if (work.mesh->is_given && field >= 0)
            session_pass_node_values(work.mesh, field, add_volume_errors_of_cells, &work, error);
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allreduce(MPI_IN_PLACE, errors.sums, (int)errors.sum_count, MPI_INT64_T, MPI_SUM, team->comm),
            "MPI_Allreduce");
    if (!status) *out = find_largest_error_of_views(&errors);
    free_volume_error_estimate(&errors);
    return status;
}
