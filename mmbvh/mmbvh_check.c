/* Checks a whole tree. One traversal visits the nodes and the entries of mmbvh.cells in the order in which mmbvh.h says
 * that they are stored. A reference to any other position is a violation. Every node and entry is therefore visited
 * exactly once, and the traversal ends even if the tree is broken. */
#include "mmbvh.h"

#include <inttypes.h>
#include <string.h>

#include "memory.h"
#include "mmbvh_cost.h"

typedef struct check_state {
    const mmbvh *tree;
    const grid *g;
    const grid_field *field;
    unsigned char *visited; /* bit set of the cells visited so far */
    int64_t cell_limit; /* number of cells of the grid, or number of meshes if the tree is a parent tree over the boxes
                           of meshes */
    int64_t next_pair;  /* index of the first node of the pair of siblings that the traversal must reach next */
    int64_t next_entry; /* index in mmbvh.cells of the cell that the traversal must reach next */
    int64_t unusable;   /* number of drawn cells with a value that is not finite */
    int64_t leaves;     /* number of leaves visited so far */
    int depth;          /* largest depth of a node visited so far */
    double overlap;     /* sum of the overlaps of siblings */
    base_error *error;
} check_state;

#define VIOLATION(w, ...) base_fail((w)->error, INSITU_ERROR_INTERNAL, __VA_ARGS__)

static insitu_status check_box(const check_state *w, int64_t index)
{
    float lower[4], upper[4];
    mmbvh_node_box(w->tree, index, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        if (w->g && !(lower[axis] <= upper[axis])) {
            return VIOLATION(w, "node %" PRId64 ": lower bound %g above upper bound %g on axis %d", index,
                             (double)lower[axis], (double)upper[axis], axis);
        }
    }
    return INSITU_OK;
}

static insitu_status check_cell_bounds(const check_state *w, int64_t index, int64_t cell)
{
    float lower[4], upper[4];
    mmbvh_node_box(w->tree, index, lower, upper);
    grid_walk vertices = grid_walk_cell(w->g, cell);
    int64_t vertex;
    while (grid_walk_next(&vertices, &vertex)) {
        double p[3];
        grid_read_vertex_position(w->g, vertex, p);
        for (int axis = 0; axis < 3; axis++) {
            const double x = (p[axis] - w->tree->origin[axis]) * w->tree->scale;
            if (!(lower[axis] <= x && x <= upper[axis])) {
                return VIOLATION(w, "leaf %" PRId64 ": vertex %" PRId64 " of cell %" PRId64 " lies outside its bounds",
                                 index, vertex, cell);
            }
        }
    }
    return INSITU_OK;
}

/* Computes the range of the cell's values. Returns false if a value is not finite. */
static bool compute_cell_range(const check_state *w, int64_t cell, double *low, double *high)
{
    grid_walk vertices = grid_walk_cell(w->g, cell);
    int64_t vertex;
    if (!grid_has_finite_cell_value(w->field, cell)) return false;
    *low = INFINITY;
    *high = -INFINITY;
    while (grid_walk_next(&vertices, &vertex)) {
        const double v = grid_field_value(w->field, w->field->is_cell_centred ? cell : vertex);
        if (!isfinite(v)) return false;
        *low = fmin(*low, v);
        *high = fmax(*high, v);
    }
    return true;
}

static void get_node_range(const check_state *w, int64_t index, float *low, float *high)
{
    const mmbvh_ranges own = mmbvh_own_ranges(w->tree);
    memcpy(low, own.low + index * own.stride, sizeof *low);
    memcpy(high, own.high + index * own.stride, sizeof *high);
}

static insitu_status check_cell_range(check_state *w, int64_t index, int64_t cell)
{
    float range_low, range_high;
    get_node_range(w, index, &range_low, &range_high);
    double low, high;
    if (!compute_cell_range(w, cell, &low, &high)) {
        w->unusable++;
        return INSITU_OK;
    }
    if (!(range_low <= low && high <= range_high)) {
        return VIOLATION(w, "leaf %" PRId64 ": value %g or %g of cell %" PRId64 " lies outside its range", index, low,
                         high, cell);
    }
    return INSITU_OK;
}

