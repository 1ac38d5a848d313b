/* Runs sweeps (bottom-up passes, mmbvh_sweep.h) over a tree, and computes the nodes' ranges for new values. */
#include "mmbvh_sweep.h"

#include <omp.h>

#include "mmbvh_fetch.h"
#include "region.h"

enum {
    TASK_NODES = 4096,
    PREFETCH_CELLS = 48,
    /* prefetch distance for tets, in cells; it is larger than for hexes, because the connectivity of a tet takes half
     * as many bytes */
    PREFETCH_TETS = 96
};

int sweep_threads(const mmbvh_options *options)
{
    return options && options->threads > 0 ? options->threads : omp_get_max_threads();
}

bool sweep_visits(const sweep *s, int64_t node)
{
    for (int v = 0; v < s->visible_count; v++) {
        const mmbvh_visible *visible = &s->visible[v];
        const float low = *(const float *)(const void *)(visible->ranges.low + node * visible->ranges.stride);
        const float high = *(const float *)(const void *)(visible->ranges.high + node * visible->ranges.stride);
        for (int i = 0; i < visible->interval_count; i++)
            if (low <= visible->intervals[i].high && high >= visible->intervals[i].low) return true;
    }
    return s->visible_count == 0;
}

static sweep_sum sweep_range_with_followers(const sweep *s, int64_t first, int64_t end)
{
    const sweep_sum sum = s->run(s, first, end);
    return s->follower ? sweep_range_with_followers(s->follower, first, end) : sum;
}

/* Returns the index of the first descendant of the right sibling, for the pair of siblings whose left node has the
 * index `first`. Returns `end` if the right sibling is a leaf. */
static int64_t find_right_subtree(const sweep *s, int64_t first, int64_t end)
{
    return mmbvh_node_count(s->tree, first + 1) ? end : mmbvh_node_ref(s->tree, first + 1);
}

/* Runs the sweep on this thread over the nodes [first, end), which are a pair of siblings and all their descendants. If
 * s->range_max is not 0, each call of s->run gets at most this number of nodes. */
static sweep_sum sweep_pair_serially(const sweep *s, int64_t first, int64_t end)
{
    if (!s->range_max || end - first <= s->range_max) return sweep_range_with_followers(s, first, end);
    const int64_t right_first = find_right_subtree(s, first, end);
    sweep_sum left = {0}, right = {0};
    if (sweep_visits(s, first + 1)) right = sweep_pair_serially(s, right_first, end);
    if (sweep_visits(s, first)) left = sweep_pair_serially(s, first + 2, right_first);
    return sweep_add(sweep_add(left, right), sweep_range_with_followers(s, first, first + 2));
}

/* Runs the sweep over the nodes [first, end), which are a pair of siblings and all their descendants, in parallel tasks
 * of at most TASK_NODES nodes. */
static sweep_sum sweep_pair_in_tasks(const sweep *s, int64_t first, int64_t end)
{
    if (end - first <= TASK_NODES) return sweep_pair_serially(s, first, end);
    const int64_t right_first = find_right_subtree(s, first, end);
    sweep_sum left = {0}, right = {0};
    if (sweep_visits(s, first)) {
#pragma omp task default(none) firstprivate(s, first, right_first) shared(left)
        left = sweep_pair_in_tasks(s, first + 2, right_first);
    }
    if (sweep_visits(s, first + 1)) right = sweep_pair_in_tasks(s, right_first, end);
#pragma omp taskwait
    return sweep_add(sweep_add(left, right), sweep_range_with_followers(s, first, first + 2));
}

sweep_sum sweep_tree(const sweep *s, int threads)
{
    sweep_sum sum = {0};
    const int64_t node_count = s->tree->node_count;
    if (!node_count || !sweep_visits(s, 0)) return sum;
    if (node_count <= TASK_NODES) {
        sum = sweep_pair_serially(s, 1, node_count);
    } else {
#pragma omp parallel num_threads(threads)
        {
            region_enter();
#pragma omp single
            sum = sweep_pair_in_tasks(s, 1, node_count);
            region_leave();
        }
    }
    return sweep_add(sum, sweep_range_with_followers(s, 0, 1)); /* the root is processed after its children */
}

/* Prefetches the connectivity of the cell at a list position that the sweep reaches soon; cells are processed in
 * descending order. Two cache lines are prefetched if a cell's entries may straddle them. */
