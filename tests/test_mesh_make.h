/* Functions for generators of test meshes. They fill the arrays of a test_mesh; these arrays must be large enough. */
#ifndef TEST_MESH_MAKE_H
#define TEST_MESH_MAKE_H

#include <stddef.h>

#include "test_meshes.h"

/* Allocates zeroed memory. Ends the process if memory runs out. */
void *test_allocate(int64_t count, size_t size);

/* Returns a hash of an index and a seed. It is the same on every machine. */
uint64_t test_hash(uint64_t index, uint64_t seed);

/* Allocate the arrays of an empty mesh for the given numbers of elements. The arrays of faces have their own function,
 * because few meshes have faces. */
void test_mesh_allocate(test_mesh *mesh, int64_t vertices, int64_t cells, int64_t connectivity);
void test_mesh_allocate_faces(test_mesh *mesh, int64_t faces, int64_t entries);

/* Each of the following functions adds one element. Those for vertices and faces return its index. */
int64_t test_mesh_add_vertex(test_mesh *mesh, const double p[3]);
int64_t test_mesh_add_face(test_mesh *mesh, const int64_t *vertices, int64_t count);

void test_mesh_add_polyhedron(test_mesh *mesh, const int64_t *faces, int64_t count);

/* Adds a cell. picks: for each vertex of the cell its index in `vertices`. */
void test_mesh_add_cell(test_mesh *mesh, int type, const int64_t *vertices, const int *picks);

/* Adds a cube as a hex (TEST_HEXES), two wedges (TEST_WEDGES), or six tets (all other kinds). Corners are numbered by
 * bits: bit 0: +x, bit 1: +y, bit 2: +z. */
void test_mesh_add_cube(test_mesh *mesh, test_mesh_kind kind, const int64_t *corners);

/* The faces of a cell type. count: number of faces; vertices: local indices; the fourth is -1 for a triangle. */
typedef struct test_faces {
    int count;
    int vertices[6][4];
} test_faces;

const test_faces *test_get_cell_faces(int type);

/* Joins the tets of a mesh into polyhedra that consist of up to six tets. */
void test_mesh_merge_tets(test_mesh *mesh);

#endif
