/* Cubes are split so that the cells of neighbouring cubes always share whole faces:
 *
 *   tets      six around the diagonal 000-111 (Kuhn): every face of the cube is split along the diagonal from its
 *             lowest to its highest corner
 *   hex       one: no face is split
 *   wedges    two, extruded along z: the z faces are split as for tets, the x and y faces are not split
 *   pyramids  six, one on each face, with their tips at the centre of the cube. If the neighbouring cube splits a
 *             common face, two tets replace the pyramid on this face. Cubes of pyramids can therefore lie between
 *             all other kinds of cubes.
 *
 * A mixed lattice contains, from below: hexes, one layer of pyramid cubes, tets, wedges (both need the same split of
 * the z faces between them), another layer of pyramid cubes, and hexes. A third of the hexes are replaced by pyramid
 * cubes. */
#include "wave_lattice.h"

#include <stddef.h>

static const int8_t corner_offset[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                           {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};

/* For each face of a cube: its corners, in an order in which the normal points outward; the axis parallel to the
 * normal; and the step to the neighbouring cube along this axis. */
static const struct {
    int8_t corner[4];
    int8_t axis, step;
} cube_face[6] = {{{0, 4, 7, 3}, 0, -1}, {{1, 2, 6, 5}, 0, 1},  {{0, 1, 5, 4}, 1, -1},
                  {{3, 7, 6, 2}, 1, 1},  {{0, 3, 2, 1}, 2, -1}, {{4, 5, 6, 7}, 2, 1}};

wave_lattice wave_lattice_make(const int size[3], wave_cells cells, double jitter)
{
    wave_lattice lattice = {.cells = cells, .jitter = jitter};
    int longest = size[0];
    for (int a = 0; a < 3; ++a) {
        lattice.size[a] = size[a];
        longest = size[a] > longest ? size[a] : longest;
    }
    lattice.edge = 2.0 / longest;
    lattice.origin[0] = -0.5 * lattice.edge * size[0];
    lattice.origin[1] = -0.5 * lattice.edge * size[1];
    lattice.origin[2] = -lattice.edge * size[2];
    return lattice;
}

int64_t wave_lattice_cube_count(const wave_lattice *lattice)
{
    return (int64_t)lattice->size[0] * lattice->size[1] * lattice->size[2];
}

int64_t wave_lattice_find_cube_id(const wave_lattice *lattice, const int ijk[3])
{
    return ijk[0] + lattice->size[0] * (ijk[1] + (int64_t)lattice->size[1] * ijk[2]);
}

void wave_lattice_find_cube_indices(const wave_lattice *lattice, int64_t cube, int ijk[3])
{
    ijk[0] = (int)(cube % lattice->size[0]);
    ijk[1] = (int)(cube / lattice->size[0] % lattice->size[1]);
    ijk[2] = (int)(cube / lattice->size[0] / lattice->size[1]);
}

bool wave_lattice_contains_cube(const wave_lattice *lattice, const int ijk[3])
{
    for (int a = 0; a < 3; ++a) {
        if (ijk[a] < 0 || ijk[a] >= lattice->size[a]) return false;
    }
    return true;
}

static int64_t lattice_vertex_count(const wave_lattice *lattice)
{
    return (int64_t)(lattice->size[0] + 1) * (lattice->size[1] + 1) * (lattice->size[2] + 1);
}

static int64_t find_corner_vertex(const wave_lattice *lattice, const int ijk[3], int corner)
{
    const int8_t *o = corner_offset[corner];
    int64_t nx = lattice->size[0] + 1, ny = lattice->size[1] + 1;
    return ijk[0] + o[0] + nx * (ijk[1] + o[1] + ny * (int64_t)(ijk[2] + o[2]));
}

static wave_cells find_cube_kind(const wave_lattice *lattice, const int ijk[3])
{
    if (lattice->cells != WAVE_MIXED) return lattice->cells;
    int low = lattice->size[2] / 5, high = 3 * lattice->size[2] / 4;
    if (ijk[2] == low || ijk[2] == high) return WAVE_PYRAMIDS;
    if (ijk[2] > low && ijk[2] < high) return ijk[2] <= (low + high) / 2 ? WAVE_TETS : WAVE_WEDGES;
    return ijk[0] < lattice->size[0] / 3 ? WAVE_PYRAMIDS : WAVE_HEXES;
}

static bool does_neighbour_split_face(const wave_lattice *lattice, const int ijk[3], int face)
{
    int axis = cube_face[face].axis;
    int beside[3] = {ijk[0], ijk[1], ijk[2]};
    beside[axis] += cube_face[face].step;
    if (!wave_lattice_contains_cube(lattice, beside)) return false;
    wave_cells kind = find_cube_kind(lattice, beside);
    return kind == WAVE_TETS || (kind == WAVE_WEDGES && axis == 2);
}

static int split_cube_into_tets(const int64_t v[8], wave_cell *cells)
{
    /* Each tet has the vertices of a path along edges of the cube from corner 0 to corner 6. The path follows the three
     * axes in one of six orders. If the order is an odd permutation of x, y, z, the two vertices in the middle are
     * exchanged, so that the tet has a positive volume. */
    static const int8_t path[6][2] = {{1, 2}, {3, 7}, {4, 5}, {2, 3}, {7, 4}, {5, 1}};
    for (int t = 0; t < 6; ++t) {
        cells[t] = (wave_cell){WAVE_TYPE_TET, {v[0], v[path[t][0]], v[path[t][1]], v[6]}};
    }
    return 6;
}

static int split_cube_into_wedges(const int64_t v[8], wave_cell *cells)
{
    cells[0] = (wave_cell){WAVE_TYPE_WEDGE, {v[0], v[1], v[2], v[4], v[5], v[6]}};
    cells[1] = (wave_cell){WAVE_TYPE_WEDGE, {v[0], v[2], v[3], v[4], v[6], v[7]}};
    return 2;
}

static int split_cube_into_pyramids(const wave_lattice *lattice, const int ijk[3], const int64_t v[8], int64_t centre,
                                    wave_cell *cells)
{
    int count = 0;
    for (int f = 0; f < 6; ++f) {
        /* The diagonal must begin at the corner with the smallest id. The index of this corner differs between the
         * faces of the table. */
        int64_t q[4];
        int least = 0;
        for (int i = 0; i < 4; ++i) {
            q[i] = v[cube_face[f].corner[i]];
            least = q[i] < q[least] ? i : least;
        }
        int64_t a = q[least], b = q[(least + 1) % 4], c = q[(least + 2) % 4], d = q[(least + 3) % 4];
        if (does_neighbour_split_face(lattice, ijk, f)) {
            cells[count++] = (wave_cell){WAVE_TYPE_TET, {a, c, b, centre}};
            cells[count++] = (wave_cell){WAVE_TYPE_TET, {a, d, c, centre}};
        } else {
            cells[count++] = (wave_cell){WAVE_TYPE_PYRAMID, {a, d, c, b, centre}};
        }
    }
    return count;
}

int wave_lattice_make_cells(const wave_lattice *lattice, int64_t cube, wave_cell cells[WAVE_CELLS_PER_CUBE])
{
    int ijk[3];
    int64_t v[8];
    wave_lattice_find_cube_indices(lattice, cube, ijk);
    for (int c = 0; c < 8; ++c) v[c] = find_corner_vertex(lattice, ijk, c);
    switch (find_cube_kind(lattice, ijk)) {
    case WAVE_TETS: return split_cube_into_tets(v, cells);
    case WAVE_WEDGES: return split_cube_into_wedges(v, cells);
    case WAVE_PYRAMIDS: return split_cube_into_pyramids(lattice, ijk, v, lattice_vertex_count(lattice) + cube, cells);
    default: cells[0] = (wave_cell){WAVE_TYPE_HEX, {v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7]}}; return 1;
    }
}

