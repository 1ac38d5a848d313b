/* Selects the visible cells. In the thesis (section 4.2), nodes whose range contains no isovalue are skipped during
 * traversal; here cells are skipped before a tree is built.
 *
 * One pass per query sets a bit for each matching cell. Two more passes over the bits then count and list the cells,
 * so that the list is allocated with its exact size. The time of a pass per query is limited by the memory bandwidth
 * for connectivity and values. */
#include <string.h>

#include "memory.h"
#include "mmbvh.h"
#include "mmbvh_fetch.h"
#include "mmbvh_rows.h"
#include "mmbvh_sweep.h"
#include "region.h"

enum { WORD_CELLS = 64, BLOCK_WORDS = 64 };

typedef struct selector selector;

/* Sets the bits of the matching cells in [begin, end). The length of this range is a multiple of 64, except at the end
 * of the grid. Returns the number of cells with non-finite values. */
typedef int64_t (*selector_run)(const selector *s, int64_t begin, int64_t end);

struct selector {
    selector_run run;
    const grid *g;
    const mmbvh_query *query;
    grid_array values; /* values of the field's component, one per vertex or cell */
    uint64_t *bits;
};

/* The result for one cell: whether its values are finite, and whether their range intersects an interval. */
typedef struct match_result {
    bool is_finite;  /* all values are finite */
    bool intersects; /* the range of the values intersects an interval of the query */
} match_result;

MMBVH_INLINE match_result match_range(const selector *s, const fetch_range e)
{
    const float low = (float)e.low, high = (float)e.high;
    match_result out = {e.is_finite, false};
    for (int i = 0; i < s->query->interval_count; i++)
        out.intersects |= (low <= s->query->intervals[i].high) & (high >= s->query->intervals[i].low);
    return out;
}

/* A range intersects an interval if one value is not above the interval and one is not below it. */
MMBVH_INLINE match_result match_floats(const selector *s, int64_t cell, const fetch_shape shape, const bool wide_index,
                                       const bool is_packed)
{
    vec4 v[2];
    match_result out = {fetch_cell_floats(s->g, &s->values, cell, shape, wide_index, is_packed, v), false};
    const vec4 low = vec4_min(v[0], v[1]), high = vec4_max(v[0], v[1]);
    for (int i = 0; i < s->query->interval_count; i++) {
        const mmbvh_interval *interval = &s->query->intervals[i];
        const bool reaches = vec4_any((ivec4)(low <= vec4_set1(interval->high)));
        const bool rises = vec4_any((ivec4)(high >= vec4_set1(interval->low)));
        out.intersects |= reaches & rises;
    }
    return out;
}

MMBVH_INLINE match_result match_doubles(const selector *s, int64_t cell, const fetch_shape shape, const bool wide_index,
                                        const bool is_packed)
{
    fetch_lane_range v;
    const bool is_finite = fetch_cell_doubles(s->g, &s->values, cell, shape, wide_index, is_packed, &v);
    return match_range(s, fetch_combine_lanes(&v, is_finite));
}

/* Returns the lanes' sign bits; bit i is the sign of lane i. */
static inline int sign_bits(ivec4 a)
{
#if defined(__SSE2__)
    return _mm_movemask_ps((__m128)a);
#else
    return (a[0] < 0) | (a[1] < 0) << 1 | (a[2] < 0) << 2 | (a[3] < 0) << 3;
#endif
}

/* Parameters of a pass that are compile-time constants in each instance. */
typedef struct pass_constants {
    fetch_shape shape;
    bool wide_index, wide_number, is_packed;
} pass_constants;

/* Returns the address of the value at the cell's vertex with the local index `at`. */
MMBVH_INLINE uintptr_t find_value_address(const selector *s, int64_t cell, int at, const pass_constants pass,
                                          const int64_t stride)
{
    const grid_array *connectivity = &s->g->connectivity;
    const uintptr_t data = (uintptr_t)s->values.data - (uintptr_t)(connectivity->base * stride);
    const char *entry =
        connectivity->data + (cell * fetch_vertex_count(s->g, cell, pass.shape) + at) * connectivity->stride;
    const int64_t index =
        pass.wide_index ? *(const int64_t *)(const void *)entry : *(const int32_t *)(const void *)entry;
    return data + (uintptr_t)(index * stride);
}

