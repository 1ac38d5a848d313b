/* The cells of a lattice (structured grid) are already in spatial order: cells in a box of indices are also close to
 * each other in space, unless the lattice is strongly deformed. Each node is split in two halves, across the axis along
 * which its box is longest; lengths are estimated from the mean edge lengths of cells. If the numbers of cells per side
 * are powers of two, halving alone would end in leaves of 2 x 2 x 1 cells, although a leaf may have MMBVH_MAX_LEAF = 7.
 * Small boxes are therefore split so that the cost of their leaves is minimal, which mostly gives leaves of 3 x 2 x 1
 * cells: a third fewer nodes, with a tenth less surface area. */
#include "mmbvh_bricks.h"

#include <math.h>
#include <omp.h>

#include "region.h"

/* A box of cell indices. */
typedef struct brick {
    int64_t first[3], count[3];
} brick;

/* SMALL_SIDE and SMALL_CELLS limit the boxes whose splits are chosen by cost. The cost of a leaf is LEAF_COST plus, for
 * each cell, the sum of the leaf's sides, in cells. The probability that a surface crosses the leaf is proportional to
 * this sum. If LEAF_COST is between 12 and 126, leaves of 3 x 2 x 1 cells cost less per cell than leaves of 2 x 2 x 1
 * or 7 x 1 x 1. */
enum { SMALL_SIDE = 8, SMALL_CELLS = 64, LEAF_COST = 24 };

typedef struct bricks {
    topology_build *build;
    const grid_lattice *lattice;
    double edge[3]; /* for each axis, the sum of the lengths of the sampled cells' edges; only the ratios are used */
    uint32_t *cells;
    /* lowest cost of a small box, indexed by the numbers of cells along its sides */
    int costs[SMALL_SIDE + 1][SMALL_SIDE + 1][SMALL_SIDE + 1];
} bricks;

static int64_t brick_cell_count(const brick *b)
{
    return b->count[0] * b->count[1] * b->count[2];
}

static brick get_drawn_brick(const grid_lattice *l)
{
    brick out;
    for (int axis = 0; axis < 3; axis++) {
        out.first[axis] = l->drawn_first[axis];
        out.count[axis] = l->drawn_end[axis] - l->drawn_first[axis];
    }
    return out;
}

int64_t bricks_count(const grid_lattice *lattice)
{
    const brick all = get_drawn_brick(lattice);
    return brick_cell_count(&all);
}

/* Returns the length of the edge from the vertex to the next one along the axis. */
static double compute_edge_length(const grid *g, int64_t vertex, int axis)
{
    double from[3], to[3], sum = 0;
    grid_read_vertex_position(g, vertex, from);
    grid_read_vertex_position(g, vertex + g->lattice->vertex_numbering.stride[axis], to);
    for (int a = 0; a < 3; a++) sum += (to[a] - from[a]) * (to[a] - from[a]);
    return sqrt(sum);
}

/* Computes, for each axis, a number proportional to the mean length of the cells' edges along it, from samples spread
 * over the whole lattice. */
static void measure_edges(const grid *g, double out[3])
{
    enum { SAMPLES = 5 };
    const brick all = get_drawn_brick(g->lattice);
    for (int axis = 0; axis < 3; axis++) {
        out[axis] = 0;
        for (int sample = 0; sample < SAMPLES * SAMPLES * SAMPLES; sample++) {
            const int part[3] = {sample % SAMPLES, sample / SAMPLES % SAMPLES, sample / SAMPLES / SAMPLES};
            int64_t vertex = 0;
            for (int a = 0; a < 3; a++)
                vertex += (all.first[a] + all.count[a] * part[a] / SAMPLES) * g->lattice->vertex_numbering.stride[a];
            out[axis] += compute_edge_length(g, vertex, axis);
        }
    }
}

/* A plane that splits a box: the axis to which it is perpendicular, and the number of layers of cells before it. */
typedef struct brick_split {
    int along;
    int64_t before;
} brick_split;

