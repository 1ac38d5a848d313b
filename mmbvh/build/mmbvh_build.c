/* The tree over all cells of a lattice (structured grid) is built by halving boxes of indices (mmbvh_bricks.c). Any
 * other tree is built in three steps. First the boxes of all cells are quantized to 16 bytes each, or their Morton keys
 * are computed (2 × 8 bytes). Then the topology is built: the links between nodes, without bounds, in 4 bytes per node.
 * Finally the nodes are written, and bottom-up passes (mmbvh_sweep.h) compute their bounds and ranges.
 *
 * Peak memory in bytes per cell: 16 for items or keys, 4 for each topology node (0.35 nodes per tet), and 4 for the
 * cell indices in the finished tree. The items are freed before the nodes are allocated. */
#include "mmbvh.h"

#include <string.h>

#include "memory.h"
#include "mmbvh_bounds.h"
#include "mmbvh_branch.h"
#include "mmbvh_bricks.h"
#include "mmbvh_cost.h"
#include "mmbvh_morton.h"
#include "mmbvh_store.h"
#include "region.h"

enum { FILL_CHUNKS = 256, PARALLEL_MIN_CELLS = 4096, LIST_CELLS = 16384 };

/* The settings, buffers and counters of one build. */
typedef struct build {
    bounds_source source;
    /* indices of the cells to use, none of which is a ghost or flat (without volume, grid_is_flat()); NULL: all cells
     * that are neither */
    const uint32_t *selected;
    int64_t candidate_count; /* length of selected, or the number of all cells including ghosts */
    mmbvh_options options;
    int threads;
    /* for each chunk of candidates, the number of the tree's cells in earlier chunks */
    int64_t starts[FILL_CHUNKS + 1];
    int64_t count;
    item *items;
    uint64_t *keys, *other_keys;
    morton_coder *coder;
    item_grid grid;
    item_set set;
    fetch_box exact; /* bounds of all cells, in the source's coordinates */
    mmbvh tree;
} build;

static int64_t chunk_start(const build *b, int chunk)
{
    return b->candidate_count * chunk / FILL_CHUNKS;
}

static bool may_skip_cells(const build *b)
{
    return !b->selected && b->source.g && (grid_has_ghosts(b->source.g) || b->source.g->flat);
}

static bool is_skipped(const build *b, int64_t cell)
{
    return may_skip_cells(b) && !grid_is_drawn(b->source.g, cell);
}

static uint32_t get_candidate_cell(const build *b, int64_t i)
{
    return b->selected ? b->selected[i] : (uint32_t)i;
}

/* Returns whether the tree covers all cells of a lattice except ghost layers, so that mmbvh_bricks.c can build it. */
static bool can_build_bricks(const build *b)
{
    const grid *g = b->source.g;
    return g && g->lattice && !b->selected && !g->ghosts && !g->flat;
}

static void count_cells(build *b)
{
    if (can_build_bricks(b)) {
        b->count = bricks_count(b->source.g->lattice);
        return;
    }
    b->starts[0] = 0;
#pragma omp parallel num_threads(b->threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) {
            const int64_t begin = chunk_start(b, chunk), end = chunk_start(b, chunk + 1);
            int64_t count = end - begin;
            for (int64_t cell = begin; may_skip_cells(b) && cell < end; cell++) count -= is_skipped(b, cell);
            b->starts[chunk + 1] = count;
        }
        region_leave();
    }
    for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) b->starts[chunk + 1] += b->starts[chunk];
    b->count = b->starts[FILL_CHUNKS];
}

/* ---- bounding boxes or Morton keys of cells --------------------------------------------------------------------- */

static void fill_items(const build *b, int chunk, item_set *set, fetch_box *exact)
{
    item *items = b->items + b->starts[chunk];
    const int64_t begin = chunk_start(b, chunk), end = chunk_start(b, chunk + 1);
    int64_t count = 0;
    for (int64_t cell = begin; cell < end; cell++) {
        if (!is_skipped(b, cell)) items[count++] = item_of_index(get_candidate_cell(b, cell));
    }
    bounds_fill_items(&b->source, &b->grid, items, count, set, exact);
}

