#include "bench_session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "session_image.h"

/* Smallest and largest number of steps before the measured ones. Unless each step has a new mesh, steps are taken until
 * the session no longer builds trees, because it builds the full tree only after some steps. */
enum { WARM_UP = 8, MOST_WARM_UP = 60 };

static const char *const part_names[BENCH_PARTS] = {"prepare", "build", "refit", "trace", "composite"};

const double bench_plane[3] = {0.4, 0.6, 0.7};
const double bench_range[2] = {-1.5, 1.5}, bench_vortex = 30, bench_warp = 0.02, bench_mirror = 1;

/* The depths of the most recent picture; NULL if it has none. */
static float *caught_depths;

bool session_writes_behind;

double session_load_image_library(void)
{
    return 0;
}

void session_find_text_faults(const insitu_image *image, insitu_word_faults *out)
{
    (void)image;
    *out = (insitu_word_faults){.font = ""};
}

insitu_status session_place_image(const insitu_image *image, const insitu_place *place, base_error *error)
{
    (void)error;
    for (int y = 0; y < image->height; y++)
        memcpy(place->rgba + 4 * ((ptrdiff_t)(place->y + y) * place->width + place->x),
               image->rgba + 4 * (ptrdiff_t)y * image->width, 4 * (size_t)image->width * sizeof(float));
    return INSITU_OK;
}

insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error)
{
    (void)format, (void)path, (void)error;
    if (!image->depth) return INSITU_OK;
    const size_t bytes = (size_t)image->width * (size_t)image->height * sizeof *caught_depths;
    free(caught_depths);
    caught_depths = malloc(bytes);
    if (!caught_depths) abort();
    memcpy(caught_depths, image->depth, bytes);
    return INSITU_OK;
}

const char *bench_change_name(bench_change change)
{
    static const char *const names[BENCH_CHANGE_COUNT] = {"new values", "moved vertices", "new mesh"};
    return names[change];
}

const char *bench_picture_name(bench_picture picture)
{
    static const char *const names[BENCH_PICTURE_COUNT] = {"isosurface",
                                                           "isosurfaces",
                                                           "volume",
                                                           "smooth isosurface",
                                                           "isosurface by differences",
                                                           "slice",
                                                           "surface",
                                                           "clipped surface",
                                                           "surface with edges",
                                                           "antialiased surface",
                                                           "q criterion",
                                                           "vortices",
                                                           "lined slice",
                                                           "lined surface",
                                                           "lined isosurface",
                                                           "warped surface",
                                                           "mirrored surface",
                                                           "planes",
                                                           "montage"};
    return names[picture];
}

void bench_require_success(const bench_scene *scene, insitu_session *session, insitu_status status)
{
    if (status == INSITU_OK) return;
    fprintf(stderr, "%s: %s\n", scene->subject.program, insitu_error(session));
    exit(1);
}

static void require_status(const bench_session *s, insitu_status status)
{
    bench_require_success(s->scene, s->session, status);
}

static float *copy_floats(const float *from, int64_t count)
{
    float *to = malloc((size_t)count * sizeof *to);
    if (!to) abort();
    memcpy(to, from, (size_t)count * sizeof *to);
    return to;
}

static bool needs_q_criterion(bench_picture picture)
{
    return picture == BENCH_Q_CRITERION || picture == BENCH_VORTICES;
}

static bool has_velocities(bench_picture picture)
{
    return needs_q_criterion(picture) || picture == BENCH_LINED_ISOSURFACE || picture == BENCH_WARPED;
}

/* Returns the velocities of an ABC flow at the vertices. The flow's phase is shifted by `shift`. */
static float *make_velocities(const grid *g, double shift)
{
    float *out = malloc(3 * (size_t)g->vertex_count * sizeof *out);
    if (!out) abort();
#pragma omp parallel for schedule(static)
    for (int64_t v = 0; v < g->vertex_count; v++) {
        double p[3];
        grid_read_vertex_position(g, v, p);
        for (int i = 0; i < 3; i++)
            out[3 * v + i] = (float)(sin(6 * (p[(i + 2) % 3] + shift)) + cos(6 * (p[(i + 1) % 3] + shift)));
    }
    return out;
}

/* Makes the second state. The field has moved a little, and the vertices by less than a cell, so that no cell is
 * inverted. */