/* Value ranges of four cells, one per lane. nonfinite is 0 if all values of the cell are finite, and otherwise NaN. */
typedef struct four_ranges {
    vec4 low, high, nonfinite;
} four_ranges;

MMBVH_INLINE four_ranges read_four_floats(const selector *s, int64_t cell, const pass_constants pass)
{
    const int64_t stride = pass.is_packed ? (int64_t)sizeof(float) : s->values.stride;
    four_ranges r = {vec4_set1(INFINITY), vec4_set1(-INFINITY), {0}};
    for (int at = 0; at < fetch_vertex_count(s->g, cell, pass.shape); at++) {
        float v[4];
        for (int i = 0; i < 4; i++) v[i] = *(const float *)find_value_address(s, cell + i, at, pass, stride);
        const vec4 values = {v[0], v[1], v[2], v[3]};
        r.low = vec4_min(values, r.low);
        r.high = vec4_max(values, r.high);
        r.nonfinite += values - values; /* 0 while all values are finite, otherwise NaN */
    }
    return r;
}

/* Reads the ranges of four cells whose values are doubles, and rounds them to float. */
MMBVH_INLINE four_ranges read_four_doubles(const selector *s, int64_t cell, const pass_constants pass)
{
    const int64_t stride = pass.is_packed ? (int64_t)sizeof(double) : s->values.stride;
    vec2 low[2], high[2], nonfinite[2] = {{0}};
    for (int pair = 0; pair < 2; pair++) {
        low[pair] = vec2_set1((double)INFINITY);
        high[pair] = -low[pair];
        for (int at = 0; at < fetch_vertex_count(s->g, cell, pass.shape); at++) {
            const int64_t first = cell + 2 * pair;
            const vec2 values = {*(const double *)find_value_address(s, first, at, pass, stride),
                                 *(const double *)find_value_address(s, first + 1, at, pass, stride)};
            low[pair] = vec2_min(values, low[pair]);
            high[pair] = vec2_max(values, high[pair]);
            nonfinite[pair] += values - values;
        }
    }
    return (four_ranges){
        {(float)low[0][0], (float)low[0][1], (float)low[1][0], (float)low[1][1]},
        {(float)high[0][0], (float)high[0][1], (float)high[1][0], (float)high[1][1]},
        {(float)nonfinite[0][0], (float)nonfinite[0][1], (float)nonfinite[1][0], (float)nonfinite[1][1]}};
}

/* Sets a bit in *unusable for each cell whose values are not finite, and in *intersecting for each other cell whose
 * range intersects an interval. */
MMBVH_INLINE void match_four(const selector *s, const four_ranges *r, uint64_t *unusable, uint64_t *intersecting)
{
    ivec4 intersects = {0};
    for (int i = 0; i < s->query->interval_count; i++)
        intersects |= (ivec4)(r->low <= vec4_set1(s->query->intervals[i].high)) &
                      (ivec4)(r->high >= vec4_set1(s->query->intervals[i].low));
    const int not_finite = sign_bits((ivec4)(r->nonfinite != vec4_set1(0)));
    *unusable = (uint64_t)not_finite;
    *intersecting = (uint64_t)(sign_bits(intersects) & ~not_finite);
}

/* Returns a bit mask of the cells in [first, first + count) that are drawn. */
static uint64_t mask_drawn_cells(const grid *g, int64_t first, int64_t count)
{
    uint64_t bits = 0;
    if (!grid_has_ghosts(g) && !g->flat) return count < WORD_CELLS ? (UINT64_C(1) << count) - 1 : ~UINT64_C(0);
    for (int64_t i = 0; i < count; i++) bits |= (uint64_t)grid_is_drawn(g, first + i) << i;
    return bits;
}