static void fill_keys(const build *b, int chunk, fetch_box *exact)
{
    uint64_t *keys = b->keys + b->starts[chunk];
    const int64_t begin = chunk_start(b, chunk), end = chunk_start(b, chunk + 1);
    int64_t count = 0;
    for (int64_t cell = begin; cell < end; cell++) {
        if (!is_skipped(b, cell)) keys[count++] = get_candidate_cell(b, cell);
    }
    morton_make_keys(&b->source, b->coder, keys, count, exact);
}

/* Computes the items or Morton keys of all cells. Positions are quantized by a grid over the given box; the box is in
 * the tree's coordinates. */
static void quantize_cells(build *b, const fetch_box *box)
{
    b->grid = item_grid_make(box->lower, box->upper);
    b->set = item_set_empty();
    fetch_box_empty(&b->exact);
    if (b->coder) morton_coder_init(b->coder, box->lower, box->upper, b->source.box_count);
#pragma omp parallel num_threads(b->threads)
    {
        region_enter();
        item_set set = item_set_empty();
        fetch_box exact;
        fetch_box_empty(&exact);
#pragma omp for schedule(dynamic)
        for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) {
            if (b->coder) {
                fill_keys(b, chunk, &exact);
            } else {
                fill_items(b, chunk, &set, &exact);
            }
        }
#pragma omp critical(mmbvh_merge)
        {
            item_set_merge(&b->set, &set);
            unite_boxes(&b->exact, &exact);
        }
        region_leave();
    }
}

/* Returns whether the estimated bounds are more than twice as long as the exact bounds on some axis. This happens if
 * vertices of ghost cells, or vertices that no cell uses, are far away. */
static bool is_estimate_too_large(const fetch_box *guess, const fetch_box *exact)
{
    for (int axis = 0; axis < 3; axis++) {
        const double is = exact->upper[axis] - exact->lower[axis], was = guess->upper[axis] - guess->lower[axis];
        if (is < 0.5 * was) return true;
    }
    return false;
}

static void quantize_in_tight_bounds(build *b)
{
    const fetch_box guess = bounds_estimate(&b->source, b->threads);
    quantize_cells(b, &guess);
    fetch_box exact = b->exact;
    bounds_transform(&b->source, &exact);
    if (is_estimate_too_large(&guess, &exact)) quantize_cells(b, &exact);
}

/* ---- links between nodes ---------------------------------------------------------------------------------------- */

static void free_buffers(build *b)
{
    base_free(b->items);
    base_free(b->keys);
    base_free(b->other_keys);
    base_free(b->coder);
    b->items = NULL;
    b->keys = b->other_keys = NULL;
    b->coder = NULL;
}

static topology *build_sah(build *b, topology_build *t)
{
    b->items = base_alloc((size_t)b->count * sizeof *b->items);
    if (!b->items) return NULL;
    quantize_in_tight_bounds(b);
    const branch_builder builder = {.build = t, .source = &b->source, .items = b->items, .count = b->count};
    return branch_build(&builder, &b->set, &b->grid);
}

static topology *build_morton(build *b, topology_build *t)
{
    b->coder = base_alloc(sizeof *b->coder);
    b->keys = base_alloc((size_t)b->count * sizeof *b->keys);
    b->other_keys = base_alloc((size_t)b->count * sizeof *b->other_keys);
    if (!b->coder || !b->keys || !b->other_keys) return NULL;
    quantize_in_tight_bounds(b);
    if (!morton_sort(b->coder, b->keys, b->other_keys, b->count, t->threads)) return NULL;
    base_free(b->other_keys);
    b->other_keys = NULL;
    return morton_build(t, b->keys, b->count);
}

