/* Measures cells of higher order: hexes of 27 nodes, compared with the linear hexes into which a caller could split
 * them; quadratic tets, compared with vtkTessellatorFilter at equal error; and a real mesh with the default settings.
 * The field is the squared distance from the origin, except on the real mesh. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_order_vtk.h"
#include "bench_scene.h"
#include "bench_session.h"
#include "bench_stats.h"
#include "test_mesh_order.h"

enum { WIDTH = 800, HEIGHT = 600, PHASES = 2, WARM_UP = 8, FINER = 2, MOST_PIECES = 4 };

/* Distance by which the vertices of bent hexes are moved. */
static const double bend_of_hexes = 0.05;

/* The mesh, the field and the scene that one session draws. */
typedef struct bench_drawing {
    const bench_scene *scene;
    bench_subject subject;
    data_cells cells;
    double *values[PHASES]; /* [0]: the values of `cells`; [1]: values that are 1 % larger */
    char keys[32];          /* lines of the scene file that precede its images */
    const char *layer;
    bool is_real; /* set if the mesh is the real one: it has a camera of its own, and its values do not change */
} bench_drawing;

typedef struct bench_times {
    bench_series first, later;
} bench_times;

static data_cells view_as_data_cells(const order_mesh *m)
{
    return (data_cells){(int)m->mesh.cell_type, m->nodes,  m->vertex_count, m->mesh.cell_count,
                        m->coordinates,         m->values, m->connectivity};
}

static data_cells make_cells(const char *name, int side, double bend)
{
    int kind = 0;
    order_mesh m;
    while (strcmp(order_kinds[kind].name, name) != 0) kind++;
    order_mesh_create(&order_kinds[kind], side, bend, order_sphere_field, 0, 1, &m);
    return view_as_data_cells(&m);
}

/* Makes linear hexes whose vertices are FINER times as dense along each axis as the nodes of the hexes of 27 nodes.
 * There are as many of them as the library makes linear pieces with `finer_pieces: FINER`. */
static data_cells make_split_hexes(int side, double bend)
{
    const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 2 * FINER};
    order_mesh m;
    order_mesh_create(&kind, side, bend, order_sphere_field, 0, 1, &m);
    order_mesh split = order_mesh_make_linear_hexes(&m, kind.order);
    split.nodes = 8;
    free(m.connectivity);
    return view_as_data_cells(&split);
}

/* Initializes a drawing, and makes its second values. The drawing takes ownership of the arrays of `cells`. */
static void create_drawing(bench_drawing *d, const bench_scene *scene, const char *name, data_cells cells)
{
    *d = (bench_drawing){.scene = scene, .subject = scene->subject, .cells = cells, .values = {cells.values}};
    d->subject.mesh = name;
    d->subject.cells = cells.cell_count;
    d->values[1] = malloc((size_t)cells.vertex_count * sizeof(double));
    if (!d->values[1]) abort();
    for (int64_t v = 0; v < cells.vertex_count; v++) d->values[1][v] = 1.01 * cells.values[v];
}

static void free_drawing(bench_drawing *d)
{
    free(d->cells.coordinates);
    free(d->cells.connectivity);
    for (int phase = 0; phase < PHASES; phase++) free(d->values[phase]);
}

static void write_scene(const void *of, FILE *file)
{
    const bench_drawing *d = of;
    const render_camera *camera = &d->scene->job.camera;
    fprintf(file, "threads: %d\n%simages:\n  - name: picture\n    size: [%d, %d]\n", d->subject.threads, d->keys,
            camera->width, camera->height);
    if (d->is_real)
        fprintf(file, "    camera: {position: [0.048, 0.144, 0.079], focal: [0, 0, 0.05], up: [1, 0, 0]}\n");
    else
        bench_write_camera(file);
    fprintf(file, "    layers: [%s]\n    outputs: [{path: picture.png}]\n", d->layer);
}

static void set_mesh(insitu_session *session, const bench_drawing *d)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    insitu_mesh_interleaved(&mesh, d->cells.coordinates, INSITU_FLOAT64);
    mesh.vertex_count = d->cells.vertex_count;
    mesh.cell_count = d->cells.cell_count;
    mesh.cell_type = (insitu_cell_type)d->cells.type;
    mesh.connectivity = (insitu_array){.data = d->cells.connectivity, .type = INSITU_INT64};
    mesh.connectivity_count = d->cells.cell_count * d->cells.nodes;
    bench_require_success(d->scene, session, insitu_set_mesh(session, "cells", &mesh));
}

static void set_values(insitu_session *session, const bench_drawing *d, int phase)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.values = (insitu_array){.data = d->values[phase], .type = INSITU_FLOAT64};
    field.count = d->cells.vertex_count;
    field.changed = INSITU_CHANGED_VALUES;
    bench_require_success(d->scene, session, insitu_set_field(session, "cells", &field));
}

