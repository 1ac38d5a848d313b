/* The min-max bounding volume hierarchy: a binary tree over a grid's cells. Each node holds the bounds of its cells and
 * the range of a scalar on them (thesis, section 4.2). The tree has no access to MPI or pixels.
 *
 * The nodes are stored in one array, root first. Siblings are adjacent, so that one reference is enough for both. A
 * leaf holds at most 7 cells. Bounds are float32, of (position - origin) * scale, rounded outward; ranges are float32,
 * rounded outward from the double values; in the compact layout, bounds are rounded further outward to a grid. Ghost
 * cells and flat cells (without volume, grid_is_flat()) are not in the tree. A cell with a non-finite value has the
 * empty range (+inf, -inf), so that no traversal visits it.
 *
 * Nodes are numbered depth first by pairs: a pair of siblings, then the descendants of the left one, then those of the
 * right one. The leaves' cells are stored in the same order. Children therefore come after parents, and the descendants
 * of a node are contiguous. */
#ifndef MMBVH_MMBVH_H
#define MMBVH_MMBVH_H

#include "error.h"
#include "grid.h"
#include "mmbvh_compact.h"

enum {
    MMBVH_MAX_LEAF = 7,
    /* maximum depth of a leaf (the root has depth 1); also the maximum size of a traversal's stack */
    MMBVH_MAX_DEPTH = 80
};

/* A node of the reference layout: 40 bytes, as in figure 4.1 of the thesis. */
typedef struct mmbvh_node {
    float lower[3];
    float range_low;
    float upper[3];
    float range_high;
    uint64_t count : 3; /* number of cells in a leaf; 0 for an inner node */
    /* leaf: first index in `cells`; inner node: index of the left child; the right child follows it */
    uint64_t ref : 61;
} mmbvh_node;

typedef enum mmbvh_layout {
    MMBVH_COMPACT,  /* 24 bytes per node, bounds in steps of a grid (mmbvh_compact.h) */
    MMBVH_REFERENCE /* 40 bytes per node, bounds in float32; also used if the compact layout cannot store the tree,
                       because it has more than 2^29 cells or bounds that are not finite */
} mmbvh_layout;

typedef enum mmbvh_builder {
    MMBVH_SAH, /* the binned surface area heuristic (SAH) */
    /* the order of cells along a Morton curve: the tree is built several times faster than by SAH, and is slower to
     * traverse */
    MMBVH_MORTON
} mmbvh_builder;

typedef struct mmbvh {
    mmbvh_node *nodes;           /* nodes in the reference layout; NULL in the compact layout */
    mmbvh_compact_node *compact; /* nodes in the compact layout; NULL in the reference layout */
    mmbvh_grid grid;             /* quantization grid of the compact layout */
    int64_t node_count;          /* number of nodes; 0 if there are no cells */
    uint32_t *cells;             /* cell indices, leaf by leaf; in a tree over the boxes of meshes
                                    (mmbvh_build_boxes()): mesh indices */
    int64_t cell_count;
    double origin[3]; /* origin of the tree's coordinates; a position has the coordinates (position - origin) * scale */
    double scale;
    double built_cost; /* SAH cost (mmbvh_cost()) when the tree was built */
    /* sum over all nodes: half the surface area of the node's box × the number of boxes and cells that a ray tests
     * after it has hit this box (2 children, or a leaf's cells); updated when bounds are refitted */
    double area;
    double built_area; /* value of `area` when the tree was built; if `area` has grown faster than the surface area of
                          the mesh, the tree has degraded */
    /* number of cells with non-finite values; the ranges stored in the nodes do not include them */
    int64_t unusable_cells;
} mmbvh;

/* The following functions read nodes of either layout; traversals use them instead of the arrays. mmbvh_node_box()
 * stores the box in elements 0 to 2 of lower and upper. It may overwrite element 3, so that whole vectors can be
 * stored. */
