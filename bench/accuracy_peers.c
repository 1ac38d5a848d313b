/* Measures the peers, which are VTK's volume mappers. A peer that crashes or exceeds its time gets a row that states
 * this. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "accuracy_rows.h"
#include "bench_apart.h"

typedef struct peer {
    const char *method, *setting;
    bench_vtk_mapper mapper;
    accuracy_opacity meaning;
    int coarser; /* only for VTK resample: number of times that the finest resolution is halved */
} peer;

static const peer peers[] = {
    {"VTK ray cast", "partial pre-integration", BENCH_VTK_RAY_PARTIAL, ACCURACY_EXTINCTION, 0},
    {"VTK ray cast", "linear integrator", BENCH_VTK_RAY_LINEAR, ACCURACY_EXTINCTION, 0},
    {"VTK Z-sweep", "partial pre-integration", BENCH_VTK_ZSWEEP, ACCURACY_EXTINCTION, 0},
    {"VTK projected tets", "-", BENCH_VTK_PROJECTED, ACCURACY_EXTINCTION, 0},
    {"VTK resample", NULL, BENCH_VTK_RESAMPLE, ACCURACY_OPACITY, 2},
    {"VTK resample", NULL, BENCH_VTK_RESAMPLE, ACCURACY_OPACITY, 1},
    {"VTK resample", NULL, BENCH_VTK_RESAMPLE, ACCURACY_OPACITY, 0},
};

static bench_vtk_request make_request(const accuracy_context *context, const peer *p, const int *pixels, int count,
                                      double opacities[ACCURACY_KNOTS])
{
    const accuracy_subject *s = context->subject;
    const int resolution = context->effort->resolution >> p->coarser;
    double longest = 0;
    for (int i = 0; i < ACCURACY_KNOTS; i++) {
        const double a = (double)s->opacities[i];
        opacities[i] = p->meaning == ACCURACY_EXTINCTION ? -log1p(-a) : a;
    }
    for (int axis = 0; axis < 3; axis++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t v = 0; v < s->mesh.vertex_count; v++) {
            low = fmin(low, s->mesh.coordinates[3 * v + axis]);
            high = fmax(high, s->mesh.coordinates[3 * v + axis]);
        }
        longest = fmax(longest, high - low);
    }
    bench_vtk_request r = {.mesh = &s->mesh,
                           .mapper = p->mapper,
                           .resolution = resolution,
                           .degrees = s->degrees,
                           .size = context->effort->size,
                           .knot_count = ACCURACY_KNOTS,
                           .knots = s->knots,
                           .opacities = opacities,
                           .colours = s->colours,
                           .unit_distance = s->unit_distance,
                           .sample_distance = 0.5 * longest / resolution,
                           .runs = context->effort->runs,
                           .seconds = context->effort->seconds,
                           .pixel_count = count,
                           .pixels = pixels};
    for (int axis = 0; axis < 3; axis++) {
        r.eye[axis] = s->look.eye[axis];
        r.focal[axis] = s->look.focal[axis];
        r.up[axis] = s->look.up[axis];
    }
    return r;
}

static void measure_peer_row(const accuracy_context *context, const peer *p, const int *pixels, int count, float *rgba)
{
    double opacities[ACCURACY_KNOTS];
    bench_vtk_result result = {0};
    const bench_vtk_request request = make_request(context, p, pixels, count, opacities);
    accuracy_row row = {.layer = "volume", .method = p->method};
    if (p->setting)
        snprintf(row.setting, sizeof row.setting, "%s", p->setting);
    else
        snprintf(row.setting, sizeof row.setting, "%d^3", request.resolution);
    row.status = bench_draw_in_child_process(&request, context->effort->peer_seconds, &result, rgba);
    if (row.status[0] == 'o') {
        row.first = result.first;
        row.runs = result.runs;
        row.frames = result.frames;
        row.error = accuracy_compute_volume_error(context->truth, p->meaning, rgba);
    }
    accuracy_print_row(context, &row);
}

void accuracy_measure_peer_rows(const accuracy_context *context)
{
    const bench_pixels *chosen = accuracy_reference_pixels(context->truth);
    const int count = bench_pixels_count(chosen);
    int *pixels = malloc(2 * (size_t)count * sizeof *pixels);
    float *rgba = malloc(4 * (size_t)count * sizeof *rgba);
    if (!pixels || !rgba) abort();
    for (int i = 0; i < count; i++) bench_pixels_position(chosen, i, &pixels[2 * i], &pixels[2 * i + 1]);
    for (size_t i = 0; i < sizeof peers / sizeof *peers; i++)
        if (!context->effort->is_brief || peers[i].mapper != BENCH_VTK_ZSWEEP)
            measure_peer_row(context, &peers[i], pixels, count, rgba);
    free(pixels);
    free(rgba);
}
