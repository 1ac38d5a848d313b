/* How a tree comes to be: boxes of all cells, the top of the tree by all threads, subtrees by one thread each, all
 * gathered into one array, ranges by the same sweep that refits them.
 *
 * Memory beside the result while it lasts, bytes a cell: 24 for the box, 4 for the second array of cell indices that
 * a parallel partition needs, and about 20 for the subtrees before they are gathered. */
#include "mmbvh.h"

#include <string.h>

#include "memory.h"
#include "mmbvh_bounds.h"
#include "mmbvh_cost.h"

enum { FILL_CHUNKS = 256, PARALLEL_MIN_CELLS = 4096 };

/* What a build holds until it ends. */
typedef struct build {
    bounds_source source;
    int64_t box_count; /* with ghosts */
    int threads;
    branch_box *boxes;
    branch_builder builder;
    bin_set set;
    mmbvh tree;
} build;

static int64_t chunk_start(const build *b, int chunk)
{
    return b->box_count * chunk / FILL_CHUNKS;
}

/* The cells that are not ghosts, in order. */
static int64_t list_chunk(const build *b, int chunk, uint32_t *cells)
{
    int64_t count = 0;
    for (int64_t cell = chunk_start(b, chunk); cell < chunk_start(b, chunk + 1); cell++) {
        if (b->source.g && !b->source.cells && grid_is_ghost(b->source.g, cell)) continue;
        if (cells) cells[count] = (uint32_t)cell;
        count++;
    }
    return count;
}

static void count_cells(const build *b, int64_t starts[FILL_CHUNKS + 1])
{
    starts[0] = 0;
#pragma omp parallel for num_threads(b->threads)
    for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) starts[chunk + 1] = list_chunk(b, chunk, NULL);
    for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) starts[chunk + 1] += starts[chunk];
}

static void fill(build *b, const int64_t starts[FILL_CHUNKS + 1])
{
    const bounds_fill fill_boxes = bounds_choose_fill(b->source.g);
    b->set = bin_set_empty();
#pragma omp parallel num_threads(b->threads)
    {
        bin_set own = bin_set_empty();
#pragma omp for schedule(dynamic)
        for (int chunk = 0; chunk < FILL_CHUNKS; chunk++) {
            list_chunk(b, chunk, b->builder.cells + starts[chunk]);
            fill_boxes(&b->source, chunk_start(b, chunk), chunk_start(b, chunk + 1), b->boxes, &own);
        }
#pragma omp critical(mmbvh_merge)
        bin_set_merge(&b->set, &own);
    }
}

static void free_scratch(branch_builder *builder)
{
    for (int i = 0; builder->scratch && i < builder->threads; i++) {
        base_free(builder->scratch[i].items);
        base_free(builder->scratch[i].nodes);
    }
    base_free(builder->scratch);
    builder->scratch = NULL;
}

static bool allocate_scratch(branch_builder *builder)
{
    builder->scratch = base_calloc((size_t)builder->threads, sizeof *builder->scratch);
    if (!builder->scratch) return false;
    const int64_t items = builder->count < SUBTREE_MAX_ITEMS ? builder->count : SUBTREE_MAX_ITEMS;
    for (int i = 0; i < builder->threads; i++) {
        subtree *s = &builder->scratch[i];
        s->items = base_alloc((size_t)items * sizeof *s->items);
        s->nodes = base_alloc((size_t)(2 * items) * sizeof *s->nodes);
        if (!s->items || !s->nodes) return false;
    }
    return true;
}

static bool allocate(build *b)
{
    branch_builder *builder = &b->builder;
    b->boxes = base_alloc((size_t)b->box_count * sizeof *b->boxes);
    builder->boxes = b->boxes;
    builder->threads = builder->count < PARALLEL_MIN_CELLS ? 1 : b->threads;
    builder->cells = b->tree.cells = base_alloc((size_t)builder->count * sizeof *builder->cells);
    builder->other = base_alloc((size_t)builder->count * sizeof *builder->other);
    return b->boxes && builder->cells && builder->other && allocate_scratch(builder);
}

/* Gives back all but the result's cells. */
static void release(build *b)
{
    free_scratch(&b->builder);
    base_free(b->builder.other);
    base_free(b->boxes);
    b->builder.other = NULL;
    b->boxes = NULL;
}