uint8_t wave_lattice_uniform_type(const wave_lattice *lattice)
{
    static const uint8_t type[] = {WAVE_TYPE_TET, WAVE_TYPE_HEX, WAVE_TYPE_WEDGE, WAVE_TYPE_PYRAMID, 0};
    return type[lattice->cells];
}

bool wave_lattice_find_vertex_indices(const wave_lattice *lattice, int64_t vertex, int ijk[3])
{
    int64_t corners = lattice_vertex_count(lattice);
    if (vertex >= corners) {
        wave_lattice_find_cube_indices(lattice, vertex - corners, ijk);
        return false;
    }
    int64_t nx = lattice->size[0] + 1, ny = lattice->size[1] + 1;
    ijk[0] = (int)(vertex % nx);
    ijk[1] = (int)(vertex / nx % ny);
    ijk[2] = (int)(vertex / nx / ny);
    return true;
}

uint8_t wave_lattice_find_walls(const wave_lattice *lattice, int64_t vertex)
{
    int ijk[3];
    unsigned walls = 0;
    if (!wave_lattice_find_vertex_indices(lattice, vertex, ijk)) return 0;
    for (int a = 0; a < 3; ++a) {
        if (ijk[a] == 0 || ijk[a] == lattice->size[a]) walls |= 1u << a;
    }
    return (uint8_t)walls;
}

static void compute_corner_position(const wave_lattice *lattice, int64_t vertex, const int ijk[3], double xyz[3])
{
    bool inner = true;
    for (int a = 0; a < 3; ++a) {
        inner = inner && ijk[a] > 0 && ijk[a] < lattice->size[a];
        xyz[a] = lattice->origin[a] + lattice->edge * ijk[a];
    }
    if (!inner || lattice->jitter == 0) return;
    for (int a = 0; a < 3; ++a) {
        double unit = (double)(wave_hash((uint64_t)(3 * vertex + a)) >> 11) * 0x1p-53;
        xyz[a] += lattice->edge * lattice->jitter * (2 * unit - 1);
    }
}

void wave_lattice_compute_position(const wave_lattice *lattice, int64_t vertex, double xyz[3])
{
    int ijk[3];
    if (wave_lattice_find_vertex_indices(lattice, vertex, ijk)) {
        compute_corner_position(lattice, vertex, ijk, xyz);
        return;
    }
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (int c = 0; c < 8; ++c) {
        const int8_t *o = corner_offset[c];
        int at[3] = {ijk[0] + o[0], ijk[1] + o[1], ijk[2] + o[2]};
        double corner[3];
        compute_corner_position(lattice, find_corner_vertex(lattice, ijk, c), at, corner);
        for (int a = 0; a < 3; ++a) xyz[a] += 0.125 * corner[a];
    }
}
