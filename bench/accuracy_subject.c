/* Makes the subjects. The lattices are those of bench_render. The views, isovalues and ranges of the real grids are
 * taken from the collection in which these grids were published. */
#include "accuracy_subject.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench_vtk.h"

static const double jitter = 0.2;

typedef struct real_grid {
    const char *name, *field;
    double isovalue, low, high;
    accuracy_view look;
} real_grid;

static const real_grid real_grids[] = {
    {"bluntfin_hex",
     "Density",
     1.2,
     0.4,
     3.5,
     {{22.6672452, 17.0931239, 27.1046469}, {3.27322817, 4.16377926, 2.86212564}, {0, 1, 0}}},
    {"bluntfin_tet",
     "Density",
     1.2,
     0.4,
     3.5,
     {{22.6672452, 17.0931239, 27.1046469}, {3.27322817, 4.16377926, 2.86212564}, {0, 1, 0}}},
    {"post_hex",
     "VelocityMagnitude",
     0.8,
     0,
     1.4,
     {{27.2353818, -27.2288028, 31.9081323}, {0.00657892227, 0, 2.41026258}, {0, 0, 1}}},
    {"post_tet",
     "VelocityMagnitude",
     0.8,
     0,
     1.4,
     {{27.2353818, -27.2288028, 31.9081323}, {0.00657892227, 0, 2.41026258}, {0, 0, 1}}},
    {"mixed_lattice", "f", 0.2, -1.5, 1.5, {{3.08739134, 2.05826089, 3.85923918}, {0, 0, 0}, {0, 1, 0}}},
};

static void set_transfer(accuracy_subject *s, double low, double high, const float opacities[ACCURACY_KNOTS],
                         double unit_distance)
{
    static const float colours[3 * ACCURACY_KNOTS] = {0.05f, 0.1f, 0.9f, 0.9f, 0.85f, 0.3f, 0.8f, 0.05f, 0.1f};
    for (int i = 0; i < ACCURACY_KNOTS; i++) s->knots[i] = low + (high - low) * i / (ACCURACY_KNOTS - 1);
    memcpy(s->opacities, opacities, sizeof s->opacities);
    memcpy(s->colours, colours, sizeof s->colours);
    s->unit_distance = unit_distance;
}

static bool make_lattice(const char *name, accuracy_subject *s)
{
    static const float tent[ACCURACY_KNOTS] = {0, 0.5f, 0};
    const char *colon = strchr(name, ':');
    const int n = colon ? atoi(colon + 1) : 0;
    for (test_mesh_kind kind = 0; n > 0 && kind < TEST_KIND_COUNT; kind++) {
        const char *kind_name = test_mesh_kind_name(kind);
        if (strlen(kind_name) != (size_t)(colon - name) || strncmp(kind_name, name, strlen(kind_name))) continue;
        test_mesh_make_lattice(kind, n, jitter, test_wave_field, &s->mesh);
        s->look = (accuracy_view){{2.4, 1.6, 3.0}, {0, 0, 0}, {0, 1, 0}};
        s->isovalue = 0.3;
        set_transfer(s, -0.6, 0.6, tent, 0.5);
        return true;
    }
    return false;
}

static void compute_mesh_bounds(const test_mesh *mesh, double low[3], double high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = (double)INFINITY;
        high[axis] = -(double)INFINITY;
        for (int64_t v = 0; v < mesh->vertex_count; v++) {
            low[axis] = fmin(low[axis], mesh->coordinates[3 * v + axis]);
            high[axis] = fmax(high[axis], mesh->coordinates[3 * v + axis]);
        }
    }
}

static double compute_diagonal(const double low[3], const double high[3])
{
    return hypot(hypot(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
}

static bool read_grid(const char *name, accuracy_subject *s)
{
    static const float ramp[ACCURACY_KNOTS] = {0, 0.1f, 0.5f};
    const char *folder = getenv("INSITU_TEST_DATA");
    double low[3], high[3];
    char path[4096];
    if (!folder || !*folder) return false;
    for (size_t i = 0; i < sizeof real_grids / sizeof *real_grids; i++) {
        const real_grid *g = &real_grids[i];
        if (strcmp(g->name, name)) continue;
        snprintf(path, sizeof path, "%s/%s.vtu", folder, name);
        if (!bench_vtk_read(path, g->field, &s->mesh)) return false;
        s->look = g->look;
        s->isovalue = g->isovalue;
        compute_mesh_bounds(&s->mesh, low, high);
        set_transfer(s, g->low, g->high, ramp, compute_diagonal(low, high) / 10);
        return true;
    }
    return false;
}

double accuracy_compute_box_size(const grid *g, int64_t cell)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        double p[3];
        grid_read_vertex_position(g, vertex, p);
        for (int axis = 0; axis < 3; axis++) {
            low[axis] = fmin(low[axis], p[axis]);
            high[axis] = fmax(high[axis], p[axis]);
        }
    }
    return cbrt((high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]));
}

