/* Percentiles are computed digit by digit. Values are doubles, mapped to integers in the same order. A pass considers
 * the values whose leading bits are those found so far, and counts them by the next 11 bits; the sum of all ranks'
 * counts determines the digit of the wanted value. Six passes find all 64 bits, and so the exact value instead of an
 * estimate, for any partition. From the third pass on few values are left: a pass stores them, and the next ones do not
 * read cells. */
#include "session_ranges.h"

#include <math.h>
#include <string.h>

#include "mmbvh_fetch.h"
#include "session_agree.h"
#include "session_distances.h"
#include "session_region.h"
#include "session_scalars.h"

/* ---- minimum and maximum --------------------------------------------------------------------------------------- */

insitu_status session_find_extremes(const session_meshes *meshes, const session_team *team,
                                    const session_range_subject *of, double *low, double *high, base_error *error)
{
    double mine[2] = {INFINITY, INFINITY}, all[2];
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, of->field) : NULL;
        if (scalar && of->plane) scalar = session_find_distance(mesh, of->plane);
        if (!scalar) continue;
        double least, most;
        session_scalar_extent(mesh, scalar, team->threads, of->is_positive ? SESSION_POSITIVE : SESSION_SEEN, &least,
                              &most);
        mine[0] = fmin(mine[0], least);
        mine[1] = fmin(mine[1], -most);
    }
    const insitu_status status =
        session_check_mpi(error, MPI_Allreduce(mine, all, 2, MPI_DOUBLE, MPI_MIN, team->comm), "MPI_Allreduce");
    *low = all[0];
    *high = -all[1];
    return status;
}

/* ---- percentiles ----------------------------------------------------------------------------------------------- */

enum { DIGIT_BITS = 11, DIGITS = 1 << DIGIT_BITS, PASSES = 6 };

static const uint64_t sign_bit = UINT64_C(1) << 63;

/* Maps a value to an integer, preserving the order. */
static uint64_t order_from_value(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits & sign_bit ? ~bits : bits | sign_bit;
}

static double value_from_order(uint64_t order)
{
    const uint64_t bits = order & sign_bit ? order & ~sign_bit : ~order;
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Returns the position of the lowest bit by which a pass counts. The last pass has 9 bits left. */
static int pass_shift(int pass)
{
    return pass + 1 < PASSES ? 64 - DIGIT_BITS * (pass + 1) : 0;
}

/* Returns the mask of the bits that are known before a pass. */
static uint64_t known_bits_mask(int pass)
{
    return pass ? ~UINT64_C(0) << pass_shift(pass - 1) : 0;
}

/* This rank's values that the last pass has considered, unsorted; they are stored if there are at most MOST_KEPT. */
enum { MOST_KEPT = 4096, FIRST_KEPT = 2 };

typedef struct kept_values {
    int count;                  /* number of values; MOST_KEPT + 1: there are more */
    uint64_t orders[MOST_KEPT]; /* the values, mapped to integers in the same order (order_from_value()) */
} kept_values;

typedef struct digit_count {
    uint64_t known_bits[2]; /* known leading bits of the low and the high percentile; the other bits are 0 */
    int pass;               /* number of the current pass, from 0; each pass determines one more digit */
    bool is_positive;       /* set if only positive values count */
    bool is_kept;           /* set if the stored values are read instead of cells */
    kept_values kept;
} digit_count;

static void keep_value(uint64_t order, kept_values *kept)
{
    int at;
#pragma omp atomic read
    at = kept->count;
    if (at > MOST_KEPT) return;
#pragma omp atomic capture
    at = kept->count++;
    if (at < MOST_KEPT) kept->orders[at] = order;
}

/* Counts a value by its next digit, for each percentile whose known leading bits it has. Returns whether it was counted
 * for any. */
static bool count_value(const digit_count *of, uint64_t order, int64_t counts[2 * DIGITS])
{
    const uint64_t known = known_bits_mask(of->pass);
    bool is_counted = false;
    for (int end = 0; end < 2; end++) {
        if ((order & known) != of->known_bits[end]) continue;
        counts[end * DIGITS + (int)((order & ~known) >> pass_shift(of->pass))]++;
        is_counted = true;
    }
    return is_counted;
}

static void count_cells(const session_mesh *mesh, const session_scalar *scalar, int threads, digit_count *of,
                        int64_t counts[2 * DIGITS])
{
    const grid *g = &mesh->cells;
    const grid_field field = session_scalar_field(mesh, scalar);
#pragma omp parallel num_threads(session_region_threads(threads, g->cell_count))
    {
        region_enter();
#pragma omp for schedule(static) reduction(+ : counts[:2 * DIGITS]) nowait
        for (int64_t cell = 0; cell < g->cell_count; cell++) {
            if (!grid_is_seen(g, cell)) continue;
            const fetch_range range = fetch_any_cell_range(g, &field, cell);
            const double middle = 0.5 * range.low + 0.5 * range.high;
            if (!range.is_finite || (of->is_positive && !(middle > 0))) continue;
            const uint64_t order = order_from_value(middle);
            if (count_value(of, order, counts) && of->pass >= FIRST_KEPT) keep_value(order, &of->kept);
        }
        region_leave();
    }
}

static void count_own_digits(const session_meshes *meshes, const session_team *team, const scene_field *field,
                             digit_count *of, int64_t counts[2 * DIGITS])
{
    for (int i = 0; i < of->kept.count && of->is_kept; i++) count_value(of, of->kept.orders[i], counts);
    if (of->is_kept) return;
    of->kept.count = 0;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        const session_scalar *scalar = mesh->is_given ? session_find_scalar(mesh, field) : NULL;
        if (scalar) count_cells(mesh, scalar, team->threads, of, counts);
    }
    of->is_kept = of->pass >= FIRST_KEPT && of->kept.count <= MOST_KEPT;
}

