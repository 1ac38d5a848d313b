/* Checks trees over lattices whose cells are addressed by lattice indices instead of connectivity. mmbvh_check() must
 * find no error; the ranges of leaves must equal brute force over the cells, even if values are not finite; and leaves
 * over small boxes must be full. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "mmbvh.h"
#include "test_mmbvh_nodes.h"

static const double no_shift[3] = {0, 0, 0};

/* A rectilinear lattice with its values as float and as double. Their arrays are padded, and the padding contains
 * NaN. */
typedef struct subject {
    grid_lattice lattice;
    grid g;
    double *axes[3], *wide;
    float *narrow;
} subject;

static grid_numbering make_numbering(const int64_t counts[3], int64_t padding, bool is_reversed, int64_t *length)
{
    grid_numbering out = {{0}, {0}, {0}, {0}};
    int64_t stride = 1;
    for (int n = 0; n < 3; n++) {
        const int axis = is_reversed ? 2 - n : n;
        const int64_t outer = stride * (counts[axis] + padding);
        if (counts[axis] == 1) continue;
        out.stride[axis] = stride;
        out.inverse_stride[axis] = 1 / (double)stride;
        out.outer[axis] = (double)outer;
        out.inverse_outer[axis] = 1 / (double)outer;
        stride = outer;
    }
    *length = stride;
    for (int axis = 0; axis < 3; axis++) /* the axis with the largest stride has no outer stride */
        if (out.outer[axis] == (double)stride) out.outer[axis] = out.inverse_outer[axis] = 0;
    return out;
}

static void *allocate_zeroed(int64_t count, size_t size)
{
    void *out = calloc((size_t)count, size);
    assert_non_null(out);
    return out;
}

static double compute_value(int64_t i, int64_t j, int64_t k, int turn)
{
    return sin(0.7 * (double)i + turn) * cos(0.9 * (double)j) + 0.3 * sin(1.1 * (double)k) + 0.2 * turn;
}

static void set_values(subject *s, int turn)
{
    const int64_t *stride = s->lattice.vertex_numbering.stride, *cells = s->lattice.cells;
    for (int64_t k = 0; k <= cells[2]; k++)
        for (int64_t j = 0; j <= cells[1]; j++)
            for (int64_t i = 0; i <= cells[0]; i++) {
                const int64_t v = i * stride[0] + j * stride[1] + k * stride[2];
                s->wide[v] = compute_value(i, j, k, turn);
                s->narrow[v] = (float)s->wide[v];
            }
}

