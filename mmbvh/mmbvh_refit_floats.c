/* Computes bounds, and optionally ranges, if coordinates and values are floats, as they are in most meshes. A vertex is
 * one vector: its position in lanes 0 to 2, its value in lane 3. The cells of up to PART_NODES nodes are read in one
 * pass, regardless of the number of cells in each leaf. */
#include "mmbvh_bounds.h"
#include "mmbvh_measure.h"

enum {
    PART_NODES = 256, /* maximum number of nodes whose cells are read in one pass */
    /* maximum number of cells in PART_NODES nodes: if two siblings and their descendants are n nodes together, n / 2 +
     * 1 of them are leaves */
    PART_CELLS = (PART_NODES / 2 + 1) * MMBVH_MAX_LEAF,
    PREFETCH_CELLS = 64,
    PREFETCH_VERTICES = 24
};

/* The boxes of consecutive cells of mmbvh.cells, beginning with the one at index `first`. Lane 3 of a box's lower and
 * upper corner holds the lowest and the highest value of the cell. */
typedef struct part {
    int64_t first;
    int64_t unusable;     /* number of cells with non-finite values */
    int64_t outside_grid; /* number of boxes that the tree's grid cannot represent */
    double area_change;   /* change of mmbvh.area caused by the nodes of this part */
    fetch_float_box float_boxes[PART_CELLS];
} part;

/* Parameters of a pass that are compile-time constants in each instance. */
typedef struct pass_constants {
    fetch_shape shape;
    bool wide_index, with_values, is_packed;
} pass_constants;

MMBVH_INLINE fetch_float_box read_cell(const sweep *s, int64_t cell, const pass_constants pass, int64_t *unusable)
{
    const grid *g = s->source->g;
    const int64_t stride = pass.is_packed ? 4 : g->coordinates[0].stride;
    const int64_t value_stride = pass.is_packed ? 4 : s->values.stride;
    const char *const x = g->coordinates[0].data, *const y = g->coordinates[1].data, *const z = g->coordinates[2].data;
    const int count = fetch_vertex_count(g, cell, pass.shape);
    const int64_t first = fetch_first_entry(g, cell, count, pass.shape);
    fetch_float_box float_box = fetch_float_box_empty();
    vec4 nonfinite = {0};
    for (int i = 0; i < count; i++) {
        const int64_t vertex = fetch_vertex(g, first, i, pass.shape, pass.wide_index);
        const vec4 p = {*(const float *)(const void *)(x + vertex * stride),
                        *(const float *)(const void *)(y + vertex * stride),
                        *(const float *)(const void *)(z + vertex * stride),
                        pass.with_values ? *(const float *)(const void *)(s->values.data + vertex * value_stride) : 0};
        float_box.lower = vec4_min(p, float_box.lower);
        float_box.upper = vec4_max(p, float_box.upper);
        if (pass.with_values) nonfinite += p - p; /* 0 while all values are finite, otherwise NaN */
    }
    if (nonfinite[3] == 0) return float_box;
    ++*unusable;
    float_box.lower[3] = INFINITY;
    float_box.upper[3] = -INFINITY;
    return float_box;
}

/* Prefetches one vertex of a hex whose connectivity was prefetched earlier; the hex's other vertices are usually near
 * this one. Cells other than hexes are skipped: a vertex of tets belongs to so many cells that it is usually in the
 * cache already. */
MMBVH_INLINE void prefetch_vertex(const sweep *s, int64_t cell, const pass_constants pass)
{
    const grid *g = s->source->g;
    if (pass.shape != FETCH_HEXES) return;
    const int64_t vertex = fetch_index(&g->connectivity, fetch_first_entry(g, cell, 8, pass.shape), pass.wide_index);
    for (int axis = 0; axis < 3; axis++) {
        __builtin_prefetch(g->coordinates[axis].data + vertex * (pass.is_packed ? 4 : g->coordinates[0].stride));
    }
    if (pass.with_values) __builtin_prefetch(s->values.data + vertex * (pass.is_packed ? 4 : s->values.stride));
}

MMBVH_INLINE void read_cells(const sweep *s, part *p, int64_t first, int64_t end, const pass_constants pass)
{
    const uint32_t *cells = s->tree->cells;
    p->first = first;
    for (int64_t i = end - 1; i >= first; i--) {
        const int64_t later =
            cells[i > PREFETCH_CELLS ? i - PREFETCH_CELLS : 0]; /* the sweep processes the cells in descending order */
        const int64_t entry =
            fetch_first_entry(s->source->g, later, fetch_vertex_count(s->source->g, later, pass.shape), pass.shape);
        prefetch_connectivity(s->source->g, entry, pass.shape);
        prefetch_vertex(s, cells[i > PREFETCH_VERTICES ? i - PREFETCH_VERTICES : 0], pass);
        p->float_boxes[i - first] = read_cell(s, cells[i], pass, &p->unusable);
    }
}