/* Builds the tree over a lattice, and computes the exact bounds from the vertices of its cells. */
static topology *build_bricks(build *b, topology_build *t)
{
    uint32_t *cells = b->tree.cells = base_alloc((size_t)b->count * sizeof *cells);
    if (!cells) return NULL;
    b->tree.cell_count = b->count;
    topology *root = bricks_build(t, b->source.g, cells);
    fetch_box_empty(&b->exact);
#pragma omp parallel num_threads(t->threads)
    {
        region_enter();
        fetch_box box;
        fetch_box_empty(&box);
#pragma omp for schedule(static) nowait
        for (int64_t first = 0; first < b->count; first += BOUNDS_BLOCK) {
            const int64_t count = b->count - first < BOUNDS_BLOCK ? b->count - first : BOUNDS_BLOCK;
            b->source.extend(&b->source, cells + first, (int)count, NULL, &box);
        }
#pragma omp critical(mmbvh_bricks)
        unite_boxes(&b->exact, &box);
        region_leave();
    }
    return root;
}

static bool list_cells(build *b)
{
    uint32_t *cells = b->tree.cells = base_alloc((size_t)b->count * sizeof *cells);
    if (!cells) return false;
    b->tree.cell_count = b->count;
    const uint64_t mask = b->coder ? (UINT64_C(1) << b->coder->index_bits) - 1 : 0;
#pragma omp parallel num_threads(b->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic, LIST_CELLS) nowait
        for (int64_t i = 0; i < b->count; i++) {
            cells[i] = b->coder ? (uint32_t)(b->keys[i] & mask) : item_index(b->items[i]);
        }
        region_leave();
    }
    return true;
}

/* Builds the links between the nodes (struct topology), and stores the indices of the tree's cells in the order of the
 * leaves. Returns NULL if memory ran out. */
static topology *build_topology(build *b, int threads)
{
    topology_build t;
    topology *root = NULL;
    if (topology_begin(&t, b->count, threads)) {
        root = can_build_bricks(b)                  ? build_bricks(b, &t)
               : b->options.builder == MMBVH_MORTON ? build_morton(b, &t)
                                                    : build_sah(b, &t);
    }
    topology_end(&t);
    if (root && !can_build_bricks(b) && !list_cells(b)) {
        topology_free(root);
        root = NULL;
    }
    free_buffers(b);
    return root;
}

/* ---- nodes ------------------------------------------------------------------------------------------------------ */

static bool allocate_nodes(build *b, int64_t node_count)
{
    mmbvh *tree = &b->tree;
    float lower[3], upper[3];
    round_box_outward(&b->exact, tree->origin, tree->scale, lower, upper);
    bool is_compact =
        b->options.layout == MMBVH_COMPACT && b->count < 1 << COMPACT_REF_BITS && node_count < 1 << COMPACT_REF_BITS;
    for (int axis = 0; axis < 3; axis++) is_compact = is_compact && upper[axis] - lower[axis] < INFINITY;
    if (is_compact) {
        tree->grid = store_make_grid(lower, upper);
        tree->compact = base_alloc((size_t)node_count * sizeof *tree->compact);
    } else {
        tree->nodes = base_alloc((size_t)node_count * sizeof *tree->nodes);
    }
    tree->node_count = node_count;
    return tree->nodes || tree->compact;
}

static bool build_nodes(build *b)
{
    count_cells(b);
    if (!b->count) return true;
    const int threads = b->count < PARALLEL_MIN_CELLS ? 1 : b->threads;
    topology *root = build_topology(b, threads);
    const bool is_built = root && allocate_nodes(b, topology_node_count(root));
    if (is_built) topology_write(root, &b->tree, threads);
    topology_free(root);
    return is_built;
}

