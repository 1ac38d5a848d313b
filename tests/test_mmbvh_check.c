/* Checks mmbvh_check() on trees that violate one invariant each: the violation must be detected, and the error must
 * name it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "memory.h"
#include "mmbvh.h"
#include "test_mmbvh_grids.h"

typedef struct fixture {
    lattice l;
    mmbvh tree;
    int64_t leaf;  /* a leaf with at least two cells */
    int64_t inner; /* an inner node below the root */
} fixture;

static int set_up(void **state)
{
    static fixture f;
    f = (fixture){.l = make_lattice(6, LATTICE_TETS, (lattice_layout){true, false, true, false})};
    const double origin[3] = {0, 0, 0};
    if (mmbvh_build(&f.l.g, &f.l.field, origin, 1, &(mmbvh_options){.layout = MMBVH_REFERENCE}, &f.tree, NULL))
        return 1;
    for (f.leaf = 0; f.tree.nodes[f.leaf].count < 2;) f.leaf++;
    for (f.inner = 1; f.tree.nodes[f.inner].count;) f.inner++;
    *state = &f;
    return 0;
}

static int tear_down(void **state)
{
    fixture *f = *state;
    mmbvh_free(&f->tree);
    free_lattice(&f->l);
    return 0;
}

static void assert_violation_is_found(fixture *f, const char *words)
{
    base_error error = {0};
    mmbvh_statistics untouched = {.leaves = -1};
    assert_int_equal(mmbvh_check(&f->tree, &f->l.g, &f->l.field, &untouched, &error), INSITU_ERROR_INTERNAL);
    if (!strstr(error.message, words)) fail_msg("expected \"%s\" in \"%s\"", words, error.message);
    assert_int_equal(untouched.leaves, -1);
}

static void sound_tree_passes(void **state)
{
    fixture *f = *state;
    assert_int_equal(mmbvh_check(&f->tree, &f->l.g, &f->l.field, NULL, NULL), INSITU_OK);
    assert_int_equal(mmbvh_check(&f->tree, NULL, NULL, NULL, NULL), INSITU_OK);
}

static void cell_twice_is_found(void **state)
{
    fixture *f = *state;
    const uint64_t first = f->tree.nodes[f->leaf].ref;
    f->tree.cells[first + 1] = f->tree.cells[first];
    assert_violation_is_found(f, "twice");
}

static void cell_that_is_not_there_is_found(void **state)
{
    fixture *f = *state;
    f->tree.cells[f->tree.nodes[f->leaf].ref] = (uint32_t)f->l.g.cell_count;
    assert_violation_is_found(f, "there is no cell");
}

static void missing_cell_is_found(void **state)
{
    fixture *f = *state;
    /* all leaves and nodes before the last node stay valid */
    mmbvh_node *last = &f->tree.nodes[f->tree.node_count - 1];
    assert_true(last->count > 1);
    last->count--;
    f->tree.cell_count--;
    assert_violation_is_found(f, "in no leaf");
}

static void entry_in_no_leaf_is_found(void **state)
{
    fixture *f = *state;
    mmbvh_node *last = &f->tree.nodes[f->tree.node_count - 1];
    assert_true(last->count > 1);
    last->count--;
    assert_violation_is_found(f, "entries are in leaves");
}

static void overlapping_leaves_are_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[f->leaf].ref += 1;
    assert_violation_is_found(f, "its cells are entries");
}

static void emptied_leaf_is_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[f->leaf].count = 0;
    assert_violation_is_found(f, "its children are nodes");
}

static void ghost_in_a_leaf_is_found(void **state)
{
    fixture *f = *state;
    f->l.ghosts = calloc((size_t)f->l.g.cell_count, 1);
    f->l.ghosts[5] = 1;
    f->l.g.ghosts = f->l.ghosts;
    f->l.g.ghosts_stride = 1;
    assert_violation_is_found(f, "is a ghost");
}

static void narrow_leaf_is_found(void **state)
{
    fixture *f = *state;
    for (int axis = 0; axis < 3; axis++) {
        mmbvh_node *leaf = &f->tree.nodes[f->leaf];
        const float lower = leaf->lower[axis], upper = leaf->upper[axis];
        leaf->lower[axis] = nextafterf(lower, INFINITY);
        assert_violation_is_found(f, "lies outside its bounds");
        leaf->lower[axis] = lower;
        leaf->upper[axis] = nextafterf(upper, -INFINITY);
        assert_violation_is_found(f, "lies outside its bounds");
        leaf->upper[axis] = upper;
    }
}

