/* Checks what layouts and builders guarantee in addition to a valid tree: boxes of compact nodes (24 bytes) contain
 * their cells tightly, quantization grids fit the mesh, cells of very different sizes are distinguished, and memory is
 * bounded. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "memory.h"
#include "mmbvh.h"
#include "mmbvh_store.h"
#include "test_mmbvh_grids.h"
#include "test_mmbvh_nodes.h"

static const double no_shift[3] = {0, 0, 0};

static mmbvh build_tree(const lattice *l, mmbvh_layout layout, mmbvh_builder builder)
{
    mmbvh tree;
    base_error error = {0};
    const mmbvh_options options = {.threads = 2, .layout = layout, .builder = builder};
    if (mmbvh_build(&l->g, &l->field, no_shift, 1, &options, &tree, &error)) fail_msg("%s", error.message);
    return tree;
}

/* Checks the rounding of random boxes in random quantization grids. Sizes and distances are from 1e-9 to 1e9, and boxes
 * are as large as the grid or as small as a point. The stored box must contain the given one. Its lower bound may be
 * off by one step, plus one for rounding; its extent may be too large by 1/256 of itself and a sixteenth of a step
 * (mmbvh_compact.h). */
static void compact_box_is_conservative_and_tight(void **state)
{
    (void)state;
    mmbvh_compact_node node = {0};
    mmbvh tree = {.compact = &node, .node_count = 1};
    for (uint64_t n = 0; n < 200000; n++) {
        vec4 lower = {0}, upper = {0};
        float low[4], high[4], grid_lower[3], grid_upper[3];
        for (uint64_t axis = 0; axis < 3; axis++) {
            const uint64_t seed = 64 * n + 8 * axis;
            const double size = pow(10, 18 * hash_to_unit_interval(seed) - 9),
                         far = hash_to_unit_interval(seed + 1) < 0.5 ? 0 : 1;
            const double begin =
                far * pow(10, 18 * hash_to_unit_interval(seed + 2) - 9) * (hash_to_unit_interval(seed + 3) - 0.5);
            const double extent =
                hash_to_unit_interval(seed + 4) < 0.1 ? 0 : size * pow(10, -7 * hash_to_unit_interval(seed + 5));
            const double place = begin + (size - extent) * hash_to_unit_interval(seed + 6);
            grid_lower[axis] = (float)begin;
            grid_upper[axis] = (float)(begin + size);
            lower[axis] = fmaxf((float)place, grid_lower[axis]);
            upper[axis] = fminf(fmaxf((float)(place + extent), lower[axis]), grid_upper[axis]);
            if (upper[axis] < lower[axis]) lower[axis] = upper[axis];
        }
        tree.grid = store_make_grid(grid_lower, grid_upper);
        assert_true(store_box(&tree, 0, lower, upper));
        mmbvh_node_box(&tree, 0, low, high);
        for (int axis = 0; axis < 3; axis++) {
            const double step = (double)tree.grid.step[axis];
            const double below = (double)lower[axis] - (double)low[axis];
            const double above = (double)high[axis] - (double)upper[axis];
            const double extent = (double)high[axis] - (double)low[axis];
            assert_true(below >= 0 && below <= 2 * step);
            assert_true(above >= 0 && above <= step + (extent + 16 * step) / 256);
        }
    }
}

static void box_beyond_the_grid_is_refused(void **state)
{
    (void)state;
    mmbvh_compact_node node = {0};
    mmbvh tree = {.compact = &node, .node_count = 1};
    tree.grid = store_make_grid((const float[3]){-1, 2, 0}, (const float[3]){1, 5, 0});
    const vec4 lower = {-1, 2, 0, 0}, upper = {1, 5, 0, 0};
    assert_true(store_box(&tree, 0, lower, upper));
    for (int axis = 0; axis < 3; axis++) {
        static const float wrong[] = {100, INFINITY, NAN};
        for (int i = 0; i < 3; i++) {
            vec4 outside = lower;
            outside[axis] = -wrong[i];
            assert_false(store_box(&tree, 0, outside, upper));
            outside = upper;
            outside[axis] = wrong[i];
            assert_false(store_box(&tree, 0, lower, outside));
        }
    }
}

