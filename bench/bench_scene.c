#include "bench_scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <omp.h>

#include "colour_map.h"
#include "memory.h"
#include "reference_integral.h"

const double bench_isovalues[BENCH_ISOVALUES] = {0.3, -0.5, 1.0};
const double bench_knots[BENCH_KNOTS] = {-0.6, 0, 0.6};
const float bench_opacities[BENCH_KNOTS] = {0, 0.5f, 0};
const double bench_unit_distance = 0.5;
const double bench_eye[3] = {2.4, 1.6, 3.0}, bench_focal[3] = {0, 0, 0}, bench_up[3] = {0, 1, 0}, bench_degrees = 40;

enum { ROWS = 18 /* rows of chosen pixels */, BIG_MESH = 13000000 };

/* Error allowed to the integral over the interval of a ray in one cell: the sum of a thousand intervals is less than
 * float32's rounding. */
static const double tolerance = 1e-11;

static const double jitter = 0.2;
static const float colours[BENCH_ISOVALUES][3] = {{0.8f, 0.7f, 0.5f}, {0.3f, 0.5f, 0.8f}, {0.8f, 0.3f, 0.3f}};
static const render_light light = {{0.36, 0.48, 0.8}, {1, 1, 1}};

static void require_success(bench_scene *scene, insitu_status status)
{
    if (status == INSITU_OK) return;
    fprintf(stderr, "%s: %s\n", scene->subject.program, scene->error.message);
    exit(1);
}

static void set_job(bench_scene *s)
{
    const double distance =
        sqrt(bench_eye[0] * bench_eye[0] + bench_eye[1] * bench_eye[1] + bench_eye[2] * bench_eye[2]);
    s->part = (render_part){&s->view.cells, &s->tree, NULL};
    s->job = (render_job){.parts = &s->part,
                          .part_count = 1,
                          .surfaces = &s->surface,
                          .volumes = &s->volume,
                          .lights = &light,
                          .light_count = 1,
                          .step = 1.0 / s->subject.n,
                          .sample_group = 64,
                          .jitter = true,
                          .is_alone = true};
    s->job.space = (render_space){.scale = 0.5, .depth_origin = distance};
}

static void set_layers(bench_scene *s)
{
    s->surface = (render_surface_layer){.field = {&s->view.field, &s->ranges},
                                        .values = bench_isovalues,
                                        .colours = colours[0],
                                        .opacity = 1,
                                        .material = {0.15f, 0.75f, 0.25f, 32}};
    s->transfer = (render_transfer){.low = bench_knots[0],
                                    .high = bench_knots[BENCH_KNOTS - 1],
                                    .opacity_count = BENCH_KNOTS,
                                    .opacity_values = bench_knots,
                                    .opacities = bench_opacities,
                                    .unit_distance = bench_unit_distance};
    s->transfer.colours = colour_map_table("viridis", &s->transfer.colour_count);
    s->volume = (render_volume_layer){{&s->view.field, &s->ranges}, &s->transfer};
}

static void free_reference(bench_scene *s)
{
    if (s->pixels) bench_pixels_destroy(s->pixels);
    free(s->integrals);
    s->pixels = NULL;
    s->integrals = NULL;
}

void bench_scene_resize(bench_scene *s, int width, int height)
{
    free_reference(s);
    render_camera_look_at(&s->job.camera, bench_eye, bench_focal, bench_up, bench_degrees, width, height);
}

void bench_scene_make_mesh(test_mesh_kind kind, int n, test_mesh *out)
{
    test_mesh_make_lattice(kind, n, jitter, test_wave_field, out);
}

void bench_scene_create(bench_scene *s, const char *program, test_mesh_kind kind, int n)
{
    test_mesh mesh;
    memset(s, 0, sizeof *s);
    s->kind = kind;
    bench_scene_make_mesh(kind, n, &mesh);
    test_view_create(&mesh, (test_layout){0}, &s->view);
    s->view.cells.ghosts = NULL;
    test_mesh_free(&mesh);
    s->subject = (bench_subject){.program = program,
                                 .isa = render_isa(),
                                 .mesh = test_mesh_kind_name(kind),
                                 .threads = omp_get_max_threads(),
                                 .n = n,
                                 .cells = s->view.cells.cell_count};
    set_job(s);
    set_layers(s);
    bench_scene_resize(s, BENCH_WIDTH, BENCH_HEIGHT);
}

void bench_scene_free(bench_scene *s)
{
    free_reference(s);
    base_free(s->fragments.items);
    mmbvh_free(&s->tree);
    test_view_free(&s->view);
}

void bench_scene_build(bench_scene *s)
{
    const double origin[3] = {0, 0, 0};
    mmbvh_free(&s->tree);
    require_success(
        s, mmbvh_build(&s->view.cells, &s->view.field, origin, s->job.space.scale, &s->how, &s->tree, &s->error));
    s->ranges = mmbvh_own_ranges(&s->tree);
}

void bench_scene_show_surfaces(bench_scene *s, int count)
{
    s->surface.value_count = count;
    s->job.surface_count = 1;
    s->job.volume_count = 0;
}

void bench_scene_show_volume(bench_scene *s)
{
    s->job.surface_count = 0;
    s->job.volume_count = 1;
}

