/* Where robust roots lie and what their normals are, through whole frames: on warped lattices of hexes, wedges and
 * pyramids, on ugly single cells, and by closed forms. */
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double three_values[3] = {-0.6, 0.3, 0.95};
static const test_mesh_kind kinds[3] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS};

/* What a ray's hits were, over a test. */
typedef struct tally {
    int64_t rays, hits, excluded, folded, different, beyond;
    double residual, depth, normal; /* the worst */
} tally;

static int hits_of(const drawn_frame *drawn, int64_t pixel, const fragment *hits[REFERENCE_MAX_HITS])
{
    int count = 0;
    for (int64_t i = drawn->first[pixel]; i < drawn->first[pixel + 1] && count < REFERENCE_MAX_HITS; i++)
        if (drawn->list.items[i].kind >= FRAGMENT_SURFACE) hits[count++] = &drawn->list.items[i];
    return count;
}

/* The hit's float32 t is off by half a unit of 1 in scaled units, and so is each vertex's depth; the slope turns that
 * into values. */
static double residual_allowed(const render_fixture *f, double slope)
{
    return 1e-6 + (3e-8 + 3e-8) / f->job.space.scale * fabs(slope);
}

static void judge_hit(const render_fixture *f, const reference_scene *scene, int x, int y, const reference_hit *truth,
                      const fragment *hit, tally *t)
{
    double slope;
    const double depth = fixture_depth(f, hit->t_in);
    const double residual = fabs(reference_residual(scene, x, y, truth, depth, &slope, NULL));
    t->hits++;
    t->beyond += residual > 1e-6;
    t->residual = fmax(t->residual, residual - residual_allowed(f, slope) + 1e-6);
    /* An error of the field of 1e-6 ranges is one of depth by the slope. */
    const double grazing = 1e-6 / fabs(slope) / f->cell_size;
    t->depth = fmax(t->depth, fabs(depth - truth->depth) / f->cell_size - grazing);
}

static void judge_ray(const render_fixture *f, const drawn_frame *drawn, const reference_scene *scene, int x, int y,
                      double margin, tally *t)
{
    const fragment *hits[REFERENCE_MAX_HITS];
    reference_ray ray;
    reference_trace(scene, x, y, fixture_background, &ray);
    t->rays++;
    if (ray.edge_margin < margin || ray.value_margin < margin || ray.eye_margin < margin) {
        t->excluded++;
        return;
    }
    if (ray.ambiguous || ray.map_failed) {
        t->folded++;
        return;
    }
    const int count = hits_of(drawn, (int64_t)y * f->job.camera.width + x, hits);
    bool same = count == ray.hit_count;
    for (int i = 0; same && i < count; i++) same = hits[i]->kind - FRAGMENT_SURFACE == (uint32_t)ray.hits[i].surface;
    if (!same) {
        t->different++;
        fprintf(stderr, "pixel %d, %d: %d hits, reference %d\n", x, y, count, ray.hit_count);
        return;
    }
    for (int i = 0; i < count; i++) judge_hit(f, scene, x, y, &ray.hits[i], hits[i], t);
}

static void judge_frame(const render_fixture *f, double margin, tally *t)
{
    drawn_frame drawn;
    reference_scene *scene = reference_create(&f->job);
    fixture_draw(f, &drawn);
    for (int y = 0; y < f->job.camera.height; y++)
        for (int x = 0; x < f->job.camera.width; x++) judge_ray(f, &drawn, scene, x, y, margin, t);
    reference_free(scene);
    drawn_free(&drawn);
}

static void tell(const char *what, const tally *t)
{
    printf("%s: %d rays, %d hits, %d excluded, %d folded, %d different; residual %.2g (%d beyond 1e-6), depth %.2g\n",
           what, (int)t->rays, (int)t->hits, (int)t->excluded, (int)t->folded, (int)t->different, t->residual,
           (int)t->beyond, t->depth);
}

static void add_robust(render_fixture *f, float opacity)
{
    fixture_add_surface(f, three_values, 3, opacity);
    f->surfaces[0].root = RENDER_ROBUST;
}