typedef match_result (*const matcher)(const selector *s, int64_t cell, const bool is_packed);

/* Sets the bits of the cells in [begin, end) that match the query. The cells may have any types. Cells that are not
 * drawn are skipped. Returns the number of cells with non-finite values. */
MMBVH_INLINE int64_t mark_matching_cells(const selector *s, int64_t begin, int64_t end, matcher match,
                                         const bool is_packed)
{
    int64_t unusable = 0;
    for (int64_t first = begin; first < end; first += WORD_CELLS) {
        const int64_t count = end - first < WORD_CELLS ? end - first : WORD_CELLS;
        uint64_t word = s->bits[first / WORD_CELLS];
        for (int64_t i = 0; i < count; i++) {
            if (!grid_is_drawn(s->g, first + i)) continue;
            const match_result cell = match(s, first + i, is_packed);
            unusable += !cell.is_finite;
            word |= (uint64_t)(cell.is_finite & cell.intersects) << i;
        }
        s->bits[first / WORD_CELLS] = word;
    }
    return unusable;
}

/* Sets the bits of the cells that match the query, four cells at a time. All cells must have the same type. Returns the
 * number of cells with non-finite values. */
MMBVH_INLINE int64_t mark_four_at_once(const selector *s, int64_t begin, int64_t end, matcher match,
                                       const pass_constants pass)
{
    int64_t unusable = 0;
    for (int64_t first = begin; first < end; first += WORD_CELLS) {
        const int64_t count = end - first < WORD_CELLS ? end - first : WORD_CELLS;
        const uint64_t drawn = mask_drawn_cells(s->g, first, count);
        uint64_t not_finite = 0, intersecting = 0, p, m;
        int64_t i = 0;
        for (; i + 4 <= count && drawn; i += 4) {
            for (int ahead = 0; ahead < 4; ahead += s->g->connectivity.is_wide ? 1 : 2)
                prefetch_later_cell(s->g, first + i + ahead, pass.shape);
            const four_ranges r =
                pass.wide_number ? read_four_doubles(s, first + i, pass) : read_four_floats(s, first + i, pass);
            match_four(s, &r, &p, &m);
            not_finite |= p << i;
            intersecting |= m << i;
        }
        for (; i < count && drawn; i++) {
            const match_result cell = match(s, first + i, pass.is_packed);
            not_finite |= (uint64_t)!cell.is_finite << i;
            intersecting |= (uint64_t)(cell.is_finite & cell.intersects) << i;
        }
        unusable += __builtin_popcountll(not_finite & drawn);
        s->bits[first / WORD_CELLS] |= intersecting & drawn;
    }
    return unusable;
}

