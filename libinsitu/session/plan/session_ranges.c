/* Percentiles are computed digit by digit. Values are doubles, mapped to 64-bit integers in the same order. A pass
 * selects the values whose leading bits equal the bits determined so far, and adds up their weights, separately for
 * each value of the next 11 bits. The sum of these weights over all ranks determines the next digit of the percentile.
 * Six passes find all 64 bits, and thus the exact percentile, for any partition. From the third pass on few values are
 * left. Therefore this pass stores them, and later passes do not read cells.
 *
 * Each cell with a volume has the weight 1. If all cells are shells, their weights are their areas. Weights are
 * integers, so that their sums are the same in any order: an area is a fraction of the largest one, times 2^28 and
 * rounded, so that 2^35 cells can be added and the error of each cell is at most 2^-29 of the largest one.
 *
 * A cell of higher order is counted once, with the values at its own nodes, independent of the pieces into which it
 * is divided. */
#include "session_ranges.h"

#include <math.h>
#include <string.h>

#include "mmbvh_fetch.h"
#include "memory.h"
#include "session_agree.h"
#include "session_distances.h"
#include "session_order_values.h"
#include "session_region.h"
#include "session_scalars.h"
#include "session_volume.h"

/* ---- minimum and maximum --------------------------------------------------------------------------------------- */

insitu_status session_find_extremes(const session_meshes *meshes, const session_team *team,
                                    const session_range_subject *of, double *low, double *high, base_error *error)
{
    double mine[2] = {INFINITY, INFINITY}, all[2];
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, of->field) : NULL;
        if (scalar && of->plane) scalar = session_find_distance_scalar(mesh, of->plane);
        if (!scalar) continue;
        double least, most;
        session_find_scalar_extent(mesh, scalar, team->threads, of->is_positive ? SESSION_POSITIVE : SESSION_SEEN,
                                   &least, &most);
        mine[0] = fmin(mine[0], least);
        mine[1] = fmin(mine[1], -most);
    }
    const insitu_status status =
        session_check_mpi(error, MPI_Allreduce(mine, all, 2, MPI_DOUBLE, MPI_MIN, team->comm), "MPI_Allreduce");
    /* if values are 0 and -0, it depends on the partition which of them the reductions return; the sums with 0.0 are 0
     * in both cases */
    *low = all[0] + 0.0;
    *high = -all[1] + 0.0;
    return status;
}

/* ---- percentiles ----------------------------------------------------------------------------------------------- */

enum { DIGIT_BITS = 11, DIGITS = 1 << DIGIT_BITS, PASSES = 6 };

static const uint64_t sign_bit = UINT64_C(1) << 63;

/* Maps a value to an integer, preserving the order. */
static uint64_t map_value_to_ordered_integer(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits & sign_bit ? ~bits : bits | sign_bit;
}