static void robust_hits_are_on_the_surface(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++) {
            render_fixture f;
            tally t = {.rays = 0};
            fixture_create_lattice(&f, kinds[k], kinds[k] == TEST_PYRAMIDS ? 3 : 4, 0.2, test_wave);
            fixture_look(&f, camera, 53, 45);
            add_robust(&f, 0.4f); /* all crossings, not the first alone */
            judge_frame(&f, 1e-6, &t);
            tell(test_mesh_kind_name(kinds[k]), &t);
            assert_true(t.hits > 600);
            assert_int_equal(t.different, 0);
            assert_true(t.residual <= 1e-6);
            assert_true(t.depth <= 1e-5);
            assert_true(t.excluded * 200 < t.rays);
            fixture_free(&f);
        }
}

/* ---- ugly cells ---- */

typedef enum ugly { UGLY_WARPED, UGLY_CONCAVE, UGLY_WEDGE, UGLY_APEX, UGLY_COUNT } ugly;

static double uniform(uint64_t n, uint64_t seed, double low, double high)
{
    return low + (high - low) * test_uniform(n, seed);
}

static void make_ugly(ugly kind, uint64_t seed, test_mesh *out)
{
    static const test_cell_shape shapes[UGLY_COUNT] = {TEST_UNIT_HEX, TEST_UNIT_HEX, TEST_UNIT_WEDGE,
                                                       TEST_UNIT_PYRAMID};
    test_mesh_single(shapes[kind], test_linear, out);
    for (uint64_t i = 0; i < (uint64_t)out->vertex_count; i++) {
        double *p = out->coordinates + 3 * i;
        const double amount = kind == UGLY_WARPED || kind == UGLY_APEX ? 0.2 : 0.1;
        for (uint64_t a = 0; a < 3; a++) p[a] += uniform(3 * i + a, seed, -amount, amount);
        out->values[i] = uniform(i, seed + 1000, -1, 1.5);
        /* A corner pulled in almost to the plane of its neighbours: dents on both sides of its edges. Beyond that plane
         * the hex's map folds, and a point has several values. */
        if (kind == UGLY_CONCAVE && i == 6)
            for (uint64_t a = 0; a < 3; a++) p[a] = uniform(a, seed + 2000, 0.24, 0.3);
        if (kind == UGLY_WEDGE && i >= 3) {
            const double angle = uniform(0, seed + 3000, -0.8, 0.8), x = p[0], y = p[1];
            p[0] = cos(angle) * x - sin(angle) * y;
            p[1] = sin(angle) * x + cos(angle) * y;
        }
    }
}

static void robust_hits_in_ugly_cells_are_the_reference(void **state)
{
    (void)state;
    static const char *const names[UGLY_COUNT] = {"warped hexes", "concave hexes", "twisted wedges", "pyramid apexes"};
    for (ugly kind = 0; kind < UGLY_COUNT; kind++) {
        tally t = {.rays = 0};
        for (uint64_t seed = 0; seed < 24; seed++) {
            test_mesh mesh;
            render_fixture f;
            make_ugly(kind, seed, &mesh);
            fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                           (const double[]){0, 0, 0});
            fixture_look(&f, seed % 2 ? CAMERA_ORTHOGRAPHIC : CAMERA_OUTSIDE, 31, 29);
            /* Close to the apex: the middle of the picture is its neighbourhood. */
            if (kind == UGLY_APEX)
                assert_true(render_camera_look_at(&f.job.camera, (const double[]){2.4, 1.6, 3.0},
                                                  mesh.coordinates + 3 * 4, (const double[]){0, 1, 0}, 2, 31, 29));
            add_robust(&f, 0.4f);
            judge_frame(&f, 1e-6, &t);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
        tell(names[kind], &t);
        assert_true(t.hits > 800);
        assert_int_equal(t.different, 0);
        assert_true(t.residual <= 1e-6);
        assert_true(t.depth <= 1e-5);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(robust_hits_are_on_the_surface),
        cmocka_unit_test(robust_hits_in_ugly_cells_are_the_reference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
