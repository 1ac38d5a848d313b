/* Measures libinsitu at each of its settings. The time of a frame begins when the trees are built, and ends when the
 * pixels are finished. It includes compositing on one rank. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "accuracy_rows.h"
#include "bench_stats.h"
#include "comp.h"
#include "memory.h"

enum { MAX_RUNS = 64, FEW_RUNS = 3 };

/* Buffers for the pictures of one subject. */
typedef struct studio {
    const accuracy_context *context;
    accuracy_scene scene;
    fragment_list fragments;
    float *image;   /* size × size × 4 */
    float *chosen;  /* count × 4: colours of the chosen pixels (accuracy_reference.h) in the most recent frame */
    double *depths; /* count: depths of the chosen pixels */
    int count;
} studio;

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static void check_status(insitu_status status, const base_error *error)
{
    if (status == INSITU_OK) return;
    fprintf(stderr, "bench_accuracy: %s\n", error->message);
    exit(1);
}

static void build_tree(accuracy_subject *s)
{
    base_error error;
    mmbvh_free(&s->tree);
    check_status(mmbvh_build(&s->view.cells, &s->view.field, s->space.origin, s->space.scale, &(mmbvh_options){0},
                             &s->tree, &error),
                 &error);
}

void accuracy_measure_build(accuracy_context *context)
{
    double times[MAX_RUNS];
    build_tree(context->subject);
    for (int i = 0; i < context->effort->runs; i++) {
        const double began = bench_read_clock();
        build_tree(context->subject);
        times[i] = bench_read_clock() - began;
    }
    context->build = bench_compute_stats(times, context->effort->runs).median;
}

static studio create_studio(const accuracy_context *context)
{
    const size_t pixels = (size_t)context->effort->size * (size_t)context->effort->size;
    studio s = {.context = context, .count = bench_pixels_count(accuracy_reference_pixels(context->truth))};
    s.image = require_memory(malloc(4 * pixels * sizeof *s.image));
    s.chosen = require_memory(malloc(4 * (size_t)s.count * sizeof *s.chosen));
    s.depths = require_memory(malloc((size_t)s.count * sizeof *s.depths));
    return s;
}

static void destroy_studio(studio *s)
{
    base_free(s->fragments.items);
    free(s->image);
    free(s->chosen);
    free(s->depths);
}

/* Merges the fragments of each pixel. The fragments of a pixel are contiguous, because one rank makes them all. */
static void merge_fragments(studio *s)
{
    const float nothing[4] = {0, 0, 0, 0};
    fragment *items = s->fragments.items;
    float depth;
    for (int64_t i = 0, end; i < s->fragments.count; i = end) {
        const uint32_t pixel = items[i].pixel;
        for (end = i + 1; end < s->fragments.count && items[end].pixel == pixel;) end++;
        comp_merge_pixel(items + i, end - i, nothing, s->image + 4 * (size_t)pixel, &depth);
    }
}

/* Draws a frame and returns its time in seconds. */
static double draw_frame(studio *s)
{
    base_error error;
    const double began = bench_read_clock();
    s->fragments.count = 0;
    check_status(render_frame(&s->scene.job, &s->fragments, NULL, &error), &error);
    merge_fragments(s);
    return bench_read_clock() - began;
}

static void choose_pixels(studio *s)
{
    bench_pixels_merge(accuracy_reference_pixels(s->context->truth), &s->scene.job.space, &s->fragments, s->chosen,
                       s->depths);
}

static bool needs_another_run(const accuracy_effort *effort, int runs, double total)
{
    if (runs >= effort->runs) return false;
    return runs == 0 || total < effort->seconds || (runs < FEW_RUNS && total < 4 * effort->seconds);
}

/* Draws a first frame, repeats it for the times, and compares the picture with the true values. */
static void measure_row(studio *s, accuracy_row *row)
{
    double frames[MAX_RUNS], total = 0;
    row->status = "ok";
    row->frames = frames;
    row->first = s->context->build + draw_frame(s);
    while (needs_another_run(s->context->effort, row->runs, total)) total += frames[row->runs++] = draw_frame(s);
    choose_pixels(s);
    row->error = s->scene.job.surface_count
                     ? accuracy_compute_surface_error(s->context->truth, s->depths)
                     : accuracy_compute_volume_error(s->context->truth, ACCURACY_OPACITY, s->chosen);
    accuracy_print_row(s->context, row);
}

