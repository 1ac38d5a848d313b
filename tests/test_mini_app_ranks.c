/* Checks the mini-app on several ranks: the state of each cell, for each partition, must be bit-identical to the state
 * that a single rank computes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "wave_mesh_create.h"
#include "wave_solver.h"

enum { STEPS = 12 };

typedef struct model {
    wave_mesh mesh;
    wave_solver solver;
} model;

static int make_model(model *m, const wave_lattice *lattice, wave_partition_kind kind, const wave_setup *setup,
                      int index_bytes, MPI_Comm comm)
{
    int rank, ranks;
    MPI_Comm_rank(comm, &rank);
    MPI_Comm_size(comm, &ranks);
    wave_partition partition = wave_partition_make(lattice, kind, ranks);
    int ok = wave_mesh_create(&partition, rank, index_bytes, &m->mesh) && m->mesh.unmatched == 0 &&
             wave_solver_create(setup, &m->mesh, comm, &m->solver);
    MPI_Allreduce(MPI_IN_PLACE, &ok, 1, MPI_INT, MPI_MIN, comm);
    if (!ok) return 0;
    wave_solver_start(&m->solver);
    for (int i = 0; i < STEPS; ++i) wave_solver_step(&m->solver);
    return 1;
}

static void free_model(model *m)
{
    wave_solver_free(&m->solver);
    wave_mesh_free(&m->mesh);
}

static int compare_ids(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* Returns the number of cells (including the halo) and own vertices of a part whose state or position differs from that
 * in the whole mesh. */
static int count_differences(const model *part, const model *whole)
{
    int differences = 0;
    for (int32_t c = 0; c < part->mesh.cells; ++c) {
        double a[4], b[4];
        const int64_t *at = bsearch(&part->mesh.cell_ids[c], whole->mesh.cell_ids, (size_t)whole->mesh.cells,
                                    sizeof(int64_t), compare_ids);
        if (!at) return part->mesh.cells;
        wave_solver_get(&part->solver, c, a);
        wave_solver_get(&whole->solver, (int32_t)(at - whole->mesh.cell_ids), b);
        differences += memcmp(a, b, sizeof a) != 0;
    }
    return differences;
}

static void compare_partitions(wave_cells cells, wave_partition_kind kind, const wave_setup *base, int index_bytes)
{
    static const int size[3] = {5, 4, 8};
    wave_lattice lattice = wave_lattice_make(size, cells, 0.2);
    wave_setup setup = *base;
    model part = {0}, whole = {0};
    setup.medium = wave_medium_make_layered(&lattice);
    setup.source = wave_source_make_default(&lattice, &setup.medium);
    setup.source.delay = 0.1;
    int ok = make_model(&whole, &lattice, WAVE_BLOCK, &setup, 4, MPI_COMM_SELF);
    ok = make_model(&part, &lattice, kind, &setup, index_bytes, MPI_COMM_WORLD) && ok;
    int differences = ok ? count_differences(&part, &whole) : 1;
    double peak = ok ? wave_solver_compute_totals(&whole.solver).peak : 0;
    MPI_Allreduce(MPI_IN_PLACE, &differences, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    free_model(&part);
    free_model(&whole);
    assert_int_equal(differences, 0);
    assert_true(peak > 1e-3); /* the wave is not zero, so that the comparison is not trivially true */
}

static void every_partition_computes_the_same_bits(void **state)
{
    (void)state;
    const wave_setup setup = {.real_bytes = 8, .reflecting = true, .order = 2};
    for (int kind = WAVE_BLOCK; kind <= WAVE_CHECKERBOARD; ++kind) {
        for (int cells = WAVE_TETS; cells <= WAVE_MIXED; ++cells) {
            compare_partitions((wave_cells)cells, (wave_partition_kind)kind, &setup, 4);
        }
    }
}

static void other_arrays_and_walls_compute_the_same_bits(void **state)
{
    (void)state;
    for (int i = 0; i < 8; ++i) {
        const wave_setup setup = {
            .real_bytes = (i & 1) ? 4 : 8, .is_soa = (i & 2) != 0, .order = 1 + (i >> 2), .swell = 0.05};
        compare_partitions(WAVE_MIXED, WAVE_RANDOM, &setup, (i & 2) ? 8 : 4);
    }
}

/* Checks that vertices which ranks share have bitwise equal positions after they are moved, because the library matches
 * them by these bits. */
static void moved_shared_vertices_stay_equal(void **state)
{
    (void)state;
    static const int size[3] = {4, 4, 4};
    wave_lattice lattice = wave_lattice_make(size, WAVE_MIXED, 0.1);
    wave_setup setup = {.real_bytes = 4, .order = 2, .swell = 0.1, .medium = wave_medium_make_layered(&lattice)};
    model part = {0}, whole = {0};
    setup.source = wave_source_make_default(&lattice, &setup.medium);
    setup.source.delay = 0.1;
    int ok = make_model(&whole, &lattice, WAVE_BLOCK, &setup, 4, MPI_COMM_SELF);
    ok = make_model(&part, &lattice, WAVE_RANDOM, &setup, 4, MPI_COMM_WORLD) && ok;
    int differences = !ok, moved = 0;
    wave_map found = {0};
    for (int32_t v = 0; ok && v < whole.mesh.vertices; ++v) wave_map_insert(&found, whole.mesh.vertex_ids[v], v);
    for (int32_t v = 0; ok && v < part.mesh.own_vertices; ++v) {
        const float *a = (const float *)part.solver.grid.coordinates.values + 3 * (int64_t)v;
        int32_t at = wave_map_find(&found, part.mesh.vertex_ids[v]);
        const float *b = (const float *)whole.solver.grid.coordinates.values + 3 * (int64_t)at;
        double rest[3];
        wave_lattice_compute_position(&lattice, part.mesh.vertex_ids[v], rest);
        differences += memcmp(a, b, 3 * sizeof *a) != 0;
        moved += a[2] != (float)rest[2];
    }
    wave_map_free(&found);
    MPI_Allreduce(MPI_IN_PLACE, &differences, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    MPI_Allreduce(MPI_IN_PLACE, &moved, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    free_model(&part);
    free_model(&whole);
    assert_int_equal(differences, 0);
    assert_true(moved > 0);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_partition_computes_the_same_bits),
        cmocka_unit_test(other_arrays_and_walls_compute_the_same_bits),
        cmocka_unit_test(moved_shared_vertices_stay_equal),
    };
    MPI_Init(&argc, &argv);
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    MPI_Finalize();
    return failed;
}