static inline void mmbvh_node_box(const mmbvh *tree, int64_t index, float lower[4], float upper[4])
{
    if (tree->compact) {
        compact_box(&tree->compact[index], &tree->grid, lower, upper);
        return;
    }
    const mmbvh_node *node = &tree->nodes[index];
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = node->lower[axis];
        upper[axis] = node->upper[axis];
    }
}

/* Prefetches a node that will be read soon. */
static inline void mmbvh_prefetch_node(const mmbvh *tree, int64_t index)
{
    __builtin_prefetch(tree->compact ? (const void *)&tree->compact[index] : (const void *)&tree->nodes[index]);
}

/* Returns the number of cells in a leaf, or 0 for an inner node. */
static inline int mmbvh_node_count(const mmbvh *tree, int64_t index)
{
    return tree->compact ? (int)(tree->compact[index].link & 7) : (int)tree->nodes[index].count;
}

/* Returns a leaf's first index in cells, or the index of an inner node's left child. The right child has the next
 * index. */
static inline int64_t mmbvh_node_ref(const mmbvh *tree, int64_t index)
{
    return tree->compact ? (int64_t)(tree->compact[index].link >> 3) : (int64_t)tree->nodes[index].ref;
}

/* Returns the number of bytes of the nodes and cell indices. */
int64_t mmbvh_bytes(const mmbvh *tree);

/* The ranges of one field for all nodes: either those stored in the nodes (stride 24 or 40), or an array of pairs
 * outside the tree (stride 8). */
typedef struct mmbvh_ranges {
    const char *low; /* address of the lower end of node 0's range */
    const char *high;
    int64_t stride; /* number of bytes from one node's range to the next */
} mmbvh_ranges;

/* A list of cells in ascending order. It owns its memory; free it with mmbvh_selection_free(). */
typedef struct mmbvh_selection {
    uint32_t *cells;
    int64_t count;
} mmbvh_selection;

typedef struct mmbvh_options {
    int threads;                      /* number of threads; 0 means the default of OpenMP */
    const mmbvh_selection *selection; /* used by a build: the cells to put in the tree, none of which may be a ghost or
                                         flat (grid_is_flat()); NULL: all cells that are neither */
    mmbvh_layout layout;
    mmbvh_builder builder;
} mmbvh_options;

/* Builds a tree over the grid's cells, except ghosts and flat cells (grid_is_flat()). The nodes store the ranges of the
 * field; if field is NULL, all ranges are (-inf, +inf). Parallel; the tree is the same for any number of threads. On
 * success *out owns its memory; free it with mmbvh_free(). On an error *out is zeroed. */
insitu_status mmbvh_build(const grid *g, const grid_field *field, const double origin[3], double scale,
                          const mmbvh_options *options, mmbvh *out, base_error *error);

/* The closed interval from low to high. */
typedef struct mmbvh_interval {
    float low, high;
} mmbvh_interval;

/* A query matches the cells whose range of field values, rounded to float, intersects at least one of the intervals.
 * Cells that match no query are invisible. */
typedef struct mmbvh_query {
    const grid_field *field;
    int interval_count;
    const mmbvh_interval *intervals;
} mmbvh_query;

/* Selects the cells that match at least one query. Ghosts, flat cells and cells with non-finite values are never
 * selected; unusable[i] receives the number of cells whose values are not finite for query i. Parallel; reads each
 * cell's values once per query, about as fast as a refit of ranges. As long as cells, values and queries do not change,
 * a tree over the selection (mmbvh_options) gives the same picture as the full tree. */
insitu_status mmbvh_select(const grid *g, const mmbvh_query *queries, int query_count, const mmbvh_options *options,
                           mmbvh_selection *out, int64_t *unusable, base_error *error);
void mmbvh_selection_free(mmbvh_selection *selection);

