/* Splits the top nodes of a SAH tree in parallel. Each node is an OpenMP task. If a node has many items (cells,
 * mmbvh_item.h), they are processed in chunks, which are tasks too. First each chunk is sorted into bins, which are
 * then merged; the result does not depend on the order of merging. After the plane has been chosen, each chunk is
 * partitioned in place. Items of the left child are called left items. Their total number is the index of the border
 * between both sides. The number of right items in front of the border equals the number of left items behind it. These
 * items are swapped, in order.
 *
 *      chunk 0        chunk 1        chunk 2
 *     | l l l r r r | l l r r r r | l l l l r r |
 *                         border ^      swap r r r of chunk 0 and one r of chunk 1 with l l l l of chunk 2
 *
 * The chunks depend only on the number of items, so the tree does not depend on the number of threads. */
#include "mmbvh_branch.h"

#include "region.h"

#include <omp.h>

enum {
    CHUNK_MIN = 16384,
    CHUNKS_MAX = 64,
    PARALLEL_MIN = 8 * CHUNK_MIN /* minimum number of items of a node that is split by several tasks */
};

/* A node that has not been split yet. */
typedef struct branch_node {
    item_set set;
    item_grid grid; /* the grid in whose steps the items' boxes are given */
    int depth;
} branch_node;

/* The state of splitting one node. */
typedef struct node_split {
    item *items;
    int64_t count;
    int64_t chunk_size;
    int chunk_count;
    int64_t left_counts[CHUNKS_MAX]; /* number of left items in each chunk */
    int64_t left_count;              /* number of items that go to the left child */
    branch_node node;
    bin_mapping mapping;
    int64_t stride; /* sampling stride (bins_sampling_stride()) */
    bin_split split;
    bins all_bins;     /* bins of all chunks, merged */
    item_set sides[2]; /* bounds of the items of the left and of the right child */
} node_split;

static void choose_chunks(node_split *s)
{
    s->chunk_size = s->count;
    if (s->count > PARALLEL_MIN) {
        const int64_t even = (s->count + CHUNKS_MAX - 1) / CHUNKS_MAX;
        s->chunk_size = even > CHUNK_MIN ? even : CHUNK_MIN;
    }
    s->chunk_count = (int)((s->count + s->chunk_size - 1) / s->chunk_size);
}

static int64_t find_end_of_chunk(const node_split *s, int chunk)
{
    const int64_t end = (chunk + 1) * s->chunk_size;
    return end < s->count ? end : s->count;
}

/* Calls act() for every chunk, in parallel tasks. */
static void run_chunks_in_tasks(node_split *s, const branch_builder *builder,
                                void (*act)(node_split *, const branch_builder *, int chunk, int64_t begin,
                                            int64_t end))
{
#pragma omp taskgroup
    for (int chunk = 0; chunk < s->chunk_count; chunk++) {
#pragma omp task if (s->chunk_count > 1) default(none) firstprivate(s, builder, act, chunk)
        act(s, builder, chunk, chunk * s->chunk_size, find_end_of_chunk(s, chunk));
    }
}

static void quantize_chunk_to_node_grid(node_split *s, const branch_builder *builder, int chunk, int64_t begin,
                                        int64_t end)
{
    (void)chunk;
    item_set own = item_set_empty();
    bounds_fill_items(builder->source, &s->node.grid, s->items + begin, end - begin, &own, NULL);
#pragma omp critical(mmbvh_merge)
    item_set_merge(&s->node.set, &own);
}

static void bin_chunk(node_split *s, const branch_builder *builder, int chunk, int64_t begin, int64_t end)
{
    (void)builder;
    (void)chunk;
    bins own;
    bins_clear(&own, s->mapping.count);
    bins_fill(&own, &s->mapping, s->items + begin, end - begin, s->stride);
#pragma omp critical(mmbvh_merge)
    bins_merge(&s->all_bins, &own, s->mapping.count);
}

static void partition_chunk(node_split *s, const branch_builder *builder, int chunk, int64_t begin, int64_t end)
{
    (void)builder;
    item *items = s->items + begin;
    const int64_t count = end - begin, left = bins_partition(&s->mapping, s->split, items, count);
    const item_set sides[2] = {item_set_of(items, left), item_set_of(items + left, count - left)};
    s->left_counts[chunk] = left;
#pragma omp critical(mmbvh_merge)
    for (int side = 0; side < 2; side++) item_set_merge(&s->sides[side], &sides[side]);
}

/* Iterator over the ranges of items that are on the wrong side of the border, chunk by chunk in their order. */
typedef struct misplaced_items {
    const node_split *s;
    bool is_left; /* true: iterates over items of the left child behind the border; false: over items of the right child
                     in front of the border */
    int chunk;
    int64_t next, end;
} misplaced_items;