/* Checks that both layouts have the same nodes with bitwise equal ranges and the same leaves, and that each box of the
 * compact layout contains that of the reference layout. */
static void layouts_represent_the_same_tree(void **state)
{
    (void)state;
    lattice l = make_lattice(12, LATTICE_MIXED, (lattice_layout){true, false, true, false});
    for (int builder = MMBVH_SAH; builder <= MMBVH_MORTON; builder++) {
        mmbvh compact = build_tree(&l, MMBVH_COMPACT, (mmbvh_builder)builder);
        mmbvh reference = build_tree(&l, MMBVH_REFERENCE, (mmbvh_builder)builder);
        assert_true(compact.compact && !compact.nodes && reference.nodes && !reference.compact);
        assert_int_equal(compact.node_count, reference.node_count);
        assert_int_equal(mmbvh_bytes(&reference) - mmbvh_bytes(&compact), 16 * compact.node_count);
        for (int64_t i = 0; i < compact.node_count; i++) {
            const node_view a = read_node(&compact, i), b = read_node(&reference, i);
            assert_true(a.count == b.count && a.ref == b.ref);
            assert_true(a.range_low == b.range_low && a.range_high == b.range_high);
            for (int axis = 0; axis < 3; axis++) {
                assert_true(a.lower[axis] <= b.lower[axis] && b.upper[axis] <= a.upper[axis]);
            }
        }
        assert_memory_equal(compact.cells, reference.cells, (size_t)compact.cell_count * sizeof *compact.cells);
        mmbvh_free(&compact);
        mmbvh_free(&reference);
    }
    free_lattice(&l);
}

static void infinite_boxes_use_the_reference_layout(void **state)
{
    (void)state;
    float lower[30], upper[30], ranges[20] = {0};
    for (int i = 0; i < 30; i++) {
        lower[i] = (float)i;
        upper[i] = i == 17 ? INFINITY : (float)(i + 2);
    }
    mmbvh tree;
    assert_int_equal(mmbvh_build_boxes(lower, upper, ranges, 10, NULL, &tree, NULL), INSITU_OK);
    assert_true(tree.nodes && !tree.compact);
    assert_proved(&tree, NULL, NULL);
    assert_true(read_node(&tree, 0).upper[17 % 3] == INFINITY);
    mmbvh_free(&tree);
}

/* Returns the number of cells in leaves whose boxes, and those of all their ancestors, contain the point. */
static int64_t count_cells_tested(const mmbvh *tree, const double p[3])
{
    int64_t tested = 0, stack[MMBVH_MAX_DEPTH + 1] = {0};
    for (int height = 1; height > 0;) {
        const node_view node = read_node(tree, stack[--height]);
        bool inside = true;
        for (int axis = 0; axis < 3; axis++) {
            inside = inside && (double)node.lower[axis] <= p[axis] && p[axis] <= (double)node.upper[axis];
        }
        if (inside) tested += node.count;
        for (int side = 0; inside && !node.count && side < 2; side++) stack[height++] = node.ref + side;
    }
    return tested;
}

/* Checks hexes of side 1 of which the ten in the middle of each axis are shrunk to a side of 2e-5. These ten together
 * are smaller than a step of the builder's first grid, 9 / 32767. Without a finer grid, the 1000 cells that are shrunk
 * along all axes would have the same position, and a leaf would contain any four of them. With a finer grid, a point in
 * a cell is in the boxes of a few leaves only. */
