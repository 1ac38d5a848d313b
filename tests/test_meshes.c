/* Basic functions of test meshes: random numbers, fields, allocation, and adding of elements. */
#include "test_mesh_make.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void *test_allocate(int64_t count, size_t size)
{
    void *p = calloc((size_t)(count > 0 ? count : 1), size);
    if (!p) {
        fprintf(stderr, "test_meshes: out of memory\n");
        exit(1);
    }
    return p;
}

static uint64_t mix_bits(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

uint64_t test_hash(uint64_t index, uint64_t seed)
{
    return mix_bits(index ^ mix_bits(seed));
}

double test_uniform(uint64_t index, uint64_t seed)
{
    return (double)(test_hash(index, seed) >> 11) * 0x1p-53;
}

double test_uniform_between(uint64_t index, uint64_t seed, double low, double high)
{
    return low + (high - low) * test_uniform(index, seed);
}

double test_wave_field(const double p[3])
{
    return sin(6 * p[0]) * cos(6 * p[1]) + sin(6 * p[1]) * cos(6 * p[2]) + sin(6 * p[2]) * cos(6 * p[0]);
}

double test_linear_field(const double p[3])
{
    return 0.3 * p[0] - 0.7 * p[1] + 0.5 * p[2] + 0.1;
}

void test_mesh_allocate(test_mesh *mesh, int64_t vertices, int64_t cells, int64_t connectivity)
{
    memset(mesh, 0, sizeof *mesh);
    mesh->coordinates = test_allocate(3 * vertices, sizeof(double));
    mesh->values = test_allocate(vertices, sizeof(double));
    mesh->offsets = test_allocate(cells + 1, sizeof(int64_t));
    mesh->connectivity = test_allocate(connectivity, sizeof(int64_t));
    mesh->types = test_allocate(cells, 1);
    mesh->ghosts = test_allocate(cells, 1);
}

void test_mesh_free(test_mesh *mesh)
{
    free(mesh->coordinates);
    free(mesh->values);
    free(mesh->offsets);
    free(mesh->connectivity);
    free(mesh->types);
    free(mesh->ghosts);
    free(mesh->face_offsets);
    free(mesh->face_connectivity);
    memset(mesh, 0, sizeof *mesh);
}

int64_t test_mesh_add_vertex(test_mesh *mesh, const double p[3])
{
    memcpy(mesh->coordinates + 3 * mesh->vertex_count, p, 3 * sizeof(double));
    return mesh->vertex_count++;
}

void test_mesh_allocate_faces(test_mesh *mesh, int64_t faces, int64_t entries)
{
    mesh->face_offsets = test_allocate(faces + 1, sizeof(int64_t));
    mesh->face_connectivity = test_allocate(entries, sizeof(int64_t));
}

int64_t test_mesh_add_face(test_mesh *mesh, const int64_t *vertices, int64_t count)
{
    memcpy(mesh->face_connectivity + mesh->face_connectivity_count, vertices, (size_t)count * sizeof *vertices);
    mesh->face_connectivity_count += count;
    mesh->face_offsets[++mesh->face_count] = mesh->face_connectivity_count;
    return mesh->face_count - 1;
}

void test_mesh_add_polyhedron(test_mesh *mesh, const int64_t *faces, int64_t count)
{
    memcpy(mesh->connectivity + mesh->connectivity_count, faces, (size_t)count * sizeof *faces);
    mesh->connectivity_count += count;
    mesh->types[mesh->cell_count++] = GRID_POLYHEDRON;
    mesh->offsets[mesh->cell_count] = mesh->connectivity_count;
}

void test_mesh_add_cell(test_mesh *mesh, int type, const int64_t *vertices, const int *picks)
{
    const int count = grid_type_vertex_count(type);
    for (int i = 0; i < count; i++) mesh->connectivity[mesh->connectivity_count++] = vertices[picks[i]];
    mesh->types[mesh->cell_count++] = (unsigned char)type;
    mesh->offsets[mesh->cell_count] = mesh->connectivity_count;
}

void test_mesh_set_values(test_mesh *mesh, test_function *f)
{
    for (int64_t i = 0; i < mesh->vertex_count; i++) mesh->values[i] = f(mesh->coordinates + 3 * i);
}