static bool misplaced_advance(misplaced_items *w)
{
    while (w->next >= w->end) {
        if (++w->chunk >= w->s->chunk_count) return false;
        const int64_t begin = w->chunk * w->s->chunk_size, border = w->s->left_count;
        const int64_t middle = begin + w->s->left_counts[w->chunk], end = find_end_of_chunk(w->s, w->chunk);
        w->next = w->is_left ? (begin > border ? begin : border) : middle;
        w->end = w->is_left ? middle : (end < border ? end : border);
    }
    return true;
}

static void exchange_items(item *a, item *b, int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        const item kept = a[i];
        a[i] = b[i];
        b[i] = kept;
    }
}

static void exchange_misplaced(node_split *s)
{
    misplaced_items right = {.s = s, .chunk = -1}, left = {.s = s, .is_left = true, .chunk = -1};
#pragma omp taskgroup
    while (misplaced_advance(&right) && misplaced_advance(&left)) {
        const int64_t rights = right.end - right.next, lefts = left.end - left.next;
        const int64_t count = rights < lefts ? rights : lefts;
        item *a = s->items + right.next, *b = s->items + left.next;
#pragma omp task if (s->chunk_count > 1) default(none) firstprivate(a, b, count)
        exchange_items(a, b, count);
        right.next += count;
        left.next += count;
    }
}

static void partition_items(node_split *s, const branch_builder *builder)
{
    run_chunks_in_tasks(s, builder, partition_chunk);
    s->left_count = 0;
    for (int chunk = 0; chunk < s->chunk_count; chunk++) s->left_count += s->left_counts[chunk];
    exchange_misplaced(s);
}

static void split_items_at_median_index(node_split *s)
{
    s->left_count = s->count / 2;
    for (int64_t i = 0; i < s->count; i++) item_set_add(&s->sides[i >= s->left_count], s->items[i]);
}

/* Chooses the split plane from a sample of the items. If the sample allows no split, all items are used. */
static void choose_node_split(node_split *s, const branch_builder *builder)
{
    s->mapping = bin_mapping_make(s->node.set.centroids, s->count);
    for (s->stride = bins_sampling_stride(s->count);; s->stride = 1) {
        bins_clear(&s->all_bins, s->mapping.count);
        run_chunks_in_tasks(s, builder, bin_chunk);
        s->split = bins_choose(&s->all_bins, &s->mapping);
        if (s->split.axis >= 0 || s->stride == 1) return;
    }
}

static void split_branch(node_split *s, const branch_builder *builder)
{
    choose_chunks(s);
    if (subtree_needs_finer_grid(s->node.set.bounds, &s->node.grid)) {
        s->node.grid = subtree_finer_grid(s->node.set.bounds, &s->node.grid);
        s->node.set = item_set_empty();
        run_chunks_in_tasks(s, builder, quantize_chunk_to_node_grid);
    }
    s->split = (bin_split){.axis = -1};
    s->sides[0] = s->sides[1] = item_set_empty();
    if (s->node.depth < TOPOLOGY_MEDIAN_DEPTH) choose_node_split(s, builder);
    if (s->split.axis < 0) {
        split_items_at_median_index(s);
    } else {
        partition_items(s, builder);
    }
}

static void build_top(const branch_builder *builder, topology *t, branch_node node)
{
    topology_build *build = builder->build;
    if (atomic_load(&build->failed)) return;
    item *items = builder->items + t->first;
    if (t->count <= TOPOLOGY_SUBTREE_CELLS) {
        topology_scratch *scratch = &build->scratch[omp_get_thread_num()];
        const topology_link root = subtree_build(scratch, builder->source, items, t->count, &node.grid, node.depth);
        topology_copy_links(build, t, scratch, root);
        return;
    }
    node_split s = {.items = items, .count = t->count, .node = node};
    split_branch(&s, builder);
    for (int side = 0; side < 2; side++) {
        const int64_t begin = side ? s.left_count : 0, end = side ? t->count : s.left_count;
        topology *child = t->children[side] = topology_new(build, t->first + begin, end - begin);
        if (!child) return;
        const branch_node below = {s.sides[side], s.node.grid, node.depth + 1};
#pragma omp task default(none) firstprivate(builder, child, below)
        build_top(builder, child, below);
    }
}

topology *branch_build(const branch_builder *builder, const item_set *set, const item_grid *grid)
{
    topology *root = topology_new(builder->build, 0, builder->count);
    if (!root) return NULL;
    const branch_node node = {*set, *grid, 1};
#pragma omp parallel num_threads(builder->build->threads)
    {
        region_enter();
#pragma omp single
        build_top(builder, root, node);
        region_leave();
    }
    if (!atomic_load(&builder->build->failed)) return root;
    topology_free(root);
    return NULL;
}
