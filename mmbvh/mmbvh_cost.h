/* Computes the cost of a finished tree by the surface area heuristic (SAH). */
#ifndef MMBVH_COST_H
#define MMBVH_COST_H

#include "mmbvh.h"

/* Returns half the surface area of a node's box, or 0 if the box is empty. */
double cost_half_area(const float lower[3], const float upper[3]);

/* Computes the value of mmbvh.area, which mmbvh.h defines, for the whole tree. The rounding does not depend on the
 * number of threads. */
double compute_area_sum_of_tree(const mmbvh *tree, int threads);

/* Returns the tree's SAH cost (mmbvh_cost()), given the value of compute_area_sum_of_tree(). */
double compute_cost_from_area_sum(const mmbvh *tree, double area);

#endif
