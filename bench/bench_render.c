/* Measures speed and error of building, refitting and rendering on a mesh of any size. A speed is the median of several
 * runs, with their minimum and maximum. The error is measured against double precision in some of the pixels. Prints
 * CSV. */
#include <stdio.h>
#include <stdlib.h>

#include "bench_command.h"
#include "bench_scene.h"
#include "memory.h"

/* Measures the speed of act() in units per second over all runs. A warm-up run precedes these runs and is not
 * counted. */
static bench_stats measure_speed(bench_scene *scene, int runs, void (*act)(bench_scene *), double units)
{
    double speeds[BENCH_MAX_RUNS];
    act(scene);
    for (int i = 0; i < runs; i++) {
        const double began = bench_read_clock();
        act(scene);
        speeds[i] = units / (bench_read_clock() - began);
    }
    return bench_compute_stats(speeds, runs);
}

static void refit_ranges(bench_scene *s)
{
    if (mmbvh_refit_ranges(&s->tree, &s->view.cells, &s->view.field, &(mmbvh_options){0}) != INSITU_OK) abort();
}

static void refit_bounds(bench_scene *s)
{
    if (mmbvh_refit_bounds(&s->tree, &s->view.cells, &(mmbvh_options){0}) != INSITU_OK) abort();
}

static void measure_tree(bench_scene *s, int runs)
{
    const double cells = (double)s->subject.cells;
    base_memory_reset_peak();
    bench_print(&s->subject, "build", "Mcells/s", measure_speed(s, runs, bench_scene_build, 1e-6 * cells));
    bench_print_number(&s->subject, "build peak", "bytes/cell", (double)base_memory_peak() / cells);
    mmbvh_statistics statistics;
    if (mmbvh_check(&s->tree, &s->view.cells, &s->view.field, &statistics, &s->error) != INSITU_OK) {
        fprintf(stderr, "bench_render: %s\n", s->error.message);
        exit(1);
    }
    bench_print_number(&s->subject, "tree size", "bytes/cell", (double)statistics.bytes / cells);
    bench_print_number(&s->subject, "tree cost", "tests/ray", statistics.cost);
    bench_print_number(&s->subject, "tree depth", "nodes", statistics.depth);
    bench_print(&s->subject, "refit ranges", "Mcells/s", measure_speed(s, runs, refit_ranges, 1e-6 * cells));
    bench_print(&s->subject, "refit bounds", "Mcells/s", measure_speed(s, runs, refit_bounds, 1e-6 * cells));
}

/* Measures a frame. Its peak memory does not include the tree. */
static void measure_frame(bench_scene *s, int runs, const char *layer)
{
    char name[64];
    const double rays = 1e-6 * s->job.camera.width * s->job.camera.height;
    const int64_t held = base_memory_held();
    base_memory_reset_peak();
    bench_print(&s->subject, layer, "Mrays/s", measure_speed(s, runs, bench_scene_frame, rays));
    snprintf(name, sizeof name, "%s peak", layer);
    bench_print_number(&s->subject, name, "MB", 1e-6 * (double)(base_memory_peak() - held));
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    const int runs = command->runs;
    bench_scene scene;
    bench_scene_create(&scene, "bench_render", kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    measure_tree(&scene, runs);
    bench_scene_show_surfaces(&scene, 1);
    measure_frame(&scene, runs, "isosurface");
    bench_scene_print_surface_error(&scene, "isosurface");
    bench_scene_show_volume(&scene);
    measure_frame(&scene, runs, "volume");
    bench_scene_print_sample_error(&scene, "volume");
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    return bench_measure_meshes(
        argc, argv,
        "Measures building, refitting and drawing of each MESH (tets, hexes, wedges, pyramids,\n"
        "polyhedra or mixed) of N^3 cubes.",
        TEST_MIXED, measure_mesh);
}
