/* Finds the neighbour across each face. Every face of an own cell must either lie on a wall of the box, or belong to
 * exactly one other cell too. A hash table stores the first cell that has a face; the key is the face's vertex ids.
 * When a second cell with the face is found, the two cells become neighbours. The entry remains and is marked, so that
 * a third cell with the face is counted as an error (wave_mesh.unmatched). */
#include "wave_faces.h"

#include <stdlib.h>

typedef struct face_entry {
    uint64_t hash;
    int32_t cell; /* cell that has the face; -1 if the entry is free */
    int8_t face, is_matched;
} face_entry;

typedef struct face_table {
    const wave_mesh *mesh;
    face_entry *entries;
    int64_t mask;
} face_table;

/* Computes the key of a face: its vertex ids in ascending order, with -1 in front for a triangle. */
static void face_key(const wave_mesh *mesh, int32_t cell, int face, int64_t key[4])
{
    int32_t v[8];
    const wave_cell_shape *shape = wave_mesh_cell(mesh, cell, v);
    key[0] = -1;
    for (int i = 0, n = 4 - shape->face_size[face]; i < shape->face_size[face]; ++i, ++n) {
        int64_t id = mesh->vertex_ids[v[shape->face[face][i]]];
        int at = n;
        for (; at > 4 - shape->face_size[face] && key[at - 1] > id; --at) key[at] = key[at - 1];
        key[at] = id;
    }
}

static uint64_t hash_face_key(const int64_t key[4])
{
    uint64_t h = 0;
    for (int i = 0; i < 4; ++i) h = wave_hash(h ^ (uint64_t)key[i]);
    return h;
}

static bool has_face_key(const face_table *table, const face_entry *entry, const int64_t key[4])
{
    int64_t other[4];
    face_key(table->mesh, entry->cell, entry->face, other);
    for (int i = 0; i < 4; ++i) {
        if (key[i] != other[i]) return false;
    }
    return true;
}

/* Returns the entry with this key, or the free entry in which to store it. */
static face_entry *find_entry(const face_table *table, const int64_t key[4], uint64_t hash)
{
    for (int64_t at = (int64_t)hash & table->mask;; at = (at + 1) & table->mask) {
        face_entry *e = &table->entries[at];
        if (e->cell < 0 || (e->hash == hash && has_face_key(table, e, key))) return e;
    }
}

/* Checks whether all vertices of the face lie on the same wall of the box. */
static bool is_on_wall(const wave_mesh *mesh, int32_t cell, int face)
{
    const wave_lattice *lattice = &mesh->partition.lattice;
    int32_t v[8];
    const wave_cell_shape *shape = wave_mesh_cell(mesh, cell, v);
    unsigned low = 7, high = 7;
    for (int i = 0; i < shape->face_size[face]; ++i) {
        int ijk[3];
        if (!wave_lattice_find_vertex_indices(lattice, mesh->vertex_ids[v[shape->face[face][i]]], ijk)) return false;
        for (int a = 0; a < 3; ++a) {
            if (ijk[a] != 0) low &= ~(1u << a);
            if (ijk[a] != lattice->size[a]) high &= ~(1u << a);
        }
    }
    return (low | high) != 0;
}

static void set_neighbours(wave_mesh *mesh, int32_t a, int face_a, int32_t b, int face_b)
{
    if (a < mesh->own_cells) mesh->neighbours[wave_mesh_first_face(mesh, a) + face_a] = b;
    if (b < mesh->own_cells) mesh->neighbours[wave_mesh_first_face(mesh, b) + face_b] = a;
}

static void match_faces(wave_mesh *mesh, face_table *table, int32_t cell)
{
    int64_t key[4];
    int faces = wave_cell_shape_of(wave_mesh_type(mesh, cell))->face_count;
    for (int f = 0; f < faces; ++f) {
        face_key(mesh, cell, f, key);
        uint64_t hash = hash_face_key(key);
        face_entry *e = find_entry(table, key, hash);
        if (e->cell < 0) {
            /* Only faces of own cells are stored; own cells precede halo cells. */
            if (cell < mesh->own_cells) *e = (face_entry){hash, cell, (int8_t)f, 0};
        } else if (e->is_matched++) {
            mesh->unmatched++;
        } else {
            set_neighbours(mesh, e->cell, e->face, cell, f);
        }
    }
}

static void count_unmatched(wave_mesh *mesh)
{
    for (int32_t c = 0; c < mesh->own_cells; ++c) {
        int64_t first = wave_mesh_first_face(mesh, c);
        int faces = wave_cell_shape_of(wave_mesh_type(mesh, c))->face_count;
        for (int f = 0; f < faces; ++f) {
            /* A face must have a neighbour if and only if it is not on a wall. */
            mesh->unmatched += (mesh->neighbours[first + f] < 0) != is_on_wall(mesh, c, f);
        }
    }
}

static bool make_face_offsets(wave_mesh *mesh)
{
    if (mesh->uniform_type) {
        mesh->face_count = (int64_t)mesh->own_cells * wave_cell_shape_of(mesh->uniform_type)->face_count;
        return true;
    }
    mesh->face_offsets = calloc((size_t)mesh->own_cells + 1, sizeof *mesh->face_offsets);
    if (!mesh->face_offsets) return false;
    for (int32_t c = 0; c < mesh->own_cells; ++c) {
        mesh->face_offsets[c] = mesh->face_count;
        mesh->face_count += wave_cell_shape_of(mesh->types[c])->face_count;
    }
    mesh->face_offsets[mesh->own_cells] = mesh->face_count;
    return true;
}

bool wave_faces_find_neighbours(wave_mesh *mesh)
{
    int64_t capacity = 64;
    if (!make_face_offsets(mesh)) return false;
    while (capacity < mesh->face_count * 5 / 4) capacity *= 2;
    face_table table = {.mesh = mesh, .mask = capacity - 1};
    mesh->neighbours = malloc(((size_t)mesh->face_count + 1) * sizeof *mesh->neighbours);
    table.entries = malloc((size_t)capacity * sizeof *table.entries);
    if (!mesh->neighbours || !table.entries) {
        free(table.entries);
        return false;
    }
    for (int64_t i = 0; i < mesh->face_count; ++i) mesh->neighbours[i] = -1;
    for (int64_t i = 0; i < capacity; ++i) table.entries[i].cell = -1;
    for (int32_t c = 0; c < mesh->cells; ++c) match_faces(mesh, &table, c);
    free(table.entries);
    count_unmatched(mesh);
    return true;
}