void accuracy_measure_surface_rows(const accuracy_context *context)
{
    if (context->effort->is_brief) return;
    studio s = create_studio(context);
    accuracy_scene_create_surface(&s.scene, context->subject);
    measure_row(&s, &(accuracy_row){.layer = "isosurface", .method = "robust", .setting = "robust"});
    destroy_studio(&s);
}

/* Writes a number of cells, as a fraction if it is below 1. */
static void name_cells(char *name, size_t bytes, double cells)
{
    if (cells >= 1)
        snprintf(name, bytes, "%g", cells);
    else
        snprintf(name, bytes, "1/%g", 1 / cells);
}

static void measure_step_rows(studio *s, const char *method, double most, double least)
{
    for (double cells = most; cells >= least; cells /= 2) {
        accuracy_row row = {.layer = "volume", .method = method};
        name_cells(row.setting, sizeof row.setting, cells);
        s->scene.job.step = cells * s->context->subject->cell_size;
        measure_row(s, &row);
    }
}

static void measure_group_rows(studio *s)
{
    s->scene.job.step = 0.25 * s->context->subject->cell_size;
    for (int group = 1; group <= 64; group *= 4) {
        accuracy_row row = {.layer = "volume", .method = "sample group"};
        s->scene.job.sample_group = group;
        snprintf(row.setting, sizeof row.setting, "%d", group);
        measure_row(s, &row);
    }
    s->scene.job.sample_group = 64;
}

/* Measures the mean of the first 1, 2, 4, ... frames, which differ in their jitter. The time of a mean is the sum of
 * its frames' times. */
static void measure_frame_rows(studio *s)
{
    const size_t channels = 4 * (size_t)s->count;
    double *sum = require_memory(calloc(channels, sizeof *sum)), total = 0, first = 0;
    float *mean = require_memory(malloc(channels * sizeof *mean));
    s->scene.job.step = s->context->subject->cell_size;
    for (int frame = 0; frame < s->context->effort->frames; frame++) {
        s->scene.job.frame = frame;
        total += draw_frame(s);
        if (frame == 0) first = total;
        choose_pixels(s);
        for (size_t i = 0; i < channels; i++) {
            sum[i] += (double)s->chosen[i];
            mean[i] = (float)(sum[i] / (frame + 1));
        }
        if (frame & (frame + 1)) continue;
        accuracy_row row = {.layer = "volume",
                            .method = "frames",
                            .status = "ok",
                            .first = s->context->build + first,
                            .runs = 1,
                            .frames = &(double){total}};
        snprintf(row.setting, sizeof row.setting, "%d", frame + 1);
        row.error = accuracy_compute_volume_error(s->context->truth, ACCURACY_OPACITY, mean);
        accuracy_print_row(s->context, &row);
    }
    s->scene.job.frame = 0;
    free(sum);
    free(mean);
}

static void measure_max_error_rows(studio *s)
{
    for (int digits = 1; digits <= 4; digits++) {
        accuracy_row row = {.layer = "volume", .method = "max_error"};
        s->scene.job.max_error = pow(10, -digits);
        snprintf(row.setting, sizeof row.setting, "1e-%d", digits);
        measure_row(s, &row);
    }
    s->scene.job.max_error = 0;
}

/* Sample groups change only the time, and equally for all kinds of cells, so they are measured only on linear cells. */
static void measure_sample_rows(studio *s)
{
    measure_step_rows(s, "samples", 4, 1.0 / 16);
    if (accuracy_is_linear(s->context->subject)) measure_group_rows(s);
    measure_frame_rows(s);
}

void accuracy_measure_volume_rows(const accuracy_context *context)
{
    const bool is_linear = accuracy_is_linear(context->subject), is_brief = context->effort->is_brief;
    studio s = create_studio(context);
    accuracy_scene_create_volume(&s.scene, context->subject);
    if (!is_brief) measure_sample_rows(&s);
    s.scene.job.integration = RENDER_SEGMENTS;
    /* A linear cell is one segment for any step, so one step suffices. */
    measure_step_rows(&s, "segments", is_linear || is_brief ? 1 : 4, is_linear || is_brief ? 1 : 1.0 / 8);
    measure_max_error_rows(&s);
    destroy_studio(&s);
}
