/* Speed and error of building, refitting and rendering, on one mesh that can be made at any size.
 *
 * The mesh is a cube [-1, 1]^3 of n^3 jittered cubes, as hexes or six tets each, with the field sin 6x cos 6y + sin 6y
 * cos 6z + sin 6z cos 6x: smooth, with an isosurface that folds back many times, and nothing at which a cell could be
 * skipped as outside. A speed is the median of several runs with the least and the greatest; beside it stands the
 * error against double precision on some of the pixels. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <omp.h>

#include "bench_error.h"
#include "colour_map.h"
#include "memory.h"
#include "test_meshes.h"

enum { WIDTH = 1920, HEIGHT = 1080, BLOCK = 60, MAX_RUNS = 1000 };

static const double isovalue = 0.3, jitter = 0.2;

/* Opacity is a tent over |f| < 0.6, its peak such that a ray through the whole cube keeps a good part of its light. */
static const double tent_values[3] = {-0.6, 0, 0.6};
static const float tent_opacities[3] = {0, 0.5f, 0};
static const double tent_unit_distance = 0.5;

typedef struct bench {
    bench_subject subject;
    test_view view;
    mmbvh tree;
    render_part part;
    render_job job;
    fragment_list fragments;
    bench_pixels *pixels;
    int runs;
    base_error error;
} bench;

static void must(bench *b, insitu_status status)
{
    if (status == INSITU_OK) return;
    fprintf(stderr, "bench_render: %s\n", b->error.message);
    exit(1);
}

/* How fast is act()? units / seconds, over the runs and one before them that is not counted. */
static bench_stats speed(bench *b, void (*act)(bench *), double units)
{
    double speeds[MAX_RUNS];
    act(b);
    for (int i = 0; i < b->runs; i++) {
        const double began = bench_seconds();
        act(b);
        speeds[i] = units / (bench_seconds() - began);
    }
    return bench_stats_of(speeds, b->runs);
}

static void build(bench *b)
{
    const double origin[3] = {0, 0, 0};
    mmbvh_free(&b->tree);
    must(b, mmbvh_build(&b->view.cells, &b->view.field, origin, b->job.space.scale, &(mmbvh_options){0}, &b->tree,
                        &b->error));
}

static void refit_ranges(bench *b)
{
    must(b, mmbvh_refit_ranges(&b->tree, &b->view.cells, &b->view.field, &(mmbvh_options){0}));
}

static void refit_bounds(bench *b)
{
    must(b, mmbvh_refit_bounds(&b->tree, &b->view.cells, &(mmbvh_options){0}));
}

static void frame(bench *b)
{
    b->fragments.count = 0;
    must(b, render_frame(&b->job, &b->fragments, NULL, &b->error));
}

static void measure_tree(bench *b)
{
    const double cells = (double)b->subject.cells;
    base_memory_reset_peak();
    bench_print(&b->subject, "build", "Mcells/s", speed(b, build, 1e-6 * cells));
    bench_print_number(&b->subject, "build peak", "bytes/cell", (double)base_memory_peak() / cells);
    mmbvh_statistics s;
    must(b, mmbvh_check(&b->tree, &b->view.cells, &b->view.field, &s, &b->error));
    bench_print_number(&b->subject, "tree size", "bytes/cell", (double)s.bytes / cells);
    bench_print_number(&b->subject, "tree cost", "tests/ray", s.cost);
    bench_print_number(&b->subject, "tree depth", "nodes", s.depth);
    bench_print(&b->subject, "refit ranges", "Mcells/s", speed(b, refit_ranges, 1e-6 * cells));
    bench_print(&b->subject, "refit bounds", "Mcells/s", speed(b, refit_bounds, 1e-6 * cells));
}

/* The peak is of what the frame holds beside the tree. */
static void measure_frame(bench *b, const char *layer)
{
    char name[64];
    const int64_t held = base_memory_held();
    base_memory_reset_peak();
    bench_print(&b->subject, layer, "Mrays/s", speed(b, frame, 1e-6 * WIDTH * HEIGHT));
    snprintf(name, sizeof name, "%s peak", layer);
    bench_print_number(&b->subject, name, "MB", 1e-6 * (double)(base_memory_peak() - held));
}

