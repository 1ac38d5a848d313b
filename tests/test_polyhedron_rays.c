/* Checks the roots that the kernels find in polyhedra, on random rays: every crossing must be found, and every hit must
 * be a crossing. The reference is brute force in double over the tets between the triangles of the cell's faces and its
 * centre. Each ray is clipped to each tet; inside the cell, the field is the sum of the fields of the tets at the
 * point, each with its sign.
 *
 * Tolerances: positions have a total error of about 3e-6 of the scene. Vertices are rounded by half a unit in the last
 * place of 1 along each axis (1e-7). Crossings of sheets (triangles between two tets) have the rounding of their
 * weights, 2.4e-7 along the ray and four times as much across (kernel_cell.h). If tets overlap, sums are evaluated up
 * to 16 times 2.4e-7 beside a sheet. So values have an error of 3e-6 times the field's slope, plus about ten roundings
 * of their own, 2e-6 of their range. The band is the range of values within this error of the isovalue. A crossing is
 * certain if the field passes from outside the band on one side to outside the band on the other side, within one
 * interval of the ray in the cell. Each certain crossing must have a hit, and each hit must be at a depth at which the
 * field is within the band. Where a ray crosses a face at a small angle, the rounding of the face's vertices (1e-7)
 * moves the crossing by 1e-7 divided by the angle's sine; this is added to the error of the depth of a jump at the
 * face. Rays whose distance from an edge of the cell is less than the error of positions do not count, because they may
 * miss the cell or not. */
#include "reference_cell.h"
#include "reference_polyhedron.h"
#include "test_mesh_dual.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { WIDTH = 40, HEIGHT = 25, MOST_POINTS = 16 * REFERENCE_MAX_TRIANGLES };

static int64_t wanted_rays = 30000;

/* A linear function of the position: its value at the origin and its gradient. */
typedef struct linear {
    double at_origin, gradient[3];
} linear;

typedef struct tet {
    /* barycentric coordinates: at least 0 inside the tet; the last one is 0 on the tet's outer triangle */
    linear inside[4];
    linear value;
    double slope; /* magnitude of the gradient */
    int sign;
} tet;

/* The cell and its tets in camera coordinates. */
typedef struct subject {
    reference_cell cell;
    double values[REFERENCE_MAX_VERTICES], low, high;
    int tet_count;
    tet tets[REFERENCE_MAX_TRIANGLES];
    bool is_star_shaped;
} subject;

/* The interval of a ray in a tet, from depth z[0] to z[1] with the values v[0] and v[1]. is_face: whether this end is
 * on the cell's surface; shift: by how much the end moves if the tet's face moves by 1 along its normal. */
typedef struct interval {
    double z[2], v[2], shift[2], slope;
    bool is_face[2];
    int sign;
} interval;

/* The field along an interval of the ray in the cell, linear between its points. A jump is stored as two points at the
 * same depth. shift: interval.shift of the faces at the path's two ends. */
typedef struct path {
    int count;
    double shift[2];
    double z[MOST_POINTS], v[MOST_POINTS];
} path;

typedef struct tally {
    int64_t rays, certain, inner, missed, wrong, at_edges, bends, in_band;
    int cells, stars;
} tally;

/* ---- the cell ---- */

static double evaluate_linear(const linear *f, const double p[3])
{
    return f->at_origin + f->gradient[0] * p[0] + f->gradient[1] * p[1] + f->gradient[2] * p[2];
}

/* Makes the linear function that is 1 at apex and 0 on the triangle `base`. Returns false if the tet has no volume. */
static bool make_barycentric_function(const double *apex, const double *const base[3], linear *out)
{
    double d[3][3], volume = 0;
    for (int a = 0; a < 3; a++) {
        d[0][a] = base[1][a] - base[0][a];
        d[1][a] = base[2][a] - base[0][a];
        d[2][a] = apex[a] - base[0][a];
    }
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        out->gradient[a] = d[0][b] * d[1][c] - d[0][c] * d[1][b];
        volume += out->gradient[a] * d[2][a];
    }
    if (volume == 0) return false;
    for (int a = 0; a < 3; a++) out->gradient[a] /= volume;
    out->at_origin = 0;
    out->at_origin = -evaluate_linear(out, base[0]);
    return true;
}

