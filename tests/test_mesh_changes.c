/* Functions that change meshes: round, mirror, renumber, reorder and transform them. */
#include "test_mesh_make.h"

#include <stdlib.h>
#include <string.h>

void test_mesh_round_to_float(test_mesh *mesh)
{
    for (int64_t i = 0; i < 3 * mesh->vertex_count; i++) mesh->coordinates[i] = (double)(float)mesh->coordinates[i];
    for (int64_t i = 0; i < mesh->vertex_count; i++) mesh->values[i] = (double)(float)mesh->values[i];
}

/* Symmetries of a cell type as permutations of its vertices. They generate all symmetries of the type, and the first is
 * a mirror image. */
typedef struct symmetry {
    int count;
    int order[3][8];
} symmetry;

static const symmetry *get_symmetries(int type)
{
    static const symmetry tet = {2, {{1, 0, 2, 3}, {1, 2, 3, 0}}};
    static const symmetry hex = {3, {{4, 5, 6, 7, 0, 1, 2, 3}, {1, 2, 3, 0, 5, 6, 7, 4}, {0, 4, 5, 1, 3, 7, 6, 2}}};
    static const symmetry wedge = {3, {{3, 4, 5, 0, 1, 2}, {1, 2, 0, 4, 5, 3}, {1, 0, 2, 4, 3, 5}}};
    static const symmetry pyramid = {2, {{1, 0, 3, 2, 4}, {1, 2, 3, 0, 4}}};
    return type == GRID_TET ? &tet : type == GRID_HEX ? &hex : type == GRID_WEDGE ? &wedge : &pyramid;
}

static void reorder_vertices(test_mesh *mesh, int64_t cell, const int *order)
{
    int64_t *v = mesh->connectivity + mesh->offsets[cell], old[8];
    const int count = grid_type_vertex_count(mesh->types[cell]);
    memcpy(old, v, (size_t)count * sizeof *v);
    for (int i = 0; i < count; i++) v[i] = old[order[i]];
}

void test_mesh_mirror_cells(test_mesh *mesh, bool every_second)
{
    for (int64_t cell = 0; cell < mesh->cell_count; cell++)
        if (mesh->types[cell] != GRID_POLYHEDRON && (!every_second || test_hash((uint64_t)cell, 4) & 1))
            reorder_vertices(mesh, cell, get_symmetries(mesh->types[cell])->order[0]);
}

/* Returns a random permutation of 0 to count - 1. */
static int64_t *make_permutation(int64_t count, uint64_t seed)
{
    int64_t *order = test_allocate(count, sizeof *order);
    for (int64_t i = 0; i < count; i++) {
        const int64_t j = (int64_t)(test_hash((uint64_t)i, seed) % (uint64_t)(i + 1));
        order[i] = order[j];
        order[j] = i;
    }
    return order;
}

/* Adds the faces of the old mesh to the new one in another order and with renumbered vertices. Returns the new index of
 * each face. */
static int64_t *shuffle_faces(const test_mesh *old, const int64_t *vertex_to, uint64_t seed, test_mesh *mesh)
{
    int64_t *face_from = make_permutation(old->face_count, seed),
            *face_to = test_allocate(old->face_count, sizeof *face_to);
    if (old->face_count) test_mesh_allocate_faces(mesh, old->face_count, old->face_connectivity_count);
    for (int64_t i = 0; i < old->face_count; i++) {
        const int64_t from = face_from[i], first = mesh->face_connectivity_count;
        const int64_t count = old->face_offsets[from + 1] - old->face_offsets[from];
        face_to[from] = test_mesh_add_face(mesh, old->face_connectivity + old->face_offsets[from], count);
        for (int64_t j = first; j < first + count; j++)
            mesh->face_connectivity[j] = vertex_to[mesh->face_connectivity[j]];
    }
    free(face_from);
    return face_to;
}

