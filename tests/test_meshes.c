/* Meshes for tests and benchmarks.
 *
 * Lattices are made cube by cube from the corners of a cube numbered by bits (bit 0: +x, bit 1: +y, bit 2: +z). Tets
 * and wedges cut the faces of a cube along the diagonal from the lowest to the highest corner, the same seen from both
 * sides. The mixed mesh is conforming: cubes of even parity are a hex, two wedges or six tets; a cube of odd parity has
 * even neighbours only, and meets each of its faces with a pyramid where the neighbour has a quad there, with two tets
 * where it has two triangles. */
#include "test_meshes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *allocate(int64_t count, size_t size)
{
    void *p = calloc((size_t)(count > 0 ? count : 1), size);
    if (!p) {
        fprintf(stderr, "test_meshes: out of memory\n");
        exit(1);
    }
    return p;
}

static uint64_t mix(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static uint64_t hash(uint64_t index, uint64_t seed)
{
    return mix(index ^ mix(seed));
}

double test_uniform(uint64_t index, uint64_t seed)
{
    return (double)(hash(index, seed) >> 11) * 0x1p-53;
}

double test_wave(const double p[3])
{
    return sin(6 * p[0]) * cos(6 * p[1]) + sin(6 * p[1]) * cos(6 * p[2]) + sin(6 * p[2]) * cos(6 * p[0]);
}

double test_linear(const double p[3])
{
    return 0.3 * p[0] - 0.7 * p[1] + 0.5 * p[2] + 0.1;
}

const char *test_mesh_kind_name(test_mesh_kind kind)
{
    static const char *const names[TEST_KIND_COUNT] = {"tets", "hexes", "wedges", "pyramids", "polyhedra", "mixed"};
    return names[kind];
}

static void mesh_allocate(test_mesh *mesh, int64_t vertices, int64_t cells, int64_t connectivity)
{
    memset(mesh, 0, sizeof *mesh);
    mesh->coordinates = allocate(3 * vertices, sizeof(double));
    mesh->values = allocate(vertices, sizeof(double));
    mesh->offsets = allocate(cells + 1, sizeof(int64_t));
    mesh->connectivity = allocate(connectivity, sizeof(int64_t));
    mesh->types = allocate(cells, 1);
    mesh->ghosts = allocate(cells, 1);
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

static int64_t add_vertex(test_mesh *mesh, const double p[3])
{
    memcpy(mesh->coordinates + 3 * mesh->vertex_count, p, 3 * sizeof(double));
    return mesh->vertex_count++;
}

static void allocate_faces(test_mesh *mesh, int64_t faces, int64_t entries)
{
    mesh->face_offsets = allocate(faces + 1, sizeof(int64_t));
    mesh->face_connectivity = allocate(entries, sizeof(int64_t));
}

static int64_t add_face(test_mesh *mesh, const int64_t *vertices, int64_t count)
{
    memcpy(mesh->face_connectivity + mesh->face_connectivity_count, vertices, (size_t)count * sizeof *vertices);
    mesh->face_connectivity_count += count;
    mesh->face_offsets[++mesh->face_count] = mesh->face_connectivity_count;
    return mesh->face_count - 1;
}

static void add_polyhedron(test_mesh *mesh, const int64_t *faces, int64_t count)
{
    memcpy(mesh->connectivity + mesh->connectivity_count, faces, (size_t)count * sizeof *faces);
    mesh->connectivity_count += count;
    mesh->types[mesh->cell_count++] = GRID_POLYHEDRON;
    mesh->offsets[mesh->cell_count] = mesh->connectivity_count;
}

/* A cell of some of the given vertices, picked by local indices. */
static void add_cell(test_mesh *mesh, int type, const int64_t *vertices, const int *picks)
{
    const int count = grid_type_vertices(type);
    for (int i = 0; i < count; i++) mesh->connectivity[mesh->connectivity_count++] = vertices[picks[i]];
    mesh->types[mesh->cell_count++] = (unsigned char)type;
    mesh->offsets[mesh->cell_count] = mesh->connectivity_count;
}

void test_mesh_set_values(test_mesh *mesh, test_function *f)
{
    for (int64_t i = 0; i < mesh->vertex_count; i++) mesh->values[i] = f(mesh->coordinates + 3 * i);
}

static void lattice_vertices(test_mesh *mesh, int n, double jitter)
{
    const double side = 2.0 / n;
    for (int k = 0; k <= n; k++)
        for (int j = 0; j <= n; j++)
            for (int i = 0; i <= n; i++) {
                const bool inner = i > 0 && j > 0 && k > 0 && i < n && j < n && k < n;
                const uint64_t index = (uint64_t)mesh->vertex_count;
                double p[3] = {i * side - 1, j * side - 1, k * side - 1};
                for (unsigned axis = 0; inner && axis < 3; axis++)
                    p[axis] += jitter * side * (2 * test_uniform(3 * index + axis, 1) - 1);
                add_vertex(mesh, p);
            }
}

/* Corner b of a cube with the vertices in the order of bits: the six faces, each around. */
static const int cube_faces[6][4] = {{0, 2, 6, 4}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                     {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 5, 7, 6}};

static void add_hex(test_mesh *mesh, const int64_t *corners)
{
    add_cell(mesh, GRID_HEX, corners, (const int[]){0, 1, 3, 2, 4, 5, 7, 6});
}

static void add_wedges(test_mesh *mesh, const int64_t *corners)
{
    add_cell(mesh, GRID_WEDGE, corners, (const int[]){0, 1, 3, 4, 5, 7});
    add_cell(mesh, GRID_WEDGE, corners, (const int[]){0, 3, 2, 4, 7, 6});
}

static void add_tets(test_mesh *mesh, const int64_t *corners)
{
    static const int tets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    for (int i = 0; i < 6; i++) add_cell(mesh, GRID_TET, corners, tets[i]);
}

/* What closes the cube's face (as cube_faces) against its centre: two tets where is_split, else a pyramid. */
static void close_face(test_mesh *mesh, const int64_t *corners, int64_t centre, const int face[4], bool is_split)
{
    const int64_t v[5] = {corners[face[0]], corners[face[1]], corners[face[2]], corners[face[3]], centre};
    if (!is_split) {
        add_cell(mesh, GRID_PYRAMID, v, (const int[]){0, 1, 2, 3, 4});
        return;
    }
    add_cell(mesh, GRID_TET, v, (const int[]){0, 1, 2, 4});
    add_cell(mesh, GRID_TET, v, (const int[]){0, 2, 3, 4});
}

static int64_t add_centre(test_mesh *mesh, const int64_t *corners)
{
    double p[3] = {0, 0, 0};
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) p[axis] += mesh->coordinates[3 * corners[i] + axis] / 8;
    return add_vertex(mesh, p);
}

/* 0 a hex, 1 wedges, 2 tets: the cube of even parity at a place of the mixed mesh. */
static int mixed_choice(const int place[3])
{
    return (int)(hash((uint64_t)(place[0] + 1024 * place[1] + 1024 * 1024 * place[2]), 2) % 3);
}

static void add_mixed(test_mesh *mesh, int n, const int place[3], const int64_t *corners)
{
    if ((place[0] + place[1] + place[2]) % 2 == 0) {
        void (*const add[3])(test_mesh *, const int64_t *) = {add_hex, add_wedges, add_tets};
        add[mixed_choice(place)](mesh, corners);
        return;
    }
    const int64_t centre = add_centre(mesh, corners);
    for (int face = 0; face < 6; face++) {
        int beside[3] = {place[0], place[1], place[2]};
        beside[face / 2] += face % 2 ? 1 : -1;
        const bool outside = beside[face / 2] < 0 || beside[face / 2] >= n;
        const int choice = outside ? 0 : mixed_choice(beside);
        close_face(mesh, corners, centre, cube_faces[face], choice == 2 || (choice == 1 && face >= 4));
    }
}

static void add_cube(test_mesh *mesh, test_mesh_kind kind, int n, const int place[3])
{
    int64_t corners[8];
    for (int b = 0; b < 8; b++) {
        const int64_t i = place[0] + (b & 1), j = place[1] + (b >> 1 & 1), k = place[2] + (b >> 2);
        corners[b] = i + (n + 1) * (j + (n + 1) * k);
    }
    switch (kind) {
    case TEST_TETS:
    case TEST_POLYHEDRA: add_tets(mesh, corners); break;
    case TEST_HEXES: add_hex(mesh, corners); break;
    case TEST_WEDGES: add_wedges(mesh, corners); break;
    case TEST_PYRAMIDS: {
        const int64_t centre = add_centre(mesh, corners);
        for (int face = 0; face < 6; face++) close_face(mesh, corners, centre, cube_faces[face], false);
        break;
    }
    default: add_mixed(mesh, n, place, corners); break;
    }
}

static const double unit_hex[8][3] = {{-0.5, -0.5, -0.5}, {0.5, -0.5, -0.5}, {0.5, 0.5, -0.5}, {-0.5, 0.5, -0.5},
                                      {-0.5, -0.5, 0.5},  {0.5, -0.5, 0.5},  {0.5, 0.5, 0.5},  {-0.5, 0.5, 0.5}};

/* ---- polyhedra ---- */

/* The faces of a cell: how many, and their vertices, -1 behind a triangle's. */
typedef struct type_faces {
    int count;
    int vertices[6][4];
} type_faces;

static const type_faces *faces_of_type(int type)
{
    static const type_faces tet = {4, {{0, 1, 2, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {0, 2, 3, -1}}};
    static const type_faces hex = {
        6, {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};
    static const type_faces wedge = {5, {{0, 1, 2, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}};
    static const type_faces pyramid = {5, {{0, 1, 2, 3}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}};
    return type == GRID_TET ? &tet : type == GRID_HEX ? &hex : type == GRID_WEDGE ? &wedge : &pyramid;
}

/* Faces by their vertices in any order, each made once. */
typedef struct face_table {
    test_mesh *mesh;
    int64_t size;
    int64_t (*keys)[4]; /* sorted; -1 in the first: free */
    int64_t *faces;
    int64_t (*cells)[2];
} face_table;

static void face_table_open(face_table *t, test_mesh *mesh, int64_t faces)
{
    *t = (face_table){.mesh = mesh, .size = 2 * faces + 1};
    t->keys = allocate(t->size, sizeof *t->keys);
    t->faces = allocate(t->size, sizeof *t->faces);
    t->cells = allocate(t->size, sizeof *t->cells);
    for (int64_t i = 0; i < t->size; i++) t->keys[i][0] = t->cells[i][0] = t->cells[i][1] = -1;
}

static void face_table_free(face_table *t)
{
    free(t->keys);
    free(t->faces);
    free(t->cells);
}

/* Where a cell's face stands in the table; the cell is noted there. */
static int64_t face_table_find(face_table *t, const int64_t *vertices, int count, int64_t cell)
{
    int64_t key[4] = {INT64_MAX, INT64_MAX, INT64_MAX, INT64_MAX};
    for (int i = 0; i < count; i++) {
        int at = i;
        for (; at > 0 && key[at - 1] > vertices[i]; at--) key[at] = key[at - 1];
        key[at] = vertices[i];
    }
    int64_t at = (int64_t)(hash((uint64_t)key[0], hash((uint64_t)key[1], (uint64_t)key[2])) % (uint64_t)t->size);
    while (t->keys[at][0] >= 0 && memcmp(t->keys[at], key, sizeof key)) at = (at + 1) % t->size;
    if (t->keys[at][0] < 0) {
        memcpy(t->keys[at], key, sizeof key);
        t->faces[at] = t->mesh ? add_face(t->mesh, vertices, count) : -1;
    }
    t->cells[at][t->cells[at][0] >= 0] = cell;
    return at;
}

static int64_t cell_face(face_table *t, const test_mesh *mesh, int64_t cell, int face)
{
    const int *picks = faces_of_type(mesh->types[cell])->vertices[face];
    const int count = picks[3] < 0 ? 3 : 4;
    int64_t vertices[4];
    for (int i = 0; i < count; i++) vertices[i] = mesh->connectivity[mesh->offsets[cell] + picks[i]];
    return face_table_find(t, vertices, count, cell);
}

void test_mesh_to_polyhedra(test_mesh *mesh, double share)
{
    test_mesh old = *mesh;
    face_table table;
    mesh_allocate(mesh, old.vertex_count, old.cell_count, old.connectivity_count);
    allocate_faces(mesh, 6 * old.cell_count, 24 * old.cell_count);
    mesh->vertex_count = old.vertex_count;
    memcpy(mesh->coordinates, old.coordinates, 3 * (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->values, old.values, (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->ghosts, old.ghosts, (size_t)old.cell_count);
    face_table_open(&table, mesh, 6 * old.cell_count);
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        if (test_uniform((uint64_t)cell, 6) >= share) {
            add_cell(mesh, old.types[cell], old.connectivity + old.offsets[cell],
                     (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
            continue;
        }
        int64_t faces[6];
        const int count = faces_of_type(old.types[cell])->count;
        for (int i = 0; i < count; i++) faces[i] = table.faces[cell_face(&table, &old, cell, i)];
        add_polyhedron(mesh, faces, count);
    }
    face_table_free(&table);
    test_mesh_free(&old);
}

/* Tets that become one polyhedron, and the faces of its surface. */
enum { GROUP_TETS = 6 };

typedef struct tet_group {
    int count, face_count;
    int64_t tets[GROUP_TETS];
    int64_t faces[4 * GROUP_TETS]; /* places in the table */
} tet_group;

static void group_toggle(tet_group *g, int64_t face)
{
    for (int i = 0; i < g->face_count; i++)
        if (g->faces[i] == face) {
            g->faces[i] = g->faces[--g->face_count];
            return;
        }
    g->faces[g->face_count++] = face;
}

/* Has every edge of the surface two faces? */
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

static void group_add(tet_group *g, const int64_t (*faces_of)[4], int64_t tet)
{
    g->tets[g->count++] = tet;
    for (int i = 0; i < 4; i++) group_toggle(g, faces_of[tet][i]);
}

/* Take one more tet beside the group, where there is one that leaves the surface good. */
static bool group_grow(tet_group *g, const face_table *t, const int64_t (*faces_of)[4], const bool *is_taken)
{
    for (int i = 0; i < g->face_count; i++)
        for (int side = 0; side < 2; side++) {
            const int64_t tet = t->cells[g->faces[(i * 5 + g->count) % g->face_count]][side];
            tet_group larger = *g;
            if (tet < 0 || is_taken[tet]) continue;
            group_add(&larger, faces_of, tet);
            if (!group_is_closed(&larger, t)) continue;
            *g = larger;
            return true;
        }
    return false;
}

/* The mesh's tets to polyhedra of up to GROUP_TETS. */
static void grow_together(test_mesh *mesh)
{
    test_mesh old = *mesh;
    face_table table;
    int64_t(*faces_of)[4] = allocate(old.cell_count, sizeof *faces_of);
    bool *is_taken = allocate(old.cell_count, sizeof *is_taken);
    mesh->types = allocate(old.cell_count, 1);
    mesh->offsets = allocate(old.cell_count + 1, sizeof(int64_t));
    mesh->connectivity = allocate(4 * old.cell_count, sizeof(int64_t));
    mesh->cell_count = mesh->connectivity_count = 0;
    allocate_faces(mesh, 4 * old.cell_count, 12 * old.cell_count);
    face_table_open(&table, NULL, 4 * old.cell_count);
    for (int64_t cell = 0; cell < old.cell_count; cell++)
        for (int i = 0; i < 4; i++) faces_of[cell][i] = cell_face(&table, &old, cell, i);
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        tet_group g = {0};
        if (is_taken[cell]) continue;
        group_add(&g, (const int64_t(*)[4])faces_of, cell);
        is_taken[cell] = true;
        const int wanted = 1 + (int)(GROUP_TETS * test_uniform((uint64_t)cell, 7));
        while (g.count < wanted && group_grow(&g, &table, (const int64_t(*)[4])faces_of, is_taken))
            is_taken[g.tets[g.count - 1]] = true;
        for (int i = 0; i < g.face_count; i++) {
            int64_t *face = &table.faces[g.faces[i]];
            if (*face < 0) *face = add_face(mesh, table.keys[g.faces[i]], 3);
            g.faces[i] = *face;
        }
        add_polyhedron(mesh, g.faces, g.face_count);
    }
    face_table_free(&table);
    free(faces_of);
    free(is_taken);
    free(old.types);
    free(old.offsets);
    free(old.connectivity);
}

const char *test_polyhedron_name(test_polyhedron_shape shape)
{
    static const char *const names[TEST_POLYHEDRON_COUNT] = {"L prism", "U prism", "spikes", "bent spikes", "cavity"};
    return names[shape];
}

static void make_prism(test_mesh *mesh, const double (*base)[2], int count)
{
    int64_t loop[2][8], faces[10];
    for (int level = 0; level < 2; level++)
        for (int i = 0; i < count; i++)
            loop[level][i] =
                add_vertex(mesh, (const double[]){base[i][0], base[i][1] + 0.1 * level, level ? 0.45 : -0.4});
    for (int level = 0; level < 2; level++) faces[level] = add_face(mesh, loop[level], count);
    for (int i = 0; i < count; i++) {
        const int next = (i + 1) % count;
        const int64_t quad[4] = {loop[0][i], loop[0][next], loop[1][next], loop[1][i]};
        faces[2 + i] = add_face(mesh, quad, 4);
    }
    add_polyhedron(mesh, faces, count + 2);
}

static void make_spikes(test_mesh *mesh, bool is_bent)
{
    int64_t faces[24];
    for (int axis = 0; axis < 3; axis++)
        for (int side = -1; side < 2; side += 2) {
            double p[3] = {0.02, -0.01, 0.03};
            p[axis] += 0.4 * side;
            add_vertex(mesh, p);
        }
    for (int octant = 0; octant < 8; octant++) {
        const int64_t corners[3] = {octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2)};
        double tip[3];
        for (int axis = 0; axis < 3; axis++) tip[axis] = 0.6 * (octant >> axis & 1 ? 1 : -1);
        if (is_bent) tip[octant % 3] *= -0.9;
        const int64_t top = add_vertex(mesh, tip);
        for (int i = 0; i < 3; i++) {
            const int64_t triangle[3] = {corners[i], corners[(i + 1) % 3], top};
            faces[3 * octant + i] = add_face(mesh, triangle, 3);
        }
    }
    add_polyhedron(mesh, faces, 24);
}

static void make_cavity(test_mesh *mesh)
{
    int64_t faces[12];
    for (int shell = 0; shell < 2; shell++) {
        const int64_t first = mesh->vertex_count;
        for (int i = 0; i < 8; i++) {
            double p[3];
            for (int axis = 0; axis < 3; axis++)
                p[axis] = (shell ? 0.2 : 0.5) * unit_hex[i][axis] * 2 + 0.02 * shell + 0.01 * axis * i;
            add_vertex(mesh, p);
        }
        for (int face = 0; face < 6; face++) {
            int64_t quad[4];
            for (int i = 0; i < 4; i++) quad[i] = first + faces_of_type(GRID_HEX)->vertices[face][i];
            faces[6 * shell + face] = add_face(mesh, quad, 4);
        }
    }
    add_polyhedron(mesh, faces, 12);
}

void test_mesh_polyhedron(test_polyhedron_shape shape, test_function *f, test_mesh *out)
{
    static const double l[6][2] = {{-0.5, -0.5}, {0.5, -0.45}, {0.5, -0.1}, {0.0, 0.0}, {-0.1, 0.5}, {-0.5, 0.4}};
    static const double u[8][2] = {{-0.5, -0.5}, {0.5, -0.5},  {0.5, 0.5},   {0.3, 0.45},
                                   {0.25, -0.3}, {-0.3, -0.3}, {-0.3, 0.45}, {-0.5, 0.5}};
    mesh_allocate(out, 16, 1, 24);
    allocate_faces(out, 24, 72);
    switch (shape) {
    case TEST_L_PRISM: make_prism(out, l, 6); break;
    case TEST_U_PRISM: make_prism(out, u, 8); break;
    case TEST_CAVITY: make_cavity(out); break;
    default: make_spikes(out, shape == TEST_BENT_SPIKES); break;
    }
    test_mesh_set_values(out, f);
}

/* ---- lattices ---- */

void test_mesh_lattice(test_mesh_kind kind, int n, double jitter, test_function *f, test_mesh *out)
{
    static const int64_t cells[TEST_KIND_COUNT] = {6, 1, 2, 6, 6, 12};
    static const int64_t connectivity[TEST_KIND_COUNT] = {24, 8, 12, 30, 24, 48};
    const int64_t cubes = (int64_t)n * n * n, lattice = (int64_t)(n + 1) * (n + 1) * (n + 1);
    mesh_allocate(out, lattice + (kind >= TEST_PYRAMIDS ? cubes : 0), cubes * cells[kind], cubes * connectivity[kind]);
    lattice_vertices(out, n, jitter);
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) add_cube(out, kind, n, (const int[]){i, j, k});
    if (kind == TEST_POLYHEDRA) grow_together(out);
    test_mesh_set_values(out, f);
}

static const double unit_tet[4][3] = {{-0.5, -0.5, -0.5}, {0.7, -0.4, -0.3}, {-0.3, 0.6, -0.4}, {-0.1, 0.0, 0.7}};

const char *test_cell_shape_name(test_cell_shape shape)
{
    static const char *const names[TEST_SHAPE_COUNT] = {"unit tet",       "unit hex",   "unit wedge",  "unit pyramid",
                                                        "sliver tet",     "warped hex", "twisted hex", "hex as wedge",
                                                        "hex as pyramid", "flat tet",   "flat hex",    "point hex"};
    return names[shape];
}

static int shape_type(test_cell_shape shape)
{
    switch (shape) {
    case TEST_UNIT_TET:
    case TEST_SLIVER_TET:
    case TEST_FLAT_TET: return GRID_TET;
    case TEST_UNIT_WEDGE: return GRID_WEDGE;
    case TEST_UNIT_PYRAMID: return GRID_PYRAMID;
    default: return GRID_HEX;
    }
}

static void shape_hex_vertex(test_cell_shape shape, int i, double p[3])
{
    const double upper = i < 4 ? 0 : 1, angle = 50 * 3.14159265358979 / 180 * upper, x = p[0], y = p[1];
    switch (shape) {
    case TEST_WARPED_HEX:
        for (unsigned axis = 0; axis < 3; axis++) p[axis] += 0.3 * test_uniform((uint64_t)(3 * i) + axis, 3) - 0.15;
        break;
    case TEST_TWISTED_HEX:
        p[0] = cos(angle) * x - sin(angle) * y;
        p[1] = sin(angle) * x + cos(angle) * y;
        break;
    case TEST_HEX_AS_WEDGE: p[0] *= 1 - upper; break;
    case TEST_HEX_AS_PYRAMID:
        p[0] *= 1 - upper;
        p[1] *= 1 - upper;
        break;
    case TEST_FLAT_HEX: p[2] = 0; break;
    case TEST_POINT_HEX: p[0] = p[1] = p[2] = 0.1; break;
    default: break;
    }
}

static void shape_vertex(test_cell_shape shape, int i, double p[3])
{
    static const double wedge[3][2] = {{-0.5, -0.4}, {0.6, -0.3}, {0.0, 0.6}};
    switch (shape_type(shape)) {
    case GRID_TET:
        memcpy(p, unit_tet[i], sizeof unit_tet[i]);
        if (shape == TEST_SLIVER_TET) p[2] = i == 3 ? 1e-4 : 0;
        if (shape == TEST_FLAT_TET) p[2] = 0.25 * p[0];
        break;
    case GRID_WEDGE:
        p[0] = wedge[i % 3][0];
        p[1] = wedge[i % 3][1] + (i < 3 ? 0 : 0.1);
        p[2] = i < 3 ? -0.5 : 0.5;
        break;
    case GRID_PYRAMID: memcpy(p, i < 4 ? unit_hex[i] : (const double[]){0.2, -0.1, 0.6}, 3 * sizeof(double)); break;
    default:
        memcpy(p, unit_hex[i], sizeof unit_hex[i]);
        shape_hex_vertex(shape, i, p);
        break;
    }
}

void test_mesh_single(test_cell_shape shape, test_function *f, test_mesh *out)
{
    const int type = shape_type(shape);
    const int64_t indices[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    mesh_allocate(out, 8, 1, 8);
    for (int i = 0; i < grid_type_vertices(type); i++) {
        double p[3];
        shape_vertex(shape, i, p);
        add_vertex(out, p);
    }
    add_cell(out, type, indices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    test_mesh_set_values(out, f);
}

void test_mesh_round(test_mesh *mesh)
{
    for (int64_t i = 0; i < 3 * mesh->vertex_count; i++) mesh->coordinates[i] = (double)(float)mesh->coordinates[i];
    for (int64_t i = 0; i < mesh->vertex_count; i++) mesh->values[i] = (double)(float)mesh->values[i];
}

/* Symmetries of a kind as reorderings: enough to make all others, the first a mirror. */
typedef struct symmetry {
    int count;
    int order[3][8];
} symmetry;

static const symmetry *symmetries(int type)
{
    static const symmetry tet = {2, {{1, 0, 2, 3}, {1, 2, 3, 0}}};
    static const symmetry hex = {3, {{4, 5, 6, 7, 0, 1, 2, 3}, {1, 2, 3, 0, 5, 6, 7, 4}, {0, 4, 5, 1, 3, 7, 6, 2}}};
    static const symmetry wedge = {3, {{3, 4, 5, 0, 1, 2}, {1, 2, 0, 4, 5, 3}, {1, 0, 2, 4, 3, 5}}};
    static const symmetry pyramid = {2, {{1, 0, 3, 2, 4}, {1, 2, 3, 0, 4}}};
    return type == GRID_TET ? &tet : type == GRID_HEX ? &hex : type == GRID_WEDGE ? &wedge : &pyramid;
}

static void reorder(test_mesh *mesh, int64_t cell, const int *order)
{
    int64_t *v = mesh->connectivity + mesh->offsets[cell], old[8];
    const int count = grid_type_vertices(mesh->types[cell]);
    memcpy(old, v, (size_t)count * sizeof *v);
    for (int i = 0; i < count; i++) v[i] = old[order[i]];
}

void test_mesh_mirror(test_mesh *mesh, bool every_second)
{
    for (int64_t cell = 0; cell < mesh->cell_count; cell++)
        if (mesh->types[cell] != GRID_POLYHEDRON && (!every_second || hash((uint64_t)cell, 4) & 1))
            reorder(mesh, cell, symmetries(mesh->types[cell])->order[0]);
}

/* A random permutation of 0 .. count - 1. */
static int64_t *permutation(int64_t count, uint64_t seed)
{
    int64_t *order = allocate(count, sizeof *order);
    for (int64_t i = 0; i < count; i++) {
        const int64_t j = (int64_t)(hash((uint64_t)i, seed) % (uint64_t)(i + 1));
        order[i] = order[j];
        order[j] = i;
    }
    return order;
}

/* The faces of old in another order, of vertices renumbered; returns where each went. */
static int64_t *shuffle_faces(const test_mesh *old, const int64_t *vertex_to, uint64_t seed, test_mesh *mesh)
{
    int64_t *face_from = permutation(old->face_count, seed), *face_to = allocate(old->face_count, sizeof *face_to);
    if (old->face_count) allocate_faces(mesh, old->face_count, old->face_connectivity_count);
    for (int64_t i = 0; i < old->face_count; i++) {
        const int64_t from = face_from[i], first = mesh->face_connectivity_count;
        const int64_t count = old->face_offsets[from + 1] - old->face_offsets[from];
        face_to[from] = add_face(mesh, old->face_connectivity + old->face_offsets[from], count);
        for (int64_t j = first; j < first + count; j++)
            mesh->face_connectivity[j] = vertex_to[mesh->face_connectivity[j]];
    }
    free(face_from);
    return face_to;
}

void test_mesh_shuffle(test_mesh *mesh, uint64_t seed)
{
    int64_t *vertex_to = permutation(mesh->vertex_count, seed), *cell_from = permutation(mesh->cell_count, seed + 1);
    test_mesh old = *mesh;
    mesh_allocate(mesh, old.vertex_count, old.cell_count, old.connectivity_count);
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
            add_polyhedron(mesh, v, count);
            for (int64_t j = first; j < first + count; j++) mesh->connectivity[j] = face_to[mesh->connectivity[j]];
            continue;
        }
        for (int j = 0; j < grid_type_vertices(old.types[from]); j++) renumbered[j] = vertex_to[v[j]];
        mesh->ghosts[i] = old.ghosts[from];
        add_cell(mesh, old.types[from], renumbered, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
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

static void reverse(int64_t *items, int64_t count)
{
    for (int64_t i = 0; i < count / 2; i++) swap_indices(&items[i], &items[count - 1 - i]);
}

/* Another beginning, and by seed the other way. */
static void turn_loop(int64_t *items, int64_t count, uint64_t seed)
{
    const int64_t by = (int64_t)(hash(1, seed) % (uint64_t)count);
    reverse(items, by);
    reverse(items + by, count - by);
    if (hash(2, seed) & 1) reverse(items, count);
}

void test_mesh_turn(test_mesh *mesh, uint64_t seed)
{
    for (int64_t i = 0; i < mesh->face_count; i++)
        turn_loop(mesh->face_connectivity + mesh->face_offsets[i], mesh->face_offsets[i + 1] - mesh->face_offsets[i],
                  hash((uint64_t)i, seed));
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        if (mesh->types[i] == GRID_POLYHEDRON) {
            int64_t *faces = mesh->connectivity + mesh->offsets[i];
            for (int64_t k = mesh->offsets[i + 1] - mesh->offsets[i] - 1; k > 0; k--)
                swap_indices(&faces[k], &faces[hash((uint64_t)(64 * i + k), seed) % (uint64_t)(k + 1)]);
            continue;
        }
        const symmetry *s = symmetries(mesh->types[i]);
        for (uint64_t turn = 0; turn < 12; turn++)
            reorder(mesh, i, s->order[hash((uint64_t)i * 16 + turn, seed) % (uint64_t)s->count]);
    }
}

void test_mesh_transform(test_mesh *mesh, double scale, const double offset[3])
{
    for (int64_t i = 0; i < mesh->vertex_count; i++)
        for (int axis = 0; axis < 3; axis++)
            mesh->coordinates[3 * i + axis] = mesh->coordinates[3 * i + axis] * scale + offset[axis];
}

const char *test_partition_kind_name(test_partition_kind kind)
{
    static const char *const names[TEST_PARTITION_COUNT] = {"block", "random", "checkerboard"};
    return names[kind];
}

static int owner_of(test_partition_kind kind, const double centre[3], int64_t cell, int n, int ranks)
{
    if (kind == TEST_RANDOM) return (int)(hash((uint64_t)cell, 5) % (uint64_t)ranks);
    const int cuts = kind == TEST_BLOCK ? ranks : n;
    int place[3];
    for (int axis = 0; axis < 3; axis++) {
        const int slab = (int)floor((centre[axis] + 1) / 2 * cuts);
        place[axis] = slab < 0 ? 0 : slab >= cuts ? cuts - 1 : slab;
    }
    return kind == TEST_BLOCK ? place[0] : (place[0] + place[1] + place[2]) % ranks;
}

void test_partition(const test_mesh *mesh, test_partition_kind kind, int n, int ranks, int *owners)
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
        owners[cell] = owner_of(kind, centre, cell, n, ranks);
    }
}

/* The part's number of a vertex, given when first asked for. */
static int64_t part_vertex(const test_mesh *mesh, int64_t *local, int64_t v, test_mesh *out)
{
    if (local[v] >= 0) return local[v];
    local[v] = add_vertex(out, mesh->coordinates + 3 * v);
    out->values[local[v]] = mesh->values[v];
    return local[v];
}

static void part_polyhedron(const test_mesh *mesh, int64_t *local, int64_t *local_face, int64_t cell, test_mesh *out)
{
    const int64_t first = out->connectivity_count, count = mesh->offsets[cell + 1] - mesh->offsets[cell];
    add_polyhedron(out, mesh->connectivity + mesh->offsets[cell], count);
    for (int64_t i = first; i < first + count; i++) {
        const int64_t face = out->connectivity[i], begin = mesh->face_offsets[face];
        if (local_face[face] < 0) {
            const int64_t at = out->face_connectivity_count, size = mesh->face_offsets[face + 1] - begin;
            local_face[face] = add_face(out, mesh->face_connectivity + begin, size);
            for (int64_t j = at; j < at + size; j++)
                out->face_connectivity[j] = part_vertex(mesh, local, out->face_connectivity[j], out);
        }
        out->connectivity[i] = local_face[face];
    }
}

void test_mesh_part(const test_mesh *mesh, const int *owners, int rank, test_mesh *out)
{
    int64_t *local = allocate(mesh->vertex_count, sizeof *local);
    int64_t *local_face = allocate(mesh->face_count, sizeof *local_face);
    for (int64_t i = 0; i < mesh->vertex_count; i++) local[i] = -1;
    for (int64_t i = 0; i < mesh->face_count; i++) local_face[i] = -1;
    mesh_allocate(out, mesh->vertex_count, mesh->cell_count, mesh->connectivity_count);
    if (mesh->face_count) allocate_faces(out, mesh->face_count, mesh->face_connectivity_count);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        if (owners[cell] != rank) continue;
        int64_t vertices[8];
        out->ghosts[out->cell_count] = mesh->ghosts[cell];
        if (mesh->types[cell] == GRID_POLYHEDRON) {
            part_polyhedron(mesh, local, local_face, cell, out);
            continue;
        }
        for (int i = 0; i < grid_type_vertices(mesh->types[cell]); i++)
            vertices[i] = part_vertex(mesh, local, mesh->connectivity[mesh->offsets[cell] + i], out);
        add_cell(out, mesh->types[cell], vertices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    }
    free(local);
    free(local_face);
}

static void store(void *to, int64_t i, bool wide, bool is_integer, double number, int64_t index)
{
    if (is_integer && wide)
        ((int64_t *)to)[i] = index;
    else if (is_integer)
        ((int32_t *)to)[i] = (int32_t)index;
    else if (wide)
        ((double *)to)[i] = number;
    else
        ((float *)to)[i] = (float)number;
}

static grid_array view_numbers(const double *numbers, int64_t count, int from_stride, int stride, bool wide, void *to)
{
    const int64_t width = wide ? 8 : 4;
    for (int64_t i = 0; i < count; i++) store(to, i * stride, wide, false, numbers[i * from_stride], 0);
    return (grid_array){.data = to, .stride = stride * width, .is_wide = wide};
}

static grid_array view_indices(const int64_t *indices, int64_t count, bool wide, void *to)
{
    for (int64_t i = 0; i < count; i++) store(to, i, wide, true, 0, indices[i]);
    return (grid_array){.data = to, .stride = wide ? 8 : 4, .is_wide = wide, .is_integer = true};
}

static void view_coordinates(const test_mesh *mesh, test_layout layout, test_view *out)
{
    const bool wide = layout.wide_coordinates;
    const int64_t count = mesh->vertex_count, step = layout.is_interleaved ? 1 : count;
    char *block = out->storage[0] = allocate(3 * count, 8);
    for (int axis = 0; axis < 3; axis++)
        out->cells.coordinates[axis] = view_numbers(mesh->coordinates + axis, count, 3, layout.is_interleaved ? 3 : 1,
                                                    wide, block + axis * step * (wide ? 8 : 4));
}

static void view_values(const test_mesh *mesh, test_layout layout, test_view *out)
{
    const int stride = layout.is_interleaved ? 2 : 1;
    out->storage[1] = allocate(mesh->vertex_count * stride, 8);
    for (int64_t i = 0; i < mesh->vertex_count * stride; i++)
        store(out->storage[1], i, layout.wide_values, false, (double)NAN, 0);
    out->field.values = view_numbers(mesh->values, mesh->vertex_count, 1, stride, layout.wide_values, out->storage[1]);
    out->field.component_count = 1;
    out->field.component_stride = layout.wide_values ? 8 : 4;
}

static bool is_homogeneous(const test_mesh *mesh)
{
    for (int64_t i = 1; i < mesh->cell_count; i++)
        if (mesh->types[i] != mesh->types[0]) return false;
    return true;
}

void test_view_create(const test_mesh *mesh, test_layout layout, test_view *out)
{
    memset(out, 0, sizeof *out);
    grid *g = &out->cells;
    g->vertex_count = mesh->vertex_count;
    g->cell_count = mesh->cell_count;
    view_coordinates(mesh, layout, out);
    view_values(mesh, layout, out);
    out->storage[2] = allocate(mesh->connectivity_count, 8);
    g->connectivity = view_indices(mesh->connectivity, mesh->connectivity_count, layout.wide_indices, out->storage[2]);
    g->cell_type = mesh->cell_count ? mesh->types[0] : GRID_TET;
    if (mesh->face_count) {
        out->storage[6] = allocate(mesh->face_count + 1, 8);
        out->storage[7] = allocate(mesh->face_connectivity_count, 8);
        g->face_count = mesh->face_count;
        g->face_offsets = view_indices(mesh->face_offsets, mesh->face_count + 1, layout.wide_indices, out->storage[6]);
        g->face_connectivity =
            view_indices(mesh->face_connectivity, mesh->face_connectivity_count, layout.wide_indices, out->storage[7]);
    }
    if (layout.with_types || mesh->face_count || !is_homogeneous(mesh)) {
        out->storage[3] = allocate(mesh->cell_count + 1, 8);
        g->offsets = view_indices(mesh->offsets, mesh->cell_count + 1, layout.wide_indices, out->storage[3]);
        out->storage[4] = allocate(mesh->cell_count, 1);
        if (mesh->cell_count) memcpy(out->storage[4], mesh->types, (size_t)mesh->cell_count);
        g->cell_types = out->storage[4];
        g->cell_types_stride = g->cell_types_bytes = 1;
    }
    out->storage[5] = allocate(mesh->cell_count, 1);
    if (mesh->cell_count) memcpy(out->storage[5], mesh->ghosts, (size_t)mesh->cell_count);
    g->ghosts = out->storage[5];
    g->ghosts_stride = 1;
}

void test_view_free(test_view *view)
{
    for (int i = 0; i < 8; i++) free(view->storage[i]);
    memset(view, 0, sizeof *view);
}