static bool make_tet(const subject *s, int triangle, double mean, tet *out)
{
    const int *t = s->cell.poly.triangles[triangle];
    const double *corners[4] = {s->cell.position[t[0]], s->cell.position[t[1]], s->cell.position[t[2]],
                                s->cell.position[s->cell.count]};
    const double f[4] = {s->values[t[0]], s->values[t[1]], s->values[t[2]], mean};
    out->sign = s->cell.poly.sign[triangle];
    out->value = (linear){0, {0, 0, 0}};
    for (int i = 0; i < 4; i++) {
        const double *const base[3] = {corners[(i + 1) % 4], corners[(i + 2) % 4], corners[(i + 3) % 4]};
        linear *w = &out->inside[i];
        if (!make_barycentric_function(corners[i], base, w)) return false;
        out->value.at_origin += f[i] * w->at_origin;
        for (int a = 0; a < 3; a++) out->value.gradient[a] += f[i] * w->gradient[a];
    }
    const double *g = out->value.gradient;
    out->slope = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    return out->sign != 0;
}

static void make_tets(subject *s)
{
    double mean = 0;
    s->low = s->high = s->values[0];
    for (int i = 0; i < s->cell.count; i++) {
        mean += s->values[i] / s->cell.count;
        s->low = fmin(s->low, s->values[i]);
        s->high = fmax(s->high, s->values[i]);
    }
    s->tet_count = 0;
    s->is_star_shaped = true;
    for (int i = 0; i < s->cell.poly.triangle_count; i++) {
        tet *t = &s->tets[s->tet_count];
        if (!make_tet(s, i, mean, t)) continue;
        s->is_star_shaped = s->is_star_shaped && t->sign > 0;
        s->tet_count++;
    }
}

static void make_subject(const render_fixture *f, subject *s)
{
    const grid *g = f->job.parts[0].cells;
    const render_camera *camera = &f->job.camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    int64_t vertices[REFERENCE_MAX_VERTICES];
    s->cell.type = GRID_POLYHEDRON;
    reference_polyhedron_read(g, 0, &s->cell, vertices);
    for (int i = 0; i < s->cell.count; i++) {
        grid_read_vertex_position(g, vertices[i], s->cell.world[i]);
        s->values[i] = grid_field_value(&f->fields[0], vertices[i]);
        for (int a = 0; a < 3; a++) {
            s->cell.position[i][a] = 0;
            for (int b = 0; b < 3; b++) s->cell.position[i][a] += axes[a][b] * (s->cell.world[i][b] - camera->eye[b]);
        }
    }
    reference_polyhedron_setup(&s->cell);
    make_tets(s);
}

/* ---- a ray ---- */

static reference_line make_pixel_line(const render_camera *camera, int x, int y)
{
    double base[3], direction[3];
    reference_line line = {{0, 0}, {0, 0}};
    render_camera_ray(camera, x, y, base, direction);
    for (int b = 0; b < 3; b++) {
        line.base[0] += camera->right[b] * (base[b] - camera->eye[b]);
        line.base[1] += camera->up[b] * (base[b] - camera->eye[b]);
        line.slope[0] += camera->right[b] * direction[b];
        line.slope[1] += camera->up[b] * direction[b];
    }
    return line;
}

/* Restricts f to the line. On the line, f is value + slope z. */
static void restrict_to_line(const linear *f, const reference_line *line, double *value, double *slope)
{
    *value = evaluate_linear(f, (const double[3]){line->base[0], line->base[1], 0});
    *slope = f->gradient[0] * line->slope[0] + f->gradient[1] * line->slope[1] + f->gradient[2];
}

static bool clip_line_to_tet(const tet *t, const reference_line *line, interval *out)
{
    double value, slope;
    *out = (interval){.z = {-(double)INFINITY, (double)INFINITY}, .slope = t->slope, .sign = t->sign};
    for (int i = 0; i < 4; i++) {
        restrict_to_line(&t->inside[i], line, &value, &slope);
        if (slope == 0 && value < 0) return false;
        if (slope == 0) continue;
        const int end = slope < 0;
        const double z = -value / slope;
        if (end ? z >= out->z[1] : z <= out->z[0]) continue;
        const double *g = t->inside[i].gradient;
        out->z[end] = z;
        out->is_face[end] = i == 3;
        out->shift[end] = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) / fabs(slope);
    }
    restrict_to_line(&t->value, line, &value, &slope);
    for (int end = 0; end < 2; end++) out->v[end] = value + slope * out->z[end];
    return out->z[0] < out->z[1];
}

