/* Measures tracing and tree building in turns with VTK and Embree, in one process, on the same mesh, camera and image.
 * Embree traces the triangles that VTK extracts, and builds trees over the boxes of libinsitu's cells. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>

#include "bench_command.h"
#include "bench_routes.h"

/* The tree builders. Only the tree of the first one is traced. */
static const struct {
    const char *name;
    mmbvh_options how;
} builders[] = {{"sah", {0}}, {"morton", {.builder = MMBVH_MORTON}}};

enum { BUILDERS = sizeof builders / sizeof *builders };

typedef struct peers_series {
    bench_series build[BUILDERS], trace, embree[3];
    double cost[BUILDERS];
} peers_series;

static const char *const builder_names[3] = {"low", "medium", "medium wide"};

static void measure_peers(bench_scene *scene, bench_routes *routes, peers_series *series, int number)
{
    for (int i = BUILDERS - 1; i >= 0; i--) {
        scene->how = builders[i].how;
        const double build_began = bench_start_timer();
        bench_scene_build(scene);
        bench_stop_timer(build_began, number, &series->build[i]);
        series->cost[i] = mmbvh_cost(&scene->tree, NULL);
    }
    const double began = bench_start_timer();
    bench_scene_frame(scene);
    bench_stop_timer(began, number, &series->trace);
    bench_routes_run(routes, bench_isovalues, 1, number);
    for (int i = 0; routes->embree && i < 3; i++) {
        bench_start_timer();
        bench_add_sample(bench_embree_build_cells(routes->embree, (bench_embree_builder)i), number, &series->embree[i]);
    }
}

/* Builds a tree by each of Embree's binary builders and prints its cost. */
static void print_costs(bench_scene *scene, bench_routes *routes)
{
    for (int i = 0; routes->embree && i <= BENCH_EMBREE_MEDIUM; i++) {
        char measure[64];
        snprintf(measure, sizeof measure, "embree cells %s cost", builder_names[i]);
        bench_embree_build_cells(routes->embree, (bench_embree_builder)i);
        bench_print_number(&scene->subject, measure, "tests/ray", bench_embree_compute_cost(routes->embree));
    }
}

static void print_series(bench_scene *scene, bench_routes *routes, peers_series *series)
{
    bench_print_number(&scene->subject, "rays", "Mrays", 1e-6 * scene->job.camera.width * scene->job.camera.height);
    for (int i = 0; i < BUILDERS; i++) {
        char measure[64];
        snprintf(measure, sizeof measure, "build %s", builders[i].name);
        bench_print_series(&scene->subject, measure, &series->build[i]);
        snprintf(measure, sizeof measure, "build %s cost", builders[i].name);
        bench_print_number(&scene->subject, measure, "tests/ray", series->cost[i]);
    }
    bench_print_series(&scene->subject, "isosurface trace", &series->trace);
    bench_routes_print(routes, "isosurface");
    for (int i = 0; routes->embree && i < 3; i++) {
        char measure[64];
        snprintf(measure, sizeof measure, "embree cells %s", builder_names[i]);
        bench_print_series(&scene->subject, measure, &series->embree[i]);
    }
    print_costs(scene, routes);
}

static float *draw_frame_depths(const bench_scene *scene)
{
    const int64_t count = (int64_t)scene->job.camera.width * scene->job.camera.height;
    float *depths = malloc((size_t)count * sizeof *depths);
    if (!depths) abort();
    for (int64_t i = 0; i < count; i++) depths[i] = INFINITY;
    for (int64_t i = 0; i < scene->fragments.count; i++) {
        const fragment *f = &scene->fragments.items[i];
        const double depth = (double)f->t_in / scene->job.space.scale + scene->job.space.depth_origin;
        depths[f->pixel] = fminf(depths[f->pixel], (float)depth);
    }
    return depths;
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    bench_scene scene;
    bench_routes routes;
    peers_series series = {0};
    bench_scene_create(&scene, "bench_peers", kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    bench_scene_show_surfaces(&scene, 1);
    bench_routes_create(&routes, &scene);
    if (routes.embree) bench_embree_set_cells(routes.embree, &scene.view.cells);
    for (int i = 0; i <= command->runs; i++) measure_peers(&scene, &routes, &series, i);
    print_series(&scene, &routes, &series);
    float *depths = draw_frame_depths(&scene);
    bench_routes_compare(&routes, depths, "isosurface", command->depths);
    bench_scene_print_surface_error(&scene, "isosurface");
    free(depths);
    bench_routes_free(&routes);
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    return bench_measure_meshes(argc, argv,
                                "Measures building and tracing of each MESH (tets or hexes) of N^3 cubes beside VTK's\n"
                                "extraction and Mesa, and beside Embree.",
                                TEST_HEXES, measure_mesh);
}
