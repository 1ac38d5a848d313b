/* Compares bounds that are refitted only for visible nodes with brute force over the visible cells, and with a refit of
 * all nodes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "mmbvh.h"
#include "test_mmbvh_grids.h"
#include "test_mmbvh_nodes.h"

static const double no_shift[3] = {0, 0, 0};

/* A tree with two criteria of visibility: the nodes' own ranges in two intervals, and the ranges (pairs) of a second
 * field in a third interval. */
typedef struct subject {
    lattice l;
    mmbvh tree;
    float *pairs;
    mmbvh_interval intervals[3];
    mmbvh_visible visible[2];
} subject;

/* Moves vertices inwards, so that the quantization grid of the compact layout still contains the mesh. */
static void move_vertices(lattice *l, double by)
{
    for (int64_t v = 0; v < l->g.vertex_count; v++) {
        double p[3];
        grid_read_vertex_position(&l->g, v, p);
        set_number(&l->g.coordinates[0], v, 9 + (1 - by) * (p[0] - 9));
        set_number(&l->g.coordinates[2], v, 9 + (1 - 2 * by) * (p[2] - 9));
    }
}

static subject make_subject(lattice_kind kind, lattice_layout layout, mmbvh_layout nodes)
{
    subject s = {.l = make_lattice(18, kind, layout)};
    const mmbvh_options options = {.threads = 2, .layout = nodes};
    assert_int_equal(mmbvh_build(&s.l.g, &s.l.field, no_shift, 1, &options, &s.tree, NULL), INSITU_OK);
    s.pairs = malloc((size_t)s.tree.node_count * 2 * sizeof *s.pairs);
    for (int64_t i = 0; i < s.tree.node_count; i++) {
        const node_view node = read_node(&s.tree, i);
        s.pairs[2 * i] = node.lower[2]; /* the range of a field whose value is the height */
        s.pairs[2 * i + 1] = node.upper[2];
    }
    return s;
}

static void choose_visible(subject *s)
{
    const node_view root = read_node(&s->tree, 0);
    const float low = root.range_low, high = root.range_high, floor = s->pairs[0];
    s->intervals[0] = (mmbvh_interval){low + 0.3f * (high - low), low + 0.3f * (high - low)};
    s->intervals[1] = (mmbvh_interval){low + 0.9f * (high - low), high};
    s->intervals[2] = (mmbvh_interval){floor, floor + 0.2f};
    s->visible[0] = (mmbvh_visible){mmbvh_own_ranges(&s->tree), 2, s->intervals};
    s->visible[1] = (mmbvh_visible){mmbvh_pair_ranges(s->pairs), 1, s->intervals + 2};
}

static void free_subject(subject *s)
{
    mmbvh_free(&s->tree);
    free(s->pairs);
    free_lattice(&s->l);
}

static bool is_leaf_visible(const subject *s, int64_t i)
{
    const node_view node = read_node(&s->tree, i);
    bool does = s->pairs[2 * i] <= s->intervals[2].high && s->pairs[2 * i + 1] >= s->intervals[2].low;
    for (int k = 0; k < 2; k++)
        does = does || (node.range_low <= s->intervals[k].high && node.range_high >= s->intervals[k].low);
    return does;
}

static void extend_bounds(node_view *to, const node_view *by)
{
    for (int axis = 0; axis < 3; axis++) {
        to->lower[axis] = fminf(to->lower[axis], by->lower[axis]);
        to->upper[axis] = fmaxf(to->upper[axis], by->upper[axis]);
    }
}

/* Computes the bounding box of a leaf's cells at their current positions. */
static node_view compute_leaf_box(const subject *s, int64_t leaf)
{
    node_view box = read_node(&s->tree, leaf);
    for (int axis = 0; axis < 3; axis++) box.lower[axis] = INFINITY, box.upper[axis] = -INFINITY;
    for (int k = 0; k < box.count; k++) {
        int64_t vertices[GRID_MAX_CELL_VERTICES];
        const int count = grid_cell_vertices(&s->l.g, s->tree.cells[box.ref + k], vertices);
        for (int i = 0; i < count; i++) {
            double p[3];
            grid_read_vertex_position(&s->l.g, vertices[i], p);
            const node_view point = {.lower = {(float)p[0], (float)p[1], (float)p[2]},
                                     .upper = {(float)p[0], (float)p[1], (float)p[2]}};
            extend_bounds(&box, &point);
        }
    }
    return box;
}

/* Checks, for all visible nodes below a node, that a node's bounds contain its cells or its visible children. Returns
 * the bounds of the node's cells. visited receives the number of visited nodes. */
static node_view assert_bounds_contain_subtree(const subject *s, int64_t i, int64_t *visited)
{
    ++*visited;
    const node_view node = read_node(&s->tree, i);
    node_view held = compute_leaf_box(s, i);
    if (!node.count) {
        for (int axis = 0; axis < 3; axis++) held.lower[axis] = INFINITY, held.upper[axis] = -INFINITY;
        for (int side = 0; side < 2; side++) {
            if (!is_leaf_visible(s, node.ref + side)) continue;
            const node_view below = assert_bounds_contain_subtree(s, node.ref + side, visited);
            extend_bounds(&held, &below);
        }
    }
    for (int axis = 0; axis < 3; axis++) {
        if (!(held.lower[axis] <= held.upper[axis])) continue;
        assert_true(node.lower[axis] <= held.lower[axis] && held.upper[axis] <= node.upper[axis]);
    }
    return held;
}

/* Checks that any number of threads refits to the same tree and computes the same area, because sums are computed in a
 * fixed order. */