static int compare_numbers(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static double interpolate_in_interval(const interval *s, double z)
{
    return s->v[0] + (z - s->z[0]) / (s->z[1] - s->z[0]) * (s->v[1] - s->v[0]);
}

/* Computes the ray's intervals in all tets and the sorted depths of their ends. Returns the number of intervals. */
static int find_intervals(const subject *s, const reference_line *line, interval *ray_intervals, double *ends)
{
    int count = 0;
    for (int i = 0; i < s->tet_count; i++) count += clip_line_to_tet(&s->tets[i], line, &ray_intervals[count]);
    for (int i = 0; i < 2 * count; i++) ends[i] = ray_intervals[i / 2].z[i % 2];
    qsort(ends, 2 * (size_t)count, sizeof *ends, compare_numbers);
    return count;
}

/* Returns the value on the face that the ray meets at depth z, and stores the face's interval.shift in *shift. */
static double find_face_value(const interval *ray_intervals, int count, double z, double *shift)
{
    double nearest = (double)INFINITY, value = 0;
    for (int i = 0; i < count; i++)
        for (int end = 0; end < 2; end++) {
            const double away = fabs(ray_intervals[i].z[end] - z);
            if (!ray_intervals[i].is_face[end] || away >= nearest) continue;
            nearest = away;
            value = ray_intervals[i].v[end];
            *shift = ray_intervals[i].shift[end];
        }
    assert_true(nearest < 1e-9);
    return value;
}

static void add_point(path *p, double z, double v)
{
    assert_true(p->count < MOST_POINTS);
    p->z[p->count] = z;
    p->v[p->count++] = v;
}

/* Adds the field between two consecutive ends of tets to the path. Returns false if this part of the ray is not inside
 * the cell. */
static bool add_piece(const interval *ray_intervals, int count, double z0, double z1, path *p)
{
    const double middle = 0.5 * (z0 + z1);
    double v[2] = {0, 0};
    int cover = 0;
    for (int i = 0; i < count; i++) {
        if (!(ray_intervals[i].z[0] < middle && middle < ray_intervals[i].z[1])) continue;
        cover += ray_intervals[i].sign;
        v[0] += ray_intervals[i].sign * interpolate_in_interval(&ray_intervals[i], z0);
        v[1] += ray_intervals[i].sign * interpolate_in_interval(&ray_intervals[i], z1);
    }
    if (cover != 1) {
        if (cover && z1 - z0 > 1e-9) fail_msg("a place is in the cell %d times", cover);
        return false;
    }
    if (!p->count) add_point(p, z0, find_face_value(ray_intervals, count, z0, &p->shift[0]));
    add_point(p, z0, v[0]);
    add_point(p, z1, v[1]);
    return true;
}

/* Finds the next interval of the ray in the cell, from the end with index *next on. Returns false if there is none. */
static bool make_next_path(const interval *ray_intervals, int count, const double *ends, int *next, path *p)
{
    p->count = 0;
    for (; *next + 1 < 2 * count; ++*next) {
        if (ends[*next + 1] - ends[*next] < 1e-13) continue;
        if (!add_piece(ray_intervals, count, ends[*next], ends[*next + 1], p) && p->count) break;
    }
    const double last = p->count ? p->z[p->count - 1] : 0;
    if (p->count) add_point(p, last, find_face_value(ray_intervals, count, last, &p->shift[1]));
    return p->count > 0;
}

/* Removes what is behind the eye from the path. */
static void cut_at_eye(path *p)
{
    int first = 0;
    while (first < p->count && p->z[first] < 0) first++;
    if (first == 0) return;
    if (first < p->count) {
        const double along = -p->z[first - 1] / (p->z[first] - p->z[first - 1]);
        p->v[first - 1] += along * (p->v[first] - p->v[first - 1]);
        p->z[first - 1] = 0;
        first--;
    }
    p->count -= first;
    memmove(p->z, p->z + first, (size_t)p->count * sizeof *p->z);
    memmove(p->v, p->v + first, (size_t)p->count * sizeof *p->v);
}

/* ---- hits ---- */

typedef struct ray_hits {
    int count;
    double z[REFERENCE_MAX_HITS];
    bool is_good[REFERENCE_MAX_HITS];
} ray_hits;

typedef struct verify {
    const render_fixture *f;
    const subject *s;
    double iso, place;
    bool is_opaque;
    tally *t;
} verify;

/* Returns the error of depths between the points k and k + 1 of the path. It is larger for a jump at a face, which is
 * between the first or the last two points. */
static double compute_depth_error(const verify *j, const path *p, int k)
{
    const double rounding = 1e-7 / j->f->job.space.scale;
    if (k == 0) return j->place + rounding * p->shift[0];
    return k + 2 == p->count ? j->place + rounding * p->shift[1] : j->place;
}

/* Returns whether there is a hit between the two depths, which are widened by the given error. */
static bool has_hit(const ray_hits *hits, double from, double to, double error)
{
    for (int i = 0; i < hits->count; i++)
        if (from - error <= hits->z[i] && hits->z[i] <= to + error) return true;
    return false;
}

/* Marks the hits near which the path enters the band. */
static void mark_hits(const verify *j, const path *p, double band, ray_hits *hits)
{
    for (int i = 0; i < hits->count; i++)
        for (int k = 0; k + 1 < p->count; k++) {
            const double error = compute_depth_error(j, p, k);
            const double z0 = fmax(p->z[k], hits->z[i] - error), z1 = fmin(p->z[k + 1], hits->z[i] + error);
            if (z0 > z1) continue;
            const double length = p->z[k + 1] - p->z[k], rise = p->v[k + 1] - p->v[k];
            const double v0 = length > 0 ? p->v[k] + (z0 - p->z[k]) / length * rise : p->v[k];
            const double v1 = length > 0 ? p->v[k] + (z1 - p->z[k]) / length * rise : p->v[k + 1];
            if (fmin(v0, v1) - j->iso <= band && fmax(v0, v1) - j->iso >= -band) hits->is_good[i] = true;
        }
}

/* Checks that each certain crossing of the path has a hit. If the surface is opaque, only the first crossing is
 * checked, because its hit hides the others. Returns whether the search may continue. */
static bool verify_path(const verify *j, const path *p, double band, const ray_hits *hits)
{
    const bool is_inner = (p->v[0] >= j->iso) == (p->v[p->count - 1] >= j->iso);
    int side = 0;
    double since = 0;
    for (int k = 0; k < p->count; k++) {
        const double v = p->v[k] - j->iso;
        const int now = v > band ? 1 : v < -band ? -1 : 0;
        j->t->bends++;
        j->t->in_band += !now;
        if (now && side && now != side) {
            j->t->certain++;
            j->t->inner += is_inner;
            if (!has_hit(hits, j->is_opaque ? 0 : since, p->z[k], compute_depth_error(j, p, k - 1))) {
                j->t->missed++;
                return false;
            }
            if (j->is_opaque) return false;
        }
        if (now) side = now, since = p->z[k];
    }
    return true;
}

/* Returns half the width of the band. If tets overlap, the slopes of the terms of a sum add up, usually of three
 * terms. */
static double compute_error_band(const verify *j, const interval *ray_intervals, int count)
{
    double steepest = 0;
    for (int i = 0; i < count; i++) steepest = fmax(steepest, ray_intervals[i].slope);
    return 2e-6 * (j->s->high - j->s->low) + j->place * steepest * (j->s->is_star_shaped ? 1 : 3);
}

static void verify_ray(const verify *j, const reference_line *line, ray_hits *hits)
{
    static interval ray_intervals[REFERENCE_MAX_TRIANGLES];
    static double ends[2 * REFERENCE_MAX_TRIANGLES];
    static path p;
    const int count = find_intervals(j->s, line, ray_intervals, ends);
    int next = 0;
    bool goes_on = true;
    if (!count && !hits->count) return;
    if (reference_compute_edge_distance(&j->s->cell, line) < j->place) {
        j->t->at_edges++;
        return;
    }
    j->t->rays++;
    const double band = compute_error_band(j, ray_intervals, count);
    while (make_next_path(ray_intervals, count, ends, &next, &p)) {
        cut_at_eye(&p);
        if (!p.count) continue;
        mark_hits(j, &p, band, hits);
        goes_on = goes_on && verify_path(j, &p, band, hits);
    }
    for (int i = 0; i < hits->count; i++) j->t->wrong += !hits->is_good[i];
}

static void list_hits(const render_fixture *f, const drawn_frame *drawn, int64_t pixel, ray_hits *out)
{
    *out = (ray_hits){.count = 0};
    for (int64_t i = drawn->first[pixel]; i < drawn->first[pixel + 1] && out->count < REFERENCE_MAX_HITS; i++)
        out->z[out->count++] = fixture_compute_scene_depth(f, drawn->list.items[i].t_in);
}

/* ---- frames ---- */

/* Sets a random camera. Some cameras are inside the mesh, and some are orthographic. */
static void set_random_camera(render_fixture *f, uint64_t seed)
{
    const double angle = test_uniform_between(0, seed, 0, 6.283), height = test_uniform_between(1, seed, -0.9, 0.9);
    const double distance = seed % 8 == 7 ? 0.1 : 3, across = distance * sqrt(1 - height * height);
    const double eye[3] = {across * cos(angle), across * sin(angle), distance * height};
    const double target[3] = {test_uniform_between(2, seed, -0.02, 0.02), test_uniform_between(3, seed, -0.02, 0.02),
                              0};
    render_camera *c = &f->job.camera;
    assert_true(render_camera_look_at(c, eye, target, (const double[]){0, 0.1, 1}, 30, WIDTH, HEIGHT));
    c->is_orthographic = seed % 8 == 3;
    c->half_height = 0.8;
    f->job.space.depth_origin = seed % 8 == 7 ? 0 : distance;
}

static void verify_frame(const render_fixture *f, const double iso, tally *t)
{
    static subject s;
    drawn_frame drawn;
    make_subject(f, &s);
    const verify j = {.f = f,
                      .s = &s,
                      .iso = iso,
                      .place = 3e-6 / f->job.space.scale,
                      .is_opaque = f->surfaces[0].opacity >= 1,
                      .t = t};
    t->cells++;
    t->stars += s.is_star_shaped;
    fixture_draw(f, &drawn);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            ray_hits hits;
            list_hits(f, &drawn, (int64_t)y * WIDTH + x, &hits);
            const reference_line line = make_pixel_line(&f->job.camera, x, y);
            verify_ray(&j, &line, &hits);
        }
    drawn_frame_free(&drawn);
}