static insitu_status check_cell(check_state *w, int64_t index, int64_t cell)
{
    if (cell >= w->cell_limit) return VIOLATION(w, "leaf %" PRId64 ": there is no cell %" PRId64, index, cell);
    unsigned char *byte = &w->visited[cell / 8];
    const unsigned bit = 1u << (cell % 8);
    if (*byte & bit) return VIOLATION(w, "leaf %" PRId64 ": cell %" PRId64 " is in the tree twice", index, cell);
    *byte = (unsigned char)(*byte | bit);
    if (!w->g) return INSITU_OK;
    if (grid_is_ghost(w->g, cell)) return VIOLATION(w, "leaf %" PRId64 ": cell %" PRId64 " is a ghost", index, cell);
    if (grid_is_flat(w->g, cell)) return VIOLATION(w, "leaf %" PRId64 ": cell %" PRId64 " is flat", index, cell);
    const insitu_status status = check_cell_bounds(w, index, cell);
    if (status || !w->field) return status;
    return check_cell_range(w, index, cell);
}

static insitu_status check_leaf(check_state *w, int64_t index)
{
    const int64_t first = mmbvh_node_ref(w->tree, index), count = mmbvh_node_count(w->tree, index);
    if (first != w->next_entry || count > w->tree->cell_count - first) {
        return VIOLATION(w, "leaf %" PRId64 ": its cells are entries %" PRId64 " on, expected %" PRId64 " of %" PRId64,
                         index, first, w->next_entry, w->tree->cell_count);
    }
    for (int64_t i = first; i < first + count; i++) {
        const insitu_status status = check_cell(w, index, w->tree->cells[i]);
        if (status) return status;
    }
    w->next_entry += count;
    w->leaves++;
    return INSITU_OK;
}

static insitu_status check_child_is_contained(const check_state *w, int64_t index, int64_t child_index)
{
    float lower[2][4], upper[2][4], low[2], high[2];
    mmbvh_node_box(w->tree, index, lower[0], upper[0]);
    mmbvh_node_box(w->tree, child_index, lower[1], upper[1]);
    get_node_range(w, index, &low[0], &high[0]);
    get_node_range(w, child_index, &low[1], &high[1]);
    for (int axis = 0; axis < 3; axis++) {
        if (!(lower[0][axis] <= lower[1][axis] && upper[1][axis] <= upper[0][axis])) {
            return VIOLATION(w, "node %" PRId64 ": child %" PRId64 " lies outside its bounds", index, child_index);
        }
    }
    if (!(low[0] <= low[1] && high[1] <= high[0])) {
        return VIOLATION(w, "node %" PRId64 ": child %" PRId64 " lies outside its range", index, child_index);
    }
    return INSITU_OK;
}

static double compute_overlap_of_pair(const mmbvh *tree, int64_t parent, int64_t pair)
{
    float lower[3][4], upper[3][4];
    mmbvh_node_box(tree, parent, lower[2], upper[2]);
    for (int side = 0; side < 2; side++) mmbvh_node_box(tree, pair + side, lower[side], upper[side]);
    for (int axis = 0; axis < 3; axis++) {
        lower[0][axis] = lower[0][axis] > lower[1][axis] ? lower[0][axis] : lower[1][axis];
        upper[0][axis] = upper[0][axis] < upper[1][axis] ? upper[0][axis] : upper[1][axis];
    }
    const double whole = cost_half_area(lower[2], upper[2]);
    return whole > 0 ? cost_half_area(lower[0], upper[0]) / whole : 0;
}

static insitu_status check_inner_node(check_state *w, int64_t index)
{
    const int64_t pair = mmbvh_node_ref(w->tree, index);
    if (pair != w->next_pair || pair + 2 > w->tree->node_count) {
        return VIOLATION(w, "node %" PRId64 ": its children are nodes %" PRId64 " on, expected %" PRId64 " of %" PRId64,
                         index, pair, w->next_pair, w->tree->node_count);
    }
    w->next_pair += 2;
    for (int side = 0; side < 2; side++) {
        const insitu_status status = check_child_is_contained(w, index, pair + side);
        if (status) return status;
    }
    w->overlap += compute_overlap_of_pair(w->tree, index, pair);
    return INSITU_OK;
}