static double compute_tet_volume(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], v[3], w[3];
    for (int i = 0; i < 3; i++) {
        u[i] = b[i] - a[i];
        v[i] = c[i] - a[i];
        w[i] = d[i] - a[i];
    }
    return fabs(u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
                u[2] * (v[0] * w[1] - v[1] * w[0])) /
           6;
}

/* Returns the volume of a polyhedron as the sum of the tets between the triangles of its faces and its centre. */
static double compute_polyhedron_volume(const test_mesh *m, int64_t cell)
{
    double centre[3] = {0, 0, 0}, sum = 0;
    int count = 0;
    for (int64_t i = m->offsets[cell]; i < m->offsets[cell + 1]; i++)
        for (int64_t k = m->face_offsets[m->connectivity[i]]; k < m->face_offsets[m->connectivity[i] + 1]; k++, count++)
            for (int axis = 0; axis < 3; axis++) centre[axis] += m->coordinates[3 * m->face_connectivity[k] + axis];
    for (int axis = 0; axis < 3; axis++) centre[axis] /= count;
    for (int64_t i = m->offsets[cell]; i < m->offsets[cell + 1]; i++) {
        const int64_t first = m->face_offsets[m->connectivity[i]], end = m->face_offsets[m->connectivity[i] + 1];
        const int64_t *v = m->face_connectivity;
        for (int64_t k = first + 1; k + 1 < end; k++)
            sum += compute_tet_volume(centre, m->coordinates + 3 * v[first], m->coordinates + 3 * v[k],
                                      m->coordinates + 3 * v[k + 1]);
    }
    return sum;
}

/* Returns the volume of a cell. Warped faces are divided into two triangles. */
static double compute_cell_volume(const test_mesh *m, int64_t cell)
{
    static const signed char tet[][4] = {{0, 1, 2, 3}}, pyramid[][4] = {{0, 1, 2, 4}, {0, 2, 3, 4}},
                             wedge[][4] = {{0, 1, 2, 5}, {0, 1, 5, 4}, {0, 4, 5, 3}},
                             hex[][4] = {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6},
                                         {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}};
    const int type = m->types[cell];
    const signed char(*tets)[4] = type == GRID_TET       ? tet
                                  : type == GRID_PYRAMID ? pyramid
                                  : type == GRID_WEDGE   ? wedge
                                                         : hex;
    const int count = type == GRID_TET ? 1 : type == GRID_PYRAMID ? 2 : type == GRID_WEDGE ? 3 : 6;
    const int64_t *v = m->connectivity + m->offsets[cell];
    double sum = 0;
    if (type == GRID_POLYHEDRON) return compute_polyhedron_volume(m, cell);
    for (int i = 0; i < count; i++)
        sum += compute_tet_volume(m->coordinates + 3 * v[tets[i][0]], m->coordinates + 3 * v[tets[i][1]],
                                  m->coordinates + 3 * v[tets[i][2]], m->coordinates + 3 * v[tets[i][3]]);
    return sum;
}

static double compute_mean_cell_size(const test_mesh *m)
{
    double sum = 0;
    for (int64_t cell = 0; cell < m->cell_count; cell++) sum += cbrt(compute_cell_volume(m, cell));
    return sum / (double)m->cell_count;
}

