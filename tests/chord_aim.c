/* Chooses cameras and rays that meet a mesh (chord_aim.h). A ray through a point is exact in double. Its rounding to
 * float32 moves the ray by up to half a unit in the last place, so the ray passes the point on either side. If the
 * point projects to the middle of the tile, ray and point are exact in float32 too, and the test on which side of the
 * point the ray passes is a tie. */
#include "chord_aim.h"

#include <math.h>
#include <string.h>

static double draw_uniform(uint64_t *counter, double low, double high)
{
    return low + (high - low) * test_uniform((*counter)++, 91);
}

static int64_t draw_uniform_index(uint64_t *counter, int64_t count)
{
    const int64_t i = (int64_t)draw_uniform(counter, 0, (double)count);
    return i < count ? i : count - 1;
}

static void draw_random_point(uint64_t *counter, double size, double p[3])
{
    for (int a = 0; a < 3; a++) p[a] = draw_uniform(counter, -size, size);
}

static void draw_random_direction(uint64_t *counter, double d[3])
{
    double square;
    do {
        draw_random_point(counter, 1, d);
        square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    } while (square > 1 || square < 0.01);
    for (int a = 0; a < 3; a++) d[a] /= sqrt(square);
}

/* ---- cameras ---- */

static void set_view(render_camera *camera, const double eye[3], const double focal[3], bool is_orthographic,
                     uint64_t *counter)
{
    double up[3];
    do draw_random_direction(counter, up);
    while (!render_camera_look_at(camera, eye, focal, up, 40, 1, 1));
    camera->is_orthographic = is_orthographic;
}

static void set_random_camera(render_camera *camera, uint64_t *counter)
{
    double eye[3], focal[3];
    const double distance = draw_uniform(counter, 2, 8);
    draw_random_direction(counter, eye);
    for (int a = 0; a < 3; a++) eye[a] *= distance;
    draw_random_point(counter, 0.5, focal);
    set_view(camera, eye, focal, draw_uniform(counter, 0, 1) < 0.5, counter);
}

static void project_to_pixel(const render_camera *c, const double p[3], double *x, double *y)
{
    double at[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++) {
        at[0] += c->right[a] * (p[a] - c->eye[a]);
        at[1] += c->up[a] * (p[a] - c->eye[a]);
        at[2] += c->forward[a] * (p[a] - c->eye[a]);
    }
    *x = c->is_orthographic ? at[0] : at[0] / at[2];
    *y = c->is_orthographic ? at[1] : at[1] / at[2];
}

/* ---- faces ---- */

enum { MAX_LOOP = 24 };

typedef struct face_loop {
    int count;
    const double *at[MAX_LOOP];
} face_loop;