static bool is_small_brick(const int64_t count[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (count[axis] > SMALL_SIDE) return false;
    return count[0] * count[1] * count[2] <= SMALL_CELLS;
}

static int cost_of_split(const bricks *s, const int64_t count[3], brick_split split)
{
    int64_t sides[2][3];
    for (int axis = 0; axis < 3; axis++) sides[0][axis] = sides[1][axis] = count[axis];
    sides[0][split.along] = split.before;
    sides[1][split.along] -= split.before;
    return s->costs[sides[0][0]][sides[0][1]][sides[0][2]] + s->costs[sides[1][0]][sides[1][1]][sides[1][2]];
}

/* Returns the split of a small box with the lowest cost; if several have this cost, `first` is preferred. *cost
 * receives the cost. */
static brick_split cheapest_split(const bricks *s, const int64_t count[3], brick_split first, int *cost)
{
    brick_split best = first;
    *cost = cost_of_split(s, count, first);
    for (int along = 0; along < 3; along++)
        for (int64_t before = 1; before < count[along]; before++) {
            const brick_split split = {along, before};
            const int own = cost_of_split(s, count, split);
            if (own < *cost) best = split;
            if (own < *cost) *cost = own;
        }
    return best;
}

/* Computes the costs of all small boxes, smaller ones first, because a box's cost is the sum of its parts' costs. */
static void compute_costs(bricks *s)
{
    for (int64_t k = 1; k <= SMALL_SIDE; k++)
        for (int64_t j = 1; j <= SMALL_SIDE; j++)
            for (int64_t i = 1; i <= SMALL_SIDE; i++) {
                const int64_t count[3] = {i, j, k}, cells = i * j * k;
                const int along = i > 1 ? 0 : j > 1 ? 1 : 2;
                if (cells <= MMBVH_MAX_LEAF)
                    s->costs[i][j][k] = LEAF_COST + (int)(cells * (i + j + k));
                else if (is_small_brick(count))
                    cheapest_split(s, count, (brick_split){along, 1}, &s->costs[i][j][k]);
            }
}

/* Splits a box of at least two cells. */
static void split_brick(const bricks *s, const brick *b, brick halves[2])
{
    double extent[3];
    for (int axis = 0; axis < 3; axis++)
        extent[axis] = b->count[axis] > 1 ? (double)b->count[axis] * s->edge[axis] : -1;
    int along = extent[1] > extent[0];
    along = extent[2] > extent[along] ? 2 : along;
    int cost;
    brick_split split = {along, b->count[along] / 2};
    if (is_small_brick(b->count)) split = cheapest_split(s, b->count, split, &cost);
    halves[0] = halves[1] = *b;
    halves[0].count[split.along] = split.before;
    halves[1].first[split.along] += split.before;
    halves[1].count[split.along] -= split.before;
}

static void list_cells(const grid_lattice *l, const brick *b, uint32_t *out)
{
    const int64_t *stride = l->cell_numbering.stride;
    for (int64_t k = b->first[2]; k < b->first[2] + b->count[2]; k++)
        for (int64_t j = b->first[1]; j < b->first[1] + b->count[1]; j++)
            for (int64_t i = b->first[0]; i < b->first[0] + b->count[0]; i++)
                *out++ = (uint32_t)(i * stride[0] + j * stride[1] + k * stride[2]);
}

/* Builds the subtree over the box and returns its root's link. `cells` is the list of the subtree's cells; the box's
 * cells are stored in it from index `first`. */
static topology_link build_subtree(const bricks *s, topology_scratch *scratch, const brick *b, uint32_t *cells,
                                   int64_t first)
{
    const int64_t count = brick_cell_count(b);
    if (count <= MMBVH_MAX_LEAF) {
        list_cells(s->lattice, b, cells + first);
        return topology_leaf(first, count);
    }
    brick halves[2];
    split_brick(s, b, halves);
    const int64_t pair = topology_new_pair(scratch);
    const topology_link left = build_subtree(s, scratch, &halves[0], cells, first);
    const topology_link right = build_subtree(s, scratch, &halves[1], cells, first + brick_cell_count(&halves[0]));
    scratch->links[pair] = left;
    scratch->links[pair + 1] = right;
    return topology_inner(pair);
}

static void build_top(const bricks *s, topology *t, const brick b)
{
    if (atomic_load(&s->build->failed)) return;
    if (t->count <= TOPOLOGY_SUBTREE_CELLS) {
        topology_scratch *scratch = &s->build->scratch[omp_get_thread_num()];
        scratch->count = 0;
        const topology_link root = build_subtree(s, scratch, &b, s->cells + t->first, 0);
        topology_copy_links(s->build, t, scratch, root);
        return;
    }
    brick halves[2];
    split_brick(s, &b, halves);
    for (int side = 0; side < 2; side++) {
        const int64_t begin = side ? brick_cell_count(&halves[0]) : 0;
        topology *child = t->children[side] = topology_new(s->build, t->first + begin, brick_cell_count(&halves[side]));
        const brick half = halves[side];
        if (!child) return;
#pragma omp task default(none) firstprivate(s, child, half)
        build_top(s, child, half);
    }
}

topology *bricks_build(topology_build *build, const grid *g, uint32_t *cells)
{
    bricks s = {.build = build, .lattice = g->lattice, .cells = cells};
    const brick all = get_drawn_brick(g->lattice);
    topology *root = topology_new(build, 0, brick_cell_count(&all));
    if (!root) return NULL;
    measure_edges(g, s.edge);
    compute_costs(&s);
#pragma omp parallel num_threads(build->threads)
    {
        region_enter();
#pragma omp single
        build_top(&s, root, all);
        region_leave();
    }
    if (!atomic_load(&build->failed)) return root;
    topology_free(root);
    return NULL;
}
