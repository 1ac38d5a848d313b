/* Speed and error of building, refitting and rendering, on one mesh that can be made at any size. A speed is the median
 * of several runs with the least and the greatest; beside it stands the error against double precision on some of the
 * pixels. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_scene.h"
#include "memory.h"

enum { MAX_RUNS = 1000 };

/* How fast is act()? units / seconds, over the runs and one before them that is not counted. */
static bench_stats speed(bench_scene *scene, int runs, void (*act)(bench_scene *), double units)
{
    double speeds[MAX_RUNS];
    act(scene);
    for (int i = 0; i < runs; i++) {
        const double began = bench_seconds();
        act(scene);
        speeds[i] = units / (bench_seconds() - began);
    }
    return bench_stats_of(speeds, runs);
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
    bench_print(&s->subject, "build", "Mcells/s", speed(s, runs, bench_scene_build, 1e-6 * cells));
    bench_print_number(&s->subject, "build peak", "bytes/cell", (double)base_memory_peak() / cells);
    mmbvh_statistics statistics;
    if (mmbvh_check(&s->tree, &s->view.cells, &s->view.field, &statistics, &s->error) != INSITU_OK) {
        fprintf(stderr, "bench_render: %s\n", s->error.message);
        exit(1);
    }
    bench_print_number(&s->subject, "tree size", "bytes/cell", (double)statistics.bytes / cells);
    bench_print_number(&s->subject, "tree cost", "tests/ray", statistics.cost);
    bench_print_number(&s->subject, "tree depth", "nodes", statistics.depth);
    bench_print(&s->subject, "refit ranges", "Mcells/s", speed(s, runs, refit_ranges, 1e-6 * cells));
    bench_print(&s->subject, "refit bounds", "Mcells/s", speed(s, runs, refit_bounds, 1e-6 * cells));
}

/* The peak is of what the frame holds beside the tree. */
static void measure_frame(bench_scene *s, int runs, const char *layer)
{
    char name[64];
    const int64_t held = base_memory_held();
    base_memory_reset_peak();
    bench_print(&s->subject, layer, "Mrays/s", speed(s, runs, bench_scene_frame, 1e-6 * BENCH_WIDTH * BENCH_HEIGHT));
    snprintf(name, sizeof name, "%s peak", layer);
    bench_print_number(&s->subject, name, "MB", 1e-6 * (double)(base_memory_peak() - held));
}

static void measure(test_mesh_kind kind, int n, int runs)
{
    bench_scene scene;
    bench_scene_create(&scene, "bench_render", kind, n, BENCH_WIDTH, BENCH_HEIGHT);
    measure_tree(&scene, runs);
    bench_scene_show_surfaces(&scene, 1);
    measure_frame(&scene, runs, "isosurface");
    bench_scene_surface_error(&scene, "isosurface");
    bench_scene_show_volume(&scene);
    measure_frame(&scene, runs, "volume");
    bench_scene_volume_error(&scene, "volume");
    bench_scene_free(&scene);
}

static int usage(int status)
{
    fprintf(status ? stderr : stdout,
            "Usage: bench_render [--runs N] [--no-head] MESH:N ...\n\n"
            "Measures each MESH (tets, hexes, wedges, pyramids or mixed) of N^3 cubes and prints CSV.\n"
            "  --runs N   runs of each measure (5)\n"
            "  --no-head  without the line of column names\n\n"
            "OMP_NUM_THREADS sets the threads, INSITU_ISA the instruction set.\n");
    return status;
}

int main(int argc, char **argv)
{
    int runs = 5, i = 1, n;
    bool head = true;
    test_mesh_kind kind;
    for (; i < argc && !strncmp(argv[i], "--", 2); i++) {
        if (!strcmp(argv[i], "--help")) return usage(0);
        if (!strcmp(argv[i], "--no-head"))
            head = false;
        else if (!strcmp(argv[i], "--runs") && i + 1 < argc)
            runs = atoi(argv[++i]);
        else
            return usage(2);
    }
    if (i == argc || runs < 1 || runs > MAX_RUNS) return usage(2);
    for (int j = i; j < argc; j++)
        if (!bench_scene_parse(argv[j], &kind, &n)) return usage(2);
    if (render_isa_warning() && *render_isa_warning()) fprintf(stderr, "bench_render: %s\n", render_isa_warning());
    if (head) bench_print_head();
    for (; i < argc; i++)
        if (bench_scene_parse(argv[i], &kind, &n)) measure(kind, n, runs);
    return 0;
}