static void measure_surface(bench *b)
{
    const float colour[3] = {0.8f, 0.7f, 0.5f};
    const mmbvh_ranges ranges = mmbvh_own_ranges(&b->tree);
    const render_surface_layer layer = {.field = {&b->view.field, &ranges},
                                        .value_count = 1,
                                        .values = &isovalue,
                                        .colours = colour,
                                        .opacity = 1,
                                        .material = {0.15f, 0.75f, 0.25f, 32},
                                        .root = RENDER_ROBUST};
    b->job.surfaces = &layer;
    b->job.surface_count = 1;
    measure_frame(b, "isosurface");
    const bench_surface_error e = bench_surface_compare(b->pixels, &b->job, test_wave, &b->fragments);
    b->job.surface_count = 0;
    bench_print(&b->subject, "isosurface depth error", "scene", e.depth);
    bench_print(&b->subject, "isosurface field error", "field", e.field);
    bench_print_number(&b->subject, "isosurface disagreements", "pixels", e.disagreements);
    bench_print_number(&b->subject, "isosurface ambiguous", "pixels", e.ambiguous);
    bench_print_number(&b->subject, "isosurface checked", "pixels", e.checked);
}

static void measure_volume(bench *b)
{
    const mmbvh_ranges ranges = mmbvh_own_ranges(&b->tree);
    render_transfer transfer = {.low = -0.6,
                                .high = 0.6,
                                .opacity_count = 3,
                                .opacity_values = tent_values,
                                .opacities = tent_opacities,
                                .unit_distance = tent_unit_distance};
    transfer.colours = colour_map_table("viridis", &transfer.colour_count);
    const render_volume_layer layer = {{&b->view.field, &ranges}, &transfer};
    b->job.volumes = &layer;
    b->job.volume_count = 1;
    measure_frame(b, "volume");
    bench_print(&b->subject, "volume error", "linear", bench_volume_compare(b->pixels, &b->job, &b->fragments));
    b->job.volume_count = 0;
}

static void prepare(bench *b, test_mesh_kind kind, int n)
{
    const double eye[3] = {2.4, 1.6, 3.0}, focal[3] = {0, 0, 0}, up[3] = {0, 1, 0};
    static const render_light light = {{0.36, 0.48, 0.8}, {1, 1, 1}};
    test_mesh mesh;
    test_mesh_lattice(kind, n, jitter, test_wave, &mesh);
    test_view_create(&mesh, (test_layout){0}, &b->view);
    b->view.cells.ghosts = NULL;
    test_mesh_free(&mesh);
    b->subject = (bench_subject){.program = "bench_render",
                                 .isa = render_isa(),
                                 .mesh = test_mesh_kind_name(kind),
                                 .threads = omp_get_max_threads(),
                                 .n = n,
                                 .cells = b->view.cells.cell_count};
    b->part = (render_part){&b->view.cells, &b->tree};
    b->job = (render_job){.parts = &b->part,
                          .part_count = 1,
                          .lights = &light,
                          .light_count = 1,
                          .step = 1.0 / n,
                          .sample_group = 16,
                          .jitter = true,
                          .is_alone = true};
    b->job.space = (render_space){.scale = 0.5, .depth_origin = sqrt(2.4 * 2.4 + 1.6 * 1.6 + 3.0 * 3.0)};
    render_camera_look_at(&b->job.camera, eye, focal, up, 40, WIDTH, HEIGHT);
    b->pixels = bench_pixels_create(&b->view.cells, &b->job.camera, BLOCK);
}

static void measure(test_mesh_kind kind, int n, int runs)
{
    bench b = {.runs = runs};
    prepare(&b, kind, n);
    measure_tree(&b);
    measure_surface(&b);
    measure_volume(&b);
    bench_pixels_destroy(b.pixels);
    base_free(b.fragments.items);
    mmbvh_free(&b.tree);
    test_view_free(&b.view);
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

/* "tets:31" */
static bool parse_mesh(const char *text, test_mesh_kind *kind, int *n)
{
    const char *colon = strchr(text, ':');
    *n = colon ? atoi(colon + 1) : 0;
    for (*kind = 0; colon && *kind < TEST_KIND_COUNT; ++*kind) {
        const char *name = test_mesh_kind_name(*kind);
        if (strlen(name) == (size_t)(colon - text) && !strncmp(name, text, strlen(name))) return *n > 0;
    }
    return false;
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
        if (!parse_mesh(argv[j], &kind, &n)) return usage(2);
    if (render_isa_warning() && *render_isa_warning()) fprintf(stderr, "bench_render: %s\n", render_isa_warning());
    if (head) bench_print_head();
    for (; i < argc; i++)
        if (parse_mesh(argv[i], &kind, &n)) measure(kind, n, runs);
    return 0;
}
