/* The min-max bounding volume hierarchy: a binary tree over a grid's cells whose nodes hold the bounds of their cells
 * and the range of a scalar on them (thesis, section 4.2). Knows no MPI and no pixels.
 *
 * The nodes stand in one array, root first, siblings side by side, so that one reference finds both. A leaf holds at
 * most 7 cells. Bounds are float32, of (position - origin) * scale, rounded outward; ranges are float32, rounded
 * outward from the double values; the compact layout rounds bounds further outward, to its grid. Ghost cells are not in
 * the tree. A cell with a value that is not finite has the empty range (+inf, -inf) and so is never met.
 *
 * Nodes are numbered depth first by pairs: a pair of siblings, then all below the left one, then all below the right
 * one; the leaves' cells stand in the same order. So children come after parents, and all below a node is one run. */
#ifndef MMBVH_MMBVH_H
#define MMBVH_MMBVH_H

#include "error.h"
#include "grid.h"
#include "mmbvh_compact.h"

enum {
    MMBVH_MAX_LEAF = 7,
    MMBVH_MAX_DEPTH = 80 /* greatest depth of a leaf; the root has depth 1. A traversal's stack needs no more entries */
};

typedef struct mmbvh_node {
    float lower[3];
    float range_low;
    float upper[3];
    float range_high;
    uint64_t count : 3; /* cells in a leaf; 0: an inner node */
    uint64_t ref : 61;  /* leaf: first entry in cells; inner: the left child's index, the right one follows */
} mmbvh_node;           /* 40 bytes, as in the thesis's figure 4.1 */

typedef enum mmbvh_layout {
    MMBVH_COMPACT,  /* 24 bytes a node, bounds in steps of a grid (mmbvh_compact.h) */
    MMBVH_REFERENCE /* 40 bytes a node, bounds in float32; also used where the compact layout cannot hold the tree: for
                       more than 2^29 cells, or bounds that are not finite */
} mmbvh_layout;

typedef enum mmbvh_builder {
    MMBVH_SAH,   /* binned surface area heuristic */
    MMBVH_MORTON /* along a space-filling curve: several times faster to build, slower to go through */
} mmbvh_builder;

typedef struct mmbvh {
    mmbvh_node *nodes;           /* the reference layout; else NULL */
    mmbvh_compact_node *compact; /* the compact layout; else NULL */
    mmbvh_grid grid;             /* quantization grid of the compact layout */
    int64_t node_count;          /* 0 for no cells at all */
    uint32_t *cells;             /* cell indices (or mesh indices in a parent tree), leaf by leaf */
    int64_t cell_count;
    double origin[3]; /* bounds are of (position - origin) * scale */
    double scale;
    double built_cost;      /* SAH cost when built */
    double area;            /* sum over all nodes: half the box's surface times the tests in it (mmbvh_cost()); refits
                               of the bounds keep it up to date */
    double built_area;      /* area when built: growth beyond that of the mesh's own surface is decay */
    int64_t unusable_cells; /* cells with the empty range in the nodes' own ranges */
} mmbvh;

/* These functions read nodes of any layout; traversals use them instead of the arrays. The box is in lanes 0 to 2 of
 * lower and upper; lane 3 is scratch, so that a box can be written by whole vectors. */
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

/* Asks memory for a node that is soon looked at. */
static inline void mmbvh_prefetch_node(const mmbvh *tree, int64_t index)
{
    __builtin_prefetch(tree->compact ? (const void *)&tree->compact[index] : (const void *)&tree->nodes[index]);
}

/* Cells in a leaf; 0: an inner node. */
static inline int mmbvh_node_count(const mmbvh *tree, int64_t index)
{
    return tree->compact ? (int)(tree->compact[index].link & 7) : (int)tree->nodes[index].count;
}

/* Returns a leaf's first entry in cells, or the index of an inner node's left child, which the right one follows. */
static inline int64_t mmbvh_node_ref(const mmbvh *tree, int64_t index)
{
    return tree->compact ? (int64_t)(tree->compact[index].link >> 3) : (int64_t)tree->nodes[index].ref;
}

/* The bytes that nodes and cell indices take. */
int64_t mmbvh_bytes(const mmbvh *tree);

/* Ranges of one field: the nodes' own (stride 24 or 40) or an array of pairs beside the tree (stride 8). */
typedef struct mmbvh_ranges {
    const char *low; /* node 0's lower bound */
    const char *high;
    int64_t stride; /* bytes from node to node */
} mmbvh_ranges;

