/* Compares the tree with brute force over all cells in double, after building and after refitting. Also checks failed
 * allocations. All tests run for both layouts and both builders. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <float.h>
#include <stdio.h>

#include "memory.h"
#include "mmbvh.h"
#include "test_mmbvh_grids.h"
#include "test_mmbvh_nodes.h"

static const double no_shift[3] = {0, 0, 0};

static mmbvh_options variant; /* layout and builder of the current group of tests */

static mmbvh_options make_thread_options(int threads)
{
    mmbvh_options options = variant;
    options.threads = threads;
    return options;
}

static mmbvh build_with_threads(const lattice *l, const grid_field *field, int threads)
{
    mmbvh tree;
    base_error error = {0};
    const mmbvh_options options = make_thread_options(threads);
    const insitu_status status = mmbvh_build(&l->g, field, no_shift, 1, &options, &tree, &error);
    if (status) fail_msg("%s", error.message);
    return tree;
}

/* Computes the box of a cell in the tree's coordinates in double. */
static void compute_cell_box(const lattice *l, const mmbvh *tree, int64_t cell, double lower[3], double upper[3])
{
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    const int count = grid_cell_vertices(&l->g, cell, vertices);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = INFINITY;
        upper[axis] = -INFINITY;
        for (int i = 0; i < count; i++) {
            double p[3];
            grid_read_vertex_position(&l->g, vertices[i], p);
            const double x = (p[axis] - tree->origin[axis]) * tree->scale;
            lower[axis] = fmin(lower[axis], x);
            upper[axis] = fmax(upper[axis], x);
        }
    }
}

