/* Makes polyhedra from other cells. Neighbouring polyhedra share faces. */
#include "test_mesh_make.h"

#include <stdlib.h>
#include <string.h>

const test_faces *test_get_cell_faces(int type)
{
    static const test_faces tet = {4, {{0, 1, 2, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {0, 2, 3, -1}}};
    static const test_faces hex = {
        6, {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};
    static const test_faces wedge = {5, {{0, 1, 2, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}};
    static const test_faces pyramid = {5, {{0, 1, 2, 3}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}};
    return type == GRID_TET ? &tet : type == GRID_HEX ? &hex : type == GRID_WEDGE ? &wedge : &pyramid;
}

/* A hash table of faces, found by their vertices in any order. Each face is added one time. */
typedef struct face_table {
    test_mesh *mesh;
    int64_t size;
    int64_t (*keys)[4]; /* sorted vertices of the face; the first is -1 if the slot is empty */
    int64_t *faces;
    int64_t (*cells)[2];
} face_table;

static void face_table_open(face_table *t, test_mesh *mesh, int64_t faces)
{
    *t = (face_table){.mesh = mesh, .size = 2 * faces + 1};
    t->keys = test_allocate(t->size, sizeof *t->keys);
    t->faces = test_allocate(t->size, sizeof *t->faces);
    t->cells = test_allocate(t->size, sizeof *t->cells);
    for (int64_t i = 0; i < t->size; i++) t->keys[i][0] = t->cells[i][0] = t->cells[i][1] = -1;
}

static void face_table_free(face_table *t)
{
    free(t->keys);
    free(t->faces);
    free(t->cells);
}

/* Finds or adds a cell's face in the table and records the cell there. Returns the slot. */
static int64_t face_table_find(face_table *t, const int64_t *vertices, int count, int64_t cell)
{
    int64_t key[4] = {INT64_MAX, INT64_MAX, INT64_MAX, INT64_MAX};
    for (int i = 0; i < count; i++) {
        int at = i;
        for (; at > 0 && key[at - 1] > vertices[i]; at--) key[at] = key[at - 1];
        key[at] = vertices[i];
    }
    int64_t at =
        (int64_t)(test_hash((uint64_t)key[0], test_hash((uint64_t)key[1], (uint64_t)key[2])) % (uint64_t)t->size);
    while (t->keys[at][0] >= 0 && memcmp(t->keys[at], key, sizeof key)) at = (at + 1) % t->size;
    if (t->keys[at][0] < 0) {
        memcpy(t->keys[at], key, sizeof key);
        t->faces[at] = t->mesh ? test_mesh_add_face(t->mesh, vertices, count) : -1;
    }
    t->cells[at][t->cells[at][0] >= 0] = cell;
    return at;
}

static int64_t find_or_add_cell_face(face_table *t, const test_mesh *mesh, int64_t cell, int face)
{
    const int *picks = test_get_cell_faces(mesh->types[cell])->vertices[face];
    const int count = picks[3] < 0 ? 3 : 4;
    int64_t vertices[4];
    for (int i = 0; i < count; i++) vertices[i] = mesh->connectivity[mesh->offsets[cell] + picks[i]];
    return face_table_find(t, vertices, count, cell);
}

void test_mesh_to_polyhedra(test_mesh *mesh, double share)
{
    test_mesh old = *mesh;
    face_table table;
    test_mesh_allocate(mesh, old.vertex_count, old.cell_count, old.connectivity_count);
    test_mesh_allocate_faces(mesh, 6 * old.cell_count, 24 * old.cell_count);
    mesh->vertex_count = old.vertex_count;
    memcpy(mesh->coordinates, old.coordinates, 3 * (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->values, old.values, (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->ghosts, old.ghosts, (size_t)old.cell_count);
    face_table_open(&table, mesh, 6 * old.cell_count);
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        if (test_uniform((uint64_t)cell, 6) >= share) {
            test_mesh_add_cell(mesh, old.types[cell], old.connectivity + old.offsets[cell],
                               (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
            continue;
        }
        int64_t faces[6];
        const int count = test_get_cell_faces(old.types[cell])->count;
        for (int i = 0; i < count; i++) faces[i] = table.faces[find_or_add_cell_face(&table, &old, cell, i)];
        test_mesh_add_polyhedron(mesh, faces, count);
    }
    face_table_free(&table);
    test_mesh_free(&old);
}

/* Tets that are joined into one polyhedron, and the faces on its surface. */
enum { GROUP_TETS = 6 };

typedef struct tet_group {
    int count, face_count;
    int64_t tets[GROUP_TETS];
    int64_t faces[4 * GROUP_TETS]; /* slots of the face table */
} tet_group;

static void group_toggle_face(tet_group *g, int64_t face)
{
    for (int i = 0; i < g->face_count; i++)
        if (g->faces[i] == face) {
            g->faces[i] = g->faces[--g->face_count];
            return;
        }
    g->faces[g->face_count++] = face;
}

/* Returns whether every edge of the group's surface belongs to exactly two faces. */
static bool group_is_closed(const tet_group *g, const face_table *t)
{
    for (int i = 0; i < g->face_count; i++)
        for (int side = 0; side < 3; side++) {
            const int64_t a = t->keys[g->faces[i]][side == 2], b = t->keys[g->faces[i]][side == 0 ? 1 : 2];
            int sharing = 0;
            for (int j = 0; j < g->face_count; j++) {
                const int64_t *v = t->keys[g->faces[j]];
                sharing += (v[0] == a || v[1] == a || v[2] == a) && (v[0] == b || v[1] == b || v[2] == b);
            }
            if (sharing != 2) return false;
        }
    return true;
}

static void group_add_tet(tet_group *g, const int64_t (*faces_of)[4], int64_t tet)
{
    g->tets[g->count++] = tet;
    for (int i = 0; i < 4; i++) group_toggle_face(g, faces_of[tet][i]);
}

/* Adds a neighbouring tet with which the surface remains closed. Returns false if there is none. */
static bool group_add_neighbouring_tet(tet_group *g, const face_table *t, const int64_t (*faces_of)[4],
                                       const bool *is_taken)
{
    for (int i = 0; i < g->face_count; i++)
        for (int side = 0; side < 2; side++) {
            const int64_t tet = t->cells[g->faces[(i * 5 + g->count) % g->face_count]][side];
            tet_group larger = *g;
            if (tet < 0 || is_taken[tet]) continue;
            group_add_tet(&larger, faces_of, tet);
            if (!group_is_closed(&larger, t)) continue;
            *g = larger;
            return true;
        }
    return false;
}

/* Joins the mesh's tets into polyhedra of up to GROUP_TETS. */
void test_mesh_merge_tets(test_mesh *mesh)
{
    test_mesh old = *mesh;
    face_table table;
    int64_t(*faces_of)[4] = test_allocate(old.cell_count, sizeof *faces_of);
    bool *is_taken = test_allocate(old.cell_count, sizeof *is_taken);
    mesh->types = test_allocate(old.cell_count, 1);
    mesh->offsets = test_allocate(old.cell_count + 1, sizeof(int64_t));
    mesh->connectivity = test_allocate(4 * old.cell_count, sizeof(int64_t));
    mesh->cell_count = mesh->connectivity_count = 0;
    test_mesh_allocate_faces(mesh, 4 * old.cell_count, 12 * old.cell_count);
    face_table_open(&table, NULL, 4 * old.cell_count);
    for (int64_t cell = 0; cell < old.cell_count; cell++)
        for (int i = 0; i < 4; i++) faces_of[cell][i] = find_or_add_cell_face(&table, &old, cell, i);
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        tet_group g = {0};
        if (is_taken[cell]) continue;
        group_add_tet(&g, (const int64_t(*)[4])faces_of, cell);
        is_taken[cell] = true;
        const int wanted = 1 + (int)(GROUP_TETS * test_uniform((uint64_t)cell, 7));
        while (g.count < wanted && group_add_neighbouring_tet(&g, &table, (const int64_t(*)[4])faces_of, is_taken))
            is_taken[g.tets[g.count - 1]] = true;
        for (int i = 0; i < g.face_count; i++) {
            int64_t *face = &table.faces[g.faces[i]];
            if (*face < 0) *face = test_mesh_add_face(mesh, table.keys[g.faces[i]], 3);
            g.faces[i] = *face;
        }
        test_mesh_add_polyhedron(mesh, g.faces, g.face_count);
    }
    face_table_free(&table);
    free(faces_of);
    free(is_taken);
    free(old.types);
    free(old.offsets);
    free(old.connectivity);
}