MMBVH_INLINE void prefetch_cell(const sweep *s, int64_t entry, const fetch_shape shape, const bool wide_index)
{
    const int64_t distance = shape == FETCH_TETS ? PREFETCH_TETS : PREFETCH_CELLS;
    if (shape == FETCH_LATTICE || entry < distance) return;
    const int64_t later = s->tree->cells[entry - distance];
    const int count = fetch_vertex_count(s->g, later, shape);
    const int64_t first = fetch_first_entry(s->g, later, count, shape);
    prefetch_connectivity(s->g, first, shape);
    if (shape != FETCH_TETS || wide_index) prefetch_connectivity(s->g, first + count - 1, shape);
}

/* Rounds a range outward. If no cell was read, the range stays empty. */
static inline range round_range_outward(const fetch_range *r)
{
    return r->low <= r->high ? (range){round_down(r->low), round_up(r->high)} : range_empty();
}

/* Returns the range of a leaf whose values are doubles. Minima and maxima are accumulated per lane over the cells, and
 * lanes are combined at the end. */
MMBVH_INLINE range compute_range_of_double_leaf(const sweep *s, int64_t ref, int64_t count, const fetch_shape shape,
                                                const bool wide_index, const bool is_packed, int64_t *unusable)
{
    fetch_lane_range leaf = {vec2_set1((double)INFINITY), vec2_set1(-(double)INFINITY)}, cell;
    for (int64_t entry = ref + count - 1; entry >= ref; entry--) {
        prefetch_cell(s, entry, shape, wide_index);
        if (!fetch_cell_doubles(s->g, &s->values, s->tree->cells[entry], shape, wide_index, is_packed, &cell)) {
            ++*unusable;
            continue;
        }
        leaf.low = vec2_min(cell.low, leaf.low);
        leaf.high = vec2_max(cell.high, leaf.high);
    }
    const fetch_range r = fetch_combine_lanes(&leaf, true);
    return round_range_outward(&r);
}

MMBVH_INLINE range compute_range_of_float_leaf(const sweep *s, int64_t ref, int64_t count, const fetch_shape shape,
                                               const bool wide_index, const bool is_packed, int64_t *unusable)
{
    vec4 low = vec4_set1(INFINITY), high = vec4_set1(-INFINITY), v[2];
    for (int64_t entry = ref + count - 1; entry >= ref; entry--) {
        prefetch_cell(s, entry, shape, wide_index);
        if (!fetch_cell_floats(s->g, &s->values, s->tree->cells[entry], shape, wide_index, is_packed, v)) {
            ++*unusable;
            continue;
        }
        low = vec4_min(vec4_min(v[0], v[1]), low);
        high = vec4_max(vec4_max(v[0], v[1]), high);
    }
    return (range){vec4_min_lane(low) + 0.0f,
                   vec4_max_lane(high) + 0.0f}; /* adding 0 makes a negative zero positive, as round_down() does */
}

MMBVH_INLINE sweep_sum run_ranges(const sweep *s, int64_t first, int64_t end, const fetch_shape shape,
                                  const bool wide_index, const bool wide_number, const bool is_packed)
{
    int64_t unusable = 0;
    for (int64_t i = end - 1; i >= first; i--) {
        const int64_t count = mmbvh_node_count(s->tree, i), ref = mmbvh_node_ref(s->tree, i);
        if (!count)
            set_range(s, i, unite_ranges_of_children(s, ref));
        else if (wide_number)
            set_range(s, i, compute_range_of_double_leaf(s, ref, count, shape, wide_index, is_packed, &unusable));
        else
            set_range(s, i, compute_range_of_float_leaf(s, ref, count, shape, wide_index, is_packed, &unusable));
    }
    return (sweep_sum){.count = unusable};
}

#define DEFINE_RUN(name, shape, wide_index, wide_number)                                                               \
    static sweep_sum name(const sweep *s, int64_t first, int64_t end)                                                  \
    {                                                                                                                  \
        return fetch_is_contiguous(&s->values) ? run_ranges(s, first, end, shape, wide_index, wide_number, true)       \
                                               : run_ranges(s, first, end, shape, wide_index, wide_number, false);     \
    }
FETCH_INSTANCES(DEFINE_RUN, run_ranges)

static const sweep_run run_ranges_table[FETCH_SHAPES][2][2] = FETCH_TABLE(run_ranges);

