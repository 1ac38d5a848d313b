/* Measures how the time of a frame depends on the cells: on their type, on the layout of their arrays, and on the ratio
 * of their size to a pixel. Only rendering is timed; frames that are compared are drawn in turns. Prints CSV. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_command.h"
#include "bench_scene.h"

enum { PICTURES = 7, LAYOUTS = 7, AWAY_PIXELS = 130 };

static const double everything_values[2] = {-2.2, 2.2};
static const float everything_opacities[2] = {0.05f, 0.3f};

typedef struct picture {
    const char *name;
    bool is_surface, shows_everything;
    bool from_afar;   /* also measured by measure_thousand(), which draws the mesh as one of a thousand ranks would */
    double max_error; /* 0: integrates samples */
    /* distance of samples, as a multiple of the benchmarks' default, which is half the side of one of the mesh's
     * cubes */
    double step;
    double unit; /* unit distance of the opacity; 0: the benchmarks' default, bench_unit_distance */
} picture;

/* Unit distance of the dense volume: nearly all light of a ray is absorbed in the first tenth of its path through the
 * cube; the optical depth is 25 to 180 per unit of length. */
static const double dense_unit = 0.002;

static const picture pictures[PICTURES] = {
    {"isosurface", .is_surface = true, .from_afar = true},
    {"volume", .from_afar = true, .step = 1},
    {"volume everywhere", .shows_everything = true, .from_afar = true, .step = 1},
    {"volume quarter step", .step = 0.5},
    {"volume max_error 1e-2", .from_afar = true, .max_error = 1e-2, .step = 1},
    {"volume dense", .shows_everything = true, .step = 1, .unit = dense_unit},
    {"volume dense max_error 1e-2", .shows_everything = true, .max_error = 1e-2, .step = 1, .unit = dense_unit}};

static const struct {
    const char *name;
    test_layout layout;
} layouts[LAYOUTS] = {{"float32", {0}},
                      {"float64", {.wide_coordinates = true, .wide_values = true}},
                      {"float64 values", {.wide_values = true}},
                      {"int64", {.wide_indices = true}},
                      {"interleaved", {.is_interleaved = true}},
                      {"mixed types given", {.with_types = true}},
                      {"float64 int64 types", {true, true, true, true, true}}};

static void set_up_picture(bench_scene *s, const picture *p)
{
    if (p->is_surface) {
        bench_scene_show_surfaces(s, 1);
        return;
    }
    bench_scene_show_volume(s);
    s->job.step = p->step / s->subject.n;
    s->job.integration = p->max_error > 0 ? RENDER_SEGMENTS : RENDER_SAMPLES;
    s->job.max_error = p->max_error;
    s->transfer.unit_distance = p->unit > 0 ? p->unit : bench_unit_distance;
    if (!p->shows_everything) return;
    s->transfer.low = everything_values[0], s->transfer.high = everything_values[1];
    s->transfer.opacity_count = 2;
    s->transfer.opacity_values = everything_values;
    s->transfer.opacities = everything_opacities;
}

/* Resets the transfer function to that of bench_scene_create(). */
static void reset_transfer_function(bench_scene *s)
{
    s->transfer.unit_distance = bench_unit_distance;
    s->transfer.low = bench_knots[0], s->transfer.high = bench_knots[BENCH_KNOTS - 1];
    s->transfer.opacity_count = BENCH_KNOTS;
    s->transfer.opacity_values = bench_knots;
    s->transfer.opacities = bench_opacities;
}

static void time_frame(bench_scene *s, int number, bench_series *series)
{
    const double began = bench_start_timer();
    bench_scene_frame(s);
    bench_stop_timer(began, number, series);
}

/* Prints the error of the dense volume. If nearly all light is absorbed between two samples, the sum over the samples
 * is far from the integral. A frame made from samples is therefore compared with the same samples computed in
 * double. */
static void print_dense_error(bench_scene *s, const picture *p)
{
    free(s->integrals); /* integrals of the usual transfer function */
    s->integrals = NULL;
    if (p->max_error > 0)
        bench_scene_print_integral_error(s, p->name);
    else
        bench_scene_print_sample_error(s, p->name);
    free(s->integrals);
    s->integrals = NULL;
}

static void measure_types(bench_scene *s, const bench_command *command)
{
    bench_scene_build(s);
    for (int i = 0; i < PICTURES; i++) {
        bench_series series = {0};
        set_up_picture(s, &pictures[i]);
        for (int number = 0; number <= command->runs; number++) time_frame(s, number, &series);
        bench_print_series(&s->subject, pictures[i].name, &series);
        if (pictures[i].is_surface)
            bench_scene_print_surface_error(s, pictures[i].name);
        else if (pictures[i].unit > 0)
            print_dense_error(s, &pictures[i]);
        else if (!pictures[i].shows_everything)
            bench_scene_print_integral_error(s, pictures[i].name);
        reset_transfer_function(s);
    }
}

static void print_ratio(const bench_scene *s, const char *measure, const bench_series *series, const bench_series *base)
{
    char name[112];
    double ratios[BENCH_MAX_RUNS];
    for (int i = 0; i < series->count; i++) ratios[i] = series->seconds[i] / base->seconds[i];
    snprintf(name, sizeof name, "%s ratio", measure);
    bench_print(&s->subject, name, "of float32", bench_compute_stats(ratios, series->count));
}