static void cells_of_very_different_sizes_are_distinguished(void **state)
{
    (void)state;
    for (int layout = MMBVH_COMPACT; layout <= MMBVH_REFERENCE; layout++) {
        lattice l = make_lattice(19, LATTICE_HEXES, (lattice_layout){true, false, true, false});
        uint64_t seed = 1;
        for (int64_t v = 0; v < l.g.vertex_count; v++) {
            double p[3];
            grid_read_vertex_position(&l.g, v, p);
            /* Shrinks the vertices 5 to 14 along each axis towards the middle. */
            for (int axis = 0; axis < 3; axis++) {
                const double x = p[axis];
                const double y = x < 5 ? x : x > 15 ? x - 10 + 2e-4 : 5 + (x - 5) * 2e-5;
                set_number(&l.g.coordinates[axis], v, y);
            }
        }
        /* Shuffles the cells, so that their indices do not depend on their positions. */
        for (int64_t cell = l.g.cell_count - 1; cell > 0; cell--) {
            const int64_t other = (int64_t)(hash_to_unit_interval(seed++) * (double)(cell + 1));
            for (int k = 0; k < 8; k++) {
                const int64_t a = grid_read_index(&l.g.connectivity, 8 * cell + k);
                const int64_t b = grid_read_index(&l.g.connectivity, 8 * other + k);
                set_index(&l.g.connectivity, 8 * cell + k, b);
                set_index(&l.g.connectivity, 8 * other + k, a);
            }
        }
        mmbvh tree = build_tree(&l, (mmbvh_layout)layout, MMBVH_SAH);
        assert_proved(&tree, &l.g, &l.field);
        int64_t tested = 0;
        for (uint64_t n = 0; n < 1000; n++) {
            double p[3];
            for (uint64_t axis = 0; axis < 3; axis++)
                p[axis] = 5 + 2e-4 * (0.1 + 0.8 * hash_to_unit_interval(3 * n + axis));
            tested += count_cells_tested(&tree, p);
        }
        /* On each axis, the box of a jittered hex is 1.3 to 1.6 times as large as the cell, and the box of a leaf half
         * as large again, so that a point is in about 4 leaves of 4 cells. Compact boxes are not checked, because their
         * steps are as large as a cell. */
        assert_true(layout == MMBVH_COMPACT || tested < 1000 * 20);
        mmbvh_free(&tree);
        free_lattice(&l);
    }
}

/* Checks a vertex that belongs to no cell and is a million times farther away than all others. */
static void vertices_of_no_cell_do_not_coarsen_the_tree(void **state)
{
    (void)state;
    lattice l = make_lattice(12, LATTICE_HEXES, (lattice_layout){true, false, true, false});
    for (int builder = MMBVH_SAH; builder <= MMBVH_MORTON; builder++) {
        mmbvh tight = build_tree(&l, MMBVH_COMPACT, (mmbvh_builder)builder);
        grid far = l.g;
        far.vertex_count++;
        for (int axis = 0; axis < 3; axis++) {
            l.coordinates = realloc(l.coordinates, (size_t)far.vertex_count * 24);
            for (int a = 0; a < 3; a++) l.g.coordinates[a].data = far.coordinates[a].data = l.coordinates + 8 * a;
            set_number(&far.coordinates[axis], far.vertex_count - 1, builder ? 1e8 : -1e8);
        }
        mmbvh tree;
        const mmbvh_options options = {.builder = (mmbvh_builder)builder};
        assert_int_equal(mmbvh_build(&far, &l.field, no_shift, 1, &options, &tree, NULL), INSITU_OK);
        assert_proved(&tree, &far, &l.field);
        /* The origins of the grids differ by a rounding of the estimated bounds, and therefore one or two split planes
         * may differ too. */
        assert_true(fabs(tree.built_cost / tight.built_cost - 1) < 0.01);
        assert_memory_equal(&tree.grid, &tight.grid, sizeof tree.grid);
        mmbvh_free(&tree);
        mmbvh_free(&tight);
    }
    free_lattice(&l);
}

static void scale_mesh(lattice *l, double scale)
{
    for (int64_t v = 0; v < l->g.vertex_count; v++) {
        double p[3];
        grid_read_vertex_position(&l->g, v, p);
        for (int axis = 0; axis < 3; axis++) set_number(&l->g.coordinates[axis], v, p[axis] * scale);
    }
}

