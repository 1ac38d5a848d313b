/* Measures the cost of slices, outer surfaces, clips, edges and antialiasing, or (with "flow") of derived fields,
 * contour lines, warps, mirrors, planes and montages. Whole steps with new values are measured. VTK's pipelines make
 * the same pictures from the same values; they are measured in turns with libinsitu, in one process. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_layers_vtk.h"
#include "bench_session.h"

/* A picture and VTK's equivalent layer, or BENCH_LAYER_NONE if it has no peer. */
typedef struct bench_pair {
    bench_picture picture;
    bench_layer layer;
} bench_pair;

enum { MOST_PICTURES = 12 };

typedef struct bench_group {
    const char *program;
    bool is_by_part; /* also print the wall-clock time of each part of a step, as it is in the report */
    int count;
    bench_pair pairs[MOST_PICTURES];
} bench_group;

static const bench_group layers = {"bench_layers",
                                   true,
                                   8,
                                   {{BENCH_SLICE, BENCH_LAYER_SLICE},
                                    {BENCH_SURFACE, BENCH_LAYER_SURFACE},
                                    {BENCH_CLIPPED, BENCH_LAYER_CLIPPED},
                                    {BENCH_EDGES, BENCH_LAYER_NONE},
                                    {BENCH_ANTIALIASED, BENCH_LAYER_NONE},
                                    {BENCH_ISOSURFACE, BENCH_LAYER_NONE},
                                    {BENCH_SMOOTH, BENCH_LAYER_NONE},
                                    {BENCH_DIFFERENCES, BENCH_LAYER_NONE}}};

/* This group measures the slice, the surface and the isosurface too, in turns with their versions with contour
 * lines. */
static const bench_group flow = {"bench_layers flow",
                                 false,
                                 12,
                                 {{BENCH_SLICE, BENCH_LAYER_SLICE},
                                  {BENCH_LINED_SLICE, BENCH_LAYER_LINED_SLICE},
                                  {BENCH_SURFACE, BENCH_LAYER_SURFACE},
                                  {BENCH_LINED_SURFACE, BENCH_LAYER_LINED_SURFACE},
                                  {BENCH_ISOSURFACE, BENCH_LAYER_NONE},
                                  {BENCH_LINED_ISOSURFACE, BENCH_LAYER_NONE},
                                  {BENCH_Q_CRITERION, BENCH_LAYER_Q_CRITERION},
                                  {BENCH_VORTICES, BENCH_LAYER_VORTICES},
                                  {BENCH_WARPED, BENCH_LAYER_WARPED},
                                  {BENCH_MIRRORED, BENCH_LAYER_MIRRORED},
                                  {BENCH_PLANES, BENCH_LAYER_PLANES},
                                  {BENCH_MONTAGE, BENCH_LAYER_MONTAGE}}};

static const float *get_float_data(const grid_array *a)
{
    return (const float *)(const void *)a->data;
}

static bench_layers_vtk *create_vtk(const bench_scene *scene, float *xyz)
{
    const grid *g = &scene->view.cells;
    const render_camera *camera = &scene->job.camera;
    for (int64_t v = 0; v < g->vertex_count; v++)
        for (int axis = 0; axis < 3; axis++) xyz[3 * v + axis] = get_float_data(&g->coordinates[axis])[v];
    const bench_contour_mesh mesh = {.vertex_count = g->vertex_count,
                                     .cell_count = g->cell_count,
                                     .cell_type = g->cell_type,
                                     .xyz = xyz,
                                     .values = get_float_data(&scene->view.field.values),
                                     .connectivity = (const int32_t *)(const void *)g->connectivity.data};
    bench_contour_view view = {.degrees = bench_degrees, .width = camera->width, .height = camera->height};
    for (int axis = 0; axis < 3; axis++) {
        view.eye[axis] = bench_eye[axis];
        view.focal[axis] = bench_focal[axis];
        view.up[axis] = bench_up[axis];
    }
    bench_layers_parameters parameters = {.isovalue = bench_isovalues[0],
                                          .vortex = bench_vortex,
                                          .warp = bench_warp,
                                          .mirror = bench_mirror,
                                          .line_count = BENCH_LINE_COUNT,
                                          .plane_count = BENCH_PLANE_COUNT};
    memcpy(parameters.plane, bench_plane, sizeof parameters.plane);
    memcpy(parameters.range, bench_range, sizeof parameters.range);
    return bench_layers_vtk_create(&mesh, &view, &parameters, scene->subject.threads);
}

