/* A mesh similar to a Voronoi diagram: polyhedra whose faces have four, five and six vertices. */
#ifndef TEST_MESH_HONEYCOMB_H
#define TEST_MESH_HONEYCOMB_H

#include "test_meshes.h"

/* Divides the cube [-1, 1]^3 into n layers with n rows of hexagonal prisms. Every second row has half prisms at the
 * hull. Inner vertices are moved along each axis by up to jitter times the distance between layers. */
void test_mesh_make_honeycomb(int n, double jitter, test_function *f, test_mesh *out);

#endif
