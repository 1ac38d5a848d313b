/* Computes the cost of the surface area heuristic: a ray that hits a convex box also hits a box inside it with a
 * probability equal to the ratio of their surface areas. */
#include "mmbvh_cost.h"

#include "mmbvh_sweep.h"
#include "region.h"

/* The sum over the nodes is divided into a fixed number of parts, so that its rounding does not depend on the number of
 * threads. */
enum { PARTS = 64 };

double cost_half_area(const float lower[3], const float upper[3])
{
    double d[3];
    for (int axis = 0; axis < 3; axis++) {
        d[axis] = (double)upper[axis] - (double)lower[axis];
        if (!(d[axis] >= 0)) return 0;
    }
    return d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
}

/* Returns the sum over nodes [begin, end) of half the surface area of the node's box times the number of boxes and
 * cells that a ray tests after it has hit this box: a leaf's cells, or the boxes of the two children. */
static double sum_areas_of_nodes(const mmbvh *tree, int64_t begin, int64_t end)
{
    double sum = 0;
    for (int64_t i = begin; i < end; i++) {
        float lower[4], upper[4];
        mmbvh_node_box(tree, i, lower, upper);
        const int count = mmbvh_node_count(tree, i);
        sum += cost_half_area(lower, upper) * (count ? (double)count : 2.0);
    }
    return sum;
}

double compute_area_sum_of_tree(const mmbvh *tree, int threads)
{
    double sums[PARTS], area = 0;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int part = 0; part < PARTS; part++) {
            const int64_t begin = tree->node_count * part / PARTS, end = tree->node_count * (part + 1) / PARTS;
            sums[part] = sum_areas_of_nodes(tree, begin, end);
        }
        region_leave();
    }
    for (int part = 0; part < PARTS; part++) area += sums[part];
    return area;
}

/* If the root's surface area is 0, no probability can be computed from areas. The cost is then that of a ray that hits
 * every node. */
double compute_cost_from_area_sum(const mmbvh *tree, double area)
{
    if (!tree->node_count) return 0;
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    const double root_area = cost_half_area(lower, upper);
    /* the added 1 is the test of the root's box, which area does not include */
    if (root_area > 0) return 1 + area / root_area;
    double tests = 0;
    for (int64_t i = 0; i < tree->node_count; i++) {
        const int count = mmbvh_node_count(tree, i);
        tests += count ? (double)count : 2.0;
    }
    return 1 + tests;
}

double mmbvh_cost(const mmbvh *tree, const mmbvh_options *options)
{
    return compute_cost_from_area_sum(tree, compute_area_sum_of_tree(tree, sweep_threads(options)));
}