/* Picks a random face of a tet, wedge, pyramid or hex. */
static int choose_cell_face(int type, uint64_t *counter, int picks[4])
{
    static const int tet[4][4] = {{0, 1, 2, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {0, 2, 3, -1}};
    static const int hex[6][4] = {{0, 1, 2, 3}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
    static const int wedge[5][4] = {{0, 1, 2, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}};
    static const int pyramid[5][4] = {{0, 1, 2, 3}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}};
    const int *face = type == GRID_TET     ? tet[draw_uniform_index(counter, 4)]
                      : type == GRID_HEX   ? hex[draw_uniform_index(counter, 6)]
                      : type == GRID_WEDGE ? wedge[draw_uniform_index(counter, 5)]
                                           : pyramid[draw_uniform_index(counter, 5)];
    memcpy(picks, face, 4 * sizeof *picks);
    return picks[3] < 0 ? 3 : 4;
}

static void choose_random_face(const test_mesh *mesh, int64_t cell, uint64_t *counter, face_loop *out)
{
    const int64_t *v = mesh->connectivity + mesh->offsets[cell];
    if (mesh->types[cell] == GRID_POLYHEDRON) {
        const int64_t face = v[draw_uniform_index(counter, mesh->offsets[cell + 1] - mesh->offsets[cell])];
        const int64_t first = mesh->face_offsets[face];
        out->count = (int)(mesh->face_offsets[face + 1] - first);
        for (int i = 0; i < out->count; i++) out->at[i] = mesh->coordinates + 3 * mesh->face_connectivity[first + i];
        return;
    }
    int picks[4];
    out->count = choose_cell_face(mesh->types[cell], counter, picks);
    for (int i = 0; i < out->count; i++) out->at[i] = mesh->coordinates + 3 * v[picks[i]];
}

static void interpolate_points(const double *a, const double *b, double share, double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = a[k] + share * (b[k] - a[k]);
}

/* Computes a point on the face: a vertex, a point of an edge (often its middle), or a point of a triangle of
 * vertices. */
static void choose_point_on_face(const face_loop *face, chord_aim aim, uint64_t *counter, double out[3])
{
    const int64_t i = draw_uniform_index(counter, face->count);
    const double *a = face->at[i], *b = face->at[(i + 1) % face->count], *c = face->at[(i + 2) % face->count];
    const double share = draw_uniform(counter, 0, 1);
    memcpy(out, a, 3 * sizeof *out);
    if (aim == CHORD_TO_VERTICES) return;
    interpolate_points(a, b, share < 0.25 ? 0.5 : draw_uniform(counter, 0, 1), out);
    if (aim == CHORD_TO_EDGES) return;
    interpolate_points(out, c, draw_uniform(counter, 0, 1), out);
}

/* Computes the eye: the point at the given distance from a on the line from b through a, beyond a. It is outside the
 * mesh. */
static void move_eye_back(const double *a, const double *b, double distance, double eye[3])
{
    double square = 0;
    for (int k = 0; k < 3; k++) square += (b[k] - a[k]) * (b[k] - a[k]);
    for (int k = 0; k < 3; k++) eye[k] = a[k] - distance * (b[k] - a[k]) / sqrt(square);
}

/* Sets a camera in the plane of a face. The eye lies on the line through the face's first edge (CHORD_ALONG_EDGES) or
 * in the plane of its first three vertices (CHORD_ALONG_FACES). Half of the cameras also look along this line or plane,
 * so that orthographic rays run along it too. */
static void set_camera_along_face(const face_loop *face, chord_aim aim, render_camera *camera, uint64_t *counter)
{
    double to[3], eye[3], focal[3];
    memcpy(to, face->at[1], sizeof to);
    if (aim == CHORD_ALONG_FACES) interpolate_points(face->at[1], face->at[2], draw_uniform(counter, 0, 1), to);
    move_eye_back(face->at[0], to, draw_uniform(counter, 4, 8), eye);
    draw_random_point(counter, 0.5, focal);
    const bool is_straight = draw_uniform(counter, 0, 1) < 0.5;
    set_view(camera, eye, is_straight ? to : focal, is_straight && draw_uniform(counter, 0, 1) < 0.7, counter);
}

/* ---- rays ---- */

static void add_ray(chord_rays *rays, double x, double y)
{
    rays->x[rays->count] = x;
    rays->y[rays->count] = y;
    rays->count++;
}

static void aim_near_random_point(const render_camera *camera, uint64_t *counter, chord_rays *rays)
{
    double p[3];
    draw_random_point(counter, 1, p);
    project_to_pixel(camera, p, &rays->centre_x, &rays->centre_y);
    const double half = pow(10, draw_uniform(counter, -4, -0.7));
    while (rays->count < CHORD_MAX_RAYS)
        add_ray(rays, rays->centre_x + draw_uniform(counter, -half, half),
                rays->centre_y + draw_uniform(counter, -half, half));
}

/* Adds rays around a random direction that is at most about 45 degrees off the view direction. */
static void aim_near_view_direction(uint64_t *counter, chord_rays *rays)
{
    rays->centre_x = draw_uniform(counter, -0.9, 0.9);
    rays->centre_y = draw_uniform(counter, -0.9, 0.9);
    while (rays->count < CHORD_MAX_RAYS)
        add_ray(rays, rays->centre_x + draw_uniform(counter, -0.1, 0.1),
                rays->centre_y + draw_uniform(counter, -0.1, 0.1));
}

/* Adds a ray through the point itself (half of the rays) or past it, at a distance of 1e-9 to 1e-3 in the image plane.
 * The first ray also chooses the tile's middle: the point's projection, or a position within 0.05 of it. */
static void aim_at_point(const render_camera *camera, const double p[3], uint64_t *counter, chord_rays *rays)
{
    double x, y;
    const double off = draw_uniform(counter, 0, 1) < 0.5 ? 0 : pow(10, draw_uniform(counter, -9, -3));
    project_to_pixel(camera, p, &x, &y);
    if (rays->count == 0) {
        const double beside = draw_uniform(counter, 0, 1) < 0.5 ? 0 : 0.05;
        rays->centre_x = x + beside * draw_uniform(counter, -1, 1);
        rays->centre_y = y + beside * draw_uniform(counter, -1, 1);
    }
    add_ray(rays, x + off * draw_uniform(counter, -1, 1), y + off * draw_uniform(counter, -1, 1));
}

static void aim_at_cell(const test_mesh *mesh, int64_t cell, chord_aim aim, const render_camera *camera,
                        uint64_t *counter, chord_rays *rays)
{
    while (rays->count < CHORD_MAX_RAYS) {
        face_loop face;
        double p[3];
        choose_random_face(mesh, cell, counter, &face);
        choose_point_on_face(&face, aim, counter, p);
        aim_at_point(camera, p, counter, rays);
    }
}

/* Sets a camera that sees a face as a line, and aims rays at the face's vertices, edges and inner points. Every ray
 * then meets the face along that line. */
static void aim_along_face(const test_mesh *mesh, int64_t cell, chord_aim aim, uint64_t *counter, render_camera *camera,
                           chord_rays *rays)
{
    face_loop face;
    choose_random_face(mesh, cell, counter, &face);
    set_camera_along_face(&face, aim, camera, counter);
    aim_at_point(camera, face.at[0], counter, rays);
    while (rays->count < CHORD_MAX_RAYS / 2) {
        double p[3];
        choose_point_on_face(&face, (chord_aim)(CHORD_TO_VERTICES + draw_uniform_index(counter, 3)), counter, p);
        aim_at_point(camera, p, counter, rays);
    }
    aim_at_cell(mesh, cell, (chord_aim)(CHORD_TO_VERTICES + draw_uniform_index(counter, 3)), camera, counter, rays);
}

/* Aims rays along an axis or a diagonal of a face or of the cube, in either direction. Eyes of perspective cameras lie
 * on lattice lines. Rays are an eighth of a cube's side apart, and the first rays lie on lattice planes. */
static void aim_along_lattice(int n, uint64_t *counter, render_camera *camera, chord_rays *rays)
{
    const double side = 2.0 / n;
    double eye[3], focal[3], direction[3], up[3] = {0, 0, 0};
    const int64_t first = draw_uniform_index(counter, 3),
                  axes = draw_uniform(counter, 0, 1) < 0.7 ? 1 : 2 + draw_uniform_index(counter, 2);
    for (int k = 0; k < 3; k++)
        direction[(first + k) % 3] = k < axes ? (draw_uniform(counter, 0, 1) < 0.5 ? -1 : 1) : 0;
    for (int a = 0; a < 3; a++) {
        focal[a] = (double)draw_uniform_index(counter, n + 1) * side - 1;
        eye[a] = focal[a] - 4 * direction[a];
    }
    up[(first + 2) % 3] = 1;
    render_camera_look_at(camera, eye, focal, up, 40, 1, 1);
    camera->is_orthographic = draw_uniform(counter, 0, 1) < 0.6;
    project_to_pixel(camera, focal, &rays->centre_x, &rays->centre_y);
    const double depth = camera->is_orthographic ? 1 : 4 * sqrt((double)axes);
    while (rays->count < CHORD_MAX_RAYS) {
        const int64_t i = rays->count % 8 - 3 + 8 * (draw_uniform_index(counter, 3) - 1), j = rays->count / 8 - 3;
        add_ray(rays, rays->centre_x + (double)i * side / 8 / depth, rays->centre_y + (double)j * side / 8 / depth);
    }
}

void chord_aim_rays(const test_mesh *mesh, int n, chord_aim aim, uint64_t *counter, render_camera *camera,
                    chord_rays *rays)
{
    const int64_t cell = draw_uniform_index(counter, mesh->cell_count);
    double eye[3], focal[3];
    rays->count = 0;
    switch (aim) {
    case CHORD_AXIS_ALIGNED: aim_along_lattice(n, counter, camera, rays); break;
    case CHORD_ALONG_EDGES:
    case CHORD_ALONG_FACES: aim_along_face(mesh, cell, aim, counter, camera, rays); break;
    case CHORD_FROM_INSIDE:
        draw_random_point(counter, 0.9, eye);
        draw_random_point(counter, 2, focal);
        set_view(camera, eye, focal, draw_uniform(counter, 0, 1) < 0.3, counter);
        aim_near_view_direction(counter, rays);
        break;
    case CHORD_RANDOM:
        set_random_camera(camera, counter);
        aim_near_random_point(camera, counter, rays);
        break;
    default:
        set_random_camera(camera, counter);
        aim_at_cell(mesh, cell, aim, camera, counter, rays);
        break;
    }
}
