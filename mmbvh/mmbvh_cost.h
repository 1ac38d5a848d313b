/* The surface area heuristic's cost of a finished tree. */
#ifndef MMBVH_COST_H
#define MMBVH_COST_H

#include "mmbvh.h"

/* Half the surface area of a node's box; 0 for an empty one. */
double cost_half_area(const float lower[3], const float upper[3]);

/* Computes mmbvh.area, the sum of boxes times tests in them, to the same bits for any number of threads. */
double cost_area_of_tree(const mmbvh *tree, int threads);

/* mmbvh_cost() of a tree of that area. */
double cost_of_area(const mmbvh *tree, double area);

#endif