MMBVH_INLINE void store_leaf(const sweep *s, part *p, int64_t node, int64_t first, int count, const pass_constants pass)
{
    const mmbvh *tree = s->tree;
    const fetch_float_box *float_boxes = p->float_boxes + (first - p->first);
    fetch_float_box all = float_boxes[0];
    for (int i = 1; i < count; i++) unite_float_boxes(&all, &float_boxes[i]);
    vec4 lower, upper;
    round_float_box_outward(&all, tree->origin, tree->scale, &lower, &upper);
    store_box_and_measure_area(s, node, lower, upper, &p->outside_grid, &p->area_change);
    /* adding 0 makes a negative zero positive, as rounding does for other meshes */
    if (pass.with_values) set_range(s, node, (range){all.lower[3] + 0.0f, all.upper[3] + 0.0f});
}

MMBVH_INLINE void store_nodes(const sweep *s, part *p, int64_t first, int64_t end, const pass_constants pass)
{
    for (int64_t i = end - 1; i >= first; i--) {
        const int count = mmbvh_node_count(s->tree, i);
        const int64_t ref = mmbvh_node_ref(s->tree, i);
        if (count) {
            store_leaf(s, p, i, ref, count, pass);
        } else {
            store_union_of_children(s, i, ref, &p->outside_grid, &p->area_change);
            if (pass.with_values) set_range(s, i, unite_ranges_of_children(s, ref));
        }
    }
}

/* Computes the bounds, and ranges if pass.with_values is set, of the nodes from end - 1 down to `first`. These nodes
 * are the root, or two siblings whose descendants are not in the interval and have been processed before. */
MMBVH_INLINE void read_and_store_nodes(const sweep *s, part *p, int64_t first, int64_t end, const pass_constants pass)
{
    for (int64_t i = first; i < end; i++) {
        const int count = mmbvh_node_count(s->tree, i);
        const int64_t ref = mmbvh_node_ref(s->tree, i);
        if (count) read_cells(s, p, ref, ref + count, pass);
        store_nodes(s, p, i, i + 1, pass);
    }
}

/* first_cell() returns the index, in mmbvh.cells, of the first cell below a node; find_end_of_cell_entries_below()
 * returns one more than the index of the last. */
static int64_t first_cell(const mmbvh *tree, int64_t node)
{
    while (!mmbvh_node_count(tree, node)) node = mmbvh_node_ref(tree, node);
    return mmbvh_node_ref(tree, node);
}

static int64_t find_end_of_cell_entries_below(const mmbvh *tree, int64_t node)
{
    while (!mmbvh_node_count(tree, node)) node = mmbvh_node_ref(tree, node) + 1;
    return mmbvh_node_ref(tree, node) + mmbvh_node_count(tree, node);
}

MMBVH_INLINE sweep_sum refit_nodes(const sweep *s, int64_t first, int64_t end, const pass_constants pass)
{
    part p;
    p.unusable = p.outside_grid = 0;
    p.area_change = 0;
    if (end - first <= 2) {
        read_and_store_nodes(s, &p, first, end, pass);
    } else {
        read_cells(s, &p, first_cell(s->tree, first), find_end_of_cell_entries_below(s->tree, first + 1), pass);
        store_nodes(s, &p, first, end, pass);
    }
    return (sweep_sum){pass.with_values ? p.unusable : p.outside_grid, p.area_change};
}

#define DEFINE_RUN_BOUNDS(name, shape, wide_index, wide_number)                                                        \
    static sweep_sum name(const sweep *s, int64_t first, int64_t end)                                                  \
    {                                                                                                                  \
        return fetch_is_contiguous(&s->source->g->coordinates[0])                                                      \
                   ? refit_nodes(s, first, end, (pass_constants){shape, wide_index, false, true})                      \
                   : refit_nodes(s, first, end, (pass_constants){shape, wide_index, false, false});                    \
    }
FETCH_FLOAT_INSTANCES(DEFINE_RUN_BOUNDS, run_bounds)

#define DEFINE_RUN_BOTH(name, shape, wide_index, wide_number)                                                          \
    static sweep_sum name(const sweep *s, int64_t first, int64_t end)                                                  \
    {                                                                                                                  \
        return fetch_is_contiguous(&s->source->g->coordinates[0]) && fetch_is_contiguous(&s->values)                   \
                   ? refit_nodes(s, first, end, (pass_constants){shape, wide_index, true, true})                       \
                   : refit_nodes(s, first, end, (pass_constants){shape, wide_index, true, false});                     \
    }
FETCH_FLOAT_INSTANCES(DEFINE_RUN_BOTH, run_both)

static const sweep_run run_bounds_table[FETCH_SHAPES][2] = FETCH_FLOAT_TABLE(run_bounds);
static const sweep_run run_both_table[FETCH_SHAPES][2] = FETCH_FLOAT_TABLE(run_both);

void sweep_bounds_as_floats(sweep *bounds)
{
    const grid *g = bounds->source->g;
    if (!bounds->source->read_float_boxes) return;
    bounds->run = run_bounds_table[fetch_grid_shape(g)][g->connectivity.is_wide];
    bounds->range_max = PART_NODES;
}

bool sweep_bounds_and_ranges_as_floats(const sweep *ranges, const bounds_source *source, sweep *both)
{
    if (!source->read_float_boxes || !sweep_reads_floats(ranges)) return false;
    *both = *ranges;
    both->source = source;
    both->run = run_both_table[fetch_grid_shape(source->g)][source->g->connectivity.is_wide];
    both->range_max = PART_NODES;
    return true;
}
