/* Compares sums over cells that are computed in SIMD lanes (session_lanes.h) with sums over single cells in long
 * double, for all types, layouts and instruction sets. Unusual cells must be left to the code for single cells. No
 * index that is out of range may be dereferenced, which is tested by coordinates next to pages that cannot be read.
 * Also compares the checks of several cells at once (session_tally.h), including mixed cells, with checks of one cell
 * at a time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "session_lanes.h"
#include "session_tally.h"
#include "test_meshes.h"

/* SIDE: chosen so that the cells fill a block and a part of another one, and the number of hexes is no multiple of
 * eight. */
enum { SIDE = 7, LAYOUTS = 16 };

/* The largest rounding error of a cell's volume, as a fraction of the volume of the cell's bounding box. It is derived
 * in session_tally.c. */
static const double rounding_share = 0x1p-46;

static test_layout choose_layout(int i)
{
    return (test_layout){
        .wide_coordinates = i & 1, .wide_indices = i & 2, .is_interleaved = i & 4, .with_types = i & 8};
}

/* ---- single cells -------------------------------------------------------------------------------------------- */

/* Finds the neighbours of a corner of a prism, or of a corner of a pyramid's base, in right-handed order: the next and
 * the previous corner around the base, and the corner above or below. */
static void find_corner_neighbours(int type, int corner, int out[3])
{
    const int around = type == GRID_WEDGE ? 3 : 4;
    const int level = corner / around, at = corner % around;
    const int next = level * around + (at + 1) % around, last = level * around + (at + around - 1) % around;
    out[0] = level ? last : next;
    out[1] = level ? next : last;
    out[2] = type == GRID_PYRAMID ? 4 : (1 - level) * around + at;
}

static long double compute_corner_determinant(long double p[][3], int corner, const int to[3])
{
    long double e[3][3];
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++) e[k][axis] = p[to[k]][axis] - p[corner][axis];
    return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) - e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
           e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

/* Returns the mean over the corners of the volume that the cell would have if its edges were parallel to those at the
 * corner. The determinant of a corner's edges is the volume of such a hex; a wedge has half of it, and a pyramid a
 * third. */
static long double compute_mean_corner_volume(int type, long double p[][3])
{
    if (type == GRID_TET) return compute_corner_determinant(p, 0, (const int[]){1, 2, 3}) / 6;
    const int corners = type == GRID_HEX ? 8 : type == GRID_WEDGE ? 6 : 4;
    const long double share = type == GRID_HEX ? 1 : type == GRID_WEDGE ? 0.5L : 1 / 3.0L;
    long double sum = 0;
    for (int corner = 0; corner < corners; corner++) {
        int to[3];
        find_corner_neighbours(type, corner, to);
        sum += compute_corner_determinant(p, corner, to);
    }
    return share * sum / corners;
}

typedef struct truth {
    double lower[3], upper[3];
    long double least, sizes;
    int64_t inverted;
    long double box; /* volume of the largest bounding box of a cell */
} truth;

static void add_cell(const grid *g, int64_t cell, truth *t)
{
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    long double p[GRID_MAX_CELL_VERTICES][3], box = 1;
    const int count = grid_cell_vertices(g, cell, vertices);
    for (int axis = 0; axis < 3; axis++) {
        double low = (double)INFINITY, high = -(double)INFINITY;
        for (int i = 0; i < count; i++) {
            const double x = grid_read_number(&g->coordinates[axis], vertices[i]);
            p[i][axis] = x;
            low = fmin(x, low);
            high = fmax(x, high);
        }
        t->lower[axis] = fmin(low, t->lower[axis]);
        t->upper[axis] = fmax(high, t->upper[axis]);
        box *= (long double)high - (long double)low;
    }
    const long double volume = compute_mean_corner_volume(grid_cell_type(g, cell), p), size = fabsl(volume);
    /* the volume is so large that rounding cannot change its sign */
    assert_true(size > (long double)rounding_share * box);
    t->least = size < t->least ? size : t->least;
    t->sizes += cbrtl(size);
    t->inverted += volume < 0;
    t->box = box > t->box ? box : t->box;
}