/* Builds the tree except for the bounds and ranges of its nodes. */
static insitu_status build_tree(build *b, base_error *error)
{
    const int64_t count = b->source.box_count;
    if (count > UINT32_MAX) {
        return base_fail(error, INSITU_ERROR_MESH, "a mesh of %lld cells on one rank: at most 4294967295 are possible",
                         (long long)count);
    }
    memcpy(b->tree.origin, b->source.origin, sizeof b->tree.origin);
    b->tree.scale = b->source.scale;
    if (build_nodes(b)) return INSITU_OK;
    mmbvh_free(&b->tree);
    return base_fail(error, INSITU_ERROR_MEMORY, "out of memory: a tree over %lld cells", (long long)count);
}

static void finish_tree(build *b, const sweep *ranges, mmbvh *out)
{
    const sweep s = sweep_of_bounds_and_ranges(&b->tree, &b->source, ranges);
    b->tree.unusable_cells = sweep_tree(&s, b->threads).count;
    b->tree.area = b->tree.built_area = compute_area_sum_of_tree(&b->tree, b->threads);
    b->tree.built_cost = compute_cost_from_area_sum(&b->tree, b->tree.area);
    *out = b->tree;
}

static build init_build(const bounds_source *source, const mmbvh_options *options)
{
    build b = {.source = *source, .candidate_count = source->box_count, .threads = sweep_threads(options)};
    if (!options) return b;
    b.options = *options;
    if (source->g && options->selection) {
        b.selected = options->selection->cells;
        b.candidate_count = options->selection->count;
    }
    return b;
}

insitu_status mmbvh_build(const grid *g, const grid_field *field, const double origin[3], double scale,
                          const mmbvh_options *options, mmbvh *out, base_error *error)
{
    if (!out) return base_fail(error, INSITU_ERROR_ARGUMENT, "no place for the tree");
    memset(out, 0, sizeof *out);
    if (!g || !origin) return base_fail(error, INSITU_ERROR_ARGUMENT, "a tree needs a grid and an origin");
    if (!(scale > 0)) return base_fail(error, INSITU_ERROR_ARGUMENT, "a tree's scale must be above 0, not %g", scale);
    const bounds_source source = bounds_source_make(g, NULL, NULL, g->cell_count, origin, scale);
    build b = init_build(&source, options);
    const insitu_status status = build_tree(&b, error);
    if (status) return status;
    const sweep ranges = sweep_of_ranges(&b.tree, g, field, mmbvh_own_ranges(&b.tree));
    finish_tree(&b, &ranges, out);
    return INSITU_OK;
}

insitu_status mmbvh_build_boxes(const float *lower, const float *upper, const float *ranges, int64_t count,
                                const mmbvh_options *options, mmbvh *out, base_error *error)
{
    static const double no_shift[3] = {0, 0, 0};
    if (!out) return base_fail(error, INSITU_ERROR_ARGUMENT, "no place for the tree");
    memset(out, 0, sizeof *out);
    if (count < 0 || (count > 0 && (!lower || !upper || !ranges))) {
        return base_fail(error, INSITU_ERROR_ARGUMENT, "a parent tree needs boxes and ranges");
    }
    const bounds_source source = bounds_source_make(NULL, lower, upper, count, no_shift, 1);
    build b = init_build(&source, options);
    const insitu_status status = build_tree(&b, error);
    if (status) return status;
    const sweep of_ranges = sweep_of_box_ranges(&b.tree, ranges);
    finish_tree(&b, &of_ranges, out);
    return INSITU_OK;
}

int64_t mmbvh_bytes(const mmbvh *tree)
{
    const size_t node = tree->compact ? sizeof *tree->compact : sizeof *tree->nodes;
    return tree->node_count * (int64_t)node + tree->cell_count * (int64_t)sizeof *tree->cells;
}

void mmbvh_free(mmbvh *tree)
{
    if (!tree) return;
    base_free(tree->nodes);
    base_free(tree->compact);
    base_free(tree->cells);
    memset(tree, 0, sizeof *tree);
}