static void measure_layouts(bench_scene *first, const bench_command *command)
{
    static bench_scene scenes[LAYOUTS];
    test_mesh mesh;
    bench_scene_make_mesh(first->kind, first->subject.n, &mesh);
    for (int l = 0; l < LAYOUTS; l++) {
        bench_scene_create(&scenes[l], first->subject.program, first->kind, 1);
        scenes[l].subject = first->subject;
        scenes[l].job.step = first->job.step;
        test_view_free(&scenes[l].view);
        test_view_create(&mesh, layouts[l].layout, &scenes[l].view);
        scenes[l].view.cells.ghosts = NULL;
        bench_scene_resize(&scenes[l], first->job.camera.width, first->job.camera.height);
        bench_scene_build(&scenes[l]);
    }
    test_mesh_free(&mesh);
    for (int i = 0; i < 2; i++) {
        bench_series series[LAYOUTS] = {0};
        char name[96];
        for (int l = 0; l < LAYOUTS; l++) set_up_picture(&scenes[l], &pictures[i]);
        for (int number = 0; number <= command->runs; number++)
            for (int l = 0; l < LAYOUTS; l++) time_frame(&scenes[l], number, &series[l]);
        const bench_series base = series[0];
        for (int l = 0; l < LAYOUTS; l++) {
            snprintf(name, sizeof name, "%s %s", pictures[i].name, layouts[l].name);
            print_ratio(first, name, &series[l], &base);
            bench_print_series(&first->subject, name, &series[l]);
        }
    }
    for (int l = 0; l < LAYOUTS; l++) bench_scene_free(&scenes[l]);
}

/* Counts the cells that a picture shows: those whose range of values overlaps the given range. */
static double count_visible_cells(const bench_scene *s, double low, double high)
{
    const grid *g = &s->view.cells;
    int64_t count = 0;
#pragma omp parallel for reduction(+ : count)
    for (int64_t c = 0; c < g->cell_count; c++) {
        double least = INFINITY, most = -INFINITY;
        int64_t vertices[8];
        const int corners = grid_cell_vertices(g, c, vertices);
        for (int i = 0; i < corners; i++) {
            const double value = grid_field_value(&s->view.field, vertices[i]);
            least = fmin(least, value), most = fmax(most, value);
        }
        count += least <= high && most >= low;
    }
    return (double)count;
}

/* Measures the time from a step's new values to the picture. It includes refitting the tree's ranges. */
static void time_new_values(bench_scene *s, int number, bench_series *series)
{
    const double began = bench_start_timer();
    if (mmbvh_refit_ranges(&s->tree, &s->view.cells, &s->view.field, &s->how) != INSITU_OK) abort();
    bench_scene_frame(s);
    bench_stop_timer(began, number, series);
}

static void print_cost(const bench_scene *s, const char *measure, bench_series *series, double shown)
{
    double costs[BENCH_MAX_RUNS];
    char name[112];
    for (int k = 0; k < series->count; k++) costs[k] = 1e9 * series->seconds[k] * s->subject.threads / shown;
    bench_print_series(&s->subject, measure, series);
    snprintf(name, sizeof name, "%s cost", measure);
    bench_print(&s->subject, name, "ns/shown cell", bench_compute_stats(costs, series->count));
}

/* Measures the work of one of a thousand ranks: the whole mesh is so far away that it is AWAY_PIXELS pixels wide. */
static void measure_thousand(bench_scene *s, const bench_command *command)
{
    const double half = tan(bench_degrees * acos(-1) / 360), wide = sqrt(3);
    const double distance = wide * s->job.camera.height / (half * AWAY_PIXELS);
    const double now = sqrt(bench_eye[0] * bench_eye[0] + bench_eye[1] * bench_eye[1] + bench_eye[2] * bench_eye[2]);
    double eye[3];
    for (int axis = 0; axis < 3; axis++) eye[axis] = bench_eye[axis] * distance / now;
    render_camera_look_at(&s->job.camera, eye, bench_focal, bench_up, bench_degrees, s->job.camera.width,
                          s->job.camera.height);
    s->job.space.depth_origin = distance;
    bench_scene_build(s);
    for (int i = 0; i < PICTURES; i++) {
        const picture *p = &pictures[i];
        if (!p->from_afar) continue;
        const bool is_surface = p->is_surface;
        const double low = is_surface            ? bench_isovalues[0]
                           : p->shows_everything ? -9
                                                 : bench_knots[0],
                     high = is_surface            ? bench_isovalues[0]
                            : p->shows_everything ? 9
                                                  : bench_knots[2];
        const double shown = count_visible_cells(s, low, high);
        bench_series series = {0}, new_values = {0};
        char name[96];
        set_up_picture(s, p);
        for (int number = 0; number <= command->runs; number++) {
            time_frame(s, number, &series);
            if (is_surface) time_new_values(s, number, &new_values);
        }
        snprintf(name, sizeof name, "%s shown", p->name);
        bench_print_number(&s->subject, name, "cells", shown);
        print_cost(s, p->name, &series, shown);
        snprintf(name, sizeof name, "%s new values", p->name);
        if (is_surface) print_cost(s, name, &new_values, shown);
        reset_transfer_function(s);
    }
}

static const bench_table tables[] = {
    {"types", measure_types}, {"layouts", measure_layouts}, {"thousand", measure_thousand}};

int main(int argc, char **argv)
{
    return bench_run_table(argc, argv, "bench_cells",
                           "Before all else stands a table's name: types, layouts, or thousand (a rank of a thousand:\n"
                           "the mesh is a tenth of the picture's width). Measures it on each MESH of N^3 cubes.",
                           tables, sizeof tables / sizeof *tables);
}
