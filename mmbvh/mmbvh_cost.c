/* A ray that meets a convex box meets one within it with the probability of their surface areas' ratio. */
#include "mmbvh_cost.h"

#include "mmbvh_sweep.h"

/* Sums are of fixed parts of the nodes, so that no number of threads changes a bit. */
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

/* Sums the tests that a ray makes in each node it meets, weighted by the chance that it meets the node. */
static double cost_of_nodes(const mmbvh *tree, int64_t begin, int64_t end, double root_area)
{
    double sum = 0;
    for (int64_t i = begin; i < end; i++) {
        float lower[4], upper[4];
        mmbvh_node_box(tree, i, lower, upper);
        const double area = root_area > 0 ? cost_half_area(lower, upper) / root_area : 1;
        const int count = mmbvh_node_count(tree, i);
        sum += area * (count ? (double)count : 2.0);
    }
    return sum;
}

double cost_of_tree(const mmbvh *tree, int threads)
{
    if (!tree->node_count) return 0;
    float lower[4], upper[4];
    mmbvh_node_box(tree, 0, lower, upper);
    const double root_area = cost_half_area(lower, upper);
    double sums[PARTS];
#pragma omp parallel for num_threads(threads) schedule(dynamic)
    for (int part = 0; part < PARTS; part++) {
        const int64_t begin = tree->node_count * part / PARTS, end = tree->node_count * (part + 1) / PARTS;
        sums[part] = cost_of_nodes(tree, begin, end, root_area);
    }
    double cost = 1; /* the root's own box */
    for (int part = 0; part < PARTS; part++) cost += sums[part];
    return cost;
}

double mmbvh_cost(const mmbvh *tree, const mmbvh_options *options)
{
    return cost_of_tree(tree, sweep_threads(options));
}