static void verify_cell(const test_mesh *mesh, uint64_t seed, tally *t)
{
    render_fixture f;
    const double values[1] = {test_uniform_between(4, seed, -0.6, 0.6)};
    fixture_create(&f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                   (const double[]){0, 0, 0});
    set_random_camera(&f, seed);
    fixture_add_surface(&f, values, 1, seed % 2 ? 1 : 0.4f);
    verify_frame(&f, values[0], t);
    fixture_free(&f);
}

static void assert_none_missed(const char *what, const tally *t)
{
    printf(
        "%s: %lld rays in %d cells, %d star-shaped: %lld certain crossings, %lld of them with both ends on one "
        "side; %lld missed, %lld hits that are none; %lld of %lld bends within the band, %lld rays at edges left out\n",
        what, (long long)t->rays, t->cells, t->stars, (long long)t->certain, (long long)t->inner, (long long)t->missed,
        (long long)t->wrong, (long long)t->in_band, (long long)t->bends, (long long)t->at_edges);
    assert_int_equal(t->missed, 0);
    assert_int_equal(t->wrong, 0);
    assert_true(t->inner > t->rays / 100);
    assert_true(100 * t->in_band < t->bends && 1000 * t->at_edges < t->rays);
}

static void random_polyhedra_miss_no_crossing(void **state)
{
    (void)state;
    for (test_random_polyhedron kind = 0; kind < TEST_RANDOM_COUNT; kind++) {
        tally t = {.rays = 0};
        for (uint64_t seed = 0; t.rays < wanted_rays / 4; seed++) {
            test_mesh mesh;
            test_mesh_make_random_polyhedron(kind, 1000 * kind + seed, &mesh);
            test_mesh_split_quads(&mesh);
            verify_cell(&mesh, seed, &t);
            test_mesh_free(&mesh);
        }
        assert_none_missed(test_random_polyhedron_name(kind), &t);
    }
}

