/* Measures whole steps and frames with volumes, and VTK's mappers of unstructured grids on the same volumes. VTK draws
 * in separate processes. Libinsitu and VTK are measured one after the other in the same run. Pictures are square, and
 * samples are at a distance of half a cube's side. Prints CSV.
 *
 * Between the knots, VTK's mappers interpolate the extinction linearly, but libinsitu the opacity. VTK also divides
 * cells at the knots of the colours, so it gets colours only at the knots of the opacity. The error of VTK's pictures
 * is measured against the integral of the function that VTK interpolates. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <mpi.h>

#include "bench_apart.h"
#include "bench_command.h"
#include "bench_session.h"

/* DENSE opacities between two knots approximate a linear extinction with an error of at most (ln 2 / 256)^2 / 8 =
 * 9.2e-7. */
enum {
    SIZE = 1080,
    DENSE = 256,
    DENSE_POINTS = (BENCH_KNOTS - 1) * DENSE + 1,
    FRAMES_SECONDS = 120,
    PEER_SECONDS = 300
};

typedef struct peer_look {
    float colours[3 * BENCH_KNOTS];
    double extinctions[BENCH_KNOTS];
    double values[DENSE_POINTS];
    float opacities[DENSE_POINTS];
    render_transfer transfer;
} peer_look;

static const struct {
    const char *name;
    bench_vtk_mapper mapper;
} peers[] = {{"vtk ray cast", BENCH_VTK_RAY_PARTIAL}, {"vtk projected tets", BENCH_VTK_PROJECTED}};

static void make_transfer_function(const bench_scene *scene, peer_look *look)
{
    for (int i = 0; i < BENCH_KNOTS; i++) {
        const int entry = i * (scene->transfer.colour_count - 1) / (BENCH_KNOTS - 1);
        memcpy(look->colours + 3 * i, scene->transfer.colours + 3 * entry, 3 * sizeof *look->colours);
        look->extinctions[i] = -log1p(-(double)bench_opacities[i]);
    }
    for (int i = 0; i < DENSE_POINTS; i++) {
        const int knot = i / DENSE < BENCH_KNOTS - 1 ? i / DENSE : BENCH_KNOTS - 2;
        const double part = (double)i / DENSE - knot;
        look->values[i] = bench_knots[knot] + part * (bench_knots[knot + 1] - bench_knots[knot]);
        look->opacities[i] =
            (float)-expm1(-(look->extinctions[knot] + part * (look->extinctions[knot + 1] - look->extinctions[knot])));
    }
    look->transfer = scene->transfer;
    look->transfer.colour_count = BENCH_KNOTS;
    look->transfer.colours = look->colours;
    look->transfer.opacity_count = DENSE_POINTS;
    look->transfer.opacity_values = look->values;
    look->transfer.opacities = look->opacities;
}

static void print_peer(bench_scene *scene, const char *name, bench_vtk_result *result, const double *truth,
                       const float *rgba)
{
    char measure[96];
    bench_series frames = {.count = result->runs};
    memcpy(frames.seconds, result->frames, (size_t)result->runs * sizeof *frames.seconds);
    snprintf(measure, sizeof measure, "volume %s first", name);
    bench_print_number(&scene->subject, measure, "ms", 1e3 * result->first);
    snprintf(measure, sizeof measure, "volume %s frame", name);
    bench_print_series(&scene->subject, measure, &frames);
    snprintf(measure, sizeof measure, "volume %s integral error", name);
    bench_print(&scene->subject, measure, "linear", bench_scene_compute_pixel_error(scene, truth, rgba));
}

static int *list_pixel_positions(const bench_pixels *pixels)
{
    const int count = bench_pixels_count(pixels);
    int *places = malloc(2 * (size_t)count * sizeof *places);
    if (!places) abort();
    for (int i = 0; i < count; i++) bench_pixels_position(pixels, i, &places[2 * i], &places[2 * i + 1]);
    return places;
}

