/* Checks the mini-app's mesh. The cells must fill the box without gaps or overlaps, each face must coincide with one
 * face of the neighbour, and every cell must belong to exactly one rank of a partition. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "wave_geometry.h"
#include "wave_faces.h"
#include "wave_mesh_create.h"

static const int sizes[][3] = {{1, 1, 1}, {2, 3, 2}, {5, 4, 8}, {7, 7, 7}};

static void compute_cell_geometry(const wave_mesh *mesh, int32_t cell, wave_cell_geometry *out)
{
    int32_t v[8];
    int64_t id[8];
    double x[8][3];
    const wave_cell_shape *shape = wave_mesh_cell(mesh, cell, v);
    for (int i = 0; i < shape->vertex_count; ++i) {
        id[i] = mesh->vertex_ids[v[i]];
        wave_lattice_compute_position(&mesh->partition.lattice, id[i], x[i]);
    }
    wave_cell_measure(shape, (const double(*)[3])x, id, out);
}

static void check_box(const wave_lattice *lattice)
{
    wave_partition partition = wave_partition_make(lattice, WAVE_BLOCK, 1);
    wave_mesh mesh;
    double sum = 0, h = lattice->edge;
    assert_true(wave_mesh_create(&partition, 0, 4, &mesh));
    assert_int_equal(mesh.unmatched, 0);
    assert_int_equal(mesh.cells, mesh.own_cells);
    for (int32_t c = 0; c < mesh.own_cells; ++c) {
        wave_cell_geometry g;
        compute_cell_geometry(&mesh, c, &g);
        assert_true(g.volume > 0);
        sum += g.volume;
        for (int a = 0; a < 3; ++a) {
            double around = 0;
            int faces = wave_cell_shape_of(wave_mesh_type(&mesh, c))->face_count;
            for (int f = 0; f < faces; ++f) around += g.area[f][a];
            /* six areas of at most 2 h^2, computed from coordinates of at most 2: 12 roundings of 2 h eps each */
            assert_true(fabs(around) <= 48 * h * 2.3e-16);
        }
    }
    double box = h * h * h * (double)wave_lattice_cube_count(lattice);
    /* The rounding error of a volume comes from about 20 operations on terms of about h^2 times the rounding of a
     * position (2 eps). */
    assert_true(fabs(sum - box) <= 40 * h * h * 2.3e-16 * mesh.own_cells + 1e-15 * box * mesh.own_cells);
    wave_mesh_free(&mesh);
}

static void cells_of_every_kind_fill_the_box(void **state)
{
    (void)state;
    for (int kind = WAVE_TETS; kind <= WAVE_MIXED; ++kind) {
        for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s) {
            for (int jitter = 0; jitter < 2; ++jitter) {
                wave_lattice lattice = wave_lattice_make(sizes[s], (wave_cells)kind, 0.2 * jitter);
                check_box(&lattice);
            }
        }
    }
}

/* Computes the centroid of a cell with flat faces. The cell is divided into tets between vertex 0 and the triangles of
 * each face. */
static void compute_exact_centroid(const wave_cell_shape *shape, double x[8][3], double centroid[3])
{
    double volume = 0, e[3][3];
    for (int a = 0; a < 3; ++a) centroid[a] = 0;
    for (int f = 0; f < shape->face_count; ++f) {
        for (int t = 2; t < shape->face_size[f]; ++t) {
            const int corner[3] = {shape->face[f][0], shape->face[f][t - 1], shape->face[f][t]};
            for (int i = 0; i < 3; ++i) {
                for (int a = 0; a < 3; ++a) e[i][a] = x[corner[i]][a] - x[0][a];
            }
            double v =
                (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
                 e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) /
                6;
            volume += v;
            for (int a = 0; a < 3; ++a) centroid[a] += v * (x[0][a] + 0.25 * (e[0][a] + e[1][a] + e[2][a]));
        }
    }
    for (int a = 0; a < 3; ++a) centroid[a] /= volume;
}

static void centroids_of_flat_cells_are_exact(void **state)
{
    (void)state;
    for (int kind = WAVE_TETS; kind <= WAVE_MIXED; ++kind) {
        wave_lattice lattice = wave_lattice_make(sizes[2], (wave_cells)kind, 0);
        wave_cell cells[WAVE_CELLS_PER_CUBE];
        for (int64_t cube = 0; cube < wave_lattice_cube_count(&lattice); ++cube) {
            int count = wave_lattice_make_cells(&lattice, cube, cells);
            for (int c = 0; c < count; ++c) {
                const wave_cell_shape *shape = wave_cell_shape_of(cells[c].type);
                wave_cell_geometry g;
                double x[8][3], exact[3];
                for (int i = 0; i < shape->vertex_count; ++i)
                    wave_lattice_compute_position(&lattice, cells[c].vertex[i], x[i]);
                wave_cell_measure(shape, (const double(*)[3])x, cells[c].vertex, &g);
                compute_exact_centroid(shape, x, exact);
                /* tolerance: about 50 roundings of coordinates of at most 2 */
                for (int a = 0; a < 3; ++a) assert_true(fabs(g.centroid[a] - exact[a]) <= 50 * 2 * 2.3e-16);
            }
        }
    }
}

