/* Measures uniform grids given as one lattice, as hexes, or as blocks of BLOCK^3 cells: the time of the first step and
 * of steps with new values, and the bytes per cell. The forms are measured in turns in one process. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_scene.h"
#include "bench_session.h"
#include "bench_stats.h"

enum { BLOCK = 16, CORNERS = 8, PHASES = 2, FULL_TREE = 12 };

typedef enum bench_form { AS_LATTICE, AS_HEXES, AS_BLOCKS, FORM_COUNT } bench_form;

static const char *const form_names[FORM_COUNT] = {"lattice", "hexes", "blocks"};

/* The grid in one form, with two states of its values. Each form is created when it is measured, and freed
 * afterwards. */
typedef struct bench_grid {
    const bench_scene *scene;
    bench_form form;
    int cells; /* number of cells of a block along each axis */
    int64_t block_count, block_vertices, block_cells;
    float *values[PHASES]; /* blocks × vertices of a block */
    float *coordinates[3]; /* coordinates of hexes */
    int32_t *connectivity;
} bench_grid;

static void *allocate_array(int64_t count, size_t size)
{
    void *p = malloc((size_t)count * size);
    if (!p) abort();
    return p;
}

static void compute_block_position(const bench_grid *g, int64_t block, int64_t first[3])
{
    const int64_t along = g->scene->subject.n / g->cells;
    first[0] = block % along * g->cells;
    first[1] = block / along % along * g->cells;
    first[2] = block / along / along * g->cells;
}

static double compute_coordinate(const bench_grid *g, int64_t index)
{
    const double spacing = 2.0 / g->scene->subject.n;
    return -1 + spacing * (double)index;
}

static void fill_block(const bench_grid *g, int64_t block)
{
    const int64_t side = g->cells + 1;
    int64_t first[3];
    compute_block_position(g, block, first);
    for (int64_t v = 0; v < g->block_vertices; v++) {
        const int64_t at[3] = {v % side, v / side % side, v / side / side};
        double p[3];
        for (int axis = 0; axis < 3; axis++) {
            p[axis] = compute_coordinate(g, first[axis] + at[axis]);
            if (g->coordinates[axis]) g->coordinates[axis][v] = (float)p[axis];
        }
        for (int phase = 0; phase < PHASES; phase++) {
            const double moved[3] = {p[0] + 0.01 * phase, p[1] + 0.02 * phase, p[2] + 0.03 * phase};
            g->values[phase][block * g->block_vertices + v] = (float)test_wave_field(moved);
        }
    }
}

