/* Measures the time to a picture: whole steps in turns with the alternatives that a user has, in one process. The
 * alternatives always begin with the mesh, even if only the values or the vertices are new. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_routes.h"
#include "bench_session.h"

static void measure_picture(const bench_scene *scene, bench_routes *routes, bench_picture picture, int runs)
{
    bench_session sessions[BENCH_CHANGE_COUNT];
    const int count = picture == BENCH_ISOSURFACES ? BENCH_ISOVALUES : 1;
    const char *name = bench_picture_name(picture);
    const bench_session *last = &sessions[BENCH_NEW_MESH]; /* the session in which everything changes */
    for (bench_change change = 0; change < BENCH_CHANGE_COUNT; change++)
        bench_session_create(&sessions[change], scene, picture, change);
    for (int number = 0; number <= runs; number++) {
        for (bench_change change = 0; change < BENCH_CHANGE_COUNT; change++)
            bench_session_step(&sessions[change], number);
        bench_routes_set(routes, bench_session_coordinates(last), scene->view.cells.vertex_count,
                         bench_session_values(last));
        bench_routes_run(routes, bench_isovalues, count, number);
    }
    for (bench_change change = 0; change < BENCH_CHANGE_COUNT; change++) bench_session_print(&sessions[change]);
    bench_routes_print(routes, name);
    float *depths = bench_session_draw_depths(last);
    bench_routes_compare(routes, depths, name, NULL);
    free(depths);
    for (bench_change change = 0; change < BENCH_CHANGE_COUNT; change++) bench_session_free(&sessions[change]);
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    bench_scene scene;
    bench_routes routes;
    bench_scene_create(&scene, "bench_steps", kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    bench_routes_create(&routes, &scene);
    measure_picture(&scene, &routes, BENCH_ISOSURFACE, command->runs);
    measure_picture(&scene, &routes, BENCH_ISOSURFACES, command->runs);
    bench_routes_free(&routes);
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const int status =
        bench_measure_meshes(argc, argv,
                             "Measures whole steps for each MESH (tets or hexes) of N^3 cubes, with new values, moved\n"
                             "vertices and a new mesh, beside VTK's extraction and Mesa, and beside Embree.",
                             TEST_HEXES, measure_mesh);
    MPI_Finalize();
    return status;
}
