/* Makes meshes with hanging nodes (test_mesh_hanging.h). All vertices lie on the lattice of the smallest cells and are
 * created when a cell first uses them. The position of a vertex on the boundary of a cube is interpolated from the
 * cube's corners. It is the same for all cubes at this vertex, because the map of a cube is bilinear on its faces. */
#include "test_mesh_hanging.h"

#include <stdlib.h>
#include <string.h>

#include "test_mesh_make.h"

typedef struct hanging {
    int n, side;
    test_hanging_shape shape;
    test_function *f;
    int64_t line; /* number of lattice points along an axis of the finest lattice */
    /* index of the mesh's vertex for each point of the finest lattice; -1 if it is not created yet */
    int64_t *vertices;
    test_mesh *mesh;
} hanging;

const char *test_hanging_shape_name(test_hanging_shape shape)
{
    static const char *const names[TEST_HANGING_SHAPE_COUNT] = {"dyadic", "turned", "curved", "round"};
    return names[shape];
}

/* Maps the cube onto a ball of radius 1. */
static void map_cube_to_ball(const double p[3], double out[3])
{
    for (int a = 0; a < 3; a++) {
        const double u = p[(a + 1) % 3] * p[(a + 1) % 3], v = p[(a + 2) % 3] * p[(a + 2) % 3];
        out[a] = p[a] * sqrt(1 - u / 2 - v / 2 + u * v / 3);
    }
}

/* Rotates about the axis (1, 2, 3) by an angle whose cosine is 0.8, and scales by 0.55. */
static void rotate_position(const double p[3], double out[3])
{
    const double length = sqrt(14), axis[3] = {1 / length, 2 / length, 3 / length};
    const double along = axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        const double across = axis[b] * p[c] - axis[c] * p[b];
        out[a] = 0.55 * (0.8 * p[a] + 0.6 * across + 0.2 * along * axis[a]);
    }
}

static void map_position(const hanging *h, const double p[3], double out[3])
{
    if (h->shape >= TEST_HANGING_CURVED)
        map_cube_to_ball(p, out);
    else if (h->shape == TEST_HANGING_ROTATED)
        rotate_position(p, out);
    else
        memcpy(out, p, 3 * sizeof *out);
}

/* Computes the position of a point of the finest lattice in the cube [-1, 1]^3. */
static void compute_lattice_position(const hanging *h, const int64_t at[3], double out[3])
{
    for (int a = 0; a < 3; a++) out[a] = 2.0 * (double)at[a] / (double)(h->n * h->side) - 1;
}

/* Interpolates the position and the value at a lattice point from the corners of the cube that contains it. */
static void interpolate_in_cube(const hanging *h, const int64_t at[3], double position[3], double *value)
{
    int64_t cube[3];
    double share[3];
    for (int a = 0; a < 3; a++) {
        cube[a] = at[a] / h->side < h->n ? at[a] / h->side : h->n - 1;
        share[a] = (double)(at[a] - cube[a] * h->side) / h->side;
    }
    position[0] = position[1] = position[2] = *value = 0;
    for (int corner = 0; corner < 8; corner++) {
        int64_t place[3];
        double weight = 1, flat[3], p[3];
        for (int a = 0; a < 3; a++) {
            place[a] = (cube[a] + (corner >> a & 1)) * h->side;
            weight *= corner >> a & 1 ? share[a] : 1 - share[a];
        }
        if (!(weight > 0)) continue;
        compute_lattice_position(h, place, flat);
        map_position(h, flat, p);
        for (int a = 0; a < 3; a++) position[a] += weight * p[a];
        *value += weight * h->f(p);
    }
}

static int64_t find_or_add_vertex(hanging *h, const int64_t at[3])
{
    int64_t *vertex = &h->vertices[at[0] + h->line * (at[1] + h->line * at[2])];
    double flat[3], own[3], mean[3], value;
    if (*vertex >= 0) return *vertex;
    const bool is_inside = at[0] % h->side && at[1] % h->side && at[2] % h->side;
    compute_lattice_position(h, at, flat);
    map_position(h, flat, own);
    interpolate_in_cube(h, at, mean, &value);
    *vertex = test_mesh_add_vertex(h->mesh, h->shape == TEST_HANGING_CURVED ? mean : own);
    h->mesh->values[*vertex] = is_inside ? h->f(h->mesh->coordinates + 3 * *vertex) : value;
    return *vertex;
}

/* Adds the cells of a cube whose lowest corner is the lattice point `at` and whose side is `width` steps of the finest
 * lattice. */
static void add_cells(hanging *h, test_mesh_kind kind, const int64_t at[3], int width)
{
    int64_t corners[8];
    for (int b = 0; b < 8; b++) {
        const int64_t place[3] = {at[0] + (b & 1) * width, at[1] + (b >> 1 & 1) * width, at[2] + (b >> 2) * width};
        corners[b] = find_or_add_vertex(h, place);
    }
    test_mesh_add_cube(h->mesh, kind, corners);
}

static void add_cells_of_cube(hanging *h, test_mesh_kind kind, const int64_t cube[3], bool is_fine)
{
    const int cuts = is_fine ? h->side : 1, width = h->side / cuts;
    for (int i = 0; i < cuts * cuts * cuts; i++) {
        const int place[3] = {i % cuts, i / cuts % cuts, i / (cuts * cuts)};
        int64_t at[3];
        for (int a = 0; a < 3; a++) at[a] = cube[a] * h->side + (int64_t)place[a] * width;
        add_cells(h, kind, at, width);
    }
}

void test_mesh_make_hanging(test_mesh_kind kind, int n, int side, test_hanging_shape shape, test_function *f,
                            test_mesh *out)
{
    hanging h = {n, side, shape, f, (int64_t)n * side + 1, NULL, out};
    const int64_t places = h.line * h.line * h.line, cells = 6 * places;
    h.vertices = test_allocate(places, sizeof *h.vertices);
    for (int64_t i = 0; i < places; i++) h.vertices[i] = -1;
    test_mesh_allocate(out, places, cells, 8 * cells);
    for (int64_t i = 0; i < (int64_t)n * n * n; i++)
        add_cells_of_cube(&h, kind, (const int64_t[]){i % n, i / n % n, i / ((int64_t)n * n)},
                          test_uniform((uint64_t)i, 77) < 1.0 / 3);
    free(h.vertices);
}