static truth compute_sums_by_brute_force(const grid *g, int64_t first, int64_t count)
{
    const double inf = (double)INFINITY;
    truth t = {{inf, inf, inf}, {-inf, -inf, -inf}, inf, 0, 0, 0};
    for (int64_t cell = first; cell < first + count; cell++) add_cell(g, cell, &t);
    return t;
}

/* Compares the sums computed in lanes with brute force. A cube root by Halley's method has a relative error of at most
 * 1e-14, and a sum of n terms one of at most n roundings. */
static void assert_sums(const lane_sums *sums, const truth *t, int64_t count)
{
    for (int axis = 0; axis < 3; axis++) {
        assert_true(sums->lower[axis] == t->lower[axis]);
        assert_true(sums->upper[axis] == t->upper[axis]);
    }
    assert_int_equal(sums->inverted_count, t->inverted);
    if (count) assert_true(fabsl((long double)sums->least - t->least) <= (long double)rounding_share * t->box);
    assert_true(fabsl((long double)sums->size_sum - t->sizes) <= (1e-14L + (long double)count * 0x1p-53L) * t->sizes);
}

/* ---- all types and layouts ----------------------------------------------------------------------------------- */

/* Makes a mesh in which some cells are mirrored and thus inverted. If its coordinates are doubles, it is far from the
 * origin. */
static test_view make_view(test_mesh_kind kind, test_layout layout, int64_t base)
{
    test_mesh mesh;
    test_view view;
    test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, &mesh);
    test_mesh_mirror_cells(&mesh, true);
    if (layout.wide_coordinates) test_mesh_transform(&mesh, 1, (const double[]){5e5, -3, 0.01});
    for (int64_t i = 0; i < mesh.connectivity_count; i++) mesh.connectivity[i] += base;
    test_view_create(&mesh, layout, &view);
    view.cells.connectivity.base = base;
    test_mesh_free(&mesh);
    return view;
}

static lane_sums compute_lane_sums(cpu_isa isa, const lane_cells *cells, int64_t *taken, int64_t *alone)
{
    lane_sums sums;
    memset(&sums, 0, sizeof sums);
    *taken = session_get_cell_loop_for_type(isa, cells->g, cells->type)(cells, &sums, alone);
    return sums;
}

static void assert_sums_of_cell_range(const grid *g, int64_t first, int64_t count)
{
    const int vertices = grid_type_vertex_count(g->cell_type);
    const lane_cells cells = {g, g->cell_type, first, count, first * vertices};
    const truth t = compute_sums_by_brute_force(g, first, count - count % LANES);
    lane_sums plain;
    for (cpu_isa isa = CPU_PLAIN; isa <= cpu_best_isa(); isa++) {
        int64_t taken, alone;
        const lane_sums sums = compute_lane_sums(isa, &cells, &taken, &alone);
        assert_int_equal(taken, count - count % LANES);
        assert_int_equal(alone, count % LANES);
        if (isa == CPU_PLAIN) plain = sums;
        assert_memory_equal(&sums, &plain, sizeof sums);
        assert_sums(&sums, &t, taken);
    }
}

static void sums_in_lanes_match_single_cells(void **state)
{
    (void)state;
    const int64_t counts[] = {0, 1, 7, 8, 9, 40, 301};
    for (test_mesh_kind kind = TEST_TETS; kind <= TEST_PYRAMIDS; kind++)
        /* Layouts with offsets need no test, because the code for lanes receives the range of cells as an argument. */
        for (int i = 0; i < LAYOUTS / 2; i++) {
            test_view view = make_view(kind, choose_layout(i), i & 1);
            view.cells.ghosts = NULL;
            for (size_t k = 0; k < sizeof counts / sizeof *counts; k++)
                assert_sums_of_cell_range(&view.cells, (int64_t)k, counts[k]);
            assert_sums_of_cell_range(&view.cells, 0, view.cells.cell_count);
            test_view_free(&view);
        }
}