static void make_states(bench_session *s)
{
    const grid *g = &s->scene->view.cells;
    const int64_t count = g->vertex_count;
    const double sway = 0.2 / s->scene->subject.n;
    for (int axis = 0; axis < 3; axis++) {
        s->coordinates[0][axis] = (float *)(void *)(uintptr_t)g->coordinates[axis].data;
        s->coordinates[1][axis] = copy_floats(s->coordinates[0][axis], count);
    }
    s->values[0] = (float *)(void *)(uintptr_t)s->scene->view.field.values.data;
    s->values[1] = copy_floats(s->values[0], count);
#pragma omp parallel for schedule(static)
    for (int64_t v = 0; v < count; v++) {
        double p[3];
        grid_read_vertex_position(g, v, p);
        for (int axis = 0; axis < 3; axis++)
            s->coordinates[1][axis][v] = (float)(p[axis] + sway * sin(3 * p[(axis + 1) % 3]));
        s->values[1][v] = (float)test_wave_field((const double[]){p[0] + 0.01, p[1] + 0.02, p[2] + 0.03});
    }
    for (int i = 0; i < 2 && has_velocities(s->picture); i++) s->velocities[i] = make_velocities(g, 0.01 * i);
}

static void describe_mesh_and_field(bench_session *s)
{
    const grid *g = &s->scene->view.cells;
    insitu_mesh_defaults(&s->mesh);
    s->mesh.vertex_count = g->vertex_count;
    s->mesh.cell_count = g->cell_count;
    s->mesh.cell_type = (insitu_cell_type)g->cell_type;
    s->mesh.connectivity_count = g->cell_count * grid_type_vertex_count(g->cell_type);
    s->mesh.connectivity = (insitu_array){.data = g->connectivity.data, .type = INSITU_INT32};
    insitu_field_defaults(&s->field);
    s->field.name = "f";
    s->field.count = g->vertex_count;
}

static void set_mesh(bench_session *s, insitu_session *to, unsigned changed)
{
    for (int axis = 0; axis < 3; axis++)
        s->mesh.coordinates[axis] = (insitu_array){.data = s->coordinates[s->place][axis], .type = INSITU_FLOAT32};
    s->mesh.changed = changed;
    require_status(s, insitu_set_mesh(to, "cube", &s->mesh));
}

static void set_field(bench_session *s, insitu_session *to)
{
    s->field.values = (insitu_array){.data = s->values[s->phase], .type = INSITU_FLOAT32};
    s->field.changed = INSITU_CHANGED_VALUES;
    require_status(s, insitu_set_field(to, "cube", &s->field));
    if (!s->velocities[0]) return;
    insitu_field velocity = s->field;
    velocity.name = "v";
    velocity.component_count = 3;
    velocity.values.data = s->velocities[s->phase];
    require_status(s, insitu_set_field(to, "cube", &velocity));
}

static bool is_slice(bench_picture picture)
{
    return picture == BENCH_SLICE || picture == BENCH_Q_CRITERION || picture == BENCH_LINED_SLICE ||
           picture == BENCH_PLANES;
}

static bool is_isosurface(bench_picture picture)
{
    return picture < BENCH_SLICE || picture == BENCH_VORTICES || picture == BENCH_LINED_ISOSURFACE;
}

static void write_lines(bench_picture picture, FILE *file)
{
    if (picture == BENCH_LINED_SLICE || picture == BENCH_LINED_SURFACE)
        fprintf(file, ", lines: {count: %d}", BENCH_LINE_COUNT);
    if (picture == BENCH_LINED_ISOSURFACE)
        fprintf(file, ", lines: {field: v, component: x, count: %d}", BENCH_LINE_COUNT);
}

/* Writes layers of slices and outer surfaces, with the same colours as VTK's. */
static void write_plane_or_faces(bench_picture picture, FILE *file)
{
    char colours[96], plane[96];
    snprintf(colours, sizeof colours, "field: %s, map: cool_to_warm, range: [%g, %g]",
             needs_q_criterion(picture) ? "q" : "f", bench_range[0], bench_range[1]);
    snprintf(plane, sizeof plane, "planes: [{normal: [%g, %g, %g], ", bench_plane[0], bench_plane[1], bench_plane[2]);
    if (picture == BENCH_PLANES)
        fprintf(file, "      - slice: {%s, %scount: %d}]", colours, plane, BENCH_PLANE_COUNT);
    else if (is_slice(picture))
        fprintf(file, "      - slice: {%s, %spoint: [0, 0, 0]}]", colours, plane);
    else
        fprintf(file, "      - surface: {colour_by: {%s}, material: {ambient: 1, diffuse: 0, specular: 0}%s", colours,
                picture == BENCH_EDGES ? ", edges: {}" : "");
    write_lines(picture, file);
    fprintf(file, "}\n");
    if (picture == BENCH_CLIPPED) fprintf(file, "    clip: {%spoint: [0, 0, 0]}]}\n", plane);
    if (picture == BENCH_ANTIALIASED) fprintf(file, "    antialias: 4\n");
}

