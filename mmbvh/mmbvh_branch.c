/* Each node is a task. A large one runs over its cells in chunks, themselves tasks: first the bins, which merge to the
 * same bits in any order, with each chunk's counts a bin beside them; then, the plane chosen, every chunk knows from
 * the chunks before it where its left and right cells go, and moves them.
 *
 *     from  | chunk 0 | chunk 1 | chunk 2 |        l and r: cells of the left and right side
 *     to    | l0 l1 l2       | r0 r1   r2 |        the order within a side is kept
 *
 * A stable partition has one result, so neither the chunks nor who runs them shows in the tree. */
#include "mmbvh_branch.h"

#include <omp.h>
#include <string.h>

#include "memory.h"

enum {
    CHUNK_MIN = 16384,
    CHUNKS_MAX = 64,
    PARALLEL_MIN = 8 * CHUNK_MIN, /* fewer cells: a task of their own keeps a thread busy long enough */
    PREFETCH_AHEAD = 16
};

typedef struct chunking {
    int64_t size;
    int count;
} chunking;

static chunking chunking_make(int64_t count)
{
    const int64_t even = (count + CHUNKS_MAX - 1) / CHUNKS_MAX;
    const int64_t size = even > CHUNK_MIN ? even : CHUNK_MIN;
    return (chunking){size, (int)((count + size - 1) / size)};
}

/* The run of a branch's cells that a chunk is. */
static const uint32_t *chunk_begin(const branch *b, chunking c, int chunk, int64_t *count)
{
    const int64_t begin = chunk * c.size;
    *count = b->count - begin < c.size ? b->count - begin : c.size;
    return b->from + b->first + begin;
}

static inline const branch_box *box_of(const branch_builder *builder, const uint32_t *cells, int64_t i, int64_t count)
{
    const int64_t ahead = i + PREFETCH_AHEAD;
    __builtin_prefetch(&builder->boxes[cells[ahead < count ? ahead : i]]);
    return &builder->boxes[cells[i]];
}

/* A branch being split. */
typedef struct splitting {
    bin_mapping mapping;
    chunking chunks;
    bins total;
    uint32_t counts[CHUNKS_MAX][BINS_MAX][4];
    bin_split split;
    bin_set sides[2];
    int64_t left_count;
} splitting;

static void bin_chunk(const branch_builder *builder, const branch *b, splitting *s, int chunk)
{
    int64_t count;
    const uint32_t *cells = chunk_begin(b, s->chunks, chunk, &count);
    bins own;
    bins_clear(&own, s->mapping.count);
    for (int64_t i = 0; i < count; i++) {
        const branch_box *box = box_of(builder, cells, i, count);
        bins_add(&own, &s->mapping, branch_box_lower(box), branch_box_upper(box));
    }
    for (int bin = 0; bin < s->mapping.count; bin++) {
        for (int axis = 0; axis < 3; axis++) s->counts[chunk][bin][axis] = own.counts[bin][axis];
    }
#pragma omp critical(mmbvh_merge)
    bins_merge(&s->total, &own, s->mapping.count);
}

static void move_chunk(const branch_builder *builder, const branch *b, splitting *s, int chunk, int64_t left,
                       int64_t right)
{
    int64_t count;
    const uint32_t *cells = chunk_begin(b, s->chunks, chunk, &count);
    uint32_t *to = b->to + b->first;
    int64_t ends[2] = {left, right};
    bin_box centroids[2] = {bin_box_empty(), bin_box_empty()};
    const int axis = s->split.axis, border = s->split.border;
    for (int64_t i = 0; i < count; i++) {
        const branch_box *box = box_of(builder, cells, i, count);
        const vec4 centroid = bin_centroid(branch_box_lower(box), branch_box_upper(box));
        const int side = bin_of(&s->mapping, centroid)[axis] >= border;
        bin_box_add(&centroids[side], centroid, centroid);
        to[ends[side]++] = cells[i];
    }
#pragma omp critical(mmbvh_merge)
    for (int side = 0; side < 2; side++) {
        bin_box_add(&s->sides[side].centroids, centroids[side].lower, centroids[side].upper);
    }
}

/* Where each chunk's left cells begin; the total comes last. */
static void left_starts(const splitting *s, int64_t starts[CHUNKS_MAX + 1])
{
    starts[0] = 0;
    for (int chunk = 0; chunk < s->chunks.count; chunk++) {
        starts[chunk + 1] = starts[chunk];
        for (int bin = 0; bin < s->split.border; bin++) starts[chunk + 1] += s->counts[chunk][bin][s->split.axis];
    }
}

static void halve(const branch_builder *builder, branch *b, splitting *s)
{
    s->left_count = b->count / 2;
    const uint32_t *cells = b->from + b->first;
    for (int64_t i = 0; i < b->count; i++) {
        const branch_box *box = box_of(builder, cells, i, b->count);
        bin_set_add(&s->sides[i >= s->left_count], branch_box_lower(box), branch_box_upper(box));
    }
    b->to = b->from;
}

static void part(const branch_builder *builder, const branch *b, splitting *s)
{
    int64_t starts[CHUNKS_MAX + 1];
    left_starts(s, starts);
    s->left_count = starts[s->chunks.count];
    bin_box bounds[2];
    bins_split_bounds(&s->total, &s->mapping, s->split, bounds);
    for (int side = 0; side < 2; side++) s->sides[side].bounds = bounds[side];
#pragma omp taskgroup
    for (int chunk = 0; chunk < s->chunks.count; chunk++) {
        const int64_t left = starts[chunk], right = s->left_count + chunk * s->chunks.size - left;
#pragma omp task if (b->count > PARALLEL_MIN) default(none) firstprivate(builder, b, s, chunk, left, right)
        move_chunk(builder, b, s, chunk, left, right);
    }
}