void test_mesh_shuffle_cells(test_mesh *mesh, uint64_t seed)
{
    int64_t *vertex_to = make_permutation(mesh->vertex_count, seed),
            *cell_from = make_permutation(mesh->cell_count, seed + 1);
    test_mesh old = *mesh;
    test_mesh_allocate(mesh, old.vertex_count, old.cell_count, old.connectivity_count);
    mesh->vertex_count = old.vertex_count;
    for (int64_t i = 0; i < old.vertex_count; i++) {
        memcpy(mesh->coordinates + 3 * vertex_to[i], old.coordinates + 3 * i, 3 * sizeof(double));
        mesh->values[vertex_to[i]] = old.values[i];
    }
    int64_t *face_to = shuffle_faces(&old, vertex_to, seed + 2, mesh);
    for (int64_t i = 0; i < old.cell_count; i++) {
        const int64_t from = cell_from[i], *v = old.connectivity + old.offsets[from];
        int64_t renumbered[8];
        if (old.types[from] == GRID_POLYHEDRON) {
            const int64_t first = mesh->connectivity_count, count = old.offsets[from + 1] - old.offsets[from];
            mesh->ghosts[i] = old.ghosts[from];
            test_mesh_add_polyhedron(mesh, v, count);
            for (int64_t j = first; j < first + count; j++) mesh->connectivity[j] = face_to[mesh->connectivity[j]];
            continue;
        }
        for (int j = 0; j < grid_type_vertex_count(old.types[from]); j++) renumbered[j] = vertex_to[v[j]];
        mesh->ghosts[i] = old.ghosts[from];
        test_mesh_add_cell(mesh, old.types[from], renumbered, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    }
    test_mesh_free(&old);
    free(vertex_to);
    free(cell_from);
    free(face_to);
}

static void swap_indices(int64_t *a, int64_t *b)
{
    const int64_t old = *a;
    *a = *b;
    *b = old;
}

static void reverse_items(int64_t *items, int64_t count)
{
    for (int64_t i = 0; i < count / 2; i++) swap_indices(&items[i], &items[count - 1 - i]);
}

/* Rotates a cyclic list by a random number of entries. Depending on the seed, also reverses it. */
static void rotate_loop(int64_t *items, int64_t count, uint64_t seed)
{
    const int64_t by = (int64_t)(test_hash(1, seed) % (uint64_t)count);
    reverse_items(items, by);
    reverse_items(items + by, count - by);
    if (test_hash(2, seed) & 1) reverse_items(items, count);
}

void test_mesh_reorder_vertices(test_mesh *mesh, uint64_t seed)
{
    for (int64_t i = 0; i < mesh->face_count; i++)
        rotate_loop(mesh->face_connectivity + mesh->face_offsets[i], mesh->face_offsets[i + 1] - mesh->face_offsets[i],
                    test_hash((uint64_t)i, seed));
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        if (mesh->types[i] == GRID_POLYHEDRON) {
            int64_t *faces = mesh->connectivity + mesh->offsets[i];
            for (int64_t k = mesh->offsets[i + 1] - mesh->offsets[i] - 1; k > 0; k--)
                swap_indices(&faces[k], &faces[test_hash((uint64_t)(64 * i + k), seed) % (uint64_t)(k + 1)]);
            continue;
        }
        const symmetry *s = get_symmetries(mesh->types[i]);
        for (uint64_t turn = 0; turn < 12; turn++)
            reorder_vertices(mesh, i, s->order[test_hash((uint64_t)i * 16 + turn, seed) % (uint64_t)s->count]);
    }
}

void test_mesh_transform(test_mesh *mesh, double scale, const double offset[3])
{
    for (int64_t i = 0; i < mesh->vertex_count; i++)
        for (int axis = 0; axis < 3; axis++)
            mesh->coordinates[3 * i + axis] = mesh->coordinates[3 * i + axis] * scale + offset[axis];
}