#define DEFINE_RUN(name, shape, wide_index, wide_number)                                                               \
    MMBVH_INLINE match_result name##_find(const selector *s, int64_t cell, const bool is_packed)                       \
    {                                                                                                                  \
        prefetch_later_cell(s->g, cell, shape);                                                                        \
        return wide_number ? match_doubles(s, cell, shape, wide_index, is_packed)                                      \
                           : match_floats(s, cell, shape, wide_index, is_packed);                                      \
    }                                                                                                                  \
    static int64_t name(const selector *s, int64_t begin, int64_t end)                                                 \
    {                                                                                                                  \
        if (shape < FETCH_BY_CELL)                                                                                     \
            return fetch_is_contiguous(&s->values)                                                                     \
                       ? mark_four_at_once(s, begin, end, name##_find,                                                 \
                                           (pass_constants){shape, wide_index, wide_number, true})                     \
                       : mark_four_at_once(s, begin, end, name##_find,                                                 \
                                           (pass_constants){shape, wide_index, wide_number, false});                   \
        return fetch_is_contiguous(&s->values) ? mark_matching_cells(s, begin, end, name##_find, true)                 \
                                               : mark_matching_cells(s, begin, end, name##_find, false);               \
    }
FETCH_INSTANCES(DEFINE_RUN, mark_vertices)

MMBVH_INLINE match_result match_cell_of_any_type(const selector *s, int64_t cell, const bool is_packed)
{
    (void)is_packed;
    return match_range(s, fetch_any_cell_range(s->g, s->query->field, cell));
}

static int64_t mark_cells_of_any_type(const selector *s, int64_t begin, int64_t end)
{
    return mark_matching_cells(s, begin, end, match_cell_of_any_type, false);
}

/* Packs `count` bytes, each 0 or 1, into bits. The bytes up to the next multiple of 8 must be readable and also be 0 or
 * 1. The multiplication moves the eight bits of a word into its highest byte. */
static uint64_t pack_bytes_into_bits(const unsigned char *bytes, int64_t count)
{
    uint64_t bits = 0, eight;
    for (int64_t n = 0; n < count; n += 8) {
        memcpy(&eight, bytes + n, sizeof eight);
        bits |= (eight * UINT64_C(0x0102040810204080) >> 56) << n;
    }
    return bits;
}

/* Returns a bit mask of the row's cells whose range intersects an interval. */
static uint64_t match_cells_of_row(const selector *s, const rows_ranges *r)
{
    unsigned char intersects[ROWS_CELLS] = {0};
    for (int i = 0; i < s->query->interval_count; i++) {
        const mmbvh_interval of = s->query->intervals[i];
        for (int64_t n = 0; n < r->count; n++)
            intersects[n] = (unsigned char)(intersects[n] | ((r->low[n] <= of.high) & (r->high[n] >= of.low)));
    }
    return pack_bytes_into_bits(intersects, r->count);
}

/* Sets the bits of the cells of a lattice in [begin, end) that match the query, row by row. The bits of a row may lie
 * in two words of the bit set; no other thread writes to these words. */
static int64_t mark_rows(const selector *s, int64_t begin, int64_t end)
{
    const grid *g = s->g;
    rows_ranges r;
    int64_t unusable = 0;
    for (int64_t from = begin; rows_compute_cell_ranges(g, s->query->field, from, end, &r); from = r.first + r.count) {
        uint64_t intersecting = match_cells_of_row(s, &r), finite = pack_bytes_into_bits(r.is_finite, r.count),
                 drawn = 0;
        for (int64_t n = 0; n < r.count && (g->ghosts || g->flat); n++) {
            const int64_t cell = r.first + n;
            drawn |= (uint64_t) !((g->ghosts && grid_is_flagged_as_ghost(g, cell)) || grid_is_flat(g, cell)) << n;
        }
        if (!g->ghosts && !g->flat) drawn = r.count < WORD_CELLS ? (UINT64_C(1) << r.count) - 1 : ~UINT64_C(0);
        unusable += __builtin_popcountll(drawn & ~finite);
        intersecting &= drawn & finite;
        const int64_t shift = r.first % WORD_CELLS;
        s->bits[r.first / WORD_CELLS] |= intersecting << shift;
        if (shift && intersecting >> (WORD_CELLS - shift))
            s->bits[r.first / WORD_CELLS + 1] |= intersecting >> (WORD_CELLS - shift);
    }
    return unusable;
}

static selector make_selector(const grid *g, const mmbvh_query *query, uint64_t *bits)
{
    static const selector_run table[FETCH_SHAPES][2][2] = FETCH_TABLE(mark_vertices);
    const grid_field *field = query->field;
    selector s = {.run = mark_cells_of_any_type, .g = g, .query = query, .values = field->values, .bits = bits};
    const bool is_float = !field->is_cell_centred && field->component >= 0 && !field->values.is_integer;
    if (is_float && !field->source_cells && !grid_may_have_polyhedra(g))
        s.run = table[fetch_grid_shape(g)][g->connectivity.is_wide][field->values.is_wide];
    if (rows_can_read(g, field)) s.run = mark_rows;
    if (field->component > 0) s.values.data += field->component * field->component_stride;
    return s;
}

/* If a lattice has at most this number of cells, the range of all its values is computed before the ranges of single
 * cells are. This takes little time, and often shows that no cell matches the query. */
enum { MOST_READ_TWICE = 1 << 16 };

/* Returns whether the range of all values shows that a small lattice has no matching cell and no non-finite value. */
static bool has_no_visible_cell(const selector *s)
{
    float low, high;
    if (s->run != mark_rows || s->g->cell_count > MOST_READ_TWICE ||
        !rows_compute_total_range(s->g, s->query->field, &low, &high))
        return false;
    return !match_range(s, (fetch_range){.low = (double)low, .high = (double)high, .is_finite = true}).intersects;
}

static int64_t mark_query(const selector *s, int threads)
{
    if (has_no_visible_cell(s)) return 0;
    const int64_t block = (int64_t)WORD_CELLS * BLOCK_WORDS, cells = s->g->cell_count;
    int64_t unusable = 0;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(dynamic, 4) reduction(+ : unusable) nowait
        for (int64_t begin = 0; begin < cells; begin += block)
            unusable += s->run(s, begin, begin + block < cells ? begin + block : cells);
        region_leave();
    }
    return unusable;
}

static int64_t count_bits(const uint64_t *bits, int64_t begin, int64_t end)
{
    int64_t count = 0;
    for (int64_t i = begin; i < end; i++) count += __builtin_popcountll(bits[i]);
    return count;
}

static void list_bits(const uint64_t *bits, int64_t begin, int64_t end, uint32_t *out)
{
    for (int64_t i = begin; i < end; i++)
        for (uint64_t word = bits[i]; word; word &= word - 1)
            *out++ = (uint32_t)(WORD_CELLS * i + __builtin_ctzll(word));
}

/* Lists the cells whose bits are set. The words of the bit set are divided into one part per thread. Each thread counts
 * the cells of its part, and then writes them after the cells of the earlier parts. */
static bool list_cells(const uint64_t *bits, int64_t words, int threads, mmbvh_selection *out)
{
    int64_t *ends = base_calloc((size_t)threads + 1, sizeof *ends);
    if (!ends) return false;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static, 1) nowait
        for (int part = 0; part < threads; part++)
            ends[part + 1] = count_bits(bits, words * part / threads, words * (part + 1) / threads);
        region_leave();
    }
    for (int part = 0; part < threads; part++) ends[part + 1] += ends[part];
    out->count = ends[threads];
    out->cells = base_alloc((size_t)(out->count ? out->count : 1) * sizeof *out->cells);
    if (out->cells) {
#pragma omp parallel num_threads(threads)
        {
            region_enter();
#pragma omp for schedule(static, 1) nowait
            for (int part = 0; part < threads; part++)
                list_bits(bits, words * part / threads, words * (part + 1) / threads, out->cells + ends[part]);
            region_leave();
        }
    }
    base_free(ends);
    return out->cells != NULL;
}

insitu_status mmbvh_select(const grid *g, const mmbvh_query *queries, int query_count, const mmbvh_options *options,
                           mmbvh_selection *out, int64_t *unusable, base_error *error)
{
    const int threads = sweep_threads(options);
    const int64_t words = (g->cell_count + WORD_CELLS - 1) / WORD_CELLS;
    uint64_t *bits = base_calloc((size_t)(words ? words : 1), sizeof *bits);
    *out = (mmbvh_selection){0};
    bool is_listed = bits != NULL;
    for (int i = 0; i < query_count && is_listed; i++) {
        const selector s = make_selector(g, &queries[i], bits);
        unusable[i] = mark_query(&s, threads);
    }
    is_listed = is_listed && list_cells(bits, words, threads, out);
    base_free(bits);
    if (is_listed) return INSITU_OK;
    *out = (mmbvh_selection){0};
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory to list the cells that show, of %lld",
                     (long long)g->cell_count);
}

void mmbvh_selection_free(mmbvh_selection *selection)
{
    base_free(selection->cells);
    *selection = (mmbvh_selection){0};
}
