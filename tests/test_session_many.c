/* Checks that the CPU time of a step grows linearly with the number of meshes, or with the number of blocks of one
 * mesh. All ranks together have thousands of them, each of which consists of one hex. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "test_session_fixture.h"

enum { FEW = 1000, MANY = 8000, STEPS = 4, TRIES = 3, CORNERS = 8 };

static const char *scene_text = "images:\n"
                                "  - name: many\n"
                                "    size: [64, 64]\n"
                                "    layers:\n"
                                "      - isosurface: {field: f, values: [0.5]}\n"
                                "      - surface: {colour: [1, 1, 1]}\n"
                                "    outputs: [{path: \"many.png\"}]\n";

/* Cubes in a row along x, with the field f = x / count. */
typedef struct row_of_cubes {
    int count;
    double (*coordinates)[CORNERS][3], (*values)[CORNERS];
} row_of_cubes;

static const int cube[CORNERS] = {0, 1, 2, 3, 4, 5, 6, 7};

static void row_create(row_of_cubes *row, int count)
{
    static const int corners[CORNERS][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                            {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    row->count = count;
    row->coordinates = malloc((size_t)count * sizeof *row->coordinates);
    row->values = malloc((size_t)count * sizeof *row->values);
    if (!row->coordinates || !row->values) abort();
    for (int i = 0; i < count; i++)
        for (int n = 0; n < CORNERS; n++)
            for (int a = 0; a < 3; a++) row->coordinates[i][n][a] = corners[n][a] + (a == 0 ? i : 0);
}

static void row_free(row_of_cubes *row)
{
    free(row->coordinates);
    free(row->values);
}

/* Writes the cube's name. Names of neighbouring cubes differ in their first digit, so that the order by name is not the
 * order in the row. */
static void make_cube_name(int i, char name[32])
{
    snprintf(name, 32, "%d%03d rank %d", i % 10, i / 10, own_rank);
}

static void set_cube(insitu_session *session, bool is_block, int i, const insitu_mesh *mesh)
{
    char name[32];
    make_cube_name(i, name);
    assert_int_equal(is_block ? insitu_set_block(session, "m", i, mesh) : insitu_set_mesh(session, name, mesh),
                     INSITU_OK);
}

static void set_values(insitu_session *session, bool is_block, int i, const insitu_field *field)
{
    char name[32];
    make_cube_name(i, name);
    assert_int_equal(is_block ? insitu_set_block_field(session, "m", i, field) : insitu_set_field(session, name, field),
                     INSITU_OK);
}

static void set_cubes(insitu_session *session, bool are_blocks, const row_of_cubes *row)
{
    for (int i = 0; i < row->count; i++) {
        insitu_mesh mesh;
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = CORNERS;
        insitu_mesh_interleaved(&mesh, row->coordinates[i], INSITU_FLOAT64);
        mesh.cell_count = 1;
        mesh.cell_type = INSITU_HEX;
        mesh.connectivity_count = CORNERS;
        mesh.connectivity = (insitu_array){.data = cube, .type = INSITU_INT32};
        set_cube(session, are_blocks, i, &mesh);
    }
}

static void set_fields(insitu_session *session, bool are_blocks, const row_of_cubes *row, int step)
{
    for (int i = 0; i < row->count; i++) {
        insitu_field field;
        for (int n = 0; n < CORNERS; n++) row->values[i][n] = row->coordinates[i][n][0] / row->count + 0.01 * step;
        insitu_field_defaults(&field);
        field.name = "f";
        field.count = CORNERS;
        field.values = (insitu_array){.data = row->values[i], .type = INSITU_FLOAT64};
        set_values(session, are_blocks, i, &field);
    }
}

static double read_cpu_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Measures the CPU time in seconds of the first step, including its set calls, and the least CPU time of the later
 * steps, which have new values. `count` is the number of cubes of all ranks together. */
static void measure_steps(bool are_blocks, int count, double *first, double *later)
{
    row_of_cubes row;
    row_create(&row, count / rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene_text));
    *first = *later = 1e9;
    for (int step = 0; step < STEPS; step++) {
        const double start = read_cpu_seconds();
        if (step == 0) set_cubes(session, are_blocks, &row);
        set_fields(session, are_blocks, &row, step);
        everywhere(insitu_step(session, step, step) == INSITU_OK);
        const double seconds = read_cpu_seconds() - start;
        if (step == 0) *first = seconds;
        if (step > 0 && seconds < *later) *later = seconds;
    }
    everywhere(insitu_last_report(session)->cells == row.count);
    everywhere(insitu_destroy(&session) == INSITU_OK);
    row_free(&row);
}

/* Returns whether the times on all ranks grow by at most the allowed factor. */
static bool is_linear(bool are_blocks)
{
    const double most = 8 * sqrt(8);
    double few_first, few, many_first, many;
    measure_steps(are_blocks, FEW, &few_first, &few);
    measure_steps(are_blocks, MANY, &many_first, &many);
    int is_within = many < most * few && many_first < most * few_first;
    MPI_Allreduce(MPI_IN_PLACE, &is_within, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    return is_within;
}

/* Checks that times grow linearly. Eight times as many meshes take eight times as long, or a little longer if they no
 * longer fit into caches; quadratic growth would take 64 times as long. The bound is the geometric mean of 8 and 64.
 * While MPICH's ranks wait for each other they spin, so that other programs on the machine can lengthen their CPU
 * times; therefore the measurement is repeated if it fails. */
static void check_step_time_is_linear(bool are_blocks)
{
    bool is_well = false;
    for (int i = 0; i < TRIES && !is_well; i++) is_well = is_linear(are_blocks);
    everywhere(is_well);
}

static void step_time_is_linear_in_mesh_count(void **context)
{
    (void)context;
    check_step_time_is_linear(false);
}

static void step_time_is_linear_in_block_count(void **context)
{
    (void)context;
    check_step_time_is_linear(true);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(step_time_is_linear_in_mesh_count),
                                       cmocka_unit_test(step_time_is_linear_in_block_count)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
