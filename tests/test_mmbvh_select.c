/* Compares the selection of visible cells with brute force over all cells in double, for every kind of cell and layout,
 * with ghosts and with values that are not finite. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "mmbvh.h"
#include "test_meshes.h"

enum {
    SIDE = 7,
    LARGE_SIDE = 15 /* LARGE_SIDE: a mesh with enough cells for several blocks on each of several threads */,
    QUERIES = 5
};

/* Intervals of the queries: one isovalue, several isovalues, the ranges in which a transfer function is not
 * transparent, and the least and the greatest of all values, each of which only one vertex has. */
static const mmbvh_interval at_one[] = {{0.25f, 0.25f}}, at_three[] = {{-1, -1}, {0.1f, 0.1f}, {0.9f, 0.9f}},
                            in_two[] = {{-0.4f, -0.3f}, {1, INFINITY}}, at_least[] = {{-2, -2}}, at_most[] = {{2, 2}};

static void make_queries(const grid_field *field, mmbvh_query queries[QUERIES])
{
    queries[0] = (mmbvh_query){field, 1, at_one};
    queries[1] = (mmbvh_query){field, 3, at_three};
    queries[2] = (mmbvh_query){field, 2, in_two};
    queries[3] = (mmbvh_query){field, 1, at_least};
    queries[4] = (mmbvh_query){field, 1, at_most};
}

/* Makes a mesh in which every fifth cell is a ghost and one of two hundred values is not finite. */
static test_mesh make_mesh(test_mesh_kind kind, int side)
{
    test_mesh mesh;
    test_mesh_make_lattice(kind, side, 0.2, test_wave_field, &mesh);
    test_mesh_round_to_float(&mesh);
    for (int64_t v = 0; v < mesh.vertex_count; v++) {
        const double u = test_uniform((uint64_t)v, 1);
        if (u < 0.005) mesh.values[v] = u < 0.002 ? (double)NAN : u < 0.0035 ? (double)INFINITY : -(double)INFINITY;
    }
    mesh.values[mesh.vertex_count / 2] = -2;
    mesh.values[mesh.vertex_count / 3] = 2;
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) mesh.ghosts[cell] = test_uniform((uint64_t)cell, 2) < 0.2;
    return mesh;
}

/* Returns -1 if the cell has a value that is not finite, 1 if the query selects the cell, else 0. */
static int select_by_brute_force(const test_view *view, const mmbvh_query *query, int64_t cell)
{
    double low = (double)INFINITY, high = -(double)INFINITY;
    grid_walk walk = grid_walk_cell(&view->cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        const double v = grid_field_value(&view->field, view->field.is_cell_centred ? cell : vertex);
        if (!isfinite(v)) return -1;
        low = fmin(v, low);
        high = fmax(v, high);
    }
    for (int i = 0; i < query->interval_count; i++)
        if ((float)low <= query->intervals[i].high && (float)high >= query->intervals[i].low) return 1;
    return 0;
}

/* Compares the selected cells with those selected by brute force. Returns their number. */
static int64_t assert_selects(const test_view *view, const mmbvh_query *queries, int count)
{
    mmbvh_selection selection;
    int64_t unusable[QUERIES], unusable_by_hand[QUERIES] = {0}, found = 0;
    base_error error;
    assert_int_equal(
        mmbvh_select(&view->cells, queries, count, &(mmbvh_options){.threads = 2}, &selection, unusable, &error),
        INSITU_OK);
    for (int64_t cell = 0; cell < view->cells.cell_count; cell++) {
        bool shows = false;
        for (int i = 0; i < count && !grid_is_ghost(&view->cells, cell); i++) {
            const int seen = select_by_brute_force(view, &queries[i], cell);
            shows |= seen > 0;
            unusable_by_hand[i] += seen < 0;
        }
        if (!shows) continue;
        assert_true(found < selection.count);
        assert_int_equal(selection.cells[found++], cell);
    }
    assert_int_equal(found, selection.count);
    for (int i = 0; i < count; i++) assert_int_equal(unusable[i], unusable_by_hand[i]);
    mmbvh_selection_free(&selection);
    return found;
}