static void fill_connectivity(bench_grid *g)
{
    static const int corners[CORNERS][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                            {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    const int64_t n = g->cells, side = n + 1;
#pragma omp parallel for schedule(static)
    for (int64_t c = 0; c < g->block_cells; c++)
        for (int i = 0; i < CORNERS; i++)
            g->connectivity[CORNERS * c + i] = (int32_t)(c % n + corners[i][0] + side * (c / n % n + corners[i][1]) +
                                                         side * side * (c / n / n + corners[i][2]));
}

static void create_grid(bench_grid *g, const bench_scene *scene, bench_form form)
{
    const int n = scene->subject.n;
    *g = (bench_grid){.scene = scene, .form = form, .cells = form == AS_BLOCKS && n > BLOCK ? BLOCK : n};
    const int64_t cells = g->cells, along = n / cells;
    g->block_count = along * along * along;
    g->block_vertices = (cells + 1) * (cells + 1) * (cells + 1);
    g->block_cells = cells * cells * cells;
    for (int i = 0; i < PHASES; i++) g->values[i] = allocate_array(g->block_count * g->block_vertices, sizeof(float));
    for (int axis = 0; axis < 3 && form == AS_HEXES; axis++)
        g->coordinates[axis] = allocate_array(g->block_vertices, sizeof(float));
    if (form == AS_HEXES) g->connectivity = allocate_array(CORNERS * g->block_cells, sizeof(int32_t));
    if (form == AS_HEXES) fill_connectivity(g);
#pragma omp parallel for schedule(static)
    for (int64_t block = 0; block < g->block_count; block++) fill_block(g, block);
}

static void free_grid(bench_grid *g)
{
    for (int i = 0; i < PHASES; i++) free(g->values[i]);
    for (int axis = 0; axis < 3; axis++) free(g->coordinates[axis]);
    free(g->connectivity);
}

static void write_scene(const void *of, FILE *file)
{
    const bench_scene *scene = of;
    fprintf(file, "threads: %d\nimages:\n  - name: picture\n    size: [%d, %d]\n", scene->subject.threads,
            scene->job.camera.width, scene->job.camera.height);
    bench_write_camera(file);
    fprintf(file, "    layers: [isosurface: {field: f, values: [%g]}]\n    outputs: [{path: picture.png}]\n",
            bench_isovalues[0]);
}

static void set_mesh(insitu_session *session, const bench_grid *g)
{
    const double spacing = 2.0 / g->scene->subject.n;
    for (int64_t block = 0; block < g->block_count; block++) {
        insitu_lattice lattice = {
            .cells = {g->cells, g->cells, g->cells}, .origin = {-1, -1, -1}, .spacing = {spacing, spacing, spacing}};
        insitu_mesh mesh;
        compute_block_position(g, block, lattice.first);
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = g->block_vertices;
        mesh.cell_count = g->block_cells;
        if (g->form == AS_HEXES) {
            mesh.cell_type = INSITU_HEX;
            mesh.connectivity_count = CORNERS * g->block_cells;
            mesh.connectivity = (insitu_array){.data = g->connectivity, .type = INSITU_INT32};
            for (int axis = 0; axis < 3; axis++)
                mesh.coordinates[axis] = (insitu_array){.data = g->coordinates[axis], .type = INSITU_FLOAT32};
        } else {
            mesh.lattice = &lattice;
        }
        bench_require_success(g->scene, session,
                              g->form == AS_BLOCKS ? insitu_set_block(session, "cube", block, &mesh)
                                                   : insitu_set_mesh(session, "cube", &mesh));
    }
}

static void set_values(insitu_session *session, const bench_grid *g, int phase)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.count = g->block_vertices;
    field.changed = INSITU_CHANGED_VALUES;
    for (int64_t block = 0; block < g->block_count; block++) {
        field.values = (insitu_array){.data = g->values[phase] + block * g->block_vertices, .type = INSITU_FLOAT32};
        bench_require_success(g->scene, session,
                              g->form == AS_BLOCKS ? insitu_set_block_field(session, "cube", block, &field)
                                                   : insitu_set_field(session, "cube", &field));
    }
}

static void measure_first_step(const bench_grid *g, int number, bench_series *series)
{
    insitu_session *session = bench_open_session(g->scene, write_scene, g->scene);
    const double began = bench_start_timer();
    set_mesh(session, g);
    set_values(session, g, 0);
    bench_require_success(g->scene, session, insitu_step(session, 0, 0));
    bench_stop_timer(began, number, series);
    insitu_destroy(&session);
}

typedef struct bench_times {
    bench_series first, whole, trace;
} bench_times;

static void measure_new_values(insitu_session *session, const bench_grid *g, int number, bench_times *times)
{
    set_values(session, g, number % PHASES);
    const double began = bench_start_timer();
    bench_require_success(g->scene, session, insitu_step(session, 0, 0));
    bench_stop_timer(began, number, &times->whole);
    bench_add_sample(1e-3 * insitu_last_report(session)->surface_ms, number, &times->trace);
}

static void print_times(const bench_grid *g, const insitu_report *report, bench_times *times)
{
    const bench_subject *subject = &g->scene->subject;
    const char *name = form_names[g->form];
    const double cells = (double)subject->cells;
    char measure[64];
    snprintf(measure, sizeof measure, "%s first step", name);
    bench_print_series(subject, measure, &times->first);
    snprintf(measure, sizeof measure, "%s new values", name);
    bench_print_series(subject, measure, &times->whole);
    snprintf(measure, sizeof measure, "%s new values trace", name);
    bench_print_series(subject, measure, &times->trace);
    snprintf(measure, sizeof measure, "%s peak", name);
    bench_print_number(subject, measure, "bytes/cell", (double)report->bytes_peak / cells);
    snprintf(measure, sizeof measure, "%s copied", name);
    bench_print_number(subject, measure, "bytes/cell", (double)report->bytes_copied / cells);
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    bench_scene scene; /* only its camera is used */
    (void)kind;
    bench_scene_create(&scene, "bench_blocks", TEST_HEXES, 1);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    scene.subject.n = n;
    scene.subject.cells = (int64_t)n * n * n;
    bench_grid grids[FORM_COUNT];
    bench_times times[FORM_COUNT] = {0};
    insitu_session *sessions[FORM_COUNT];
    for (bench_form form = 0; form < FORM_COUNT; form++) create_grid(&grids[form], &scene, form);
    for (int number = 0; number <= command->runs; number++)
        for (bench_form form = 0; form < FORM_COUNT; form++)
            measure_first_step(&grids[form], number, &times[form].first);
    for (bench_form form = 0; form < FORM_COUNT; form++) {
        sessions[form] = bench_open_session(&scene, write_scene, &scene);
        set_mesh(sessions[form], &grids[form]);
        for (int i = 0; i < FULL_TREE; i++) measure_new_values(sessions[form], &grids[form], 0, &times[form]);
    }
    for (int number = 1; number <= command->runs; number++)
        for (bench_form form = 0; form < FORM_COUNT; form++)
            measure_new_values(sessions[form], &grids[form], number, &times[form]);
    for (bench_form form = 0; form < FORM_COUNT; form++) {
        print_times(&grids[form], insitu_last_report(sessions[form]), &times[form]);
        insitu_destroy(&sessions[form]);
        free_grid(&grids[form]);
    }
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const int status = bench_measure_meshes(
        argc, argv,
        "Measures uniform grids of N^3 cells, MESH being hexes, as one lattice, as hexes and as blocks of\n"
        "16^3 cells: the first step, steps with new values, and bytes per cell.",
        TEST_HEXES, measure_mesh);
    MPI_Finalize();
    return status;
}
