/* Checks, by brute force, the linear pieces into which cells of higher order are split. Pieces must have the volume of
 * their cells and the same orientation. Each of their faces, compared by its nodes, must belong to exactly two pieces,
 * or to one piece on the border of the mesh. So there is no gap and no overlap between cells. Coordinates are rotated
 * and mirrored in all 48 possible ways, because the split of serendipity cells depends on the order of coordinates. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "session_cell_faces.h"
#include "session_split.h"
#include "session_tally.h"
#include "test_mesh_order.h"

enum { SIDE = 2, WAYS = 48 };

static double zero_field(const double p[3])
{
    return p[0];
}

/* Permutes the axes in one of six orders and gives each axis one of two signs. */
static void permute_axes(order_mesh *mesh, int way)
{
    static const signed char orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        double *p = mesh->coordinates + 3 * i;
        const double in[3] = {p[0], p[1], p[2]};
        for (int axis = 0; axis < 3; axis++) p[axis] = in[orders[way / 8][axis]] * (way >> axis & 1 ? -1 : 1);
    }
}

typedef struct face_key {
    int64_t vertices[4]; /* in ascending order; the first is -1 if the face is a triangle */
} face_key;

static int compare_numbers(const void *a, const void *b)
{
    const int64_t left = *(const int64_t *)a, right = *(const int64_t *)b;
    return left < right ? -1 : left > right;
}

static int compare_keys(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(face_key));
}

static grid make_grid(const order_mesh *mesh, const session_topology *t)
{
    grid g = {.vertex_count = mesh->vertex_count,
              .cell_count = t->cell_count,
              .connectivity = t->connectivity,
              .offsets = t->offsets,
              .cell_types = (const char *)t->cell_types,
              .cell_types_stride = 1,
              .cell_types_bytes = 1,
              .cell_type = t->cell_type};
    for (int axis = 0; axis < 3; axis++)
        g.coordinates[axis] = (grid_array){
            .data = (const char *)(mesh->coordinates + axis), .stride = 3 * sizeof(double), .is_wide = true};
    return g;
}

static int64_t list_faces(const grid *g, face_key *keys)
{
    int64_t count = 0;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        const session_cell_faces faces = session_faces_of_cell(g, cell);
        for (int64_t f = 0; f < faces.count; f++) {
            const session_face_loop loop = session_find_face_loop(&faces, f);
            keys[count] = (face_key){{-1, -1, -1, -1}};
            for (int64_t i = 0; i < loop.size; i++) keys[count].vertices[i] = session_face_vertex(&loop, i);
            qsort(keys[count++].vertices, 4, sizeof(int64_t), compare_numbers);
        }
    }
    return count;
}

static bool is_on_border(const order_mesh *mesh, const face_key *key)
{
    bool is_on = false;
    for (int side = 0; side < 6; side++) {
        bool are_all = true;
        for (int i = 0; i < 4; i++)
            if (key->vertices[i] >= 0)
                are_all =
                    are_all && fabs(mesh->coordinates[3 * key->vertices[i] + side / 2] - (side % 2 * 2 - 1)) < 1e-12;
        is_on = is_on || are_all;
    }
    return is_on;
}

static void check_faces_match(const order_mesh *mesh, const grid *g, const char *name, int way)
{
    face_key *keys = malloc((size_t)g->cell_count * 6 * sizeof *keys);
    const int64_t count = list_faces(g, keys);
    int64_t open = 0, shared_by_more = 0;
    qsort(keys, (size_t)count, sizeof *keys, compare_keys);
    for (int64_t i = 0, end = 0; i < count; i = end) {
        while (end < count && compare_keys(&keys[i], &keys[end]) == 0) end++;
        open += end - i == 1 && !is_on_border(mesh, &keys[i]);
        shared_by_more += end - i > 2;
    }
    if (open || shared_by_more)
        fprintf(stderr, "%s, turned %d: %lld open faces inside, %lld of three cells\n", name, way, (long long)open,
                (long long)shared_by_more);
    assert_true(open == 0 && shared_by_more == 0);
    free(keys);
}

/* Checks that the volumes of pieces with flat faces add up to the volume of the cube, 8, up to rounding, and that all
 * have the same sign. */
static void check_volumes_add_up(const grid *g, bool is_mirrored)
{
    double sum = 0;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        double points[GRID_MAX_CELL_VERTICES][3];
        const int count = grid_cell_vertices(g, cell, vertices);
        for (int i = 0; i < count; i++) grid_read_vertex_position(g, vertices[i], points[i]);
        const double volume = tally_signed_volume(grid_cell_type(g, cell), points);
        assert_true(is_mirrored ? volume < 0 : volume > 0);
        sum += fabs(volume);
    }
    assert_true(fabs(sum - 8) < 1e-9);
}

static void cut_and_verify(const order_kind *kind, int way, double bend)
{
    order_mesh mesh;
    base_error error = {.status = INSITU_OK};
    order_mesh_create(kind, SIDE, bend, zero_field, 0, 1, &mesh);
    permute_axes(&mesh, way);
    session_mesh cut = {.name = (char[]){"m"}, .given = mesh.mesh};
    assert_int_equal(session_split_cells(&cut, 1, &error), INSITU_OK);
    const grid g = make_grid(&mesh, &cut.topology);
    const bool is_mirrored = (way / 24 + (way & 1) + (way >> 1 & 1) + (way >> 2 & 1)) % 2 == 1;
    check_faces_match(&mesh, &g, kind->name, way);
    if (bend == 0) check_volumes_add_up(&g, is_mirrored);
    for (int64_t i = 1; i < g.cell_count; i++) assert_true(cut.topology.parents[i] - cut.topology.parents[i - 1] <= 1);
    assert_int_equal(cut.topology.parents[g.cell_count - 1], mesh.cell_count - 1);
    session_drop_topology(&cut.topology);
    order_mesh_free(&mesh);
}

static void pieces_fill_their_cells(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++)
        for (int way = 0; way < WAYS; way++) {
            if (order_kinds[k].order > 2 && way) continue; /* the split of other cells does not depend on coordinates */
            cut_and_verify(&order_kinds[k], way, 0);
            cut_and_verify(&order_kinds[k], way, 0.08);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pieces_fill_their_cells)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
