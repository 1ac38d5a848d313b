/* Functions for the makers of test meshes: they fill the arrays of a test_mesh, which must have room. */
#ifndef TEST_MESH_MAKE_H
#define TEST_MESH_MAKE_H

#include <stddef.h>

#include "test_meshes.h"

/* Zeroed; running out of memory ends the process. */
void *test_allocate(int64_t count, size_t size);

/* A hash of an index and a seed, the same on every machine. */
uint64_t test_hash(uint64_t index, uint64_t seed);

/* Room for so many of each; the mesh has none yet. Faces apart, for few meshes have any. */
void test_mesh_allocate(test_mesh *mesh, int64_t vertices, int64_t cells, int64_t connectivity);
void test_mesh_allocate_faces(test_mesh *mesh, int64_t faces, int64_t entries);

/* These return the number of the new vertex, face or cell. */
int64_t test_mesh_add_vertex(test_mesh *mesh, const double p[3]);
int64_t test_mesh_add_face(test_mesh *mesh, const int64_t *vertices, int64_t count);

void test_mesh_add_polyhedron(test_mesh *mesh, const int64_t *faces, int64_t count);

/* A cell of some of the given vertices, picked by local indices. */
void test_mesh_add_cell(test_mesh *mesh, int type, const int64_t *vertices, const int *picks);

/* A cube as a hex, two wedges, or six tets for any other kind. Corners by bits: bit 0: +x, bit 1: +y, bit 2: +z. */
void test_mesh_add_cube(test_mesh *mesh, test_mesh_kind kind, const int64_t *corners);

/* The faces of a cell: how many, and their vertices, -1 behind a triangle's. */
typedef struct test_faces {
    int count;
    int vertices[6][4];
} test_faces;

const test_faces *test_faces_of(int type);

/* A mesh of tets to polyhedra of up to six of them. */
void test_mesh_grow_together(test_mesh *mesh);

#endif