static double map_ordered_integer_to_value(uint64_t order)
{
    const uint64_t bits = order & sign_bit ? order & ~sign_bit : ~order;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Returns the position of the lowest bit of the digit that a pass determines. In the last pass only 9 bits are left. */
static int compute_digit_shift(int pass)
{
    return pass + 1 < PASSES ? 64 - DIGIT_BITS * (pass + 1) : 0;
}

/* Returns a mask of the leading bits of a value that the passes before this one have determined. */
static uint64_t make_mask_of_known_bits(int pass)
{
    return pass ? ~UINT64_C(0) << compute_digit_shift(pass - 1) : 0;
}

/* MOST_KEPT: maximum number of values that a pass stores for the passes after it; FIRST_KEPT: index, from 0, of the
 * first pass that may store values. */
enum { MOST_KEPT = 4096, FIRST_KEPT = 2 };

typedef struct weighted_value {
    uint64_t order; /* the value, mapped to an integer in the same order (map_value_to_ordered_integer()) */
    int64_t weight;
} weighted_value;

typedef struct kept_values {
    int count; /* number of values; if it exceeds MOST_KEPT, not all of them are stored */
    weighted_value values[MOST_KEPT];
} kept_values;

typedef struct digit_count {
    /* the leading bits that are known of the low and of the high percentile; all other bits are 0 */
    uint64_t known_bits[2];
    int pass;            /* index of the current pass, from 0; each pass determines one more digit */
    bool is_positive;    /* true: only positive values are counted */
    bool is_of_shells;   /* true: only shells are counted; false: only cells with a volume are counted */
    double largest_area; /* area of the largest shell that is counted */
    /* for each mesh with cells of higher order, the values of the caller's cells; NULL for all other meshes */
    session_cell_value **order_values;
    bool is_kept; /* set if the values that an earlier pass has stored are read, instead of the cells */
    kept_values kept;
} digit_count;

static void store_value_for_later_passes(const weighted_value *value, kept_values *kept)
{
    int at;
#pragma omp atomic read
    at = kept->count;
    if (at > MOST_KEPT) return;
#pragma omp atomic capture
    at = kept->count++;
    if (at < MOST_KEPT) kept->values[at] = *value;
}

/* Compares the leading bits of a value with the known bits of the two percentiles. If they are equal for a percentile,
 * adds the value's weight to the count of its next digit for this percentile. Returns whether the weight was added to
 * any count. */
static bool add_weight_of_value(const digit_count *of, const weighted_value *value, int64_t counts[2 * DIGITS])
{
    const uint64_t known = make_mask_of_known_bits(of->pass);
    bool is_counted = false;
    for (int end = 0; end < 2; end++) {
        if ((value->order & known) != of->known_bits[end]) continue;
        counts[end * DIGITS + (int)((value->order & ~known) >> compute_digit_shift(of->pass))] += value->weight;
        is_counted = true;
    }
    return is_counted;
}

/* The caller's cells of one mesh, with their values of one field. */
typedef struct counted_cells {
    int64_t count;
    const grid *g;
    grid_field field;
    const session_cell_value *values; /* values of the cells if some of them are of higher order; otherwise NULL */
} counted_cells;

/* Finds the cells of one mesh, and their values of a field. Returns false if the mesh does not have the field. */
static bool find_cells(const session_meshes *meshes, int index, const scene_field *field, const digit_count *of,
                       counted_cells *out)
{
    const session_mesh *mesh = meshes->items[index];
    const session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, field) : NULL;
    if (!scalar) return false;
    *out = (counted_cells){session_count_whole_cells(mesh), &mesh->cells, session_get_scalar_values(mesh, scalar),
                           of->order_values[index]};
    return true;
}

static bool is_shell(const counted_cells *cells, int64_t cell)
{
    return cells->values ? cells->values[cell].is_shell : grid_is_shell(cells->g, cell);
}

static double find_shell_area(const counted_cells *cells, int64_t cell)
{
    return cells->values ? cells->values[cell].volume : session_shell_area(cells->g, cell);
}

/* Computes the mean of a cell's minimum and maximum. Returns false if the cell is not shown or its values are not
 * counted. */
static bool find_mean_of_extremes(const digit_count *of, const counted_cells *cells, int64_t cell, double *middle)
{
    if (cells->values) {
        const session_cell_value *value = &cells->values[cell];
        *middle = 0.5 * value->minimum + 0.5 * value->maximum;
        return value->is_counted && (!of->is_positive || *middle > 0);
    }
    if (!grid_can_be_shown(cells->g, cell)) return false;
    const fetch_range range = fetch_any_cell_range(cells->g, &cells->field, cell);
    *middle = 0.5 * range.low + 0.5 * range.high;
    return range.is_finite && (!of->is_positive || *middle > 0);
}

static int64_t compute_cell_weight(const digit_count *of, const counted_cells *cells, int64_t cell)
{
    if (!of->is_of_shells) return 1;
    return of->largest_area > 0 ? llrint(find_shell_area(cells, cell) / of->largest_area * 0x1p28) : 0;
}