static void write_volume(const bench_session *s, FILE *file)
{
    fprintf(file, "      - volume: {field: f, map: viridis, range: [%g, %g], unit_distance: %g, opacity: [",
            bench_knots[0], bench_knots[BENCH_KNOTS - 1], bench_unit_distance);
    for (int i = 0; i < BENCH_KNOTS; i++)
        fprintf(file, "%s[%g, %g]", i ? ", " : "",
                (bench_knots[i] - bench_knots[0]) / (bench_knots[BENCH_KNOTS - 1] - bench_knots[0]),
                (double)bench_opacities[i]);
    fprintf(file, "]}\n    sampling: {step: %.9g}\n", s->scene->job.step);
}

static void write_isosurface(bench_picture picture, FILE *file)
{
    if (picture == BENCH_VORTICES) {
        fprintf(file, "      - isosurface: {field: q, values: [%g]}\n", bench_vortex);
        return;
    }
    fprintf(file, "      - isosurface: {field: f, values: [");
    for (int i = 0; i < (picture == BENCH_ISOSURFACES ? BENCH_ISOVALUES : 1); i++)
        fprintf(file, "%s%g", i ? ", " : "", bench_isovalues[i]);
    fprintf(file, "]%s",
            picture == BENCH_SMOOTH        ? ", normals: vertex"
            : picture == BENCH_DIFFERENCES ? ", normals: differences"
                                           : "");
    write_lines(picture, file);
    fprintf(file, "}\n");
}

void bench_write_camera(FILE *file)
{
    fprintf(file, "    camera: {position: [%g, %g, %g], focal: [%g, %g, %g], up: [%g, %g, %g], angle: %g}\n",
            bench_eye[0], bench_eye[1], bench_eye[2], bench_focal[0], bench_focal[1], bench_focal[2], bench_up[0],
            bench_up[1], bench_up[2], bench_degrees);
}

/* Writes an image with the layer of this picture. `part` is the number of the image in a montage, or -1 if the image is
 * not in a montage. The images of a montage have half the width and height. */
static void write_image(const bench_session *s, bench_picture picture, int part, const char *ending, FILE *file)
{
    const render_camera *camera = &s->scene->job.camera;
    const int side = part < 0 ? 1 : 2, least = 8;
    const bool is_small = picture == BENCH_Q_CRITERION;
    fprintf(file, "  - name: picture%d\n    size: [%d, %d]\n", part + 1, is_small ? least : camera->width / side,
            is_small ? least : camera->height / side);
    bench_write_camera(file);
    fprintf(file, "    layers:\n");
    if (picture == BENCH_VOLUME)
        write_volume(s, file);
    else if (is_isosurface(picture))
        write_isosurface(picture, file);
    else
        write_plane_or_faces(picture, file);
    fprintf(file, "    outputs: [{path: picture%s%s}]\n", ending, part < 0 ? "" : ", grid: [2, 2]");
}

/* A session's scene file, and the extension of its pictures' names. */
typedef struct scene_file {
    const bench_session *session;
    const char *ending;
} scene_file;

static void write_scene(const void *of, FILE *file)
{
    static const bench_picture parts[BENCH_VIEWS] = {BENCH_SLICE, BENCH_SURFACE, BENCH_CLIPPED, BENCH_ISOSURFACE};
    const scene_file *written = of;
    const bench_session *s = written->session;
    fprintf(file, "threads: %d\n", s->scene->subject.threads);
    if (needs_q_criterion(s->picture)) fprintf(file, "fields: {q: {q_criterion: v}}\n");
    if (s->picture == BENCH_WARPED) fprintf(file, "meshes: {cube: {warp: {field: v, scale: %g}}}\n", bench_warp);
    if (s->picture == BENCH_MIRRORED) fprintf(file, "meshes: {cube: {mirror: {x: %g}}}\n", bench_mirror);
    fprintf(file, "images:\n");
    if (s->picture != BENCH_MONTAGE) write_image(s, s->picture, -1, written->ending, file);
    for (int i = 0; i < BENCH_VIEWS && s->picture == BENCH_MONTAGE; i++)
        write_image(s, parts[i], i, written->ending, file);
}