void bench_scene_frame(bench_scene *s)
{
    s->fragments.count = 0;
    require_success(s, render_frame(&s->job, &s->fragments, NULL, &s->error));
}

/* Returns the chosen pixels. The first call chooses them, because not every benchmark needs them. A big mesh gets fewer
 * pixels, because the reference intersects each pixel's ray with every cell near any of them. */
const bench_pixels *bench_scene_choose_pixels(bench_scene *s)
{
    const int block = s->job.camera.height / (s->subject.cells < BIG_MESH ? ROWS : ROWS / 2);
    if (!s->pixels) s->pixels = bench_pixels_create(&s->view.cells, &s->job.camera, block);
    return s->pixels;
}

void bench_scene_print_surface_error(bench_scene *s, const char *name)
{
    char measure[96];
    const bench_surface_error e =
        bench_surface_compare(bench_scene_choose_pixels(s), &s->job, test_wave_field, &s->fragments);
    const struct {
        const char *what;
        double number;
    } counts[] = {{"disagreements", e.disagreements}, {"ambiguous", e.ambiguous}, {"checked", e.checked}};
    snprintf(measure, sizeof measure, "%s depth error", name);
    bench_print(&s->subject, measure, "scene", e.depth);
    snprintf(measure, sizeof measure, "%s field error", name);
    bench_print(&s->subject, measure, "field", e.field);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        snprintf(measure, sizeof measure, "%s %s", name, counts[i].what);
        bench_print_number(&s->subject, measure, "pixels", counts[i].number);
    }
}

double *bench_scene_compute_integrals(bench_scene *s, const render_transfer *transfer)
{
    const float nothing[4] = {0, 0, 0, 0};
    const bench_pixels *pixels = bench_scene_choose_pixels(s);
    const int count = bench_pixels_count(pixels);
    const render_part kept = {bench_pixels_cells(pixels), NULL, NULL};
    const render_volume_layer layer = {s->volume.field, transfer};
    render_job job = s->job;
    double *rgba = malloc(4 * (size_t)count * sizeof *rgba);
    if (!rgba) abort();
    job.parts = &kept;
    job.volumes = &layer;
    job.volume_count = 1;
    reference_integral *integral = reference_integral_create(&job, tolerance);
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) {
        int x, y;
        bench_pixels_position(pixels, i, &x, &y);
        reference_integral_trace(integral, x, y, nothing, NULL, 0, rgba + 4 * i);
    }
    reference_integral_free(integral);
    return rgba;
}

bench_stats bench_scene_compute_pixel_error(const bench_scene *s, const double *truth, const float *rgba)
{
    const int count = bench_pixels_count(s->pixels);
    double *errors = malloc((size_t)count * sizeof *errors);
    if (!errors) abort();
    int seen = 0;
    for (int i = 0; i < count; i++) {
        double error = 0;
        for (int channel = 0; channel < 4; channel++)
            error = fmax(error, fabs((double)rgba[4 * i + channel] - truth[4 * i + channel]));
        if (truth[4 * i + 3] > 0) errors[seen++] = error;
    }
    const bench_stats out = bench_compute_stats(errors, seen);
    free(errors);
    return out;
}

void bench_scene_print_sample_error(bench_scene *s, const char *name)
{
    char measure[96];
    snprintf(measure, sizeof measure, "%s error", name);
    bench_print(&s->subject, measure, "linear",
                bench_volume_compare(bench_scene_choose_pixels(s), &s->job, &s->fragments));
}

void bench_scene_print_integral_error(bench_scene *s, const char *name)
{
    const int count = bench_pixels_count(bench_scene_choose_pixels(s));
    float *rgba = malloc(4 * (size_t)count * sizeof *rgba);
    double *depths = malloc((size_t)count * sizeof *depths);
    char measure[96];
    if (!rgba || !depths) abort();
    if (!s->integrals) s->integrals = bench_scene_compute_integrals(s, &s->transfer);
    bench_pixels_merge(s->pixels, &s->job.space, &s->fragments, rgba, depths);
    snprintf(measure, sizeof measure, "%s integral error", name);
    bench_print(&s->subject, measure, "linear", bench_scene_compute_pixel_error(s, s->integrals, rgba));
    free(rgba);
    free(depths);
}

static void run_table(const bench_command *command, const char *program, const bench_table *table, test_mesh_kind kind,
                      int n)
{
    char name[64];
    bench_scene scene;
    snprintf(name, sizeof name, "%s %s", program, table->name);
    bench_scene_create(&scene, name, kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    table->measure(&scene, command);
    bench_scene_free(&scene);
}

int bench_run_table(int argc, char **argv, const char *program, const char *about, const bench_table *tables, int count)
{
    bench_command command;
    int table = 0;
    while (argc > 1 && table < count && strcmp(argv[1], tables[table].name) != 0) table++;
    const bool is_named = argc > 1 && table < count;
    if (!bench_command_parse(argc - is_named, argv + is_named, about, TEST_MIXED, &command)) return command.status;
    if (!is_named) return fprintf(stderr, "%s: no table of that name\n", program), 2;
    for (int i = 0; i < command.mesh_count; i++)
        run_table(&command, program, &tables[table], command.meshes[i].kind, command.meshes[i].n);
    return 0;
}