/* Returns the smallest full angle of view that contains all corners of the bounds. */
static double compute_fitting_view_angle(const render_camera *camera, const double low[3], const double high[3])
{
    double steepest = 0;
    for (int corner = 0; corner < 8; corner++) {
        double p[3] = {0, 0, 0};
        for (int axis = 0; axis < 3; axis++) {
            const double d = (corner >> axis & 1 ? high[axis] : low[axis]) - camera->eye[axis];
            p[0] += d * camera->right[axis];
            p[1] += d * camera->up[axis];
            p[2] += d * camera->forward[axis];
        }
        steepest = fmax(steepest, fmax(fabs(p[0]), fabs(p[1])) / p[2]);
    }
    return 2 * atan(steepest) * 57.29577951308232;
}

static void place_camera(accuracy_subject *s, int size)
{
    const accuracy_view *look = &s->look;
    double low[3], high[3], centre_depth = 0;
    compute_mesh_bounds(&s->mesh, low, high);
    render_camera_look_at(&s->camera, look->eye, look->focal, look->up, 40, size, size);
    s->degrees = compute_fitting_view_angle(&s->camera, low, high);
    render_camera_look_at(&s->camera, look->eye, look->focal, look->up, s->degrees, size, size);
    for (int axis = 0; axis < 3; axis++) {
        s->space.origin[axis] = 0.5 * (low[axis] + high[axis]);
        centre_depth += (s->space.origin[axis] - look->eye[axis]) * s->camera.forward[axis];
    }
    s->space.scale = exp2(-ceil(log2(0.5 * compute_diagonal(low, high))));
    s->space.depth_origin = centre_depth;
}

bool accuracy_subject_create(const char *name, int size, accuracy_subject *out)
{
    memset(out, 0, sizeof *out);
    snprintf(out->name, sizeof out->name, "%s", name);
    if (!make_lattice(name, out) && !read_grid(name, out)) return false;
    test_view_create(&out->mesh, (test_layout){0}, &out->view);
    out->view.cells.ghosts = NULL;
    out->cell_size = compute_mean_cell_size(&out->mesh);
    place_camera(out, size);
    return true;
}

void accuracy_subject_free(accuracy_subject *s)
{
    mmbvh_free(&s->tree);
    test_view_free(&s->view);
    test_mesh_free(&s->mesh);
}

static void initialize_scene(accuracy_scene *scene, const accuracy_subject *s)
{
    memset(scene, 0, sizeof *scene);
    scene->part = (render_part){&s->view.cells, &s->tree, NULL};
    scene->ranges = mmbvh_own_ranges(&s->tree);
    scene->job = (render_job){.camera = s->camera,
                              .space = s->space,
                              .parts = &scene->part,
                              .part_count = 1,
                              .step = s->cell_size,
                              .sample_group = 64,
                              .jitter = true,
                              .is_alone = true};
}

void accuracy_scene_create_surface(accuracy_scene *scene, const accuracy_subject *s)
{
    static const render_light light = {{0.36, 0.48, 0.8}, {1, 1, 1}};
    static const float colour[3] = {0.8f, 0.7f, 0.5f};
    initialize_scene(scene, s);
    scene->surface = (render_surface_layer){.field = {&s->view.field, &scene->ranges},
                                            .value_count = 1,
                                            .values = &s->isovalue,
                                            .colours = colour,
                                            .opacity = 1,
                                            .material = {0.15f, 0.75f, 0.25f, 32}};
    scene->job.lights = &light;
    scene->job.light_count = 1;
    scene->job.surfaces = &scene->surface;
    scene->job.surface_count = 1;
}

void accuracy_scene_create_volume(accuracy_scene *scene, const accuracy_subject *s)
{
    initialize_scene(scene, s);
    scene->transfer = (render_transfer){.low = s->knots[0],
                                        .high = s->knots[ACCURACY_KNOTS - 1],
                                        .colour_count = ACCURACY_KNOTS,
                                        .colours = s->colours,
                                        .opacity_count = ACCURACY_KNOTS,
                                        .opacity_values = s->knots,
                                        .opacities = s->opacities,
                                        .unit_distance = s->unit_distance};
    scene->volume = (render_volume_layer){{&s->view.field, &scene->ranges}, &scene->transfer};
    scene->job.volumes = &scene->volume;
    scene->job.volume_count = 1;
}

bool accuracy_is_linear(const accuracy_subject *s)
{
    for (int64_t cell = 0; cell < s->mesh.cell_count; cell++)
        if (s->mesh.types[cell] != GRID_TET && s->mesh.types[cell] != GRID_POLYHEDRON) return false;
    return true;
}