static insitu_status count_digits(const session_meshes *meshes, const session_team *team, const scene_field *field,
                                  digit_count *of, int64_t counts[2 * DIGITS], base_error *error)
{
    memset(counts, 0, 2 * DIGITS * sizeof *counts);
    count_own_digits(meshes, team, field, of, counts);
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, counts, 2 * DIGITS, MPI_INT64_T, MPI_SUM, team->comm),
                             "MPI_Allreduce");
}

/* Returns the digit of the value with this rank in the order; *rank becomes its rank among the values with this
 * digit. */
static int find_digit(const int64_t counts[DIGITS], int64_t *rank)
{
    int digit = 0;
    while (digit + 1 < DIGITS && *rank >= counts[digit]) *rank -= counts[digit++];
    return digit;
}

static insitu_status find_percentiles(const session_meshes *meshes, const session_team *team, const scene_field *field,
                                      const scene_colour_map *map, double *low, double *high, base_error *error)
{
    const double percent[2] = {map->range.low, map->range.high};
    int64_t counts[2 * DIGITS], total = 0, ranks[2] = {0, 0};
    digit_count of = {.is_positive = map->scale == SCENE_LOG};
    for (of.pass = 0; of.pass < PASSES; of.pass++) {
        const insitu_status status = count_digits(meshes, team, field, &of, counts, error);
        if (status) return status;
        for (int i = 0; i < DIGITS && of.pass == 0; i++) total += counts[i];
        for (int end = 0; end < 2; end++) {
            if (of.pass == 0) ranks[end] = (int64_t)fmax(ceil(percent[end] / 100 * (double)total), 1) - 1;
            const int digit = find_digit(counts + (ptrdiff_t)end * DIGITS, &ranks[end]);
            of.known_bits[end] |= (uint64_t)digit << pass_shift(of.pass);
        }
    }
    *low = total ? value_from_order(of.known_bits[0]) : INFINITY;
    *high = total ? value_from_order(of.known_bits[1]) : -INFINITY;
    return INSITU_OK;
}

/* ---- all sources of ranges ------------------------------------------------------------------------------------- */

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
