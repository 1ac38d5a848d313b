/* Compares secondary rays, which begin at hits of surfaces, with brute force in double. For the comparison, each ray
 * becomes the only ray of a picture whose eye is the ray's origin, and the roots in every cell are computed. The test
 * covers all kinds of cells and every instruction set, rays towards lights and into the hemisphere, with and without
 * ignoring surfaces nearer than half a cell. Rays whose result may depend on rounding are excluded; there must be
 * few. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "render_light.h"
#include "test_effort.h"
#include "test_hemisphere.h"
#include "test_mesh_honeycomb.h"
#include "test_render_fixture.h"

enum { SIDE = 3, WIDTH = 17, HEIGHT = 13, SAMPLES = 16, LIGHTS = 2 };

static const double isovalues[2] = {0.1, 0.5};
static const double radius = 0.6;

typedef struct hits {
    fragment_list fragments;
    int64_t count;
    render_hit *hits;
    render_hit_rays *rays, *open;
} hits;

static void copy_hits(const render_fixture *f, hits *out)
{
    base_error error = {0};
    *out = (hits){0};
    assert_int_equal(render_frame(&f->job, &out->fragments, NULL, &error), INSITU_OK);
    const size_t most = (size_t)out->fragments.count + 1;
    out->hits = calloc(most, sizeof *out->hits);
    out->rays = calloc(most, sizeof *out->rays);
    out->open = calloc(most, sizeof *out->open);
    assert_true(out->hits && out->rays && out->open);
    for (int64_t i = 0; i < out->fragments.count; i++)
        out->count += render_make_hit_from_fragment(&f->job, &out->fragments.items[i], &out->hits[out->count],
                                                    &out->rays[out->count]);
    memcpy(out->open, out->rays, most * sizeof *out->rays);
}

static void free_hits(hits *h)
{
    base_free(h->fragments.items);
    free(h->hits);
    free(h->rays);
    free(h->open);
}

/* ---- rays in double ------------------------------------------------------------------------------------------ */

static void decode_normal(const float folded[2], double n[3])
{
    n[0] = (double)folded[0];
    n[1] = (double)folded[1];
    n[2] = 1 - fabs(n[0]) - fabs(n[1]);
    if (n[2] < 0) {
        n[0] = (1 - fabs((double)folded[1])) * (folded[0] < 0 ? -1 : 1);
        n[1] = (1 - fabs((double)folded[0])) * (folded[1] < 0 ? -1 : 1);
    }
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int a = 0; a < 3; a++) n[a] /= length;
}

static void compute_ray_start(const render_fixture *f, const render_hit *hit, const double n[3], double out[3])
{
    double base[3], direction[3];
    render_camera_ray(&f->job.camera, (int)(hit->pixel % WIDTH), (int)(hit->pixel / WIDTH), base, direction);
    for (int a = 0; a < 3; a++)
        out[a] =
            base[a] + fixture_compute_scene_depth(f, hit->t) * direction[a] + RENDER_LIFT / f->job.space.scale * n[a];
}

typedef struct tally {
    int64_t rays, blocked, undecided_rays, wrong;
} tally;

static void grow_box(const double place[3], double low[3], double high[3])
{
    for (int a = 0; a < 3; a++) {
        low[a] = fmin(low[a], place[a]);
        high[a] = fmax(high[a], place[a]);
    }
}

/* Returns the cube root of the volume of the cell's bounding box. */
static double compute_cell_size(const test_mesh *mesh, int64_t cell)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t i = mesh->offsets[cell]; i < mesh->offsets[cell + 1]; i++) {
        const int64_t entry = mesh->connectivity[i];
        if (mesh->types[cell] != GRID_POLYHEDRON) {
            grow_box(mesh->coordinates + 3 * entry, low, high);
            continue;
        }
        for (int64_t k = mesh->face_offsets[entry]; k < mesh->face_offsets[entry + 1]; k++)
            grow_box(mesh->coordinates + 3 * mesh->face_connectivity[k], low, high);
    }
    return cbrt((high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]));
}

/* Computes by brute force whether the ray meets a surface in front of its origin. Returns 1 if it does, 0 if not, -1 if
 * the result may depend on rounding. The root at the hit itself lies behind the origin, because the origin is lifted
 * off the surface by more than the error of the hit. */