/* Checks connectivity whose entries are separated by other numbers. */
static void strided_connectivity_gives_the_same_sums(void **state)
{
    (void)state;
    for (int wide = 0; wide < 2; wide++) {
        test_view view = make_view(TEST_WEDGES, (test_layout){.wide_indices = wide}, 0);
        grid *g = &view.cells;
        const int64_t count = 6 * g->cell_count, size = wide ? 8 : 4;
        char *spread = calloc((size_t)count, (size_t)(3 * size));
        assert_non_null(spread);
        for (int64_t i = 0; i < count; i++)
            memcpy(spread + 3 * size * i, g->connectivity.data + size * i, (size_t)size);
        g->ghosts = NULL;
        g->connectivity.data = spread;
        g->connectivity.stride = 3 * size;
        assert_sums_of_cell_range(g, 0, g->cell_count);
        free(spread);
        test_view_free(&view);
    }
}

/* ---- unusual cells ------------------------------------------------------------------------------------------- */

static void make_ghost(grid *g, int64_t cell)
{
    ((char *)(uintptr_t)g->ghosts)[cell] = 1;
}

static void make_flat(grid *g, int64_t cell)
{
    int32_t *vertices = (int32_t *)(uintptr_t)g->connectivity.data + 4 * cell;
    vertices[3] = vertices[0];
}

static void make_infinite(grid *g, int64_t cell)
{
    const int32_t vertex = ((const int32_t *)(const void *)g->connectivity.data)[4 * cell + 2];
    ((float *)(uintptr_t)g->coordinates[1].data)[vertex] = INFINITY;
}

static void make_nan(grid *g, int64_t cell)
{
    const int32_t vertex = ((const int32_t *)(const void *)g->connectivity.data)[4 * cell];
    ((float *)(uintptr_t)g->coordinates[2].data)[vertex] = NAN;
}

static void set_index_out_of_range(grid *g, int64_t cell)
{
    ((int32_t *)(uintptr_t)g->connectivity.data)[4 * cell + 1] = (int32_t)g->vertex_count;
}

static void unusual_cells_are_excluded_from_lanes(void **state)
{
    (void)state;
    void (*const make[])(grid *, int64_t) = {make_ghost, make_flat, make_infinite, make_nan, set_index_out_of_range};
    const int64_t places[] = {0, 3, 8, 511, 512, 700, 2047};
    for (size_t m = 0; m < sizeof make / sizeof *make; m++)
        for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
            test_view view = make_view(TEST_TETS, (test_layout){0}, 0);
            const int64_t place = places[i];
            make[m](&view.cells, place);
            const lane_cells cells = {&view.cells, GRID_TET, 0, view.cells.cell_count, 0};
            for (cpu_isa isa = CPU_PLAIN; isa <= cpu_best_isa(); isa++) {
                int64_t taken, alone, again, none;
                const lane_sums sums = compute_lane_sums(isa, &cells, &taken, &alone);
                /* earlier cells may be excluded too, because they can share the changed vertex */
                assert_true(taken <= place && taken % LANES == 0);
                assert_true(alone > 0 && taken + alone <= cells.count);
                if (make[m] == make_ghost || make[m] == set_index_out_of_range) assert_true(taken + alone > place);
                const lane_cells before = {&view.cells, GRID_TET, 0, taken, 0};
                const lane_sums expected = compute_lane_sums(isa, &before, &again, &none);
                assert_int_equal(again, taken);
                assert_true(sums.size_sum == expected.size_sum && sums.inverted_count == expected.inverted_count);
                assert_true(sums.least == expected.least);
            }
            test_view_free(&view);
        }
}

/* Memory between two pages that cannot be read. The numbers in it are adjacent to one of these pages. */
typedef struct guarded {
    char *pages;
    size_t page, inner;
} guarded;

