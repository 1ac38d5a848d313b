/* A tree under construction, before it has bounds: only the nodes' children and the leaves' cells.
 *
 * Its top has nodes with pointers, made by all threads. Below each of its leaves hangs a subtree that one thread made
 * alone, of 4 bytes a node, numbered as the tree will be. In the end all nodes are numbered and written out. */
#ifndef MMBVH_TOPOLOGY_H
#define MMBVH_TOPOLOGY_H

#include <stdatomic.h>

#include "mmbvh.h"

enum {
    TOPOLOGY_SUBTREE_CELLS = 16384,              /* most cells of a subtree: with their nodes they fit a core's cache */
    TOPOLOGY_MEDIAN_DEPTH = MMBVH_MAX_DEPTH - 32 /* from here on nodes are halved, so that 2^32 cells end within the
                                                    depth allowed */
};

/* A subtree's node. The 3 low bits are a leaf's count, 0 for an inner node; the others are the leaf's first cell, or
 * the inner node's left child, counted from the subtree's begin. */
typedef uint32_t topology_link;

static inline topology_link topology_leaf(int64_t first, int64_t count)
{
    return (topology_link)(first << 3 | count);
}

static inline topology_link topology_inner(int64_t left)
{
    return (topology_link)(left << 3);
}

/* The memory in which a thread makes the links of a subtree. */
typedef struct topology_scratch {
    topology_link *links; /* room for 2 TOPOLOGY_SUBTREE_CELLS: all below the root */
    int64_t count;
} topology_scratch;

/* Takes a place for a pair of siblings. */
static inline int64_t topology_new_pair(topology_scratch *s)
{
    s->count += 2;
    return s->count - 2;
}

typedef struct topology {
    int64_t first, count;         /* range of the node's cells */
    struct topology *children[2]; /* NULL: a subtree */
    topology_link root;
    topology_link *links; /* all below the root */
    int64_t link_count;
} topology;

/* The data that the tasks of a build share. */
typedef struct topology_build {
    int threads;
    topology_scratch *scratch; /* by thread */
    atomic_bool failed;        /* an allocation */
} topology_build;

/* False: out of memory. topology_end() must be called all the same. */
bool topology_begin(topology_build *build, int64_t cells, int threads);
void topology_end(topology_build *build);

/* NULL: out of memory; the build has then failed. */
topology *topology_new(topology_build *build, int64_t first, int64_t count);

/* Makes the contents of the thread's scratch the subtree under t. */
void topology_keep(topology_build *build, topology *t, const topology_scratch *scratch, topology_link root);

int64_t topology_node_count(const topology *t);

/* Writes the nodes of tree, numbered depth first by pairs, the root first, and gives the links' memory back on the way.
 */
void topology_write(topology *t, const mmbvh *tree, int threads);

/* t may be NULL. */
void topology_free(topology *t);

#endif