static void assert_same_with_any_threads(const subject *s, const mmbvh *before)
{
    mmbvh again = *before;
    bool is_whole;
    assert_int_equal(
        mmbvh_refit_visible_bounds(&again, &s->l.g, s->visible, 2, &(mmbvh_options){.threads = 1}, &is_whole),
        INSITU_OK);
    assert_same_nodes(&again, &s->tree);
    assert_true(again.area == s->tree.area);
}

static mmbvh copy_tree(const mmbvh *tree)
{
    mmbvh copy = *tree;
    const size_t bytes = (size_t)tree->node_count * get_node_size(tree);
    void *nodes = malloc(bytes);
    memcpy(nodes, get_node_bytes(tree), bytes);
    if (tree->compact)
        copy.compact = nodes;
    else
        copy.nodes = nodes;
    return copy;
}

static void free_copy(mmbvh *copy)
{
    free(copy->compact);
    free(copy->nodes);
}

static int64_t count_stale_nodes(const subject *s, const mmbvh *before, const mmbvh *whole)
{
    int64_t stale = 0;
    for (int64_t i = 0; i < s->tree.node_count; i++) {
        const node_view was = read_node(before, i), is = read_node(&s->tree, i), all = read_node(whole, i);
        stale += memcmp(&was.lower, &is.lower, 12) == 0 && memcmp(&is.lower, &all.lower, 12) != 0;
    }
    return stale;
}

static void check_visible_refit(subject *s)
{
    mmbvh before = copy_tree(&s->tree), whole = copy_tree(&s->tree), other = copy_tree(&s->tree);
    bool is_whole = true;
    int64_t visited = 0;
    move_vertices(&s->l, 0.02);
    choose_visible(s);
    /* The trees are copies with the same ranges, so the criteria of visibility apply to each of them. */
    assert_int_equal(
        mmbvh_refit_visible_bounds(&s->tree, &s->l.g, s->visible, 2, &(mmbvh_options){.threads = 2}, &is_whole),
        INSITU_OK);
    assert_false(is_whole);
    assert_bounds_contain_subtree(s, 0, &visited);
    assert_same_with_any_threads(s, &other);
    assert_int_equal(mmbvh_refit_bounds(&whole, &s->l.g, &(mmbvh_options){.threads = 2}), INSITU_OK);
    assert_true(visited > 100 && visited < s->tree.node_count);
    assert_true(count_stale_nodes(s, &before, &whole) > s->tree.node_count / 10);
    /* A refit of all nodes must also update the nodes that were skipped. */
    assert_int_equal(mmbvh_refit_bounds(&s->tree, &s->l.g, &(mmbvh_options){.threads = 2}), INSITU_OK);
    assert_same_nodes(&s->tree, &whole);
    assert_int_equal(mmbvh_check(&s->tree, &s->l.g, &s->l.field, NULL, NULL), INSITU_OK);
    free_copy(&before);
    free_copy(&whole);
    free_copy(&other);
}

static void only_visible_bounds_are_refitted(void **state)
{
    (void)state;
    for (int kind = LATTICE_TETS; kind <= LATTICE_MIXED; kind++)
        for (int bits = 0; bits < 8; bits++) {
            const lattice_layout layout = {bits & 1, bits >> 1 & 1, bits >> 1 & 1, bits >> 1 & 1};
            subject s = make_subject((lattice_kind)kind, layout, bits >> 2 ? MMBVH_REFERENCE : MMBVH_COMPACT);
            check_visible_refit(&s);
            free_subject(&s);
        }
}

/* Checks that the area that refits update incrementally equals the area computed over all nodes. n sums of positive
 * double numbers and as many differences have an error of at most 2 n 2^-53 of the largest sum. */
static void refit_updates_the_visible_area(void **state)
{
    (void)state;
    subject s = make_subject(LATTICE_HEXES, (lattice_layout){0}, MMBVH_COMPACT);
    for (int i = 0; i < 5; i++) {
        bool is_whole;
        move_vertices(&s.l, 0.02);
        choose_visible(&s);
        mmbvh_refit_visible_bounds(&s.tree, &s.l.g, s.visible, i % 2 ? 0 : 2, NULL, &is_whole);
        assert_true(is_whole == (i % 2 == 1));
        if (!is_whole) continue;
        const node_view root = read_node(&s.tree, 0);
        const double x = (double)root.upper[0] - (double)root.lower[0],
                     y = (double)root.upper[1] - (double)root.lower[1],
                     z = (double)root.upper[2] - (double)root.lower[2];
        const double cost = 1 + s.tree.area / (x * y + y * z + z * x);
        assert_true(fabs(cost / mmbvh_cost(&s.tree, NULL) - 1) <= 5 * 2 * (double)s.tree.node_count * 0x1p-53);
    }
    free_subject(&s);
}

static void invisible_trees_are_not_refitted(void **state)
{
    (void)state;
    subject s = make_subject(LATTICE_TETS, (lattice_layout){0}, MMBVH_COMPACT);
    mmbvh before = copy_tree(&s.tree);
    bool is_whole;
    choose_visible(&s);
    s.visible[0].interval_count = 0;
    move_vertices(&s.l, 0.02);
    assert_int_equal(mmbvh_refit_visible_bounds(&s.tree, &s.l.g, s.visible, 1, NULL, &is_whole), INSITU_OK);
    assert_same_nodes(&s.tree, &before);
    assert_int_equal(mmbvh_refit_visible_bounds(&s.tree, &s.l.g, s.visible, 1, NULL, NULL), INSITU_ERROR_ARGUMENT);
    free_copy(&before);
    free_subject(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(only_visible_bounds_are_refitted),
        cmocka_unit_test(refit_updates_the_visible_area),
        cmocka_unit_test(invisible_trees_are_not_refitted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
