/* Assigns cells to ranks, and extracts the part of a rank from a mesh. */
#include "test_mesh_make.h"

#include <math.h>
#include <stdlib.h>

const char *test_partition_kind_name(test_partition_kind kind)
{
    static const char *const names[TEST_PARTITION_COUNT] = {"block", "random", "checkerboard"};
    return names[kind];
}

static int choose_owner(test_partition_kind kind, const double centre[3], int64_t cell, int n, int ranks)
{
    if (kind == TEST_RANDOM) return (int)(test_hash((uint64_t)cell, 5) % (uint64_t)ranks);
    const int cuts = kind == TEST_BLOCK ? ranks : n;
    int place[3];
    for (int axis = 0; axis < 3; axis++) {
        const int slab = (int)floor((centre[axis] + 1) / 2 * cuts);
        place[axis] = slab < 0 ? 0 : slab >= cuts ? cuts - 1 : slab;
    }
    return kind == TEST_BLOCK ? place[0] : (place[0] + place[1] + place[2]) % ranks;
}

void test_partition_cells(const test_mesh *mesh, test_partition_kind kind, int n, int ranks, int *owners)
{
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        double centre[3] = {0, 0, 0};
        int64_t count = 0;
        for (int64_t i = mesh->offsets[cell]; i < mesh->offsets[cell + 1]; i++) {
            const int64_t entry = mesh->connectivity[i], *loop = &mesh->connectivity[i];
            int64_t loop_count = 1;
            if (mesh->types[cell] == GRID_POLYHEDRON) {
                loop = mesh->face_connectivity + mesh->face_offsets[entry];
                loop_count = mesh->face_offsets[entry + 1] - mesh->face_offsets[entry];
            }
            count += loop_count;
            for (int64_t j = 0; j < loop_count; j++)
                for (int axis = 0; axis < 3; axis++) centre[axis] += mesh->coordinates[3 * loop[j] + axis];
        }
        for (int axis = 0; axis < 3; axis++) centre[axis] /= (double)count;
        owners[cell] = choose_owner(kind, centre, cell, n, ranks);
    }
}

/* Returns the index of a vertex in the part. A vertex is added to the part when it is used for the first time. */
static int64_t find_or_add_part_vertex(const test_mesh *mesh, int64_t *local, int64_t v, test_mesh *out)
{
    if (local[v] >= 0) return local[v];
    local[v] = test_mesh_add_vertex(out, mesh->coordinates + 3 * v);
    out->values[local[v]] = mesh->values[v];
    return local[v];
}

static void copy_polyhedron_to_part(const test_mesh *mesh, int64_t *local, int64_t *local_face, int64_t cell,
                                    test_mesh *out)
{
    const int64_t first = out->connectivity_count, count = mesh->offsets[cell + 1] - mesh->offsets[cell];
    test_mesh_add_polyhedron(out, mesh->connectivity + mesh->offsets[cell], count);
    for (int64_t i = first; i < first + count; i++) {
        const int64_t face = out->connectivity[i], begin = mesh->face_offsets[face];
        if (local_face[face] < 0) {
            const int64_t at = out->face_connectivity_count, size = mesh->face_offsets[face + 1] - begin;
            local_face[face] = test_mesh_add_face(out, mesh->face_connectivity + begin, size);
            for (int64_t j = at; j < at + size; j++)
                out->face_connectivity[j] = find_or_add_part_vertex(mesh, local, out->face_connectivity[j], out);
        }
        out->connectivity[i] = local_face[face];
    }
}

void test_mesh_extract_part(const test_mesh *mesh, const int *owners, int rank, test_mesh *out)
{
    int64_t *local = test_allocate(mesh->vertex_count, sizeof *local);
    int64_t *local_face = test_allocate(mesh->face_count, sizeof *local_face);
    for (int64_t i = 0; i < mesh->vertex_count; i++) local[i] = -1;
    for (int64_t i = 0; i < mesh->face_count; i++) local_face[i] = -1;
    test_mesh_allocate(out, mesh->vertex_count, mesh->cell_count, mesh->connectivity_count);
    if (mesh->face_count) test_mesh_allocate_faces(out, mesh->face_count, mesh->face_connectivity_count);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        if (owners[cell] != rank) continue;
        int64_t vertices[8];
        out->ghosts[out->cell_count] = mesh->ghosts[cell];
        if (mesh->types[cell] == GRID_POLYHEDRON) {
            copy_polyhedron_to_part(mesh, local, local_face, cell, out);
            continue;
        }
        for (int i = 0; i < grid_type_vertex_count(mesh->types[cell]); i++)
            vertices[i] = find_or_add_part_vertex(mesh, local, mesh->connectivity[mesh->offsets[cell] + i], out);
        test_mesh_add_cell(out, mesh->types[cell], vertices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    }
    free(local);
    free(local_face);
}
