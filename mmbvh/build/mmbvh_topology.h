/* A tree under construction that has no bounds yet, only the links between nodes and the leaves' cells.
 *
 * Its top consists of nodes with pointers, built by all threads. Each leaf of the top refers to a subtree that one
 * thread built, with 4 bytes per node and the node order of the final tree. At the end all nodes are numbered and
 * written to the final tree. */
#ifndef MMBVH_TOPOLOGY_H
#define MMBVH_TOPOLOGY_H

#include <stdatomic.h>

#include "mmbvh.h"

enum {
    TOPOLOGY_SUBTREE_CELLS = 16384, /* maximum number of cells in a subtree: cells and nodes fit in a core's cache */
    /* nodes at this depth in the tree, or deeper, are split into halves with equal numbers of cells, so that trees of
     * 2^32 cells stay within the maximum depth */
    TOPOLOGY_MEDIAN_DEPTH = MMBVH_MAX_DEPTH - 32
};

/* A node of a subtree. The 3 low bits are the number of cells in a leaf, or 0 for an inner node. The other bits are the
 * leaf's first cell, or the index of the inner node's left child, both relative to the start of the subtree. */
typedef uint32_t topology_link;

static inline topology_link topology_leaf(int64_t first, int64_t count)
{
    return (topology_link)(first << 3 | count);
}

static inline topology_link topology_inner(int64_t left)
{
    return (topology_link)(left << 3);
}

/* The buffer in which a thread builds the links of a subtree. */
typedef struct topology_scratch {
    topology_link *links; /* has room for two nodes per cell of the largest subtree, enough for all nodes below its
                             root */
    int64_t count;
} topology_scratch;

/* Appends two nodes for a pair of siblings; returns the index of the first. */
static inline int64_t topology_new_pair(topology_scratch *s)
{
    s->count += 2;
    return s->count - 2;
}

typedef struct topology {
    int64_t first, count;         /* the node's range in the tree's cell list */
    struct topology *children[2]; /* children of an inner node; NULL if the node is a subtree */
    topology_link root;           /* link of the subtree's root */
    topology_link *links;         /* all nodes of the subtree below its root */
    int64_t link_count;
} topology;

/* The data that the tasks of a build share. */
typedef struct topology_build {
    int threads;
    topology_scratch *scratch; /* one scratch buffer per thread */
    atomic_bool failed;        /* set to true after an allocation failed */
} topology_build;

/* Allocates the threads' buffers. Returns false if memory ran out. The caller must call topology_end() even then. */
bool topology_begin(topology_build *build, int64_t cells, int threads);
void topology_end(topology_build *build);

/* Allocates a node of the top; if memory ran out, returns NULL and marks the build as failed. */
topology *topology_new(topology_build *build, int64_t first, int64_t count);

/* Copies the links in the thread's scratch to t, as the subtree with this root. */
void topology_copy_links(topology_build *build, topology *t, const topology_scratch *scratch, topology_link root);

int64_t topology_node_count(const topology *t);

/* Writes all nodes to the tree: the root first, then all pairs of siblings depth first. Each subtree's links are freed
 * as soon as they are written. */
void topology_write(topology *t, const mmbvh *tree, int threads);

/* Frees the tree under construction. t may be NULL. */
void topology_free(topology *t);

#endif