static insitu_status check_nodes(check_state *w)
{
    /* Stack of nodes still to be visited: the right children along the current path. */
    struct {
        int64_t index;
        int depth;
    } stack[MMBVH_MAX_DEPTH + 1] = {{0, 1}};
    int height = 1;
    while (height > 0) {
        const int64_t index = stack[--height].index;
        const int depth = stack[height].depth;
        if (depth > MMBVH_MAX_DEPTH) return VIOLATION(w, "node %" PRId64 ": deeper than %d", index, MMBVH_MAX_DEPTH);
        w->depth = depth > w->depth ? depth : w->depth;
        insitu_status status = check_box(w, index);
        const bool is_leaf = mmbvh_node_count(w->tree, index) > 0;
        if (!status) status = is_leaf ? check_leaf(w, index) : check_inner_node(w, index);
        if (status) return status;
        if (is_leaf) continue;
        for (int side = 1; side >= 0; side--) {
            stack[height].index = mmbvh_node_ref(w->tree, index) + side;
            stack[height++].depth = depth + 1;
        }
    }
    return INSITU_OK;
}

/* Returns an error if the traversal has not visited all nodes, entries and cells. */
static insitu_status check_all_nodes_visited(const check_state *w)
{
    if (w->next_pair != w->tree->node_count && w->tree->node_count) {
        return VIOLATION(w, "%" PRId64 " of %" PRId64 " nodes are reached", w->next_pair, w->tree->node_count);
    }
    if (w->next_entry != w->tree->cell_count) {
        return VIOLATION(w, "%" PRId64 " of %" PRId64 " cell entries are in leaves", w->next_entry,
                         w->tree->cell_count);
    }
    for (int64_t cell = 0; cell < w->cell_limit; cell++) {
        const bool seen = w->visited[cell / 8] >> (cell % 8) & 1;
        if (!seen && !(w->g && !grid_is_drawn(w->g, cell))) return VIOLATION(w, "cell %" PRId64 " is in no leaf", cell);
    }
    if (w->field && w->unusable != w->tree->unusable_cells) {
        return VIOLATION(w, "%" PRId64 " cells are unusable, the tree says %" PRId64, w->unusable,
                         w->tree->unusable_cells);
    }
    return INSITU_OK;
}

static mmbvh_statistics make_statistics(const check_state *w)
{
    mmbvh_statistics s = {.leaves = w->leaves, .depth = w->depth, .cost = mmbvh_cost(w->tree, NULL)};
    const int64_t inner = w->tree->node_count - w->leaves;
    s.cells_a_leaf = w->leaves ? (double)w->tree->cell_count / (double)w->leaves : 0;
    s.sibling_overlap = inner ? w->overlap / (double)inner : 0;
    s.bytes = mmbvh_bytes(w->tree);
    return s;
}

insitu_status mmbvh_check(const mmbvh *tree, const grid *g, const grid_field *field, mmbvh_statistics *out,
                          base_error *error)
{
    if (!tree) return base_fail(error, INSITU_ERROR_ARGUMENT, "no tree to check");
    check_state w = {.tree = tree, .g = g, .field = g ? field : NULL, .next_pair = 1, .error = error};
    w.cell_limit = g ? g->cell_count : tree->cell_count;
    w.visited = base_calloc((size_t)w.cell_limit / 8 + 1, 1);
    if (!w.visited) return base_fail(error, INSITU_ERROR_MEMORY, "out of memory: checking a tree");
    insitu_status status = tree->node_count > 0 ? check_nodes(&w) : INSITU_OK;
    if (!status) status = check_all_nodes_visited(&w);
    base_free(w.visited);
    if (!status && out) *out = make_statistics(&w);
    return status;
}