static void mixed_mesh_has_all_four_types(void **state)
{
    (void)state;
    wave_lattice lattice = wave_lattice_make(sizes[3], WAVE_MIXED, 0);
    wave_cell cells[WAVE_CELLS_PER_CUBE];
    int seen[16] = {0};
    for (int64_t cube = 0; cube < wave_lattice_cube_count(&lattice); ++cube) {
        int count = wave_lattice_make_cells(&lattice, cube, cells);
        for (int c = 0; c < count; ++c) seen[cells[c].type]++;
    }
    assert_true(seen[10] && seen[12] && seen[13] && seen[14]);
}

/* Checks that unmatched faces are counted, on which the other tests rely: a cell whose face coincides with no other
 * face must be counted. */
static void unmatched_faces_are_counted(void **state)
{
    (void)state;
    const int size[3] = {2, 2, 2};
    wave_lattice lattice = wave_lattice_make(size, WAVE_TETS, 0);
    wave_partition partition = wave_partition_make(&lattice, WAVE_BLOCK, 1);
    wave_mesh mesh;
    assert_true(wave_mesh_create(&partition, 0, 4, &mesh));
    /* Changes a vertex of the first tet, so that its faces match no face of another cell. */
    int32_t *connectivity = mesh.connectivity;
    free(mesh.neighbours);
    connectivity[0] = connectivity[1];
    mesh.face_count = mesh.unmatched = 0;
    assert_true(wave_faces_find_neighbours(&mesh));
    assert_true(mesh.unmatched > 0);
    wave_mesh_free(&mesh);
}

static void check_cover(const wave_lattice *lattice, wave_partition_kind kind, int ranks)
{
    wave_partition partition = wave_partition_make(lattice, kind, ranks);
    int64_t ids = wave_lattice_cube_count(lattice) * WAVE_CELLS_PER_CUBE, count = 0, expected = 0;
    char *seen = calloc((size_t)ids, 1);
    wave_cell cells[WAVE_CELLS_PER_CUBE];
    for (int64_t cube = 0; cube < wave_lattice_cube_count(lattice); ++cube) {
        expected += wave_lattice_make_cells(lattice, cube, cells);
    }
    for (int r = 0; r < ranks; ++r) {
        wave_mesh mesh;
        assert_true(wave_mesh_create(&partition, r, 8, &mesh));
        assert_int_equal(mesh.unmatched, 0);
        count += mesh.own_cells;
        for (int32_t c = 0; c < mesh.own_cells; ++c) assert_int_equal(seen[mesh.cell_ids[c]]++, 0);
        wave_mesh_free(&mesh);
    }
    assert_int_equal(count, expected);
    free(seen);
}

static void partitions_give_each_cell_to_one_rank(void **state)
{
    (void)state;
    static const int ranks[] = {1, 2, 3, 4, 7, 100};
    for (int kind = WAVE_BLOCK; kind <= WAVE_CHECKERBOARD; ++kind) {
        for (size_t r = 0; r < sizeof ranks / sizeof *ranks; ++r) {
            wave_lattice lattice = wave_lattice_make(sizes[2], WAVE_MIXED, 0);
            check_cover(&lattice, (wave_partition_kind)kind, ranks[r]);
        }
    }
}

/* Checks that the cells that rank a sends to rank b are those that b receives from a, in the same order. */
static void sends_match_receives_of_other_ranks(void **state)
{
    (void)state;
    enum { RANKS = 3 };
    for (int kind = WAVE_BLOCK; kind <= WAVE_CHECKERBOARD; ++kind) {
        wave_lattice lattice = wave_lattice_make(sizes[2], WAVE_MIXED, 0);
        wave_partition partition = wave_partition_make(&lattice, (wave_partition_kind)kind, RANKS);
        wave_mesh mesh[RANKS];
        for (int r = 0; r < RANKS; ++r) assert_true(wave_mesh_create(&partition, r, 4, &mesh[r]));
        for (int a = 0; a < RANKS; ++a) {
            for (int l = 0; l < mesh[a].link_count; ++l) {
                const wave_link *out = &mesh[a].links[l];
                const wave_mesh *other = &mesh[out->rank];
                int b = 0;
                while (b < other->link_count && other->links[b].rank != a) ++b;
                assert_true(b < other->link_count);
                const wave_link *in = &other->links[b];
                assert_int_equal(out->send_end - out->send_begin, in->receive_end - in->receive_begin);
                for (int32_t i = 0; i < out->send_end - out->send_begin; ++i) {
                    assert_int_equal(mesh[a].cell_ids[mesh[a].sends[out->send_begin + i]],
                                     other->cell_ids[in->receive_begin + i]);
                }
            }
        }
        for (int r = 0; r < RANKS; ++r) wave_mesh_free(&mesh[r]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_of_every_kind_fill_the_box),      cmocka_unit_test(centroids_of_flat_cells_are_exact),
        cmocka_unit_test(mixed_mesh_has_all_four_types),         cmocka_unit_test(unmatched_faces_are_counted),
        cmocka_unit_test(partitions_give_each_cell_to_one_rank), cmocka_unit_test(sends_match_receives_of_other_ranks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