static void assert_selects_all_queries(const test_mesh *mesh, test_layout layout)
{
    test_view view;
    mmbvh_query queries[QUERIES];
    test_view_create(mesh, layout, &view);
    make_queries(&view.field, queries);
    for (int i = 0; i < QUERIES; i++) {
        const int64_t count = assert_selects(&view, &queries[i], 1);
        assert_true(count > 0 && count < view.cells.cell_count);
    }
    assert_selects(&view, queries, QUERIES);
    test_view_free(&view);
}

static void only_cells_that_may_be_visible_are_selected(void **state)
{
    (void)state;
    for (int kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh = make_mesh((test_mesh_kind)kind, SIDE);
        for (int bits = 0; bits < 16; bits++)
            assert_selects_all_queries(&mesh, (test_layout){false, bits & 1, bits >> 1 & 1, bits >> 2 & 1, bits >> 3});
        test_mesh_free(&mesh);
        mesh = make_mesh((test_mesh_kind)kind, LARGE_SIDE);
        assert_selects_all_queries(&mesh, (test_layout){false});
        test_mesh_free(&mesh);
    }
}

/* Checks components and magnitudes of vectors, values in cells, integers, and double values whose selection depends on
 * the rounding to float. */
static void selection_supports_all_field_kinds(void **state)
{
    (void)state;
    for (int kind = TEST_TETS; kind <= TEST_MIXED; kind++) {
        test_mesh mesh = make_mesh((test_mesh_kind)kind, SIDE);
        test_view view;
        test_view_create(&mesh, (test_layout){false}, &view);
        const int64_t count =
            /* number of values, enough for a field in cells and for one at vertices */
            mesh.cell_count > mesh.vertex_count ? mesh.cell_count : mesh.vertex_count;
        double *vectors = malloc((size_t)count * 3 * sizeof *vectors);
        int32_t *integers = malloc((size_t)count * sizeof *integers);
        assert_true(vectors && integers);
        for (int64_t i = 0; i < 3 * count; i++)
            vectors[i] =
                1 + (test_uniform((uint64_t)i, 3) < 0.4 ? 0 : test_uniform_between((uint64_t)i, 4, -5e-8, 5e-8));
        for (int64_t i = 0; i < count; i++) integers[i] = (int32_t)test_uniform_between((uint64_t)i, 5, -3, 3);
        vectors[3 * 11 + 2] = (double)NAN;
        const grid_field fields[] = {
            {.values = {.data = (const char *)vectors, .stride = 24, .is_wide = true},
             .component_stride = 8,
             .component_count = 3,
             .component = 2},
            {.values = {.data = (const char *)vectors, .stride = 24, .is_wide = true},
             .component_stride = 8,
             .component_count = 3,
             .component = -1},
            {.values = {.data = (const char *)vectors, .stride = 8, .is_wide = true},
             .component_stride = 8,
             .component_count = 1,
             .is_cell_centred = true},
            {.values = {.data = (const char *)integers, .stride = 4, .is_integer = true}, .component_count = 1},
        };
        for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
            const float root = sqrtf(3);
            const mmbvh_interval at[] = {{1, 1}, {root, root}, {2, 2}};
            view.field = fields[i];
            assert_true(assert_selects(&view, &(mmbvh_query){&view.field, 3, at}, 1) > 0);
        }
        free(vectors);
        free(integers);
        test_view_free(&view);
        test_mesh_free(&mesh);
    }
}

static void cells_without_a_query_are_not_selected(void **state)
{
    (void)state;
    test_mesh mesh = make_mesh(TEST_TETS, SIDE);
    test_view view;
    test_view_create(&mesh, (test_layout){false}, &view);
    const mmbvh_interval beyond = {7, 8};
    assert_int_equal(assert_selects(&view, &(mmbvh_query){&view.field, 1, &beyond}, 1), 0);
    assert_int_equal(assert_selects(&view, &(mmbvh_query){&view.field, 0, NULL}, 1), 0);
    view.cells.cell_count = 0;
    assert_int_equal(assert_selects(&view, &(mmbvh_query){&view.field, 1, at_one}, 1), 0);
    test_view_free(&view);
    test_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_cells_that_may_be_visible_are_selected),
        cmocka_unit_test(selection_supports_all_field_kinds),
        cmocka_unit_test(cells_without_a_query_are_not_selected),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