static void print_pair(bench_session *session, bool is_by_part, bench_series *peer)
{
    const bench_subject *subject = &session->scene->subject;
    const char *name = bench_picture_name(session->picture);
    char measure[96];
    snprintf(measure, sizeof measure, "%s new values", name);
    if (is_by_part)
        bench_session_print(session);
    else
        bench_print_series(subject, measure, &session->whole);
    snprintf(measure, sizeof measure, "%s vtk", name);
    if (peer->count) bench_print_series(subject, measure, peer);
}

static void measure_pictures(const bench_scene *scene, const bench_group *group, bench_layers_vtk *vtk, int runs)
{
    bench_session sessions[MOST_PICTURES];
    bench_series peers[MOST_PICTURES] = {0};
    const bench_pair *pairs = group->pairs;
    for (int i = 0; i < group->count; i++)
        bench_session_create(&sessions[i], scene, pairs[i].picture, BENCH_NEW_VALUES);
    for (int number = 0; number <= runs; number++)
        for (int i = 0; i < group->count; i++) {
            bench_session_step(&sessions[i], number);
            if (!vtk || pairs[i].layer == BENCH_LAYER_NONE) continue;
            bench_layers_vtk_set(vtk, bench_session_values(&sessions[i]), bench_session_velocities(&sessions[i]));
            const double began = bench_start_timer();
            bench_layers_vtk_draw(vtk, pairs[i].layer);
            bench_stop_timer(began, number, &peers[i]);
        }
    for (int i = 0; i < group->count; i++) {
        print_pair(&sessions[i], group->is_by_part, &peers[i]);
        bench_session_free(&sessions[i]);
    }
}

static void measure_group(const bench_command *command, const bench_group *group, test_mesh_kind kind, int n)
{
    bench_scene scene;
    bench_scene_create(&scene, group->program, kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    float *xyz = malloc(3 * (size_t)scene.view.cells.vertex_count * sizeof *xyz);
    if (!xyz) abort();
    bench_layers_vtk *vtk = bench_layers_vtk_is_available() ? create_vtk(&scene, xyz) : NULL;
    if (!vtk) fprintf(stderr, "bench_layers: no VTK, or no X server: ours alone\n");
    measure_pictures(&scene, group, vtk, command->runs);
    bench_layers_vtk_destroy(vtk);
    free(xyz);
    bench_scene_free(&scene);
}

static void measure_layers(const bench_command *command, test_mesh_kind kind, int n)
{
    measure_group(command, &layers, kind, n);
}

static void measure_flow(const bench_command *command, test_mesh_kind kind, int n)
{
    measure_group(command, &flow, kind, n);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const bool is_flow = argc > 1 && strcmp(argv[1], "flow") == 0;
    if (is_flow) bench_use_processor_time();
    const int status = bench_measure_meshes(
        argc - is_flow, argv + is_flow,
        "Measures steps of new values for each MESH (tets or hexes) of N^3 cubes: a slice, the outer\n"
        "surface, the same clipped, with edges and with 4 samples a pixel, the first three beside VTK's\n"
        "filters and Mesa; and an isosurface by each kind of normals. With the word \"flow\" before the\n"
        "options: pictures with and without contour lines, the Q criterion alone and its isosurface, a\n"
        "warp, a mirror, 16 planes and a montage, beside VTK's filters and Mesa, in time of the processor.",
        TEST_HEXES, is_flow ? measure_flow : measure_layers);
    MPI_Finalize();
    return status;
}