/* Replaces *session by a new session, and measures its first step. */
static void take_first_step(const bench_drawing *d, int number, insitu_session **session, bench_times *times)
{
    insitu_destroy(session);
    *session = bench_open_session(d->scene, write_scene, d);
    const double began = bench_start_timer();
    set_mesh(*session, d);
    set_values(*session, d, 0);
    bench_require_success(d->scene, *session, insitu_step(*session, 0, 0));
    bench_stop_timer(began, number, &times->first);
}

static void take_later_step(const bench_drawing *d, int number, insitu_session *session, bench_times *times)
{
    if (!d->is_real) set_values(session, d, number & 1);
    const double began = bench_start_timer();
    bench_require_success(d->scene, session, insitu_step(session, number, 0));
    bench_stop_timer(began, number, &times->later);
}

/* Measures drawings in turns. The caller destroys the sessions. */
static void measure_drawings(const bench_drawing *drawings, int count, int runs, insitu_session **sessions,
                             bench_times *times)
{
    for (int number = 0; number <= runs; number++)
        for (int i = 0; i < count; i++) take_first_step(&drawings[i], number, &sessions[i], &times[i]);
    for (int number = -WARM_UP; number <= runs; number++)
        for (int i = 0; i < count; i++) take_later_step(&drawings[i], number, sessions[i], &times[i]);
}

static void print_series(const bench_drawing *d, const char *name, const char *what, bench_series *series)
{
    char measure[64];
    snprintf(measure, sizeof measure, "%s %s", name, what);
    bench_print_series(&d->subject, measure, series);
}

static void print_number(const bench_drawing *d, const char *name, const char *what, const char *unit, double number)
{
    char measure[64];
    snprintf(measure, sizeof measure, "%s %s", name, what);
    bench_print_number(&d->subject, measure, unit, number);
}

/* Prints the number of all linear pieces. Only the text copied_why of the report contains this number. */
static void print_pieces_made(const bench_drawing *d, const char *name, const insitu_report *report)
{
    const char *at = strstr(report->copied_why, " linear pieces of its cells");
    while (at && at > report->copied_why && strchr("0123456789", at[-1])) at--;
    print_number(d, name, "made", "pieces", at ? strtod(at, NULL) : 0);
}

static void measure_hexes(const bench_scene *scene, int runs, const char *name, double bend)
{
    static const struct {
        const char *name, *layer;
    } layers[] = {{"isosurface", "isosurface: {field: f, values: [0.5], normals: vertex}"},
                  {"surface", "surface: {colour_by: {field: f}}"},
                  {"volume", "volume: {field: f}"}};
    const int side = scene->subject.n;
    bench_drawing drawings[2];
    create_drawing(&drawings[0], scene, name, make_cells("hex 27", side, bend));
    create_drawing(&drawings[1], scene, name, make_split_hexes(side, bend));
    drawings[1].subject.cells = drawings[0].subject.cells;
    snprintf(drawings[0].keys, sizeof drawings[0].keys, "finer_pieces: %d\n", FINER);
    for (size_t i = 0; i < sizeof layers / sizeof *layers; i++) {
        insitu_session *sessions[2] = {NULL, NULL};
        bench_times times[2] = {0};
        for (int form = 0; form < 2; form++) drawings[form].layer = layers[i].layer;
        measure_drawings(drawings, 2, runs, sessions, times);
        print_series(&drawings[0], layers[i].name, "first step", &times[0].first);
        print_series(&drawings[0], layers[i].name, "new values", &times[0].later);
        print_series(&drawings[1], layers[i].name, "split first step", &times[1].first);
        print_series(&drawings[1], layers[i].name, "split new values", &times[1].later);
        print_pieces_made(&drawings[0], layers[i].name, insitu_last_report(sessions[0]));
        for (int form = 0; form < 2; form++) insitu_destroy(&sessions[form]);
    }
    for (int form = 0; form < 2; form++) free_drawing(&drawings[form]);
}

/* Returns the largest error of linear interpolation in the middle of an edge of a linear piece. It is a quarter of the
 * edge's squared length, because the field is the squared distance from the origin. In half of the tets, the longest
 * edge is a diagonal of an octahedron, from (0, 0, 0) to (1, 2, 1) in a lattice with spacing h. */
static double compute_error_of_pieces(int side, int pieces)
{
    const double h = 1.0 / (side * pieces);
    return 6 * h * h / 4;
}