/* Rounds down by functions of the C library, not by those of the tree. */
static float round_down_to_float(double x)
{
    const float f = (float)x;
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static float round_up_to_float(double x)
{
    const float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

/* Computes a leaf's box and range of values by brute force. */
static node_view compute_leaf_by_brute_force(const lattice *l, const mmbvh *tree, const grid_field *field,
                                             int64_t index)
{
    node_view leaf = read_node(tree, index);
    double low = INFINITY, high = -INFINITY,
           box[2][3] = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int k = 0; k < leaf.count; k++) {
        const int64_t cell = tree->cells[leaf.ref + k];
        double lower[3], upper[3], values[GRID_MAX_CELL_VERTICES];
        compute_cell_box(l, tree, cell, lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            box[0][axis] = fmin(box[0][axis], lower[axis]);
            box[1][axis] = fmax(box[1][axis], upper[axis]);
        }
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        const int count = grid_cell_vertices(&l->g, cell, vertices);
        if (!grid_cell_values(field, cell, vertices, count, values)) continue;
        for (int i = 0; i < count; i++) {
            low = fmin(low, values[i]);
            high = fmax(high, values[i]);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        leaf.lower[axis] = round_down_to_float(box[0][axis]);
        leaf.upper[axis] = round_up_to_float(box[1][axis]);
    }
    leaf.range_low = low <= high ? round_down_to_float(low) : INFINITY;
    leaf.range_high = low <= high ? round_up_to_float(high) : -INFINITY;
    return leaf;
}

/* Checks that a box is hardly larger than expected. The compact layout rounds a lower bound down to a whole step, and
 * by one step more if the quotient is rounded in the wrong direction. It measures an extent from the stored lower bound
 * and rounds it up by at most 1/256 of itself and 16 steps. */
static void assert_tight_box(const mmbvh *tree, const node_view *node, const node_view *expected)
{
    for (int axis = 0; axis < 3; axis++) {
        const double below = (double)expected->lower[axis] - (double)node->lower[axis];
        const double above = (double)node->upper[axis] - (double)expected->upper[axis];
        const double step = tree->compact ? (double)tree->grid.step[axis] : 0;
        const double extent = tree->compact ? (double)node->upper[axis] - (double)node->lower[axis] : 0;
        assert_true(below >= 0 && below <= 2 * step);
        assert_true(above >= 0 && above <= step + (extent + 16 * step) / 256);
    }
}

/* Checks that boxes are no larger than necessary. mmbvh_check() checks that they contain their cells. */
static void assert_tight(const lattice *l, const mmbvh *tree, const grid_field *field)
{
    for (int64_t i = 0; i < tree->node_count; i++) {
        const node_view node = read_node(tree, i);
        node_view expected;
        if (node.count) {
            expected = compute_leaf_by_brute_force(l, tree, field, i);
        } else {
            const node_view pair[2] = {read_node(tree, node.ref), read_node(tree, node.ref + 1)};
            expected = pair[0];
            for (int axis = 0; axis < 3; axis++) {
                expected.lower[axis] = fminf(pair[0].lower[axis], pair[1].lower[axis]);
                expected.upper[axis] = fmaxf(pair[0].upper[axis], pair[1].upper[axis]);
            }
            expected.range_low = fminf(pair[0].range_low, pair[1].range_low);
            expected.range_high = fmaxf(pair[0].range_high, pair[1].range_high);
        }
        assert_tight_box(tree, &node, &expected);
        assert_true(node.range_low == expected.range_low);
        assert_true(node.range_high == expected.range_high);
    }
}

static void every_layout_builds_a_valid_tight_tree(void **state)
{
    (void)state;
    for (int kind = LATTICE_TETS; kind <= LATTICE_MIXED; kind++) {
        for (int bits = 0; bits < 16; bits++) {
            const lattice_layout layout = {bits & 1, bits >> 1 & 1, bits >> 2 & 1, bits >> 3 & 1};
            lattice l = make_lattice(7, (lattice_kind)kind, layout);
            mmbvh tree = build_with_threads(&l, &l.field, 2);
            const mmbvh_statistics s = assert_proved(&tree, &l.g, &l.field);
            assert_tight(&l, &tree, &l.field);
            assert_int_equal(tree.unusable_cells, 0);
            assert_int_equal(tree.cell_count, l.g.cell_count);
            assert_int_equal(s.bytes,
                             tree.node_count * (variant.layout == MMBVH_REFERENCE ? 40 : 24) + tree.cell_count * 4);
            mmbvh_free(&tree);
            assert_true(!tree.nodes && !tree.compact);
            free_lattice(&l);
        }
    }
}

static void shifted_and_scaled_bounds_are_rounded_outward(void **state)
{
    (void)state;
    lattice l = make_lattice(6, LATTICE_TETS, (lattice_layout){true, false, true, false});
    const double origin[3] = {5.8e6, -1.0 / 3, 2};
    mmbvh tree;
    base_error error = {0};
    assert_int_equal(mmbvh_build(&l.g, &l.field, origin, 0.1, &variant, &tree, &error), INSITU_OK);
    assert_proved(&tree, &l.g, &l.field);
    assert_tight(&l, &tree, &l.field);
    mmbvh_free(&tree);
    free_lattice(&l);
}

/* Checks a mesh of 178,746 tets, which is large enough that several threads split the root in chunks. */
static void same_bytes_for_any_number_of_threads(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, 3, 8, 8, 8};
    lattice l = make_lattice(31, LATTICE_TETS, (lattice_layout){false, false, true, false});
    mmbvh first = build_with_threads(&l, &l.field, 1);
    assert_proved(&first, &l.g, &l.field);
    for (size_t i = 0; i < sizeof threads / sizeof *threads; i++) {
        mmbvh tree = build_with_threads(&l, &l.field, threads[i]);
        assert_same_nodes(&tree, &first);
        assert_memory_equal(tree.cells, first.cells, (size_t)first.cell_count * sizeof *first.cells);
        assert_true(tree.built_cost == first.built_cost);
        mmbvh_free(&tree);
    }
    mmbvh_free(&first);
    free_lattice(&l);
}

static void ghosts_are_not_in_the_tree(void **state)
{
    (void)state;
    lattice l = make_lattice(8, LATTICE_MIXED, (lattice_layout){false, true, false, false});
    l.ghosts = calloc((size_t)l.g.cell_count, 3);
    int64_t ghosts = 0;
    for (int64_t cell = 0; cell < l.g.cell_count; cell++) {
        /* makes the bounds of the cells that are not ghosts smaller than those of all cells */
        const bool outer = cell < l.g.cell_count / 3;
        l.ghosts[3 * cell] = outer || hash_to_unit_interval((uint64_t)cell) < 0.4 ? 2 : 0;
        ghosts += l.ghosts[3 * cell] != 0;
    }
    l.g.ghosts = l.ghosts;
    l.g.ghosts_stride = 3;
    l.g.ghosts_bytes = 1;
    mmbvh tree = build_with_threads(&l, &l.field, 2);
    assert_int_equal(tree.cell_count, l.g.cell_count - ghosts);
    assert_proved(&tree, &l.g, &l.field);
    assert_tight(&l, &tree, &l.field);
    mmbvh_free(&tree);

    for (int64_t cell = 0; cell < l.g.cell_count; cell++) l.ghosts[3 * cell] = 1;
    tree = build_with_threads(&l, &l.field, 2);
    assert_int_equal(tree.node_count, 0);
    assert_proved(&tree, &l.g, &l.field);
    mmbvh_free(&tree);
    free_lattice(&l);
}

/* Sets the values of some vertices to NaN or infinity. Returns the number of cells that have such a vertex. */
static int64_t corrupt_vertex_values(lattice *l)
{
    for (int64_t v = 0; v < l->g.vertex_count; v++) {
        const double u = hash_to_unit_interval((uint64_t)(7 * v));
        if (u < 0.03) set_number(&l->field.values, v, u < 0.01 ? (double)NAN : u < 0.02 ? INFINITY : -INFINITY);
    }
    int64_t count = 0;
    for (int64_t cell = 0; cell < l->g.cell_count; cell++) {
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        double values[GRID_MAX_CELL_VERTICES];
        const int n = grid_cell_vertices(&l->g, cell, vertices);
        count += !grid_cell_values(&l->field, cell, vertices, n, values);
    }
    return count;
}

static void values_that_are_not_finite_are_counted_and_left_out(void **state)
{
    (void)state;
    for (int kind = LATTICE_TETS; kind <= LATTICE_MIXED; kind++) {
        lattice l = make_lattice(9, (lattice_kind)kind, (lattice_layout){false, false, kind == LATTICE_HEXES, false});
        const int64_t unusable = corrupt_vertex_values(&l);
        assert_true(unusable > 0 && unusable < l.g.cell_count);
        mmbvh tree = build_with_threads(&l, &l.field, 2);
        assert_int_equal(tree.unusable_cells, unusable);
        assert_proved(&tree, &l.g, &l.field);
        assert_tight(&l, &tree, &l.field);
        for (int64_t v = 0; v < l.g.vertex_count; v++) set_number(&l.field.values, v, (double)NAN);
        mmbvh_refit_ranges(&tree, &l.g, &l.field, NULL);
        assert_int_equal(tree.unusable_cells, l.g.cell_count);
        for (int64_t i = 0; i < tree.node_count; i++) {
            const node_view node = read_node(&tree, i);
            assert_true(node.range_low == INFINITY && node.range_high == -INFINITY);
        }
        mmbvh_free(&tree);
        free_lattice(&l);
    }
}

static void values_beyond_floats_round_outward(void **state)
{
    (void)state;
    lattice l = make_lattice(2, LATTICE_HEXES, (lattice_layout){false, false, true, false});
    for (int64_t v = 0; v < l.g.vertex_count; v++) set_number(&l.field.values, v, v % 2 ? 1e300 : 2e300);
    mmbvh tree = build_with_threads(&l, &l.field, 1);
    assert_proved(&tree, &l.g, &l.field);
    node_view root = read_node(&tree, 0);
    assert_true(root.range_low == FLT_MAX && root.range_high == INFINITY);
    for (int64_t v = 0; v < l.g.vertex_count; v++) set_number(&l.field.values, v, v % 2 ? -1e-300 : 1e-300);
    mmbvh_refit_ranges(&tree, &l.g, &l.field, NULL);
    assert_proved(&tree, &l.g, &l.field);
    root = read_node(&tree, 0);
    assert_true(root.range_low == -FLT_TRUE_MIN && root.range_high == FLT_TRUE_MIN);
    mmbvh_free(&tree);
    free_lattice(&l);
}

static void no_field_gives_infinite_ranges(void **state)
{
    (void)state;
    lattice l = make_lattice(5, LATTICE_TETS, (lattice_layout){0});
    mmbvh tree = build_with_threads(&l, NULL, 2);
    assert_proved(&tree, &l.g, NULL);
    for (int64_t i = 0; i < tree.node_count; i++) {
        const node_view node = read_node(&tree, i);
        assert_true(node.range_low == -INFINITY && node.range_high == INFINITY);
    }
    mmbvh_free(&tree);
    free_lattice(&l);
}

/* Checks a mesh of 29,791 hexes: its tree has more nodes than one task of a refit processes. */
static void refitted_ranges_equal_a_fresh_build(void **state)
{
    (void)state;
    lattice l = make_lattice(31, LATTICE_HEXES, (lattice_layout){false, false, false, false});
    mmbvh old = build_with_threads(&l, &l.field, 2);
    for (int64_t v = 0; v < l.g.vertex_count; v++) set_number(&l.field.values, v, hash_to_unit_interval((uint64_t)v));
    const int64_t unusable = corrupt_vertex_values(&l);
    mmbvh fresh = build_with_threads(&l, &l.field, 2);
    assert_memory_not_equal(get_node_bytes(&old), get_node_bytes(&fresh),
                            (size_t)fresh.node_count * get_node_size(&fresh));
    for (int threads = 1; threads <= 3; threads++) {
        for (int64_t i = 0; i < old.node_count; i++) corrupt_range(&old, i);
        assert_int_equal(mmbvh_refit_ranges(&old, &l.g, &l.field, &(mmbvh_options){.threads = threads}), INSITU_OK);
        assert_same_nodes(&old, &fresh);
        assert_int_equal(old.unusable_cells, unusable);
    }
    mmbvh_free(&old);
    mmbvh_free(&fresh);
    free_lattice(&l);
}

/* Checks refitted ranges for every kind of cell and every layout. Values include zeros of both signs and, if values are
 * double, numbers that are not exact in float. */
static void refitted_ranges_are_tight_in_every_layout(void **state)
{
    (void)state;
    for (int kind = LATTICE_TETS; kind <= LATTICE_MIXED; kind++)
        for (int bits = 0; bits < 8; bits++) {
            const lattice_layout layout = {false, bits & 1, bits >> 1 & 1, bits >> 2 & 1};
            lattice l = make_lattice(7, (lattice_kind)kind, layout);
            mmbvh tree = build_with_threads(&l, &l.field, 2);
            for (int64_t v = 0; v < l.g.vertex_count; v++) {
                const double u = hash_to_unit_interval((uint64_t)v);
                set_number(&l.field.values, v, u < 0.2 ? 0.0 : u < 0.4 ? -0.0 : u - 0.7);
            }
            const int64_t unusable = corrupt_vertex_values(&l);
            assert_int_equal(mmbvh_refit_ranges(&tree, &l.g, &l.field, &(mmbvh_options){.threads = 2}), INSITU_OK);
            assert_int_equal(tree.unusable_cells, unusable);
            assert_proved(&tree, &l.g, &l.field);
            assert_tight(&l, &tree, &l.field);
            for (int64_t i = 0; i < tree.node_count; i++) {
                const node_view node = read_node(&tree, i);
                assert_true(node.range_low != 0 || !signbit(node.range_low));
                assert_true(node.range_high != 0 || !signbit(node.range_high));
            }
            mmbvh_free(&tree);
            free_lattice(&l);
        }
}

static void refitted_bounds_contain_moved_vertices_tightly(void **state)
{
    (void)state;
    for (int bits = 0; bits < 6; bits++) {
        const lattice_layout layout = {bits & 1, false, false, bits & 1};
        lattice l = make_lattice(18, (lattice_kind)(bits / 2), layout);
        mmbvh tree = build_with_threads(&l, &l.field, 2);
        mmbvh_refit_bounds(&tree, &l.g, &(mmbvh_options){.threads = 2});
        mmbvh same = build_with_threads(&l, &l.field, 2);
        assert_same_nodes(&tree, &same);
        assert_true(mmbvh_cost(&tree, NULL) == tree.built_cost);
        for (int64_t v = 0; v < l.g.vertex_count; v++) {
            double p[3];
            grid_read_vertex_position(&l.g, v, p);
            set_number(&l.g.coordinates[0], v, p[0] + 3 * sin(p[1]));
            set_number(&l.g.coordinates[2], v, p[2] * 1.5 - 7);
        }
        assert_int_not_equal(mmbvh_check(&tree, &l.g, &l.field, NULL, NULL), INSITU_OK);
        mmbvh_refit_bounds(&tree, &l.g, &(mmbvh_options){.threads = 2});
        assert_proved(&tree, &l.g, &l.field);
        assert_tight(&l, &tree, &l.field);
        assert_true(mmbvh_cost(&tree, NULL) > tree.built_cost);
        mmbvh_free(&tree);
        mmbvh_free(&same);
        free_lattice(&l);
    }
}

/* Checks that the ranges computed for a second field equal the ranges of the nodes of a tree that is refitted to this
 * field. */
static void assert_pairs_equal_refit(lattice *l, const mmbvh *tree, const grid_field *field)
{
    float *pairs = malloc((size_t)tree->node_count * 2 * sizeof *pairs);
    int64_t unusable = -1;
    assert_int_equal(mmbvh_compute_ranges(tree, &l->g, field, &(mmbvh_options){.threads = 2}, pairs, &unusable),
                     INSITU_OK);
    mmbvh other = build_with_threads(l, field, 1);
    assert_proved(&other, &l->g, field);
    assert_tight(l, &other, field);
    assert_int_equal(unusable, other.unusable_cells);
    const mmbvh_ranges a = mmbvh_pair_ranges(pairs), b = mmbvh_own_ranges(&other);
    for (int64_t i = 0; i < tree->node_count; i++) {
        assert_memory_equal(a.low + i * a.stride, b.low + i * b.stride, sizeof(float));
        assert_memory_equal(a.high + i * a.stride, b.high + i * b.stride, sizeof(float));
    }
    mmbvh_free(&other);
    free(pairs);
}

static void additional_fields_have_separate_ranges(void **state)
{
    (void)state;
    lattice l = make_lattice(19, LATTICE_MIXED, (lattice_layout){0});
    mmbvh tree = build_with_threads(&l, &l.field, 2);
    assert_pairs_equal_refit(&l, &tree, &l.field);

    double *vectors = malloc((size_t)l.g.cell_count * 3 * sizeof *vectors);
    for (int64_t i = 0; i < 3 * l.g.cell_count; i++) vectors[i] = hash_to_unit_interval((uint64_t)i) - 0.5;
    vectors[3 * 17 + 1] = NAN;
    grid_field field = {.values = {.data = (const char *)vectors, .stride = 24, .is_wide = true},
                        .component_stride = 8,
                        .component_count = 3,
                        .component = 1};
    assert_pairs_equal_refit(&l, &tree, &field); /* a component of a vector at the vertices */
    field.component = -1;
    assert_pairs_equal_refit(&l, &tree, &field); /* the magnitude of the vector */
    field.is_cell_centred = true;
    assert_pairs_equal_refit(&l, &tree, &field); /* a field in cells */
    field.component = 2;
    assert_pairs_equal_refit(&l, &tree, &field);

    int32_t *integers = malloc((size_t)l.g.vertex_count * sizeof *integers);
    for (int64_t v = 0; v < l.g.vertex_count; v++) integers[v] = (int32_t)(2e9 * hash_to_unit_interval((uint64_t)v));
    const grid_field materials = {.values = {.data = (const char *)integers, .stride = 4, .is_integer = true},
                                  .component_count = 1};
    assert_pairs_equal_refit(&l, &tree, &materials);
    mmbvh_free(&tree);
    free(vectors);
    free(integers);
    free_lattice(&l);
}

/* Makes `count` cells that are all the same tet. The vertices are those of a single cube. */
static lattice make_coincident(int64_t count)
{
    lattice l = make_lattice(1, LATTICE_TETS, (lattice_layout){0});
    free(l.connectivity);
    l.g.connectivity = make_array(&l.connectivity, 4 * count, false, true, false);
    for (int64_t i = 0; i < 4 * count; i++) set_index(&l.g.connectivity, i, lattice_tets[0][i % 4]);
    l.g.cell_count = count;
    return l;
}

static void coincident_cells_are_split_in_halves(void **state)
{
    (void)state;
    static const int64_t counts[] = {0, 1, 2, 7, 8, 100, 100000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        lattice l = make_coincident(counts[i]);
        mmbvh tree = build_with_threads(&l, &l.field, 2);
        const mmbvh_statistics s = assert_proved(&tree, &l.g, &l.field);
        const int64_t halvings = counts[i] > 7 ? (int64_t)ceil(log2((double)counts[i] / 7)) : 0;
        /* In the order of the space-filling curve, cells at the same position are ordered by their index. They are
         * split until a leaf has four consecutive cells. */
        const int64_t most = variant.builder == MMBVH_SAH ? halvings : (int64_t)ceil(log2((double)counts[i] + 1)) - 2;
        assert_true(s.depth <= (most > 0 ? most : 0) + 1);
        assert_int_equal(s.leaves, counts[i] == 0 ? 0 : counts[i] <= 7 ? 1 : s.leaves);
        assert_true((tree.node_count == 0) == (counts[i] == 0));
        mmbvh_free(&tree);
        free_lattice(&l);
    }
}

/* Checks the depth of the tree for 174 boxes on the six half axes. Each box is 17 times nearer to the origin than the
 * previous one on its half axis, so that a plane between 16 equal bins separates hardly more than one box. copies:
 * number of copies of each box. */
static void assert_depth_of_shrinking_boxes(int64_t copies)
{
    enum { STEPS = 29, PLACES = 6 * STEPS };
    const int64_t count = PLACES * copies;
    float *lower = calloc((size_t)(3 * count), sizeof *lower), *upper = calloc((size_t)(3 * count), sizeof *upper);
    float *ranges = calloc((size_t)(2 * count), sizeof *ranges);
    for (int64_t i = 0; i < count; i++) {
        const int64_t step = i % PLACES / 6, axis = i % 3;
        const float x = powf(17, (float)-step) * (i % 6 < 3 ? 1.0f : -1.0f);
        lower[3 * i + axis] = fminf(x, 1.1f * x);
        upper[3 * i + axis] = fmaxf(x, 1.1f * x);
    }
    mmbvh tree;
    assert_int_equal(mmbvh_build_boxes(lower, upper, ranges, count, &variant, &tree, NULL), INSITU_OK);
    base_error error = {0};
    mmbvh_statistics s = {0};
    if (mmbvh_check(&tree, NULL, NULL, &s, &error)) fail_msg("%s", error.message);
    /* if the tree were less deep, it would not test the limit of the depth */
    assert_true(variant.builder != MMBVH_SAH || s.depth > MMBVH_MAX_DEPTH - 32);
    mmbvh_free(&tree);
    free(lower);
    free(upper);
    free(ranges);
}

static void depth_is_bounded_where_cells_shrink_without_end(void **state)
{
    (void)state;
    assert_depth_of_shrinking_boxes(1);
    assert_depth_of_shrinking_boxes(2000); /* the upper levels, which several threads build together, are deep too */
}

/* Checks boxes for which the sample of every seventh box, from which the first split planes are chosen, finds no plane:
 * the sampled boxes lie at 0, and the others at random positions between 1 and 2. */
static void split_planes_are_found_if_sampling_finds_none(void **state)
{
    (void)state;
    enum { COUNT = 40000 };
    static float lower[COUNT][3], upper[COUNT][3], ranges[COUNT][2];
    for (int64_t i = 0; i < COUNT; i++) {
        lower[i][0] = i % 7 ? 1 + (float)hash_to_unit_interval((uint64_t)i) : 0;
        upper[i][0] = lower[i][0] + 0.001f;
        upper[i][1] = upper[i][2] = 1;
    }
    for (int64_t count = COUNT / 10; count <= COUNT; count *= 10) {
        mmbvh tree;
        float low[2][4], high[2][4];
        assert_int_equal(mmbvh_build_boxes(lower[0], upper[0], ranges[0], count, &variant, &tree, NULL), INSITU_OK);
        for (int side = 0; side < 2; side++) mmbvh_node_box(&tree, 1 + side, low[side], high[side]);
        assert_true(fmaxf(low[0][0], low[1][0]) > fminf(high[0][0], high[1][0]) - 0.02f);
        mmbvh_free(&tree);
    }
}

/* Checks refitting if one cell is far away, on either side. One child of the root is then a leaf with this cell, and
 * the other contains all other cells. */
static void refit_updates_siblings_of_leaves(void **state)
{
    (void)state;
    for (int side = 0; side < 2; side++) {
        lattice l = make_lattice(25, LATTICE_HEXES, (lattice_layout){0});
        const int64_t vertex = side ? l.g.vertex_count - 1 : 0;
        for (int axis = 0; axis < 3; axis++) set_number(&l.g.coordinates[axis], vertex, side ? 1e4 : -1e4);
        mmbvh tree = build_with_threads(&l, &l.field, 2);
        assert_true(mmbvh_node_count(&tree, 1 + side) > 0 && mmbvh_node_count(&tree, 2 - side) == 0);
        for (int64_t i = 0; i < tree.node_count; i++) {
            corrupt_range(&tree, i);
            corrupt_box(&tree, i);
        }
        mmbvh_refit_ranges(&tree, &l.g, &l.field, &(mmbvh_options){.threads = 2});
        mmbvh_refit_bounds(&tree, &l.g, &(mmbvh_options){.threads = 2});
        assert_proved(&tree, &l.g, &l.field);
        assert_tight(&l, &tree, &l.field);
        mmbvh_free(&tree);
        free_lattice(&l);
    }
}

static void parent_tree_contains_every_mesh(void **state)
{
    (void)state;
    enum { COUNT = 1000 };
    static float lower[COUNT][3], upper[COUNT][3], ranges[COUNT][2];
    for (int64_t i = 0; i < COUNT; i++) {
        for (int axis = 0; axis < 3; axis++) {
            lower[i][axis] = (float)(10 * hash_to_unit_interval((uint64_t)(6 * i + axis)));
            upper[i][axis] = lower[i][axis] + (float)hash_to_unit_interval((uint64_t)(6 * i + axis + 3));
        }
        ranges[i][0] = (float)hash_to_unit_interval((uint64_t)i) - 2;
        ranges[i][1] = i % 9 ? ranges[i][0] + 1 : -INFINITY;
        if (i % 9 == 0) ranges[i][0] = INFINITY;
    }
    for (int64_t count = 0; count <= COUNT; count = 3 * count + 1) {
        mmbvh tree;
        assert_int_equal(mmbvh_build_boxes(lower[0], upper[0], ranges[0], count, &variant, &tree, NULL), INSITU_OK);
        assert_proved(&tree, NULL, NULL);
        assert_int_equal(tree.cell_count, count);
        for (int64_t i = 0; i < tree.node_count; i++) {
            const node_view node = read_node(&tree, i);
            for (int k = 0; k < node.count; k++) {
                const uint32_t mesh = tree.cells[node.ref + k];
                assert_true(node.range_low <= ranges[mesh][0] && ranges[mesh][1] <= node.range_high);
                for (int axis = 0; axis < 3; axis++) {
                    assert_true(node.lower[axis] <= lower[mesh][axis] && upper[mesh][axis] <= node.upper[axis]);
                }
            }
        }
        mmbvh_free(&tree);
    }
}

/* Checks that a traversal that enters only boxes which contain a point reaches every cell whose own box contains the
 * point. */
static void point_query_finds_every_cell(void **state)
{
    (void)state;
    lattice l = make_lattice(9, LATTICE_MIXED, (lattice_layout){0});
    mmbvh tree = build_with_threads(&l, &l.field, 2);
    bool *met = malloc((size_t)l.g.cell_count * sizeof *met);
    for (int64_t n = 0; n < 200; n++) {
        double p[3];
        for (int axis = 0; axis < 3; axis++)
            p[axis] = 10 * hash_to_unit_interval((uint64_t)(1000 + 3 * n + axis)) - 0.5;
        if (n < 50)
            grid_read_vertex_position(&l.g, 13 * n,
                                      p); /* the first points are vertices, which lie at corners of boxes */
        memset(met, 0, (size_t)l.g.cell_count * sizeof *met);
        int64_t stack[MMBVH_MAX_DEPTH + 1] = {0};
        for (int height = 1; height > 0;) {
            const node_view node = read_node(&tree, stack[--height]);
            bool inside = true;
            for (int axis = 0; axis < 3; axis++) {
                inside = inside && node.lower[axis] <= p[axis] && p[axis] <= node.upper[axis];
            }
            for (int k = 0; inside && k < node.count; k++) met[tree.cells[node.ref + k]] = true;
            for (int side = 0; inside && !node.count && side < 2; side++) stack[height++] = node.ref + side;
        }
        for (int64_t cell = 0; cell < l.g.cell_count; cell++) {
            double lower[3], upper[3];
            compute_cell_box(&l, &tree, cell, lower, upper);
            bool inside = true;
            for (int axis = 0; axis < 3; axis++) inside = inside && lower[axis] <= p[axis] && p[axis] <= upper[axis];
            assert_true(!inside || met[cell]);
        }
    }
    free(met);
    mmbvh_free(&tree);
    free_lattice(&l);
}

/* Checks that the tree is efficient. On a lattice of n^3 cubes a ray crosses about 1.5 n cubes: the mean chord of a
 * cube is 2/3 of its side, and the ray crosses planes between cells on three axes. A tree that tests 60 boxes and cells
 * for each crossed cube would be useless. */
static void cost_grows_with_the_side_not_the_cells(void **state)
{
    (void)state;
    double costs[2];
    for (int i = 0; i < 2; i++) {
        lattice l = make_lattice(i ? 30 : 10, LATTICE_HEXES, (lattice_layout){0});
        mmbvh tree = build_with_threads(&l, NULL, 2);
        const mmbvh_statistics s = assert_proved(&tree, &l.g, NULL);
        assert_true(s.cost == tree.built_cost && s.cells_a_leaf >= 1 && s.cells_a_leaf <= 7);
        assert_true(s.sibling_overlap > 0 && s.sibling_overlap < 0.6);
        costs[i] = s.cost;
        mmbvh_free(&tree);
        free_lattice(&l);
    }
    assert_true(costs[0] < 60 * 15 && costs[1] < 60 * 45);
    assert_true(costs[1] / costs[0] < 5);
}

static void cost_of_a_tree_matches_manual_computation(void **state)
{
    (void)state;
    mmbvh_node nodes[3] = {{.upper = {4, 2, 1}, .ref = 1},
                           {.upper = {1, 2, 1}, .count = 3},
                           {.lower = {2, 0, 0}, .upper = {4, 1, 1}, .count = 2, .ref = 3}};
    const mmbvh tree = {.nodes = nodes, .node_count = 3, .cell_count = 5, .scale = 1};
    /* Half of the boxes' surface areas are 14, 5 and 5. The cost is 1 for the root's box, 2 for the pair of children,
     * and the number of cells of each leaf times the leaf's probability. All terms are exact to 1e-15. */
    assert_true(fabs(mmbvh_cost(&tree, NULL) - (3 + (3 * 5 + 2 * 5) / 14.0)) < 1e-14);
}

static void failed_allocations_return_an_error_without_a_leak(void **state)
{
    (void)state;
    /* 63,888 tets: enough for a tree whose top and subtrees are built separately */
    lattice l = make_lattice(22, LATTICE_TETS, (lattice_layout){0});
    for (int threads = 1; threads <= 2; threads++) {
        const int64_t held = base_memory_held(), before = base_memory_allocations();
        mmbvh tree = build_with_threads(&l, &l.field, threads);
        const int64_t allocations = base_memory_allocations() - before;
        mmbvh_free(&tree);
        assert_int_equal(base_memory_held(), held);
        assert_true(allocations > 10);
        for (int64_t n = 1; n <= allocations; n++) {
            base_error error = {0};
            memset(&tree, 0xff, sizeof tree);
            base_memory_fail_nth(n);
            const mmbvh_options options = make_thread_options(threads);
            assert_int_equal(mmbvh_build(&l.g, &l.field, no_shift, 1, &options, &tree, &error), INSITU_ERROR_MEMORY);
            assert_int_equal(error.status, INSITU_ERROR_MEMORY);
            const mmbvh zeroed = {0};
            assert_memory_equal(&tree, &zeroed, sizeof tree);
            assert_int_equal(base_memory_held(), held);
        }
        base_memory_fail_nth(0);
    }
    free_lattice(&l);
}

static void wrong_arguments_are_refused(void **state)
{
    (void)state;
    lattice l = make_lattice(1, LATTICE_TETS, (lattice_layout){0});
    mmbvh tree;
    assert_int_equal(mmbvh_build(NULL, NULL, no_shift, 1, NULL, &tree, NULL), INSITU_ERROR_ARGUMENT);
    assert_int_equal(mmbvh_build(&l.g, NULL, no_shift, 0, NULL, &tree, NULL), INSITU_ERROR_ARGUMENT);
    assert_int_equal(mmbvh_build(&l.g, NULL, no_shift, (double)NAN, NULL, &tree, NULL), INSITU_ERROR_ARGUMENT);
    assert_int_equal(mmbvh_build_boxes(NULL, NULL, NULL, 1, NULL, &tree, NULL), INSITU_ERROR_ARGUMENT);
    assert_int_equal(mmbvh_refit_ranges(NULL, &l.g, NULL, NULL), INSITU_ERROR_ARGUMENT);
    mmbvh_free(NULL);
    free_lattice(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_layout_builds_a_valid_tight_tree),
        cmocka_unit_test(shifted_and_scaled_bounds_are_rounded_outward),
        cmocka_unit_test(same_bytes_for_any_number_of_threads),
        cmocka_unit_test(ghosts_are_not_in_the_tree),
        cmocka_unit_test(values_that_are_not_finite_are_counted_and_left_out),
        cmocka_unit_test(values_beyond_floats_round_outward),
        cmocka_unit_test(no_field_gives_infinite_ranges),
        cmocka_unit_test(refitted_ranges_equal_a_fresh_build),
        cmocka_unit_test(refitted_ranges_are_tight_in_every_layout),
        cmocka_unit_test(refitted_bounds_contain_moved_vertices_tightly),
        cmocka_unit_test(additional_fields_have_separate_ranges),
        cmocka_unit_test(coincident_cells_are_split_in_halves),
        cmocka_unit_test(depth_is_bounded_where_cells_shrink_without_end),
        cmocka_unit_test(split_planes_are_found_if_sampling_finds_none),
        cmocka_unit_test(refit_updates_siblings_of_leaves),
        cmocka_unit_test(parent_tree_contains_every_mesh),
        cmocka_unit_test(point_query_finds_every_cell),
        cmocka_unit_test(cost_grows_with_the_side_not_the_cells),
        cmocka_unit_test(cost_of_a_tree_matches_manual_computation),
        cmocka_unit_test(failed_allocations_return_an_error_without_a_leak),
        cmocka_unit_test(wrong_arguments_are_refused),
    };
    /* test_mmbvh_layout checks that both layouts contain the same tree for either builder. */
    static const mmbvh_options variants[] = {{.layout = MMBVH_COMPACT, .builder = MMBVH_SAH},
                                             {.layout = MMBVH_REFERENCE, .builder = MMBVH_SAH},
                                             {.layout = MMBVH_COMPACT, .builder = MMBVH_MORTON}};
    static const char *const names[] = {"mmbvh_compact", "mmbvh_reference", "mmbvh_morton"};
    int failures = 0;
    for (int i = 0; i < 3; i++) {
        variant = variants[i];
        failures += cmocka_run_group_tests_name(names[i], tests, NULL, NULL);
    }
    return failures;
}