static guarded allocate_guarded(size_t bytes)
{
    guarded out = {.page = (size_t)sysconf(_SC_PAGESIZE)};
    out.inner = (bytes + out.page - 1) / out.page * out.page;
    out.pages = mmap(NULL, out.inner + 2 * out.page, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(out.pages != MAP_FAILED);
    assert_int_equal(mprotect(out.pages + out.page, out.inner, PROT_READ | PROT_WRITE), 0);
    return out;
}

static void assert_not_followed(const grid *g, void *index, int64_t cell, int64_t wrong)
{
    const bool wide = g->connectivity.is_wide;
    const int64_t good = wide ? *(int64_t *)index : *(int32_t *)index;
    if (wide)
        *(int64_t *)index = wrong;
    else
        *(int32_t *)index = (int32_t)wrong;
    const lane_cells cells = {g, GRID_HEX, 0, g->cell_count, 0};
    for (cpu_isa isa = CPU_PLAIN; isa <= cpu_best_isa(); isa++) {
        int64_t taken, alone;
        compute_lane_sums(isa, &cells, &taken, &alone);
        assert_true(taken <= cell && taken + alone > cell);
    }
    if (wide)
        *(int64_t *)index = good;
    else
        *(int32_t *)index = (int32_t)good;
}

static void wrong_indices_are_not_dereferenced(void **state)
{
    (void)state;
    /* bits: widths of coordinates and of indices, index base, end of the memory at which the numbers are */
    for (int i = 0; i < 16; i++) {
        const int64_t base = i >> 2 & 1;
        test_view view = make_view(TEST_HEXES, choose_layout(i & 3), base);
        grid *g = &view.cells;
        g->ghosts = NULL;
        const size_t size = g->coordinates[0].is_wide ? 8 : 4, bytes = size * (size_t)g->vertex_count;
        guarded memory[3];
        for (int axis = 0; axis < 3; axis++) {
            memory[axis] = allocate_guarded(bytes);
            char *to = memory[axis].pages + memory[axis].page + (i & 8 ? memory[axis].inner - bytes : 0);
            memcpy(to, g->coordinates[axis].data, bytes);
            g->coordinates[axis].data = to;
        }
        const int64_t wrong[] = {base - 1, base + g->vertex_count, INT32_MAX, INT32_MIN, INT64_MAX, INT64_MIN};
        const int64_t cells[] = {0, g->cell_count / 2, g->cell_count / LANES * LANES - 1};
        for (int k = 0; k < (g->connectivity.is_wide ? 6 : 4); k++)
            for (int c = 0; c < 3; c++)
                assert_not_followed(
                    g, (char *)(uintptr_t)g->connectivity.data + g->connectivity.stride * (8 * cells[c] + k), cells[c],
                    wrong[k]);
        assert_sums_of_cell_range(g, 0,
                                  g->cell_count); /* reads the first and the last vertex, but nothing beyond them */
        for (int axis = 0; axis < 3; axis++) munmap(memory[axis].pages, memory[axis].inner + 2 * memory[axis].page);
        test_view_free(&view);
    }
}

/* ---- several cells ------------------------------------------------------------------------------------------- */

static void volumes_in_lanes_match_single_cells(void **state)
{
    (void)state;
    const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        for (int i = 0; i < LAYOUTS; i++) {
            test_view view = make_view(kinds[k], choose_layout(i), 0);
            for (int64_t cell = 0; cell < view.cells.cell_count; cell += cell < 40 ? 1 : 57)
                make_ghost(&view.cells, cell);
            session_mesh mesh = {.cells = view.cells};
            for (int64_t cell = 0; cell < view.cells.cell_count; cell++)
                mesh.topology.connectivity_count += grid_type_vertex_count(grid_cell_type(&view.cells, cell));
            mesh_tally all = tally_empty(), each = tally_empty();
            const tally_run run = tally_choose_check_function(&mesh);
            assert_non_null(run);
            assert_int_equal(run(&mesh, 0, view.cells.cell_count, &all), view.cells.cell_count);
            for (int64_t cell = 0; cell < view.cells.cell_count; cell++) tally_cell(&view.cells, cell, &each);
            assert_memory_equal(all.lower, each.lower, sizeof all.lower);
            assert_memory_equal(all.upper, each.upper, sizeof all.upper);
            assert_int_equal(all.drawn_count, each.drawn_count);
            assert_int_equal(all.ghost_count, each.ghost_count);
            assert_int_equal(all.inverted_count, each.inverted_count);
            assert_int_equal(all.flat_count, 0);
            assert_true(fabs(all.size_sum - each.size_sum) <=
                        1e-12 * each.size_sum); /* error of 4000 roundings, and of cube roots */
            test_view_free(&view);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums_in_lanes_match_single_cells), cmocka_unit_test(strided_connectivity_gives_the_same_sums),
        cmocka_unit_test(unusual_cells_are_excluded_from_lanes), cmocka_unit_test(wrong_indices_are_not_dereferenced),
        cmocka_unit_test(volumes_in_lanes_match_single_cells)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
