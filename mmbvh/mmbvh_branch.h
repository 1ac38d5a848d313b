/* The top of a tree under construction: nodes of many cells, split by all threads together, down to subtrees that
 * one thread builds alone. */
#ifndef MMBVH_BRANCH_H
#define MMBVH_BRANCH_H

#include <stdatomic.h>

#include "mmbvh_subtree.h"

/* A cell's box as the nodes will hold it. 24 bytes: at the top of the tree memory bandwidth is what counts. */
typedef struct branch_box {
    float lower[3];
    float upper[3];
} branch_box;

typedef float vec4_unaligned __attribute__((vector_size(16), may_alias, aligned(4)));

static inline vec4 branch_box_lower(const branch_box *box)
{
    return *(const vec4_unaligned *)(const void *)box->lower;
}

static inline vec4 branch_box_upper(const branch_box *box)
{
    const vec4 last = *(const vec4_unaligned *)(const void *)(box->lower + 2);
    return __builtin_shufflevector(last, last, 1, 2, 3, 3);
}

typedef struct branch {
    mmbvh_node node;            /* in a subtree the references count from the start of block, or of the cells */
    struct branch *children[2]; /* NULL: a subtree */
    mmbvh_node *block;          /* all below a subtree's root */
    int64_t block_count;
    int64_t first, count; /* of the cells in from */
    uint32_t *from, *to;  /* where its cells stand, and where its children's will */
    bin_set set;
    int depth;
} branch;

typedef struct branch_builder {
    const branch_box *boxes; /* by cell */
    uint32_t *cells;         /* in: the cells to build over; out: leaf by leaf */
    uint32_t *other;         /* as many */
    int64_t count;
    subtree *scratch; /* by thread */
    int threads;
    atomic_bool failed; /* an allocation */
} branch_builder;

/* The tree's top with its subtrees, or NULL where an allocation failed. set is that of all the cells. */
branch *branch_build(branch_builder *builder, const bin_set *set);

/* Nodes of the whole tree: all below the branch, and itself. */
int64_t branch_node_count(const branch *b);

/* Into one array, numbered depth first by pairs, root first; gives back the blocks' memory as it goes. */
void branch_gather(branch *root, mmbvh_node *nodes, int threads);

/* NULL is fine. */
void branch_free(branch *b);

#endif
