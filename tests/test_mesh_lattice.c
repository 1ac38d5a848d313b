/* Makes lattices cube by cube. The corners of a cube are numbered by bits (bit 0: +x, bit 1: +y, bit 2: +z). Tets and
 * wedges split the faces of a cube along the diagonal from the lowest to the highest corner, so that both cubes at a
 * face use the same diagonal. The mixed mesh is conforming. A cube of even parity is a hex, two wedges or six tets. A
 * cube of odd parity has only even neighbours: it has a pyramid on each face that is a quad of the neighbour, and two
 * tets on each face that is two triangles of the neighbour. */
#include "test_mesh_make.h"

const char *test_mesh_kind_name(test_mesh_kind kind)
{
    static const char *const names[TEST_KIND_COUNT] = {"tets", "hexes", "wedges", "pyramids", "polyhedra", "mixed"};
    return names[kind];
}

static void add_lattice_vertices(test_mesh *mesh, int n, double jitter)
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
                test_mesh_add_vertex(mesh, p);
            }
}

/* The six faces of a cube; the corners of each face are in cyclic order. */
static const int cube_faces[6][4] = {{0, 2, 6, 4}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                     {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 5, 7, 6}};

static void add_hex(test_mesh *mesh, const int64_t *corners)
{
    test_mesh_add_cell(mesh, GRID_HEX, corners, (const int[]){0, 1, 3, 2, 4, 5, 7, 6});
}

static void add_wedges(test_mesh *mesh, const int64_t *corners)
{
    test_mesh_add_cell(mesh, GRID_WEDGE, corners, (const int[]){0, 1, 3, 4, 5, 7});
    test_mesh_add_cell(mesh, GRID_WEDGE, corners, (const int[]){0, 3, 2, 4, 7, 6});
}

static void add_tets(test_mesh *mesh, const int64_t *corners)
{
    static const int tets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
    for (int i = 0; i < 6; i++) test_mesh_add_cell(mesh, GRID_TET, corners, tets[i]);
}

void test_mesh_add_cube(test_mesh *mesh, test_mesh_kind kind, const int64_t *corners)
{
    if (kind == TEST_HEXES)
        add_hex(mesh, corners);
    else if (kind == TEST_WEDGES)
        add_wedges(mesh, corners);
    else
        add_tets(mesh, corners);
}

/* Connects a face of the cube (one of cube_faces) to the cube's centre, by two tets if is_split is set, else by a
 * pyramid. */
static void connect_face_to_centre(test_mesh *mesh, const int64_t *corners, int64_t centre, const int face[4],
                                   bool is_split)
{
    const int64_t v[5] = {corners[face[0]], corners[face[1]], corners[face[2]], corners[face[3]], centre};
    if (!is_split) {
        test_mesh_add_cell(mesh, GRID_PYRAMID, v, (const int[]){0, 1, 2, 3, 4});
        return;
    }
    test_mesh_add_cell(mesh, GRID_TET, v, (const int[]){0, 1, 2, 4});
    test_mesh_add_cell(mesh, GRID_TET, v, (const int[]){0, 2, 3, 4});
}

static int64_t add_centre(test_mesh *mesh, const int64_t *corners)
{
    double p[3] = {0, 0, 0};
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) p[axis] += mesh->coordinates[3 * corners[i] + axis] / 8;
    return test_mesh_add_vertex(mesh, p);
}

/* Returns the type of an even cube of the mixed mesh, by a hash of its position: 0 for a hex, 1 for wedges, 2 for
 * tets. */
static int choose_mixed_cell_type(const int place[3])
{
    return (int)(test_hash((uint64_t)(place[0] + 1024 * place[1] + 1024 * 1024 * place[2]), 2) % 3);
}

static void add_mixed_cube(test_mesh *mesh, int n, const int place[3], const int64_t *corners)
{
    if ((place[0] + place[1] + place[2]) % 2 == 0) {
        void (*const add[3])(test_mesh *, const int64_t *) = {add_hex, add_wedges, add_tets};
        add[choose_mixed_cell_type(place)](mesh, corners);
        return;
    }
    const int64_t centre = add_centre(mesh, corners);
    for (int face = 0; face < 6; face++) {
        int beside[3] = {place[0], place[1], place[2]};
        beside[face / 2] += face % 2 ? 1 : -1;
        const bool outside = beside[face / 2] < 0 || beside[face / 2] >= n;
        const int choice = outside ? 0 : choose_mixed_cell_type(beside);
        connect_face_to_centre(mesh, corners, centre, cube_faces[face], choice == 2 || (choice == 1 && face >= 4));
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
    case TEST_HEXES:
    case TEST_WEDGES:
    case TEST_POLYHEDRA: test_mesh_add_cube(mesh, kind, corners); break;
    case TEST_PYRAMIDS: {
        const int64_t centre = add_centre(mesh, corners);
        for (int face = 0; face < 6; face++) connect_face_to_centre(mesh, corners, centre, cube_faces[face], false);
        break;
    }
    default: add_mixed_cube(mesh, n, place, corners); break;
    }
}

void test_mesh_make_lattice(test_mesh_kind kind, int n, double jitter, test_function *f, test_mesh *out)
{
    static const int64_t cells[TEST_KIND_COUNT] = {6, 1, 2, 6, 6, 12};
    static const int64_t connectivity[TEST_KIND_COUNT] = {24, 8, 12, 30, 24, 48};
    const int64_t cubes = (int64_t)n * n * n, lattice = (int64_t)(n + 1) * (n + 1) * (n + 1);
    test_mesh_allocate(out, lattice + (kind >= TEST_PYRAMIDS ? cubes : 0), cubes * cells[kind],
                       cubes * connectivity[kind]);
    add_lattice_vertices(out, n, jitter);
    for (int k = 0; k < n; k++)
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) add_cube(out, kind, n, (const int[]){i, j, k});
    if (kind == TEST_POLYHEDRA) test_mesh_merge_tets(out);
    test_mesh_set_values(out, f);
}