static void count_digits_of_cells(const counted_cells *cells, int threads, digit_count *of, int64_t counts[2 * DIGITS])
{
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells->count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : counts[:2 * DIGITS]) nowait
        for (int64_t cell = 0; cell < cells->count; cell++) {
            double middle;
            if (is_shell(cells, cell) != of->is_of_shells || !find_mean_of_extremes(of, cells, cell, &middle)) continue;
            const weighted_value value = {map_value_to_ordered_integer(middle), compute_cell_weight(of, cells, cell)};
            if (add_weight_of_value(of, &value, counts) && of->pass >= FIRST_KEPT)
                store_value_for_later_passes(&value, &of->kept);
        }
        region_leave();
    }
}

static void count_own_digits(const session_meshes *meshes, const session_team *team, const scene_field *field,
                             digit_count *of, int64_t counts[2 * DIGITS])
{
    for (int i = 0; i < of->kept.count && of->is_kept; i++) add_weight_of_value(of, &of->kept.values[i], counts);
    if (of->is_kept) return;
    of->kept.count = 0;
    for (int i = 0; i < meshes->count; i++) {
        counted_cells cells;
        if (find_cells(meshes, i, field, of, &cells)) count_digits_of_cells(&cells, team->threads, of, counts);
    }
    of->is_kept = of->pass >= FIRST_KEPT && of->kept.count <= MOST_KEPT;
}

static insitu_status count_digits_over_ranks(const session_meshes *meshes, const session_team *team,
                                             const scene_field *field, digit_count *of, int64_t counts[2 * DIGITS],
                                             base_error *error)
{
    memset(counts, 0, 2 * DIGITS * sizeof *counts);
    count_own_digits(meshes, team, field, of, counts);
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, counts, 2 * DIGITS, MPI_INT64_T, MPI_SUM, team->comm),
                             "MPI_Allreduce");
}

/* Entries of the reduction by minimum that determines which cells are counted. SOLID: -1 if there is a cell with a
 * volume, otherwise 0. AREA: the negated area of the largest shell; it is not updated after a cell with a volume has
 * been found. LACKING: -1 if memory ran out on a rank, otherwise 0. */
enum { SOLID, AREA, LACKING, KINDS };

static void find_own_kinds_of_cells(const counted_cells *cells, int threads, const digit_count *of, double least[KINDS])
{
#pragma omp parallel num_threads(session_choose_loop_threads(threads, cells->count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : least[:KINDS]) nowait
        for (int64_t cell = 0; cell < cells->count; cell++) {
            double middle;
            if (least[SOLID] < 0 || !find_mean_of_extremes(of, cells, cell, &middle)) continue;
            if (is_shell(cells, cell))
                least[AREA] = fmin(least[AREA], -find_shell_area(cells, cell));
            else
                least[SOLID] = -1;
        }
        region_leave();
    }
}

/* Computes of->order_values: for each mesh with cells of higher order, the minimum and maximum of the values at the
 * nodes of each of the caller's cells, and the cells' volumes or areas. The nodes of quads are assumed to be
 * equispaced, because areas hardly depend on the spacing. Returns false if memory runs out. */
static bool find_higher_order_cell_values(const session_meshes *meshes, int threads, const scene_field *field,
                                          digit_count *of, base_error *error)
{
    of->order_values = base_calloc((size_t)meshes->count + 1, sizeof(session_cell_value *));
    if (!of->order_values) session_fail_for_memory(error, meshes->count, "percentiles");
    for (int i = 0; i < meshes->count && !error->status; i++) {
        const session_mesh *mesh = meshes->items[i];
        const session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, field) : NULL;
        if (!scalar || !mesh->topology.is_split) continue;
        const bool is_own = !scalar->is_recentred && !session_is_distance(scalar);
        const session_order_field own = {.mesh = mesh,
                                         .values = session_get_scalar_values(mesh, scalar),
                                         .given =
                                             is_own ? session_find_field_with_caller_nodes(mesh, scalar->field) : -1,
                                         .threads = threads};
        session_compute_higher_order_cell_values(&own, &of->order_values[i], error);
    }
    return !error->status;
}

static void free_higher_order_cell_values(const session_meshes *meshes, digit_count *of)
{
    for (int i = 0; i < meshes->count && of->order_values; i++) base_free(of->order_values[i]);
    base_free(of->order_values);
}