/* Returns the range of a leaf for fields and cells that the specialized functions above cannot read. */
static range compute_range_of_any_leaf(const sweep *s, int64_t ref, int64_t count, int64_t *unusable)
{
    fetch_range leaf = {(double)INFINITY, -(double)INFINITY, true};
    for (int64_t k = 0; k < count; k++) {
        const fetch_range cell = fetch_any_cell_range(s->g, s->field, s->tree->cells[ref + k]);
        *unusable += !cell.is_finite;
        if (!cell.is_finite) continue;
        leaf.low = cell.low < leaf.low ? cell.low : leaf.low;
        leaf.high = cell.high > leaf.high ? cell.high : leaf.high;
    }
    return round_range_outward(&leaf);
}

static sweep_sum compute_ranges_of_any_cells(const sweep *s, int64_t first, int64_t end)
{
    int64_t unusable = 0;
    for (int64_t i = end - 1; i >= first; i--) {
        const int64_t count = mmbvh_node_count(s->tree, i), ref = mmbvh_node_ref(s->tree, i);
        set_range(s, i, count ? compute_range_of_any_leaf(s, ref, count, &unusable) : unite_ranges_of_children(s, ref));
    }
    return (sweep_sum){.count = unusable};
}

static sweep_sum set_infinite_ranges(const sweep *s, int64_t first, int64_t end)
{
    for (int64_t i = first; i < end; i++) set_range(s, i, (range){-INFINITY, INFINITY});
    return (sweep_sum){0};
}

static sweep_sum compute_ranges_of_given_boxes(const sweep *s, int64_t first, int64_t end)
{
    for (int64_t i = end - 1; i >= first; i--) {
        const int64_t count = mmbvh_node_count(s->tree, i), ref = mmbvh_node_ref(s->tree, i);
        range r = count ? range_empty() : unite_ranges_of_children(s, ref);
        for (int64_t k = 0; k < count; k++) {
            const float *of_box = s->box_ranges + 2 * (int64_t)s->tree->cells[ref + k];
            r = range_union((range){of_box[0], of_box[1]}, r);
        }
        set_range(s, i, r);
    }
    return (sweep_sum){0};
}

/* Returns whether the specialized functions can read the field. */
static bool can_use_specialized(const grid *g, const grid_field *field)
{
    const bool is_float = !field->is_cell_centred && field->component >= 0 && !field->values.is_integer;
    return is_float && !field->source_cells && !grid_may_have_polyhedra(g);
}

bool sweep_reads_floats(const sweep *ranges)
{
    return ranges->field && can_use_specialized(ranges->g, ranges->field) && !ranges->values.is_wide;
}

static sweep_run choose_sweep_function(const grid *g, const grid_field *field)
{
    if (!field) return set_infinite_ranges;
    if (!can_use_specialized(g, field)) return compute_ranges_of_any_cells;
    return run_ranges_table[fetch_grid_shape(g)][g->connectivity.is_wide][field->values.is_wide];
}

sweep sweep_of_ranges(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_ranges ranges)
{
    sweep s = {.tree = tree, .g = g, .field = field, .ranges = ranges};
    s.run = choose_sweep_function(g, field);
    if (field && field->component >= 0) {
        s.values = field->values;
        s.values.data += field->component * field->component_stride;
    }
    return s;
}

sweep sweep_of_box_ranges(const mmbvh *tree, const float *ranges)
{
    return (sweep){
        .tree = tree, .run = compute_ranges_of_given_boxes, .box_ranges = ranges, .ranges = mmbvh_own_ranges(tree)};
}

insitu_status mmbvh_refit_ranges(mmbvh *tree, const grid *g, const grid_field *field, const mmbvh_options *options)
{
    if (!tree || !g) return INSITU_ERROR_ARGUMENT;
    if (!tree->node_count) return INSITU_OK;
    const sweep s = sweep_of_ranges(tree, g, field, mmbvh_own_ranges(tree));
    tree->unusable_cells = sweep_tree(&s, sweep_threads(options)).count;
    return INSITU_OK;
}

insitu_status mmbvh_compute_ranges(const mmbvh *tree, const grid *g, const grid_field *field,
                                   const mmbvh_options *options, float *pairs, int64_t *unusable)
{
    if (!tree || !g || (!pairs && tree->node_count)) return INSITU_ERROR_ARGUMENT;
    int64_t count = 0;
    if (tree->node_count) {
        const sweep s = sweep_of_ranges(tree, g, field, mmbvh_pair_ranges(pairs));
        count = sweep_tree(&s, sweep_threads(options)).count;
    }
    if (unusable) *unusable = count;
    return INSITU_OK;
}