/* On return the cells of the two sides stand in b->to. */
static void split_branch(const branch_builder *builder, branch *b, splitting *s)
{
    s->mapping = bin_mapping_make(&b->set.centroids, b->count);
    s->chunks = chunking_make(b->count);
    s->split = (bin_split){.axis = -1};
    s->sides[0] = s->sides[1] = bin_set_empty();
    if (b->depth < SUBTREE_MEDIAN_DEPTH) {
        bins_clear(&s->total, s->mapping.count);
#pragma omp taskgroup
        for (int chunk = 0; chunk < s->chunks.count; chunk++) {
#pragma omp task if (b->count > PARALLEL_MIN) default(none) firstprivate(builder, b, s, chunk)
            bin_chunk(builder, b, s, chunk);
        }
        s->split = bins_choose(&s->total, &s->mapping, &b->set.bounds);
    }
    if (s->split.axis < 0) {
        halve(builder, b, s);
    } else {
        part(builder, b, s);
    }
}

static branch *new_branch(branch_builder *builder)
{
    branch *b = base_calloc(1, sizeof *b);
    if (!b) atomic_store(&builder->failed, true);
    return b;
}

static bool make_children(branch_builder *builder, branch *b)
{
    splitting s;
    split_branch(builder, b, &s);
    const int64_t counts[2] = {s.left_count, b->count - s.left_count};
    for (int side = 0; side < 2; side++) {
        branch *child = b->children[side] = new_branch(builder);
        if (!child) return false;
        child->first = b->first + (side ? counts[0] : 0);
        child->count = counts[side];
        child->from = b->to;
        child->to = b->to == builder->cells ? builder->other : builder->cells;
        child->set = s.sides[side];
        child->depth = b->depth + 1;
        bin_set_store(&child->set, &child->node);
    }
    return true;
}

/* The cells are gathered before their places in the result are written: from may be the result. */
static void build_subtree(branch_builder *builder, branch *b)
{
    subtree *s = &builder->scratch[omp_get_thread_num()];
    const uint32_t *cells = b->from + b->first;
    for (int64_t i = 0; i < b->count; i++) {
        const branch_box *box = box_of(builder, cells, i, b->count);
        ivec4 upper = (ivec4)branch_box_upper(box);
        upper[3] = (int32_t)cells[i];
        s->items[i] = (bin_item){vec4_xyz(branch_box_lower(box)), (vec4)upper};
    }
    s->first_entry = (uint64_t)b->first;
    b->node = subtree_build(s, b->count, &b->set, b->depth);
    for (int64_t i = 0; i < b->count; i++) {
        builder->cells[b->first + i] = (uint32_t)((ivec4)s->items[i].upper)[3];
    }
    b->block_count = s->node_count;
    if (!s->node_count) return;
    b->block = base_alloc((size_t)s->node_count * sizeof *b->block);
    if (b->block) {
        memcpy(b->block, s->nodes, (size_t)s->node_count * sizeof *b->block);
    } else {
        atomic_store(&builder->failed, true);
    }
}

static void grow(branch_builder *builder, branch *b)
{
    if (atomic_load(&builder->failed)) return;
    if (b->count <= SUBTREE_MAX_ITEMS) {
        build_subtree(builder, b);
        return;
    }
    if (!make_children(builder, b)) return;
    for (int side = 0; side < 2; side++) {
        branch *child = b->children[side];
#pragma omp task default(none) firstprivate(builder, child)
        grow(builder, child);
    }
}

branch *branch_build(branch_builder *builder, const bin_set *set)
{
    branch *root = new_branch(builder);
    if (!root) return NULL;
    root->count = builder->count;
    root->from = builder->cells;
    root->to = builder->other;
    root->set = *set;
    root->depth = 1;
    bin_set_store(set, &root->node);
#pragma omp parallel num_threads(builder->threads)
#pragma omp single
    grow(builder, root);
    if (!atomic_load(&builder->failed)) return root;
    branch_free(root);
    return NULL;
}

static int64_t nodes_below(const branch *b)
{
    if (!b->children[0]) return b->block_count;
    return 2 + nodes_below(b->children[0]) + nodes_below(b->children[1]);
}

int64_t branch_node_count(const branch *b)
{
    return 1 + nodes_below(b);
}

static void copy_block(branch *b, mmbvh_node *nodes, int64_t first)
{
    for (int64_t i = 0; i < b->block_count; i++) {
        mmbvh_node node = b->block[i];
        if (!node.count) node.ref = (node.ref + (uint64_t)first) & (UINT64_MAX >> 3);
        nodes[first + i] = node;
    }
    base_free(b->block);
    b->block = NULL;
}

/* The branch's root to its slot, all below it to first and on; returns where they end. */
static int64_t gather(branch *b, mmbvh_node *nodes, int64_t slot, int64_t first)
{
    nodes[slot] = b->node;
    if (!b->children[0]) {
        if (!b->node.count) nodes[slot].ref = (uint64_t)first & (UINT64_MAX >> 3);
#pragma omp task default(none) firstprivate(b, nodes, first)
        copy_block(b, nodes, first);
        return first + b->block_count;
    }
    nodes[slot].count = 0;
    nodes[slot].ref = (uint64_t)first & (UINT64_MAX >> 3);
    const int64_t below = gather(b->children[0], nodes, first, first + 2);
    return gather(b->children[1], nodes, first + 1, below);
}

void branch_gather(branch *root, mmbvh_node *nodes, int threads)
{
#pragma omp parallel num_threads(threads)
#pragma omp single
    gather(root, nodes, 0, 1);
}

void branch_free(branch *b)
{
    if (!b) return;
    branch_free(b->children[0]);
    branch_free(b->children[1]);
    base_free(b->block);
    base_free(b);
}