/* The tree's cells were places in the selection. */
static void name_cells(const build *b)
{
#pragma omp parallel for num_threads(b->threads) schedule(static)
    for (int64_t i = 0; i < b->tree.cell_count; i++) b->tree.cells[i] = b->source.cells[b->tree.cells[i]];
}

/* Cells and nodes without ranges. */
static bool build_topology(build *b)
{
    int64_t starts[FILL_CHUNKS + 1];
    count_cells(b, starts);
    b->builder.count = starts[FILL_CHUNKS];
    if (!b->builder.count) return true;
    branch *root = NULL;
    if (allocate(b)) {
        fill(b, starts);
        root = branch_build(&b->builder, &b->set);
    }
    release(b);
    if (!root) return false;
    const int64_t node_count = branch_node_count(root);
    b->tree.nodes = base_alloc((size_t)node_count * sizeof *b->tree.nodes);
    if (b->tree.nodes) {
        branch_gather(root, b->tree.nodes, b->builder.threads);
        b->tree.node_count = node_count;
        b->tree.cell_count = b->builder.count;
    }
    branch_free(root);
    if (b->source.cells) name_cells(b);
    return b->tree.nodes != NULL;
}

static insitu_status run(build *b, mmbvh *out, base_error *error)
{
    memset(out, 0, sizeof *out);
    if (b->box_count > UINT32_MAX) {
        return base_fail(error, INSITU_ERROR_MESH, "a mesh of %lld cells on one rank: at most 4294967295 are possible",
                         (long long)b->box_count);
    }
    memcpy(b->tree.origin, b->source.origin, sizeof b->tree.origin);
    b->tree.scale = b->source.scale;
    if (!build_topology(b)) {
        mmbvh_free(&b->tree);
        return base_fail(error, INSITU_ERROR_MEMORY, "out of memory: a tree over %lld cells", (long long)b->box_count);
    }
    b->tree.built_cost = cost_of_tree(&b->tree, b->threads);
    *out = b->tree;
    return INSITU_OK;
}

insitu_status mmbvh_build(const grid *g, const grid_field *field, const double origin[3], double scale,
                          const mmbvh_options *options, mmbvh *out, base_error *error)
{
    if (!out) return base_fail(error, INSITU_ERROR_ARGUMENT, "no place for the tree");
    memset(out, 0, sizeof *out);
    if (!g || !origin) return base_fail(error, INSITU_ERROR_ARGUMENT, "a tree needs a grid and an origin");
    if (!(scale > 0)) return base_fail(error, INSITU_ERROR_ARGUMENT, "a tree's scale must be above 0, not %g", scale);
    build b = {.source = {.g = g, .scale = scale}, .box_count = g->cell_count, .threads = sweep_threads(options)};
    if (options && options->selection) {
        b.source.cells = options->selection->cells;
        b.box_count = options->selection->count;
    }
    memcpy(b.source.origin, origin, sizeof b.source.origin);
    const insitu_status status = run(&b, out, error);
    return status ? status : mmbvh_refit_ranges(out, g, field, options);
}

insitu_status mmbvh_build_boxes(const float *lower, const float *upper, const float *ranges, int64_t count,
                                const mmbvh_options *options, mmbvh *out, base_error *error)
{
    if (!out) return base_fail(error, INSITU_ERROR_ARGUMENT, "no place for the tree");
    memset(out, 0, sizeof *out);
    if (count < 0 || (count > 0 && (!lower || !upper || !ranges))) {
        return base_fail(error, INSITU_ERROR_ARGUMENT, "a parent tree needs boxes and ranges");
    }
    build b = {.source = {.scale = 1, .lower = lower, .upper = upper}, .box_count = count};
    b.threads = sweep_threads(options);
    const insitu_status status = run(&b, out, error);
    if (status || !count) return status;
    const sweep s = sweep_of_box_ranges(out, ranges);
    sweep_tree(&s, b.threads);
    return INSITU_OK;
}

int64_t mmbvh_bytes(const mmbvh *tree)
{
    return tree->node_count * (int64_t)sizeof *tree->nodes + tree->cell_count * (int64_t)sizeof *tree->cells;
}

void mmbvh_free(mmbvh *tree)
{
    if (!tree) return;
    base_free(tree->nodes);
    base_free(tree->cells);
    memset(tree, 0, sizeof *tree);
}