/* Some of a grid's cells, in rising order. Owns its list: mmbvh_selection_free(). */
typedef struct mmbvh_selection {
    uint32_t *cells;
    int64_t count;
} mmbvh_selection;

typedef struct mmbvh_options {
    int threads;                      /* >= 1; 0: as many as OpenMP would take */
    const mmbvh_selection *selection; /* for a build: only these cells; NULL: all. None may be a ghost or flat. */
    mmbvh_layout layout;
    mmbvh_builder builder;
} mmbvh_options;

/* Build over the grid's cells (ghosts and flat cells left out) with the ranges of field (NULL: all ranges (-inf,
 * +inf)). Parallel; the same tree for any number of threads. On success *out owns the memory: free it with
 * mmbvh_free(). On an error *out is zeroed. */
insitu_status mmbvh_build(const grid *g, const grid_field *field, const double origin[3], double scale,
                          const mmbvh_options *options, mmbvh *out, base_error *error);

/* Values from low to high, ends included. */
typedef struct mmbvh_interval {
    float low, high;
} mmbvh_interval;

/* The part of a field that can be seen: cells whose range, rounded to float, meets one of the intervals. */
typedef struct mmbvh_wish {
    const grid_field *field;
    int interval_count;
    const mmbvh_interval *intervals;
} mmbvh_wish;

/* Selects the cells that can be seen by any of the wishes. Ghosts and flat cells are never selected, nor is a cell by a
 * wish whose field is not finite there; unusable gets the number of such cells for each wish. Parallel; reads each
 * cell's values once a wish, at about the speed of a refit of ranges. A tree over the selection (mmbvh_options) draws
 * the same as the full tree, as long as cells, values and wishes stay. */
insitu_status mmbvh_select(const grid *g, const mmbvh_wish *wishes, int wish_count, const mmbvh_options *options,
                           mmbvh_selection *out, int64_t *unusable, base_error *error);
void mmbvh_selection_free(mmbvh_selection *selection);

/* Build over boxes (a parent tree over meshes): lower/upper are count × 3, ranges count × 2 (low, high). */
insitu_status mmbvh_build_boxes(const float *lower, const float *upper, const float *ranges, int64_t count,
                                const mmbvh_options *options, mmbvh *out, base_error *error);

void mmbvh_free(mmbvh *tree);

/* For new values on the same cells: computes the nodes' own ranges again. Parallel; keeps no new memory. */
insitu_status mmbvh_refit_ranges(mmbvh *tree, const grid *g, const grid_field *field, const mmbvh_options *options);

/* For moved vertices of the same cells: computes the bounds again and leaves the ranges. */
insitu_status mmbvh_refit_bounds(mmbvh *tree, const grid *g, const mmbvh_options *options);

/* The part of a tree that can be seen: nodes whose range meets one of the intervals. */
typedef struct mmbvh_visible {
    mmbvh_ranges ranges; /* ranges of the current values */
    int interval_count;
    const mmbvh_interval *intervals;
} mmbvh_visible;

/* As above, but may leave out nodes that none of the parts shows; *is_whole tells whether all nodes were done. If not,
 * bounds hold only what can be seen below a node, until values, intervals or vertices change: a traversal that passes
 * over nodes that show nothing finds the same cells, but mmbvh_check() would fail. */
insitu_status mmbvh_refit_visible_bounds(mmbvh *tree, const grid *g, const mmbvh_visible *visible, int visible_count,
                                         const mmbvh_options *options, bool *is_whole);

/* Ranges of a further field over the same tree: pairs is node_count × 2 floats, the caller's memory, written.
 * unusable gets the number of cells with a value that is not finite. */
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

/* The tree's present SAH cost: the expected number of boxes and cells that a random ray tests if it meets the root
 * (each box 1, each cell 1). Only the options' threads are used. */
double mmbvh_cost(const mmbvh *tree, const mmbvh_options *options);

typedef struct mmbvh_statistics {
    int64_t leaves;
    int depth;              /* depth of the deepest leaf; the root has depth 1 */
    double cells_a_leaf;    /* mean */
    double sibling_overlap; /* mean over inner nodes: surface area of the children's intersection over their union's */
    double cost;            /* mmbvh_cost() */
    int64_t bytes;          /* nodes and cell indices */
} mmbvh_statistics;

/* Prove the tree: every drawn cell is in exactly one leaf, counts are within 1..7, every node's bounds and range
 * contain those of its children and its cells, siblings are adjacent, and every node is reached once. The first
 * violation is the error. g, field may be NULL (a parent tree): then only the structure is proved. out may be NULL. */
insitu_status mmbvh_check(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_statistics *out,
                          base_error *error);

#endif