/* Checks concave polyhedra, including prisms whose bases are not plane. */
static void concave_polyhedra_miss_no_crossing(void **state)
{
    tally t = {.rays = 0};
    (void)state;
    for (uint64_t seed = 0; t.rays < wanted_rays / 4; seed++) {
        test_mesh mesh;
        test_mesh_make_polyhedron((test_polyhedron_shape)(seed / 2 % TEST_POLYHEDRON_COUNT), test_linear_field, &mesh);
        for (uint64_t i = 0; i < (uint64_t)mesh.vertex_count; i++) {
            for (uint64_t a = 0; a < 3; a++)
                mesh.coordinates[3 * i + a] += test_uniform_between(3 * i + a, seed, -0.02, 0.02);
            mesh.values[i] = test_uniform_between(i, seed + 1000, -1, 1);
        }
        test_mesh_split_quads(&mesh);
        verify_cell(&mesh, seed, &t);
        test_mesh_free(&mesh);
    }
    assert_none_missed("concave cells", &t);
}

/* Returns whether the field on the ray is above the value at some depth. */
static bool is_value_crossed(const subject *s, const reference_line *line, double value)
{
    static interval ray_intervals[REFERENCE_MAX_TRIANGLES];
    static double ends[2 * REFERENCE_MAX_TRIANGLES];
    static path p;
    int next = 0;
    const int count = find_intervals(s, line, ray_intervals, ends);
    while (make_next_path(ray_intervals, count, ends, &next, &p))
        for (int k = 0; k < p.count; k++)
            if (p.v[k] > value) return true;
    return false;
}