static int is_blocked_by_brute_force(const render_fixture *f, const test_mesh *mesh, const double start[3],
                                     const double d[3], double reach)
{
    static const float nothing[4] = {0, 0, 0, 0};
    const double *across = fabs(d[1]) < 0.9 ? (const double[]){0, 1, 0} : (const double[]){1, 0, 0};
    const double lift = RENDER_LIFT / f->job.space.scale;
    render_job job = f->job;
    render_surface_layer clear = f->surfaces[0];
    reference_ray ray;
    double focal[3];
    bool is_met = false;
    for (int a = 0; a < 3; a++) focal[a] = start[a] + d[a];
    clear.opacity = 0.5F; /* surfaces are transparent, so that all hits are found, not only the first */
    job.surfaces = &clear;
    job.paint = RENDER_LIGHT;
    assert_true(render_camera_look_at(&job.camera, start, focal, across, 40, 1, 1));
    job.camera.is_orthographic = true;
    job.space.depth_origin = 0;
    reference_scene *scene = reference_create(&job);
    reference_trace(scene, 0, 0, nothing, &ray);
    reference_free(scene);
    if (ray.ambiguous || ray.map_failed || ray.edge_margin < 2e-5 || ray.value_margin < 2e-5) return -1;
    if (ray.eye_margin * f->cell_size < 0.4 * lift) return -1;
    for (int i = 0; i < ray.hit_count; i++) {
        const double depth = ray.hits[i].depth,
                     contact = (double)clear.contact * compute_cell_size(mesh, ray.hits[i].cell);
        if (fabs(depth - reach) < 1e-4 || (contact > 0 && fabs(depth - contact) < 1e-4)) return -1;
        is_met = is_met || (depth < reach && depth > contact);
    }
    return is_met;
}

static void count_ray_result(int said, bool is_open, const char *what, tally *t)
{
    t->rays++;
    t->blocked += said == 1;
    t->undecided_rays += said < 0;
    if (said < 0 || said != is_open) return;
    if (!t->wrong++) fprintf(stderr, "%s: %s\n", what, said ? "a blocked ray is open" : "an open ray is blocked");
}

static void verify_hit(const render_fixture *f, const test_mesh *mesh, const hits *h, int64_t i, const char *what,
                       tally *t)
{
    const render_hit *hit = &h->hits[i];
    double n[3], start[3], d[3];
    decode_normal(hit->normal, n);
    compute_ray_start(f, hit, n, start);
    for (int k = 0; k < SAMPLES; k += 3) {
        test_hemisphere_direction(hit->pixel, WIDTH, SAMPLES, k, n, d);
        count_ray_result(is_blocked_by_brute_force(f, mesh, start, d, radius), h->open[i].samples >> k & 1, what, t);
    }
    for (int k = 0; k < LIGHTS; k++)
        if (h->rays[i].lights >> k & 1)
            count_ray_result(is_blocked_by_brute_force(f, mesh, start, f->lights[k].direction, INFINITY),
                             h->open[i].lights >> k & 1, what, t);
}

static void verify_mesh(const test_mesh *mesh, fixture_camera camera, float contact, const char *what)
{
    static const render_occlusion occlusion = {3, SAMPLES, 0.6};
    render_fixture f;
    fixture_create(&f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / SIDE, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(&f, camera, WIDTH, HEIGHT);
    fixture_add_surface(&f, isovalues, 2, 1);
    f.surfaces[0].contact = contact;
    f.job.paint = RENDER_UNLIT;
    f.job.occlusion = &occlusion;
    assert_int_equal(f.job.light_count, LIGHTS);
    for (int set = 0; set < fixture_isa_count(); set++) {
        base_error error = {0};
        tally t = {0};
        hits h;
        fixture_select_isa(set);
        copy_hits(&f, &h);
        render_occluders *occluders;
        assert_int_equal(render_occluders_create(&f.job, &occluders, &error), INSITU_OK);
        assert_int_equal(render_clear_blocked_rays(occluders, h.hits, h.open, h.count, &error), INSITU_OK);
        render_occluders_free(occluders);
        for (int64_t i = 0; i < h.count; i++)
            if (test_is_long_run() || i % (set + 1 == fixture_isa_count() ? 2 : 7) == 0)
                verify_hit(&f, mesh, &h, i, what, &t);
        free_hits(&h);
        if (t.wrong || t.undecided_rays * 4 > t.rays || t.blocked < t.rays / 20 || t.rays < 50)
            fail_msg("%s, %s: of %lld rays %lld blocked, %lld unsure, %lld wrong", what, fixture_isa_name(set),
                     (long long)t.rays, (long long)t.blocked, (long long)t.undecided_rays, (long long)t.wrong);
    }
    fixture_free(&f);
}

static void occlusion_of_lattices_matches_brute_force(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, &mesh);
        verify_mesh(&mesh, kind % 2 ? CAMERA_ORTHOGRAPHIC : CAMERA_OUTSIDE, 0, test_mesh_kind_name(kind));
        verify_mesh(&mesh, kind % 2 ? CAMERA_INSIDE : CAMERA_ORTHOGRAPHIC, 0.5F, test_mesh_kind_name(kind));
        test_mesh_free(&mesh);
    }
}

static void occlusion_of_honeycombs_matches_brute_force(void **state)
{
    test_mesh mesh;
    (void)state;
    test_mesh_make_honeycomb(SIDE, 0.2, test_wave_field, &mesh);
    verify_mesh(&mesh, CAMERA_OUTSIDE, 0, "honeycomb");
    verify_mesh(&mesh, CAMERA_ORTHOGRAPHIC, 0.5F, "honeycomb");
    test_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(occlusion_of_lattices_matches_brute_force),
        cmocka_unit_test(occlusion_of_honeycombs_matches_brute_force),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