/* Determines, over all ranks, whether cells with a volume are counted or, if there are none, shells. */
static insitu_status choose_counted_cells(const session_meshes *meshes, const session_team *team,
                                          const scene_field *field, digit_count *of, base_error *error)
{
    double least[KINDS] = {0};
    if (!find_higher_order_cell_values(meshes, team->threads, field, of, error)) least[LACKING] = -1;
    for (int i = 0; i < meshes->count && least[LACKING] == 0; i++) {
        counted_cells cells;
        if (find_cells(meshes, i, field, of, &cells)) find_own_kinds_of_cells(&cells, team->threads, of, least);
    }
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, least, KINDS, MPI_DOUBLE, MPI_MIN, team->comm), "MPI_Allreduce");
    of->is_of_shells = least[SOLID] == 0;
    of->largest_area = -least[AREA];
    return status || least[LACKING] == 0 ? status : session_agree(team->comm, error);
}

/* Returns the next digit of the value at a position in the sorted list of values, in which each value takes as many
 * positions as its weight. counts: the sum of the weights for each digit, over the values whose earlier digits equal
 * those found so far. On entry, *rank is the position among these values; on return, it is the position among those of
 * them that have the returned digit. */
static int find_digit_at_position(const int64_t counts[DIGITS], int64_t *rank)
{
    int digit = 0;
    while (digit + 1 < DIGITS && *rank >= counts[digit]) *rank -= counts[digit++];
    return digit;
}

/* Returns the position of a percentile in the sorted list of values, in which each value takes as many positions as its
 * weight. total: number of all positions. The result is limited to total - 1, because the total may be too large for an
 * exact conversion to double. */
static int64_t find_position_of_percentile(double percent, int64_t total)
{
    const int64_t rank = (int64_t)fmax(ceil(percent / 100 * (double)total), 1) - 1;
    return rank < total ? rank : total - 1;
}

static insitu_status find_percentiles(const session_meshes *meshes, const session_team *team, const scene_field *field,
                                      const scene_colour_map *map, double *low, double *high, base_error *error)
{
    const double percent[2] = {map->range.low, map->range.high};
    int64_t counts[2 * DIGITS], total = 0, ranks[2] = {0, 0};
    digit_count of = {.is_positive = map->scale == SCENE_LOG};
    insitu_status status = choose_counted_cells(meshes, team, field, &of, error);
    for (of.pass = 0; of.pass < PASSES && !status; of.pass++) {
        status = count_digits_over_ranks(meshes, team, field, &of, counts, error);
        for (int i = 0; i < DIGITS && of.pass == 0; i++) total += counts[i];
        for (int end = 0; end < 2; end++) {
            if (of.pass == 0) ranks[end] = find_position_of_percentile(percent[end], total);
            const int digit = find_digit_at_position(counts + (ptrdiff_t)end * DIGITS, &ranks[end]);
            of.known_bits[end] |= (uint64_t)digit << compute_digit_shift(of.pass);
        }
    }
    free_higher_order_cell_values(meshes, &of);
    *low = total ? map_ordered_integer_to_value(of.known_bits[0]) : INFINITY;
    *high = total ? map_ordered_integer_to_value(of.known_bits[1]) : -INFINITY;
    return status;
}

/* ---- range that a colour map requires ---------------------------------------------------------------------------- */

insitu_status session_find_range(const session_meshes *meshes, const session_team *team, const scene_field *field,
                                 const scene_colour_map *map, double *low, double *high, base_error *error)
{
    const session_range_subject of = {field, NULL, map->scale == SCENE_LOG};
    if (map->range.source == SCENE_RANGE_PERCENTILES)
        return find_percentiles(meshes, team, field, map, low, high, error);
    const insitu_status status = session_find_extremes(meshes, team, &of, low, high, error);
    if (status || map->range.source != SCENE_RANGE_SYMMETRIC || *low > *high) return status;
    *high = fmax(fabs(*low), fabs(*high));
    *low = -*high;
    return INSITU_OK;
}
