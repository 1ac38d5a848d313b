/* A mesh as Voronoi's: polyhedra with faces of four, five and six vertices. */
#ifndef TEST_MESH_HONEYCOMB_H
#define TEST_MESH_HONEYCOMB_H

#include "test_meshes.h"

/* The cube [-1, 1]^3 as n layers of n rows of hexagonal prisms, halved in every second row at the hull. Inner vertices
 * are moved by up to jitter of the distance between layers along each axis. */
void test_mesh_honeycomb(int n, double jitter, test_function *f, test_mesh *out);

#endif
