/* Measures what slices, outer surfaces, clips, edges and antialiasing cost: whole steps with new values, and VTK's way
 * to the same picture from the same values, in turns in one process. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_layers_vtk.h"
#include "bench_session.h"

static const bench_picture pictures[] = {BENCH_SLICE,       BENCH_SURFACE,    BENCH_CLIPPED, BENCH_EDGES,
                                         BENCH_ANTIALIASED, BENCH_ISOSURFACE, BENCH_SMOOTH,  BENCH_DIFFERENCES};
enum { PICTURES = sizeof pictures / sizeof *pictures };

static const float *floats(const grid_array *a)
{
    return (const float *)(const void *)a->data;
}

static bench_layers_vtk *create_vtk(const bench_scene *scene, float *xyz)
{
    const grid *g = &scene->view.cells;
    const render_camera *camera = &scene->job.camera;
    for (int64_t v = 0; v < g->vertex_count; v++)
        for (int axis = 0; axis < 3; axis++) xyz[3 * v + axis] = floats(&g->coordinates[axis])[v];
    const bench_contour_mesh mesh = {.vertex_count = g->vertex_count,
                                     .cell_count = g->cell_count,
                                     .cell_type = g->cell_type,
                                     .xyz = xyz,
                                     .values = floats(&scene->view.field.values),
                                     .connectivity = (const int32_t *)(const void *)g->connectivity.data};
    bench_contour_view view = {.degrees = bench_degrees, .width = camera->width, .height = camera->height};
    for (int axis = 0; axis < 3; axis++) {
        view.eye[axis] = bench_eye[axis];
        view.focal[axis] = bench_focal[axis];
        view.up[axis] = bench_up[axis];
    }
    return bench_layers_vtk_create(&mesh, &view, bench_plane, scene->subject.threads);
}

/* Only the first three pictures have a peer. */
static void measure_pictures(const bench_scene *scene, bench_layers_vtk *vtk, int runs)
{
    bench_session sessions[PICTURES];
    bench_series peers[BENCH_LAYER_COUNT] = {0};
    for (int i = 0; i < PICTURES; i++) bench_session_create(&sessions[i], scene, pictures[i], BENCH_NEW_VALUES);
    for (int number = 0; number <= runs; number++)
        for (int i = 0; i < PICTURES; i++) {
            bench_session_step(&sessions[i], number);
            if (!vtk || i >= BENCH_LAYER_COUNT) continue;
            bench_layers_vtk_set(vtk, bench_session_values(&sessions[i]));
            const double began = bench_begin();
            bench_layers_vtk_draw(vtk, (bench_layer)i);
            bench_end(began, number, &peers[i]);
        }
    for (int i = 0; i < PICTURES; i++) {
        char measure[96];
        snprintf(measure, sizeof measure, "%s vtk", bench_picture_name(pictures[i]));
        bench_session_print(&sessions[i]);
        if (vtk && i < BENCH_LAYER_COUNT) bench_print_series(&scene->subject, measure, &peers[i]);
        bench_session_free(&sessions[i]);
    }
}

static void measure(const bench_command *command, test_mesh_kind kind, int n)
{
    bench_scene scene;
    bench_scene_create(&scene, "bench_layers", kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    float *xyz = malloc(3 * (size_t)scene.view.cells.vertex_count * sizeof *xyz);
    if (!xyz) abort();
    bench_layers_vtk *vtk = bench_layers_vtk_is_available() ? create_vtk(&scene, xyz) : NULL;
    if (!vtk) fprintf(stderr, "bench_layers: no VTK, or no X server: ours alone\n");
    measure_pictures(&scene, vtk, command->runs);
    bench_layers_vtk_destroy(vtk);
    free(xyz);
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const int status = bench_measure_meshes(
        argc, argv,
        "Measures steps of new values for each MESH (tets or hexes) of N^3 cubes: a slice, the outer\n"
        "surface, the same clipped, with edges and with 4 samples a pixel, the first three beside VTK's\n"
        "filters and Mesa; and an isosurface by each kind of normals.",
        TEST_HEXES, measure);
    MPI_Finalize();
    return status;
}