/* Makes a prism in the shape of a hook whose centre is in its stem. The tets at the two sides of the hook, one of them
 * with a negative sign, extend through the stem. Values are -1 on the inner side, else 1, so that the sum at the stem's
 * wall is about 1 + 1.5 / 4 + 0.5 / 6. */
static void make_hook(test_mesh *out)
{
    static const double base[8][2] = {{-1.2, -0.5}, {0, -0.5},   {0, 0.3},   {0.3, 0.3},
                                      {0.3, -0.5},  {0.5, -0.5}, {0.5, 0.5}, {-1.2, 0.5}};
    test_mesh_make_polyhedron(TEST_U_PRISM, test_linear_field, out);
    for (int i = 0; i < 16; i++) {
        for (int a = 0; a < 2; a++) out->coordinates[3 * i + a] = base[i % 8][a];
        out->coordinates[3 * i + 1] = base[i % 8][1];
        out->values[i] = i % 8 == 3 || i % 8 == 4 ? -1 : 1;
    }
    test_mesh_split_quads(out);
}

/* Checks an isovalue that no vertex reaches but that the sum over overlapping tets exceeds. No surface may be drawn: by
 * definition, the tree does not find the cell for an isovalue beyond the range of its vertices' values. */
static void sums_beyond_the_vertices_show_no_surface(void **state)
{
    static const double value = 1.1;
    static subject s;
    test_mesh mesh;
    render_fixture f;
    drawn_frame drawn;
    int beyond = 0;
    (void)state;
    make_hook(&mesh);
    fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                   (const double[]){0, 0, 0});
    fixture_add_surface(&f, &value, 1, 0.4f);
    for (uint64_t seed = 0; seed < 16; seed++) {
        set_random_camera(&f, seed);
        make_subject(&f, &s);
        fixture_draw(&f, &drawn);
        assert_int_equal(drawn.list.count, 0);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const reference_line line = make_pixel_line(&f.job.camera, i % WIDTH, i / WIDTH);
            beyond += is_value_crossed(&s, &line, value);
        }
        drawn_frame_free(&drawn);
    }
    printf("%d rays pass values beyond those of the vertices\n", beyond);
    assert_true(beyond > 10);
    fixture_free(&f);
    test_mesh_free(&mesh);
}

int main(int argc, char **argv)
{
    if (fixture_isa_is_unavailable()) return 77;
    if (argc > 1) wanted_rays = atoll(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_polyhedra_miss_no_crossing),
        cmocka_unit_test(concave_polyhedra_miss_no_crossing),
        cmocka_unit_test(sums_beyond_the_vertices_show_no_surface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