insitu_session *bench_open_session(const bench_scene *scene, void (*write)(const void *of, FILE *file), const void *of)
{
    char path[] = "/tmp/bench_session_XXXXXX";
    insitu_session *session = NULL;
    const int descriptor = mkstemp(path);
    FILE *file = descriptor >= 0 ? fdopen(descriptor, "w") : NULL;
    if (!file) {
        perror(path);
        exit(1);
    }
    write(of, file);
    fclose(file);
    const insitu_status status = insitu_create(MPI_COMM_WORLD, path, &session);
    unlink(path);
    bench_require_success(scene, session, status);
    return session;
}

/* Opens a session whose pictures have this extension; only .exr has depths. */
static insitu_session *open_session(const bench_session *s, const char *ending)
{
    const scene_file written = {s, ending};
    return bench_open_session(s->scene, write_scene, &written);
}

static bool was_tree_built(const bench_session *s)
{
    return insitu_last_report(s->session)->build_ms > 0;
}

void bench_session_create(bench_session *s, const bench_scene *scene, bench_picture picture, bench_change change)
{
    memset(s, 0, sizeof *s);
    s->scene = scene;
    s->picture = picture;
    s->change = change;
    make_states(s);
    describe_mesh_and_field(s);
    s->session = open_session(s, ".png");
    set_mesh(s, s->session, INSITU_CHANGED_ALL);
    set_field(s, s->session);
    for (int i = 0; i < WARM_UP || (i < MOST_WARM_UP && change != BENCH_NEW_MESH && was_tree_built(s)); i++)
        bench_session_step(s, 0);
}

void bench_session_free(bench_session *s)
{
    insitu_destroy(&s->session);
    for (int axis = 0; axis < 3; axis++) free(s->coordinates[1][axis]);
    free(s->values[1]);
    for (int i = 0; i < 2; i++) free(s->velocities[i]);
}

static void advance_state(bench_session *s)
{
    if (s->change != BENCH_NEW_VALUES) {
        s->place = !s->place;
        set_mesh(s, s->session, s->change == BENCH_NEW_MESH ? INSITU_CHANGED_ALL : INSITU_CHANGED_GEOMETRY);
    }
    if (s->change != BENCH_MOVED_VERTICES) {
        s->phase = !s->phase;
        set_field(s, s->session);
    }
}

void bench_session_step(bench_session *s, int number)
{
    advance_state(s);
    const double began = bench_start_timer();
    const insitu_status status = insitu_step(s->session, s->cycle++, 0);
    bench_stop_timer(began, number, &s->whole);
    require_status(s, status);
    const insitu_report *r = insitu_last_report(s->session);
    const double parts[BENCH_PARTS] = {r->prepare_ms, r->build_ms, r->refit_ms, r->surface_ms + r->volume_ms,
                                       r->composite_ms};
    for (int i = 0; i < BENCH_PARTS; i++) bench_add_sample(1e-3 * parts[i], number, &s->parts[i]);
    s->bytes_trees = r->bytes_trees;
    s->bytes_peak = r->bytes_peak;
}

const float *const *bench_session_coordinates(const bench_session *s)
{
    return (const float *const *)s->coordinates[s->place];
}

const float *bench_session_values(const bench_session *s)
{
    return s->values[s->phase];
}

const float *bench_session_velocities(const bench_session *s)
{
    return s->velocities[s->phase];
}

void bench_session_print(bench_session *s)
{
    char measure[96];
    const int length =
        snprintf(measure, sizeof measure, "%s %s", bench_picture_name(s->picture), bench_change_name(s->change));
    char *const end = measure + length;
    const size_t room = sizeof measure - (size_t)length;
    const double cells = (double)s->scene->subject.cells;
    bench_print_series(&s->scene->subject, measure, &s->whole);
    for (int i = 0; i < BENCH_PARTS; i++) {
        snprintf(end, room, " %s", part_names[i]);
        bench_print_series(&s->scene->subject, measure, &s->parts[i]);
    }
    snprintf(end, room, " trees");
    bench_print_number(&s->scene->subject, measure, "bytes/cell", (double)s->bytes_trees / cells);
    snprintf(end, room, " peak");
    bench_print_number(&s->scene->subject, measure, "bytes/cell", (double)s->bytes_peak / cells);
}

float *bench_session_draw_depths(const bench_session *s)
{
    bench_session again = *s;
    again.session = open_session(s, ".exr");
    set_mesh(&again, again.session, INSITU_CHANGED_ALL);
    set_field(&again, again.session);
    require_status(&again, insitu_step(again.session, 0, 0));
    insitu_destroy(&again.session);
    float *depths = caught_depths;
    caught_depths = NULL;
    return depths;
}