/* Checks a mesh that grows a thousandfold and shrinks again. The quantization grid must be adapted, and the cost of the
 * tree must stay the same. */
static void refit_follows_a_mesh_that_grows_and_shrinks(void **state)
{
    (void)state;
    lattice l = make_lattice(18, LATTICE_TETS, (lattice_layout){true, false, true, false});
    mmbvh tree = build_tree(&l, MMBVH_COMPACT, MMBVH_SAH);
    static const double scales[] = {1.01, 1000, 1e-3, 1e-6, 1e6};
    for (int i = 0; i < 5; i++) {
        scale_mesh(&l, scales[i]);
        assert_int_equal(mmbvh_refit_bounds(&tree, &l.g, &(mmbvh_options){.threads = 2}), INSITU_OK);
        const mmbvh_statistics s = assert_proved(&tree, &l.g, &l.field);
        /* Boxes are rounded differently on another grid: by 1/256 of an extent along three axes. */
        assert_true(fabs(s.cost / tree.built_cost - 1) < 3.0 / 256);
    }
    set_number(&l.g.coordinates[0], 5, INFINITY);
    assert_int_equal(mmbvh_refit_bounds(&tree, &l.g, NULL), INSITU_ERROR_MESH);
    mmbvh_free(&tree);
    free_lattice(&l);
}

/* Checks that a tree built along the space-filling curve costs at most 1.5 times as much as one built by the surface
 * area heuristic. */
static void morton_builder_costs_little_more_than_plane_builder(void **state)
{
    (void)state;
    for (int kind = LATTICE_TETS; kind <= LATTICE_HEXES; kind++) {
        lattice l = make_lattice(20, (lattice_kind)kind, (lattice_layout){0});
        mmbvh planes = build_tree(&l, MMBVH_COMPACT, MMBVH_SAH), curve = build_tree(&l, MMBVH_COMPACT, MMBVH_MORTON);
        assert_true(planes.built_cost < curve.built_cost && curve.built_cost < 1.5 * planes.built_cost);
        mmbvh_free(&planes);
        mmbvh_free(&curve);
        free_lattice(&l);
    }
}

/* Checks that the tree of 178,746 tets takes at most 16 bytes per cell, and that building it takes at most 2.5 times as
 * much memory. */
static void tree_memory_is_within_the_stated_bounds(void **state)
{
    (void)state;
    lattice l = make_lattice(31, LATTICE_TETS, (lattice_layout){0});
    for (int builder = MMBVH_SAH; builder <= MMBVH_MORTON; builder++) {
        const int64_t before = base_memory_held();
        base_memory_reset_peak();
        mmbvh tree = build_tree(&l, MMBVH_COMPACT, (mmbvh_builder)builder);
        const int64_t peak = base_memory_peak() - before, held = base_memory_held() - before;
        assert_int_equal(held, mmbvh_bytes(&tree));
        assert_true(held <= 16 * l.g.cell_count);
        assert_true(2 * peak <= 5 * held);
        mmbvh_free(&tree);
        assert_int_equal(base_memory_held(), before);
    }
    free_lattice(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(compact_box_is_conservative_and_tight),
        cmocka_unit_test(box_beyond_the_grid_is_refused),
        cmocka_unit_test(layouts_represent_the_same_tree),
        cmocka_unit_test(infinite_boxes_use_the_reference_layout),
        cmocka_unit_test(cells_of_very_different_sizes_are_distinguished),
        cmocka_unit_test(vertices_of_no_cell_do_not_coarsen_the_tree),
        cmocka_unit_test(refit_follows_a_mesh_that_grows_and_shrinks),
        cmocka_unit_test(morton_builder_costs_little_more_than_plane_builder),
        cmocka_unit_test(tree_memory_is_within_the_stated_bounds),
    };
    return cmocka_run_group_tests_name("mmbvh_layout", tests, NULL, NULL);
}