static void narrow_leaf_range_is_found(void **state)
{
    fixture *f = *state;
    mmbvh_node *leaf = &f->tree.nodes[f->leaf];
    const float low = leaf->range_low;
    leaf->range_low = nextafterf(low, INFINITY);
    assert_violation_is_found(f, "lies outside its range");
    leaf->range_low = low;
    leaf->range_high = nextafterf(leaf->range_high, -INFINITY);
    assert_violation_is_found(f, "lies outside its range");
}

static void narrow_inner_node_is_found(void **state)
{
    fixture *f = *state;
    mmbvh_node *node = &f->tree.nodes[f->inner];
    for (int axis = 0; axis < 3; axis++) {
        const float lower = node->lower[axis], upper = node->upper[axis];
        node->lower[axis] = nextafterf(lower, INFINITY);
        assert_violation_is_found(f, "lies outside its bounds");
        node->lower[axis] = lower;
        node->upper[axis] = nextafterf(upper, -INFINITY);
        assert_violation_is_found(f, "lies outside its bounds");
        node->upper[axis] = upper;
    }
}

static void narrow_inner_range_is_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[f->inner].range_high = nextafterf(f->tree.nodes[f->inner].range_high, -INFINITY);
    assert_violation_is_found(f, "lies outside its range");
}

static void bounds_that_are_not_numbers_are_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[0].lower[1] = NAN;
    assert_violation_is_found(f, "above upper bound");
}

static void range_that_is_not_a_number_is_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[0].range_low = NAN;
    assert_violation_is_found(f, "outside its range");
}

static void cycle_is_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes[f->inner].ref = 1;
    assert_violation_is_found(f, "its children are nodes 1 on");
}

static void reference_beyond_the_nodes_is_found(void **state)
{
    fixture *f = *state;
    f->tree.node_count--;
    assert_violation_is_found(f, "its children are nodes");
}

static void node_never_reached_is_found(void **state)
{
    fixture *f = *state;
    f->tree.nodes = base_realloc(f->tree.nodes, (size_t)(f->tree.node_count + 2) * sizeof *f->tree.nodes);
    f->tree.node_count += 2;
    assert_violation_is_found(f, "nodes are reached");
}

static void wrong_unusable_count_is_found(void **state)
{
    fixture *f = *state;
    f->tree.unusable_cells = 1;
    assert_violation_is_found(f, "unusable");
}

/* Makes a tree that is one level too deep: every left child is a leaf of one cell. */
static void too_deep_a_tree_is_found(void **state)
{
    (void)state;
    enum { LEVELS = MMBVH_MAX_DEPTH + 1, NODES = 2 * LEVELS - 1 };
    static mmbvh_node nodes[NODES];
    static uint32_t cells[LEVELS];
    for (uint32_t i = 0; i < LEVELS; i++) cells[i] = i;
    for (int level = 0; level < LEVELS - 1; level++) {
        nodes[2 * level].count = 0;
        nodes[2 * level].ref = (uint64_t)(2 * level + 1) & (UINT64_MAX >> 3);
        nodes[2 * level + 1] = (mmbvh_node){.count = 1, .ref = (uint64_t)level & (UINT64_MAX >> 3)};
    }
    nodes[NODES - 1] = (mmbvh_node){.count = 1, .ref = LEVELS - 1};
    const mmbvh tree = {.nodes = nodes, .node_count = NODES, .cells = cells, .cell_count = LEVELS, .scale = 1};
    base_error error = {0};
    assert_int_equal(mmbvh_check(&tree, NULL, NULL, NULL, &error), INSITU_ERROR_INTERNAL);
    assert_non_null(strstr(error.message, "deeper than"));
}

#define BROKEN_TREE(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        BROKEN_TREE(sound_tree_passes),
        BROKEN_TREE(cell_twice_is_found),
        BROKEN_TREE(cell_that_is_not_there_is_found),
        BROKEN_TREE(missing_cell_is_found),
        BROKEN_TREE(entry_in_no_leaf_is_found),
        BROKEN_TREE(overlapping_leaves_are_found),
        BROKEN_TREE(emptied_leaf_is_found),
        BROKEN_TREE(ghost_in_a_leaf_is_found),
        BROKEN_TREE(narrow_leaf_is_found),
        BROKEN_TREE(narrow_leaf_range_is_found),
        BROKEN_TREE(narrow_inner_node_is_found),
        BROKEN_TREE(narrow_inner_range_is_found),
        BROKEN_TREE(bounds_that_are_not_numbers_are_found),
        BROKEN_TREE(range_that_is_not_a_number_is_found),
        BROKEN_TREE(cycle_is_found),
        BROKEN_TREE(reference_beyond_the_nodes_is_found),
        BROKEN_TREE(node_never_reached_is_found),
        BROKEN_TREE(wrong_unusable_count_is_found),
        cmocka_unit_test(too_deep_a_tree_is_found),
    };
    return cmocka_run_group_tests_name("mmbvh_check", tests, NULL, NULL);
}