/* Makes a lattice. layers: number of ghost layers on each side. */
static void make_padded_lattice(const int64_t cells[3], int64_t padding, bool is_reversed, int64_t layers, subject *s)
{
    static const signed char hex[8][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                          {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    grid_lattice *l = &s->lattice;
    int64_t vertices[3], sides[3];
    *s = (subject){.lattice = {.cell_count = 1}};
    for (int axis = 0; axis < 3; axis++) {
        vertices[axis] = cells[axis] + 1;
        sides[axis] = cells[axis] ? cells[axis] : 1;
        l->cells[axis] = cells[axis];
        l->drawn_first[axis] = cells[axis] ? layers : 0;
        l->drawn_end[axis] = sides[axis] - l->drawn_first[axis];
        l->cell_count *= sides[axis];
        s->axes[axis] = allocate_zeroed(vertices[axis], sizeof(double));
        for (int64_t n = 0; n < vertices[axis]; n++) s->axes[axis][n] = 0.1 * (double)n + 0.004 * (double)(n * n % 7);
        l->axes[axis] = (grid_axis){s->axes[axis], vertices[axis], &l->vertex_numbering, axis};
        s->g.coordinates[axis] = (grid_array){.is_wide = true, .axis = &l->axes[axis]};
    }
    l->vertex_numbering = make_numbering(vertices, padding, is_reversed, &s->g.vertex_count);
    l->cell_numbering = make_numbering(sides, padding, is_reversed, &s->g.cell_count);
    l->has_ghosts = layers > 0 || s->g.cell_count != l->cell_count;
    for (int i = 0; i < 8; i++)
        for (int axis = 0; axis < 3; axis++) l->corner_offsets[i] += hex[i][axis] * l->vertex_numbering.stride[axis];
    s->g.lattice = l;
    s->g.cell_type = cells[2] ? GRID_HEX : GRID_QUAD;
    s->wide = allocate_zeroed(s->g.vertex_count, sizeof *s->wide);
    s->narrow = allocate_zeroed(s->g.vertex_count, sizeof *s->narrow);
    for (int64_t v = 0; v < s->g.vertex_count; v++) s->narrow[v] = (float)(s->wide[v] = (double)NAN);
    set_values(s, 0);
}

static void free_subject(subject *s)
{
    for (int axis = 0; axis < 3; axis++) free(s->axes[axis]);
    free(s->wide);
    free(s->narrow);
}

static grid_field make_field(const subject *s, bool is_wide)
{
    const int64_t size = is_wide ? (int64_t)sizeof *s->wide : (int64_t)sizeof *s->narrow;
    const void *data = is_wide ? (const void *)s->wide : s->narrow;
    return (grid_field){
        .values = {.data = data, .stride = size, .is_wide = is_wide}, .component_stride = size, .component_count = 1};
}

/* Checks that the range of each leaf is the range of its cells with finite values, rounded outward to float. */
static void assert_ranges(const subject *s, const mmbvh *tree, const grid_field *field)
{
    int64_t unusable = 0;
    for (int64_t i = 0; i < tree->node_count; i++) {
        const node_view node = read_node(tree, i);
        double low = (double)INFINITY, high = -low;
        for (int n = 0; n < node.count; n++) {
            const int64_t cell = tree->cells[node.ref + n];
            int64_t vertices[GRID_MAX_CELL_VERTICES];
            double values[GRID_MAX_CELL_VERTICES];
            const int count = grid_cell_vertices(&s->g, cell, vertices);
            const bool is_finite = grid_cell_values(field, cell, vertices, count, values);
            unusable += !is_finite;
            for (int v = 0; v < count && is_finite; v++) low = fmin(low, values[v]), high = fmax(high, values[v]);
        }
        if (!node.count) continue;
        assert_true(low > high ? node.range_low > node.range_high
                               : (double)node.range_low <= low && (double)nextafterf(node.range_low, INFINITY) > low);
        assert_true(low > high ||
                    ((double)node.range_high >= high && (double)nextafterf(node.range_high, -INFINITY) < high));
    }
    assert_int_equal(tree->unusable_cells, unusable);
}

static void check_lattice(const int64_t cells[3], int64_t padding, bool is_reversed, int64_t layers)
{
    subject s;
    make_padded_lattice(cells, padding, is_reversed, layers, &s);
    for (int is_wide = 0; is_wide < 2; is_wide++) {
        const grid_field field = make_field(&s, is_wide);
        const mmbvh_options options = {.threads = 2, .layout = is_wide ? MMBVH_REFERENCE : MMBVH_COMPACT};
        mmbvh tree;
        set_values(&s, 0);
        assert_int_equal(mmbvh_build(&s.g, &field, no_shift, 1, &options, &tree, NULL), INSITU_OK);
        assert_proved(&tree, &s.g, &field);
        assert_ranges(&s, &tree, &field);
        set_values(&s, 1);
        for (int64_t v = 0; v < s.g.vertex_count; v += 37) s.narrow[v] = (float)(s.wide[v] = (double)NAN);
        assert_int_equal(mmbvh_refit_ranges(&tree, &s.g, &field, &options), INSITU_OK);
        assert_proved(&tree, &s.g, &field);
        assert_ranges(&s, &tree, &field);
        mmbvh_free(&tree);
    }
    free_subject(&s);
}

static void brick_trees_are_valid_with_tight_ranges(void **state)
{
    (void)state;
    static const int64_t sides[][3] = {{1, 1, 1},  {2, 3, 1},  {7, 1, 1}, {8, 1, 1},    {5, 4, 6},   {16, 16, 16},
                                       {9, 13, 3}, {40, 2, 2}, {6, 6, 0}, {33, 20, 25}, {1, 17, 40}, {23, 9, 0}};
    for (size_t i = 0; i < sizeof sides / sizeof sides[0]; i++)
        for (int bits = 0; bits < 4; bits++) check_lattice(sides[i], bits & 1 ? 2 : 0, bits >> 1, 0);
    check_lattice((const int64_t[]){12, 11, 10}, 0, false, 2);
    check_lattice((const int64_t[]){12, 11, 10}, 3, true, 1);
}

/* Checks the memory of trees over small boxes. Leaves must have 3 x 2 x 1 cells even if the box's sides are powers of
 * two. With 24 bytes per node and 4 bytes per cell, leaves of 6 cells take 12 bytes per cell; the smaller leaves at the
 * ends of the sides take less than another 12. */
static void small_boxes_fill_their_leaves(void **state)
{
    (void)state;
    static const int64_t sides[][3] = {{16, 16, 16}, {32, 32, 32}, {24, 24, 24},
                                       {64, 32, 16}, {48, 50, 0},  {31, 29, 30}};
    for (size_t i = 0; i < sizeof sides / sizeof sides[0]; i++) {
        subject s;
        mmbvh tree;
        make_padded_lattice(sides[i], 0, false, 0, &s);
        const grid_field field = make_field(&s, false);
        assert_int_equal(mmbvh_build(&s.g, &field, no_shift, 1, NULL, &tree, NULL), INSITU_OK);
        const mmbvh_statistics statistics = assert_proved(&tree, &s.g, &field);
        assert_true(statistics.cells_a_leaf > 5.5);
        assert_true(mmbvh_bytes(&tree) <= 13 * s.g.cell_count);
        mmbvh_free(&tree);
        free_subject(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(brick_trees_are_valid_with_tight_ranges),
                                       cmocka_unit_test(small_boxes_fill_their_leaves)};
    return cmocka_run_group_tests_name("mmbvh_bricks", tests, NULL, NULL);
}
