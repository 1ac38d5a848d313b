/* Bounds of a tree's nodes, new or again. */
#include <string.h>

#include "mmbvh_bounds.h"
#include "mmbvh_store.h"

enum { PREFETCH_CELLS = 48 };

static bool store_cells(const mmbvh *tree, const bounds_source *source, int64_t index, int64_t first, int count)
{
    fetch_box box;
    float lower[3], upper[3];
    fetch_box_empty(&box);
    const uint32_t *cells = tree->cells + first; /* the sweep goes down through them */
    source->unite(source, cells, count, first < PREFETCH_CELLS ? NULL : cells - PREFETCH_CELLS, &box);
    fetch_box_round(&box, tree->origin, tree->scale, lower, upper);
    return store_box(tree, index, (vec4){lower[0], lower[1], lower[2], 0}, (vec4){upper[0], upper[1], upper[2], 0});
}

/* Returns how many nodes' boxes the tree's grid does not hold. */
static int64_t run_bounds(const sweep *s, int64_t first, int64_t end)
{
    const mmbvh *tree = s->tree;
    int64_t misfits = 0;
    for (int64_t i = end - 1; i >= first; i--) {
        const int count = mmbvh_node_count(tree, i);
        const int64_t ref = mmbvh_node_ref(tree, i);
        misfits += !(count ? store_cells(tree, s->source, i, ref, count) : store_union(tree, i, ref));
    }
    return misfits;
}

sweep sweep_of_bounds(const mmbvh *tree, const bounds_source *source)
{
    sweep s = {.tree = tree, .source = source, .run = run_bounds};
    sweep_bounds_as_floats(&s);
    return s;
}

/* Finds the bounds of all the tree's cells, in the source's coordinates. */
static fetch_box exact_bounds(const mmbvh *tree, const bounds_source *source, int threads)
{
    fetch_box all;
    fetch_box_empty(&all);
#pragma omp parallel num_threads(threads)
    {
        fetch_box own;
        fetch_box_empty(&own);
#pragma omp for schedule(static)
        for (int64_t begin = 0; begin < tree->cell_count; begin += BOUNDS_BLOCK) {
            const int64_t left = tree->cell_count - begin;
            const int count = (int)(left < BOUNDS_BLOCK ? left : BOUNDS_BLOCK);
            source->unite(source, tree->cells + begin, count, NULL, &own);
        }
#pragma omp critical(mmbvh_merge)
        fetch_box_unite(&all, &own);
    }
    return all;
}

/* The mesh has left the tree's grid: a new one, with room for as much again of the same. */
static insitu_status sweep_new_grid(mmbvh *tree, const sweep *s, int threads)
{
    const fetch_box exact = exact_bounds(tree, s->source, threads);
    float lower[3], upper[3];
    fetch_box_round(&exact, tree->origin, tree->scale, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        const float margin = 0.125f * (upper[axis] - lower[axis]);
        if (!(margin < INFINITY)) return INSITU_ERROR_MESH;
        lower[axis] -= margin;
        upper[axis] += margin;
    }
    tree->grid = store_grid(lower, upper);
    return sweep_tree(s, threads) ? INSITU_ERROR_MESH : INSITU_OK;
}

/* A mesh that has shrunk leaves most of its grid's steps unused. */
static bool is_grid_wasted(const mmbvh *tree)
{
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        const float steps = (upper[axis] - lower[axis]) / tree->grid.step[axis];
        const float far = fmaxf(fabsf(lower[axis]), fabsf(upper[axis]));
        if (steps < (float)(COMPACT_LOWER_MAX / 8) && tree->grid.step[axis] > far * 0x1p-20f) return true;
    }
    return false;
}

insitu_status mmbvh_refit_bounds(mmbvh *tree, const grid *g, const mmbvh_options *options)
{
    if (!tree || !g) return INSITU_ERROR_ARGUMENT;
    const int threads = sweep_threads(options);
    const bounds_source source = bounds_source_make(g, NULL, NULL, g->cell_count, tree->origin, tree->scale);
    const sweep s = sweep_of_bounds(tree, &source);
    const int64_t misfits = sweep_tree(&s, threads);
    if (!tree->compact || !tree->node_count) return INSITU_OK;
    return misfits || is_grid_wasted(tree) ? sweep_new_grid(tree, &s, threads) : INSITU_OK;
}
