/* Bounds of cells and nodes from the vertices: for the builder's boxes, and to refit the bounds of a tree. */
#include "mmbvh_bounds.h"

#include "mmbvh_fetch.h"

/* A grid's cells' boxes. */

MMBVH_INLINE void fill_boxes(const bounds_source *source, int64_t begin, int64_t end, branch_box *boxes, bin_set *set,
                             const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    for (int64_t i = begin; i < end; i++) {
        const int64_t cell = source->cells ? (int64_t)source->cells[i] : i;
        if (grid_is_ghost(source->g, cell)) continue;
        fetch_box box;
        fetch_box_empty(&box);
        fetch_box_cell(&box, source->g, cell, shape, wide_index, wide_number);
        branch_box *to = &boxes[i];
        fetch_box_round(&box, source->origin, source->scale, to->lower, to->upper);
        bin_set_add(set, branch_box_lower(to), branch_box_upper(to));
    }
}

#define DEFINE_FILL(name, shape, wide_index, wide_number)                                                              \
    static void name(const bounds_source *source, int64_t begin, int64_t end, branch_box *boxes, bin_set *set)         \
    {                                                                                                                  \
        fill_boxes(source, begin, end, boxes, set, shape, wide_index, wide_number);                                    \
    }
FETCH_INSTANCES(DEFINE_FILL, fill)

static void fill_any(const bounds_source *source, int64_t begin, int64_t end, branch_box *boxes, bin_set *set)
{
    for (int64_t i = begin; i < end; i++) {
        const int64_t cell = source->cells ? (int64_t)source->cells[i] : i;
        if (grid_is_ghost(source->g, cell)) continue;
        fetch_box box;
        fetch_box_empty(&box);
        fetch_box_any_cell(&box, source->g, cell);
        branch_box *to = &boxes[i];
        fetch_box_round(&box, source->origin, source->scale, to->lower, to->upper);
        bin_set_add(set, branch_box_lower(to), branch_box_upper(to));
    }
}

static void fill_given(const bounds_source *source, int64_t begin, int64_t end, branch_box *boxes, bin_set *set)
{
    for (int64_t i = begin; i < end; i++) {
        for (int axis = 0; axis < 3; axis++) {
            boxes[i].lower[axis] = source->lower[3 * i + axis] + 0.0f;
            boxes[i].upper[axis] = source->upper[3 * i + axis] + 0.0f;
        }
        bin_set_add(set, branch_box_lower(&boxes[i]), branch_box_upper(&boxes[i]));
    }
}

bounds_fill bounds_choose_fill(const grid *g)
{
    static const bounds_fill table[FETCH_SHAPES][2][2] = FETCH_TABLE(fill);
    if (!g) return fill_given;
    if (!fetch_is_plain(g)) return fill_any;
    return table[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
}

/* A tree's nodes' bounds. */

static void unite_children(mmbvh_node *node, const mmbvh_node *pair)
{
    for (int axis = 0; axis < 3; axis++) {
        const float l0 = pair[0].lower[axis], l1 = pair[1].lower[axis];
        const float u0 = pair[0].upper[axis], u1 = pair[1].upper[axis];
        node->lower[axis] = l0 < l1 ? l0 : l1;
        node->upper[axis] = u0 > u1 ? u0 : u1;
    }
}

MMBVH_INLINE int64_t run_bounds(const sweep *s, int64_t first, int64_t end, const bool plain, const fetch_shape shape,
                                const bool wide_index, const bool wide_number)
{
    for (int64_t i = end - 1; i >= first; i--) {
        mmbvh_node *node = s->nodes + i;
        if (!node->count) {
            unite_children(node, s->nodes + node->ref);
            continue;
        }
        fetch_box box;
        fetch_box_empty(&box);
        for (uint64_t k = 0; k < node->count; k++) {
            const int64_t cell = s->tree->cells[node->ref + k];
            if (plain) {
                fetch_box_cell(&box, s->g, cell, shape, wide_index, wide_number);
            } else {
                fetch_box_any_cell(&box, s->g, cell);
            }
        }
        fetch_box_round(&box, s->tree->origin, s->tree->scale, node->lower, node->upper);
    }
    return 0;
}

#define DEFINE_RUN(name, shape, wide_index, wide_number)                                                               \
    static int64_t name(const sweep *s, int64_t first, int64_t end)                                                    \
    {                                                                                                                  \
        return run_bounds(s, first, end, true, shape, wide_index, wide_number);                                        \
    }
FETCH_INSTANCES(DEFINE_RUN, run_bounds)

static int64_t run_any_bounds(const sweep *s, int64_t first, int64_t end)
{
    return run_bounds(s, first, end, false, FETCH_BY_CELL, false, false);
}

insitu_status mmbvh_refit_bounds(mmbvh *tree, const grid *g, const mmbvh_options *options)
{
    static const sweep_run table[FETCH_SHAPES][2][2] = FETCH_TABLE(run_bounds);
    if (!tree || !g) return INSITU_ERROR_ARGUMENT;
    sweep s = {.tree = tree, .g = g, .nodes = tree->nodes, .run = run_any_bounds};
    if (fetch_is_plain(g)) {
        s.run = table[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
    }
    sweep_tree(&s, sweep_threads(options));
    return INSITU_OK;
}
