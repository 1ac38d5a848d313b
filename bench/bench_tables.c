/* Measures tables like those of the thesis: 4.1 traversals, 4.2 sample groups, 4.3 groups against steps, 5.2 sizes. The
 * program is started once for each instruction set and number of threads to compare their speeds. A speed is the median
 * of the runs, and is printed together with the error. Prints CSV.
 *
 * Isosurfaces have BENCH_WIDTH × BENCH_HEIGHT pixels. Volumes are much slower, so their pictures are smaller. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <sys/resource.h>

#include "bench_command.h"
#include "bench_scene.h"

enum { VOLUME_WIDTH = 640, VOLUME_HEIGHT = 360, GROUPS = 6, STEPS = 6 };

static const int groups[GROUPS] = {1, 4, 8, 16, 24, 32};

/* Steps as multiples of a cube's side. As in table 4.3, they are 0.25 to 1.5 times the step of the other tables. */
static const double steps[STEPS] = {0.125, 0.25, 0.375, 0.5, 0.625, 0.75};

static const struct {
    const char *name;
    render_traversal traversal;
} traversals[] = {{"binned", RENDER_BINNED}, {"tiles", RENDER_TILES}};

static void build_and_print_time(bench_scene *s)
{
    const double began = bench_start_timer();
    bench_scene_build(s);
    bench_print_number(&s->subject, "build", "s", bench_read_clock() - began);
}

static void measure_frames(bench_scene *s, const char *name, const bench_command *command)
{
    double speeds[BENCH_MAX_RUNS];
    const double rays = 1e-6 * s->job.camera.width * s->job.camera.height;
    bench_scene_frame(s);
    for (int i = 0; i < command->runs; i++) {
        const double began = bench_start_timer();
        bench_scene_frame(s);
        speeds[i] = rays / (bench_read_clock() - began);
    }
    bench_print(&s->subject, name, "Mrays/s", bench_compute_stats(speeds, command->runs));
}

static void measure_surface(bench_scene *s, const char *name, const bench_command *command)
{
    bench_scene_show_surfaces(s, 1);
    measure_frames(s, name, command);
    bench_scene_print_surface_error(s, name);
}

static void measure_volume(bench_scene *s, const char *name, const bench_command *command)
{
    bench_scene_show_volume(s);
    measure_frames(s, name, command);
    bench_scene_print_integral_error(s, name);
}

/* Measures traversal by tiles with the default sample group, and then with groups of each size. The sample window of a
 * tile has at most as many samples as a group. */
static void measure_groups(bench_scene *s, const char *prefix, const bench_command *command)
{
    char name[64];
    s->job.traversal = RENDER_TILES;
    snprintf(name, sizeof name, "%s tiles", prefix);
    measure_volume(s, name, command);
    for (int i = 0; i < GROUPS; i++) {
        snprintf(name, sizeof name, "%s group %d", prefix, groups[i]);
        s->job.sample_group = groups[i];
        measure_volume(s, name, command);
    }
}

static void print_group_table(bench_scene *s, const bench_command *command)
{
    build_and_print_time(s);
    bench_scene_resize(s, VOLUME_WIDTH / command->shrink, VOLUME_HEIGHT / command->shrink);
    measure_groups(s, "volume", command);
}

static void print_step_table(bench_scene *s, const bench_command *command)
{
    build_and_print_time(s);
    bench_scene_resize(s, VOLUME_WIDTH / command->shrink, VOLUME_HEIGHT / command->shrink);
    for (int step = 0; step < STEPS; step++) {
        char prefix[64];
        snprintf(prefix, sizeof prefix, "volume step %g", steps[step]);
        s->job.step = 2 * steps[step] / s->subject.n;
        measure_groups(s, prefix, command);
    }
}

static void measure_layers(bench_scene *s, const bench_command *command)
{
    measure_surface(s, "isosurface", command);
    bench_scene_resize(s, VOLUME_WIDTH / command->shrink, VOLUME_HEIGHT / command->shrink);
    measure_volume(s, "volume", command);
}

static void print_scaling_table(bench_scene *s, const bench_command *command)
{
    build_and_print_time(s);
    measure_layers(s, command);
}

static void measure_traversals(bench_scene *s, const bench_command *command)
{
    for (size_t i = 0; i < sizeof traversals / sizeof *traversals; i++) {
        char name[64];
        snprintf(name, sizeof name, "isosurface %s", traversals[i].name);
        s->job.traversal = traversals[i].traversal;
        measure_surface(s, name, command);
    }
    s->job.traversal = RENDER_BINNED;
}

static void print_size_table(bench_scene *s, const bench_command *command)
{
    struct rusage usage;
    build_and_print_time(s);
    measure_traversals(s, command);
    measure_layers(s, command);
    getrusage(RUSAGE_SELF, &usage);
    bench_print_number(&s->subject, "process peak", "GiB", (double)usage.ru_maxrss / (1 << 20));
}

static const bench_table tables[] = {{"groups", print_group_table},
                                     {"steps", print_step_table},
                                     {"sizes", print_size_table},
                                     {"scaling", print_scaling_table}};

int main(int argc, char **argv)
{
    return bench_run_table(argc, argv, "bench_tables",
                           "Before all else stands a table's name: sizes (4.1 and 5.2 of the thesis), groups (4.2),\n"
                           "steps (4.3) or scaling. Measures it on each MESH of N^3 cubes.",
                           tables, sizeof tables / sizeof *tables);
}