static void measure_pieces(bench_drawing *d, int pieces, int runs)
{
    const double error = compute_error_of_pieces(d->subject.n, pieces), rounding = 1.0001;
    char name[32];
    bench_times times = {0};
    bench_series update = {0};
    insitu_session *session = NULL;
    bench_tessellator *vtk = bench_tessellator_create(&d->cells, rounding * error);
    snprintf(d->keys, sizeof d->keys, "finer_pieces: %d\n", pieces);
    snprintf(name, sizeof name, "%d pieces", pieces);
    for (int number = 0; number <= runs; number++) {
        take_first_step(d, number, &session, &times);
        const double began = bench_start_timer();
        if (vtk) bench_tessellator_update(vtk);
        if (vtk) bench_stop_timer(began, number, &update);
    }
    print_series(d, name, "step", &times.first);
    print_number(d, name, "error", "field", error);
    print_pieces_made(d, name, insitu_last_report(session));
    if (vtk) print_series(d, name, "vtk", &update);
    if (vtk) print_number(d, name, "vtk error", "field", bench_tessellator_longest_squared(vtk) / 4);
    if (vtk) print_number(d, name, "vtk made", "cells", (double)bench_tessellator_cell_count(vtk));
    insitu_destroy(&session);
    bench_tessellator_destroy(vtk);
}

static void measure_tets(const bench_scene *scene, int runs)
{
    bench_drawing d;
    create_drawing(&d, scene, "tets of 10 nodes", make_cells("tet 10", scene->subject.n, 0));
    d.layer = "isosurface: {field: f, values: [0.5]}";
    for (int pieces = 1; pieces <= MOST_PIECES; pieces++) measure_pieces(&d, pieces, runs);
    free_drawing(&d);
}

static void measure_real(const bench_scene *scene, int runs)
{
    static const struct {
        const char *name, *keys, *layer;
    } pictures[] = {{"isosurface", "", "isosurface: {field: f, values: [0.5]}"},
                    {"isosurface of one piece", "finer_pieces: 1\n", "isosurface: {field: f, values: [0.5]}"},
                    {"volume", "", "volume: {field: f}"},
                    {"volume of one piece", "finer_pieces: 1\n", "volume: {field: f}"}};
    const char *folder = getenv("INSITU_TEST_DATA");
    char path[1024];
    data_cells cells;
    bench_drawing d;
    snprintf(path, sizeof path, "%s/cylinder_quadratic.vtu", folder ? folder : "");
    if (!folder || !data_cells_read_file(path, "velocity_norm", &cells)) {
        fprintf(stderr, "bench_order: without VTK or INSITU_TEST_DATA no real mesh is measured\n");
        return;
    }
    create_drawing(&d, scene, "cylinder_quadratic", cells);
    d.is_real = true;
    for (size_t i = 0; i < sizeof pictures / sizeof *pictures; i++) {
        insitu_session *session = NULL;
        bench_times times = {0};
        int pieces = 1;
        snprintf(d.keys, sizeof d.keys, "%s", pictures[i].keys);
        d.layer = pictures[i].layer;
        measure_drawings(&d, 1, runs, &session, &times);
        const insitu_report *report = insitu_last_report(session);
        sscanf(report->pieces, "mesh \"cells\": %d piece", &pieces);
        print_series(&d, pictures[i].name, "first step", &times.first);
        print_series(&d, pictures[i].name, "frame", &times.later);
        print_number(&d, pictures[i].name, "chosen", "pieces", pieces);
        print_number(&d, pictures[i].name, "copied", "bytes/node",
                     (double)report->bytes_copied / (double)cells.vertex_count);
        print_number(&d, pictures[i].name, "trees", "bytes/node",
                     (double)report->bytes_trees / (double)cells.vertex_count);
        insitu_destroy(&session);
    }
    free_drawing(&d);
}

static void measure(const bench_command *command, test_mesh_kind kind, int n)
{
    bench_scene scene; /* only its camera is used */
    bench_scene_create(&scene, "bench_order", kind, 1);
    bench_scene_resize(&scene, WIDTH / command->shrink, HEIGHT / command->shrink);
    scene.subject.n = n;
    if (kind == TEST_TETS) {
        measure_tets(&scene, command->runs);
        measure_real(&scene, command->runs);
    } else {
        measure_hexes(&scene, command->runs, "hexes of 27 nodes", 0);
        measure_hexes(&scene, command->runs, "bent hexes of 27 nodes", bend_of_hexes);
    }
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    bench_use_processor_time();
    const int status = bench_measure_meshes(
        argc, argv,
        "Measures cells of higher order in CPU time. hexes: cubes of 27 nodes, straight and bent, beside\n"
        "the linear hexes that a caller could split them into. tets: quadratic tets beside VTK's\n"
        "tessellator at equal error, and cylinder_quadratic.vtu of the folder INSITU_TEST_DATA.",
        TEST_HEXES, measure);
    MPI_Finalize();
    return status;
}