/* Builds a parent tree over the boxes of meshes: lower and upper are count × 3 values, ranges count × 2 (low, high). */
insitu_status mmbvh_build_boxes(const float *lower, const float *upper, const float *ranges, int64_t count,
                                const mmbvh_options *options, mmbvh *out, base_error *error);

void mmbvh_free(mmbvh *tree);

/* Computes the ranges stored in the nodes from new values of the same cells. Parallel; keeps no additional memory. */
insitu_status mmbvh_refit_ranges(mmbvh *tree, const grid *g, const grid_field *field, const mmbvh_options *options);

/* Computes the bounds from moved vertices of the same cells. The ranges do not change. */
insitu_status mmbvh_refit_bounds(mmbvh *tree, const grid *g, const mmbvh_options *options);

/* The visible part of a tree: the nodes whose range intersects one of the intervals. */
typedef struct mmbvh_visible {
    mmbvh_ranges ranges; /* ranges of the field's current values */
    int interval_count;
    const mmbvh_interval *intervals;
} mmbvh_visible;

/* Computes the bounds from moved vertices of the same cells. Nodes that are in none of the visible parts may be
 * skipped. *is_whole is set to true if no node was skipped. Otherwise the bounds of a node contain only its visible
 * descendants, and are valid only until values, intervals or vertices change. A traversal that skips invisible nodes
 * then finds the same cells as after mmbvh_refit_bounds(), but mmbvh_check() fails. */
insitu_status mmbvh_refit_visible_bounds(mmbvh *tree, const grid *g, const mmbvh_visible *visible, int visible_count,
                                         const mmbvh_options *options, bool *is_whole);

/* Computes the ranges of another field for the same tree. `pairs` receives node_count × 2 floats. `unusable` receives
 * the number of cells with a non-finite value. */
insitu_status mmbvh_compute_ranges(const mmbvh *tree, const grid *g, const grid_field *field,
                                   const mmbvh_options *options, float *pairs, int64_t *unusable);

static inline mmbvh_ranges mmbvh_own_ranges(const mmbvh *tree)
{
    if (!tree->node_count) return (mmbvh_ranges){0};
    if (tree->compact) {
        return (mmbvh_ranges){(const char *)&tree->compact->range_low, (const char *)&tree->compact->range_high,
                              (int64_t)sizeof *tree->compact};
    }
    return (mmbvh_ranges){(const char *)&tree->nodes->range_low, (const char *)&tree->nodes->range_high,
                          (int64_t)sizeof *tree->nodes};
}

static inline mmbvh_ranges mmbvh_pair_ranges(const float *pairs)
{
    mmbvh_ranges r = {(const char *)pairs, (const char *)(pairs + 1), 2 * (int64_t)sizeof(float)};
    return r;
}

/* Returns the tree's current SAH cost: the expected number of boxes and cells that a random ray tests if it hits the
 * root's box; testing a box and testing a cell have the same cost. Only the number of threads is read from the
 * options. */
double mmbvh_cost(const mmbvh *tree, const mmbvh_options *options);

typedef struct mmbvh_statistics {
    int64_t leaves;
    int depth;              /* depth of the deepest leaf; the root has depth 1 */
    double cells_a_leaf;    /* mean number of cells per leaf */
    double sibling_overlap; /* mean over inner nodes: surface area of the intersection of the children's boxes, divided
                               by that of their union */
    double cost;            /* SAH cost as computed by mmbvh_cost() */
    int64_t bytes;          /* size in bytes of nodes and cell indices */
} mmbvh_statistics;

/* Checks the tree: every cell that is neither a ghost nor flat is in exactly one leaf, leaves have 1 to 7 cells, every
 * node's bounds and range contain those of its children and cells, siblings are adjacent, and every node is reached
 * exactly once. The first violation is reported as the error. If g or field is NULL (parent tree), only the structure
 * is checked. out may be NULL. */
insitu_status mmbvh_check(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_statistics *out,
                          base_error *error);

#endif