static void measure_peers(bench_scene *scene, test_mesh_kind kind, int runs)
{
    peer_look look;
    test_mesh mesh;
    bench_scene_make_mesh(kind, scene->subject.n, &mesh);
    make_transfer_function(scene, &look);
    const int count = bench_pixels_count(bench_scene_choose_pixels(scene));
    int *places = list_pixel_positions(scene->pixels);
    double *truth = bench_scene_compute_integrals(scene, &look.transfer);
    float *rgba = malloc(4 * (size_t)count * sizeof *rgba);
    if (!rgba) abort();
    bench_vtk_request request = {.mesh = &mesh,
                                 .degrees = bench_degrees,
                                 .size = scene->job.camera.height,
                                 .knot_count = BENCH_KNOTS,
                                 .knots = bench_knots,
                                 .opacities = look.extinctions,
                                 .colours = look.colours,
                                 .unit_distance = bench_unit_distance,
                                 .runs = runs,
                                 .seconds = FRAMES_SECONDS,
                                 .pixel_count = count,
                                 .pixels = places};
    memcpy(request.eye, bench_eye, sizeof request.eye);
    memcpy(request.focal, bench_focal, sizeof request.focal);
    memcpy(request.up, bench_up, sizeof request.up);
    for (size_t i = 0; i < sizeof peers / sizeof *peers; i++) {
        bench_vtk_result result = {0};
        request.mapper = peers[i].mapper;
        const char *status = bench_draw_in_child_process(&request, PEER_SECONDS, &result, rgba);
        if (!strcmp(status, "ok"))
            print_peer(scene, peers[i].name, &result, truth, rgba);
        else
            fprintf(stderr, "bench_volumes: %s: %s\n", peers[i].name, status);
    }
    free(rgba);
    free(truth);
    free(places);
    test_mesh_free(&mesh);
}

static void measure_steps(bench_scene *scene, int runs)
{
    for (bench_change change = 0; change < BENCH_CHANGE_COUNT; change++) {
        bench_session session;
        bench_session_create(&session, scene, BENCH_VOLUME, change);
        for (int number = 1; number <= runs; number++) bench_session_step(&session, number);
        bench_session_print(&session);
        bench_session_free(&session);
    }
}

/* Measures only frames, and their error. If max_error is 0, no bound of the error is requested. */
static void measure_frames(bench_scene *scene, const char *name, render_integration integration, double max_error,
                           int runs)
{
    bench_series frames = {0};
    char measure[64];
    scene->job.integration = integration;
    scene->job.max_error = max_error;
    for (int number = 0; number <= runs; number++) {
        const double began = bench_start_timer();
        bench_scene_frame(scene);
        bench_stop_timer(began, number, &frames);
    }
    snprintf(measure, sizeof measure, "volume %s frame", name);
    bench_print_series(&scene->subject, measure, &frames);
    snprintf(measure, sizeof measure, "volume %s", name);
    bench_scene_print_integral_error(scene, measure);
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    const int runs = command->runs;
    bench_scene scene;
    bench_scene_create(&scene, "bench_volumes", kind, n);
    bench_scene_resize(&scene, SIZE / command->shrink, SIZE / command->shrink);
    bench_scene_build(&scene);
    bench_scene_show_volume(&scene);
    if (bench_vtk_is_available() && kind == TEST_TETS) measure_peers(&scene, kind, runs);
    measure_steps(&scene, runs);
    measure_frames(&scene, "samples", RENDER_SAMPLES, 0, runs);
    measure_frames(&scene, "max_error 1e-1", RENDER_SEGMENTS, 1e-1, runs);
    measure_frames(&scene, "max_error 1e-3", RENDER_SEGMENTS, 1e-3, runs);
    measure_frames(&scene, "segments", RENDER_SEGMENTS, 0, runs);
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const int status = bench_measure_meshes(
        argc, argv,
        "Measures volumes of each MESH (tets or hexes) of N^3 cubes: whole steps and frames, and of\n"
        "tets beside VTK's mappers.",
        TEST_HEXES, measure_mesh);
    MPI_Finalize();
    return status;
}
