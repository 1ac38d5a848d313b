/* A tree under construction, before it has bounds: only who is whose child, and which cells are in which leaf.
 *
 * The top is nodes of pointers, made by all threads; below each of its leaves hangs a subtree that one thread made
 * alone: 4 bytes a node, numbered as the tree will be. When all are there, they are numbered through and written out.
 */
#ifndef MMBVH_TOPOLOGY_H
#define MMBVH_TOPOLOGY_H

#include <stdatomic.h>

#include "mmbvh.h"

enum {
    TOPOLOGY_SUBTREE_CELLS = 16384,              /* at most: they and their nodes fit a core's cache */
    TOPOLOGY_MEDIAN_DEPTH = MMBVH_MAX_DEPTH - 32 /* from here on halves: 2^32 cells end within the depth allowed */
};

/* A subtree's node. The 3 low bits are a leaf's count; the others are its first cell, or an inner node's left child,
 * counted from where the subtree begins. */
typedef uint32_t topology_link;

static inline topology_link topology_leaf(int64_t first, int64_t count)
{
    return (topology_link)(first << 3 | count);
}

static inline topology_link topology_inner(int64_t left)
{
    return (topology_link)(left << 3);
}

/* The links of one subtree, as a thread makes them. */
typedef struct topology_scratch {
    topology_link *links; /* room for 2 TOPOLOGY_SUBTREE_CELLS: all below the root */
    int64_t count;
} topology_scratch;

/* A place for a pair of siblings. */
static inline int64_t topology_new_pair(topology_scratch *s)
{
    s->count += 2;
    return s->count - 2;
}

typedef struct topology {
    int64_t first, count;         /* of the cells */
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

/* False: out of memory; topology_end() all the same. */
bool topology_begin(topology_build *build, int64_t cells, int threads);
void topology_end(topology_build *build);

/* NULL: out of memory, and the build has failed. */
topology *topology_new(topology_build *build, int64_t first, int64_t count);

/* Makes the contents of the thread's scratch the subtree under t. */
void topology_keep(topology_build *build, topology *t, const topology_scratch *scratch, topology_link root);

int64_t topology_node_count(const topology *t);

/* Writes the nodes of tree, numbered depth first by pairs, the root first, and gives the links' memory back on the way.
 */
void topology_write(topology *t, const mmbvh *tree, int threads);

/* NULL is fine. */
void topology_free(topology *t);

#endif
