/* Checks clipping: every layer is drawn only in the region that the planes, boxes and spheres of a clip leave. Pictures
 * are compared with closed forms for the cube's surface, for isosurfaces that are planes, and for a medium of constant
 * opacity drawn by all methods. The clip belongs to the image, to each layer, or to one layer beside a layer that is
 * not clipped. Cells of every type are tested; if they are distributed at random, the picture is the same as on one
 * rank. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "test_session_fixture.h"
#include "test_session_view.h"

enum { SIDE = 3 };

#define CLIPPED(more, layers) IMAGE_BEGIN("%s" more) layers IMAGE_END

typedef struct half_space {
    double normal[3], distance;
} half_space;

static const half_space clips[] = {
    {{1. / 3, 2. / 3, 2. / 3}, 0.3}, {{-1, 0, 0}, 0.7}, {{1, 0, 0}, 5}, {{0, -1, 0}, 5}, {{0, 1, 0}, 0.8}};
static const half_space corner[] = {{{-1, 0, 0}, -0.1}, {{1, 0, 0}, 5},  {{0, -1, 0}, 0.2},
                                    {{0, 1, 0}, 5},     {{0, 0, -1}, 0}, {{0, 0, 1}, 5}};

/* The visible region: inside the half spaces and the ball, and outside the hole, a convex region that is cut out. */
typedef struct region {
    const char *text; /* text of the scene's clip */
    const half_space *planes, *hole;
    size_t plane_count, hole_count;
    double radius; /* radius of the ball; 0 if there is no ball */
    bool is_outside;
} region;

static const double ball[3] = {0.5, 0.4, 0.6};

static const region regions[] = {
    /* x + 2 y + 2 z <= 0.9, and a box that excludes x < -0.7 and y > 0.8. */
    {.text = "{planes: [{normal: [1, 2, 2], point: [0, 0, 0], offset: 0.3}], box: [[-0.7, -5, -5], [5, 0.8, 5]]}",
     .planes = clips,
     .plane_count = sizeof clips / sizeof *clips},
    {.text = "{sphere: {centre: [0.5, 0.4, 0.6], radius: 0.9}}", .radius = 0.9},
    {.text = "{sphere: {centre: [0.5, 0.4, 0.6], radius: 0.7}, keep: outside}", .radius = 0.7, .is_outside = true},
    {.text = "{box: [[0.1, -0.2, 0], [5, 5, 5]], keep: outside}",
     .hole = corner,
     .hole_count = sizeof corner / sizeof *corner}};
enum { REGIONS = sizeof regions / sizeof *regions };

static const half_space cube[] = {{{1, 0, 0}, 1},  {{-1, 0, 0}, 1}, {{0, 1, 0}, 1},
                                  {{0, -1, 0}, 1}, {{0, 0, 1}, 1},  {{0, 0, -1}, 1}};
/* The isosurface 0.2 of test_linear_field(), 0.3 x - 0.7 y + 0.5 z + 0.1. */
static const half_space linear = {{0.3, -0.7, 0.5}, 0.1};

static double intersect_half_space(const ray *r, const half_space *plane)
{
    return (plane->distance - dot_product(plane->normal, r->base)) / dot_product(plane->normal, r->direction);
}

typedef struct interval {
    double begin, end;
} interval;

static interval clip_interval(const ray *r, const half_space *planes, size_t count)
{
    interval out = {0, INFINITY};
    for (size_t i = 0; i < count; i++) {
        const double depth = intersect_half_space(r, &planes[i]);
        if (dot_product(planes[i].normal, r->direction) > 0)
            out.end = fmin(out.end, depth);
        else
            out.begin = fmax(out.begin, depth);
    }
    return out;
}

static interval intersect_ball(const ray *r, double radius)
{
    double from[3];
    for (int a = 0; a < 3; a++) from[a] = ball[a] - r->base[a];
    const double square = dot_product(r->direction, r->direction), nearest = dot_product(from, r->direction) / square;
    const double left = (radius * radius - dot_product(from, from)) / square + nearest * nearest;
    return left > 0 ? (interval){nearest - sqrt(left), nearest + sqrt(left)} : (interval){INFINITY, -INFINITY};
}

static interval intersect_intervals(interval a, interval b)
{
    return (interval){fmax(a.begin, b.begin), fmin(a.end, b.end)};
}

static interval compute_visible_interval(const region *g, const ray *r)
{
    const interval within = clip_interval(r, g->planes, g->plane_count);
    return g->radius > 0 && !g->is_outside ? intersect_intervals(within, intersect_ball(r, g->radius)) : within;
}

static interval compute_hole_interval(const region *g, const ray *r)
{
    if (g->is_outside) return intersect_ball(r, g->radius);
    return g->hole_count ? clip_interval(r, g->hole, g->hole_count) : (interval){INFINITY, -INFINITY};
}

static interval intersect_ray_with_cube(const ray *r)
{
    return clip_interval(r, cube, 6);
}

/* ---- the expected pictures ----------------------------------------------------------------------------------- */

enum { MOST = 3 };

static bool is_near_interval_end(double depth, interval s)
{
    return fabs(depth - s.begin) < 1e-4 || fabs(depth - s.end) < 1e-4;
}

/* Stores the depths of crossings that are inside the visible region, in their order. Returns their number, or -1 if a
 * crossing is so near the region's border that rounding decides. */
static int select_visible_depths(const region *g, const ray *r, const double *depths, int count, double out[MOST])
{
    const interval within = compute_visible_interval(g, r), hole = compute_hole_interval(g, r);
    int kept = 0;
    for (int i = 0; i < count; i++) {
        if (is_near_interval_end(depths[i], within) || is_near_interval_end(depths[i], hole)) return -1;
        if (depths[i] < within.begin || depths[i] > within.end) continue;
        if (depths[i] < hole.begin || depths[i] > hole.end) out[kept++] = depths[i];
    }
    return kept;
}

static int find_visible_cube_faces(const region *g, const ray *r, double out[MOST])
{
    const interval s = intersect_ray_with_cube(r);
    if (fabs(s.end - s.begin) < 1e-4) return -1;
    if (s.end < s.begin) return 0;
    const double depths[2] = {s.begin, s.end};
    return select_visible_depths(g, r, depths, 2, out);
}

static int find_visible_plane_hits(const region *g, const ray *r, double out[MOST])
{
    const interval s = intersect_ray_with_cube(r);
    const double depth = intersect_half_space(r, &linear);
    if (is_near_interval_end(depth, s)) return -1;
    if (!(depth > s.begin && depth < s.end)) return 0;
    return select_visible_depths(g, r, &depth, 1, out);
}

typedef int see_function(const region *g, const ray *r, double out[MOST]);

/* Checks surfaces of constant opacity: the depth of the nearest surface in each pixel, and the opacity that follows
 * from the number of surfaces. */
static bool has_surfaces(const caught_picture *picture, const region *g, see_function *see, double opacity)
{
    int hits = 0, behind = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        double depths[MOST];
        const int count = see(g, &r, depths);
        if (count < 0) continue;
        const double alpha = 1 - pow(1 - opacity, count), depth = count ? depths[0] : (double)INFINITY;
        const double own = (double)picture->depth[pixel];
        hits += count > 0;
        behind += count == 1;
        if (fabs((double)picture->rgba[4 * pixel + 3] - alpha) < 1e-6 &&
            (own == depth || fabs(own - depth) < 1.5e-5)) /* the tolerance derived in test_session_surfaces.c */
            continue;
        fprintf(stderr, "pixel %d: opacity %g, depth %g; expected %g, %g\n", pixel,
                (double)picture->rgba[4 * pixel + 3], own, alpha, depth);
        return false;
    }
    return hits > PIXELS / 60 && behind > PIXELS / 80;
}

static double compute_interval_length(interval s)
{
    return fmax(s.end - s.begin, 0);
}

/* Checks the opacity of a medium in which half of the light passes a length of 1. media: number of such media in the
 * same region. The library enlarges the visible region by 2e-6 of half the diagonal, which is 4e-6, and a ray's
 * interval by this over the cosine to the region's border. */
static bool has_expected_medium(const caught_picture *picture, const region *g, double media, double tolerance)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const ray r = make_pixel_ray(pixel);
        const interval within = intersect_intervals(intersect_ray_with_cube(&r), compute_visible_interval(g, &r));
        const double length = (compute_interval_length(within) -
                               compute_interval_length(intersect_intervals(within, compute_hole_interval(g, &r)))) *
                              sqrt(dot_product(r.direction, r.direction));
        const double alpha = 1 - pow(0.5, media * length), own = (double)picture->rgba[4 * pixel + 3];
        hits += alpha > 0.1;
        if (fabs(own - alpha) < tolerance) continue;
        fprintf(stderr, "pixel %d: opacity %g, expected %g\n", pixel, own, alpha);
        return false;
    }
    return hits > PIXELS / 20;
}

static bool has_transparent_cube_surface(const caught_picture *p, const region *g)
{
    return has_surfaces(p, g, find_visible_cube_faces, 0.5);
}
static bool is_cube(const caught_picture *p, const region *g)
{
    return has_surfaces(p, g, find_visible_cube_faces, 1);
}
static bool is_plane(const caught_picture *p, const region *g)
{
    return has_surfaces(p, g, find_visible_plane_hits, 1);
}
static bool has_transparent_isosurface_plane(const caught_picture *p, const region *g)
{
    return has_surfaces(p, g, find_visible_plane_hits, 0.25);
}
/* If a ray grazes the ball, the length of its interval has an error of about the square root of the ball's error: 0.004
 * for 4e-6. */
static bool is_exact_medium(const caught_picture *p, const region *g)
{
    return has_expected_medium(p, g, 1, g->radius > 0 ? 4e-3 : 1e-4);
}
/* One sampling step of 0.01 absorbs 0.0069 of the light. An interval can be wrong by a step at either end, and the hole
 * adds two ends. */
static bool is_sampled_medium(const caught_picture *p, const region *g)
{
    return has_expected_medium(p, g, 1, g->hole_count || g->is_outside ? 0.028 : 0.014);
}
static bool is_double_medium(const caught_picture *p, const region *g)
{
    return has_expected_medium(p, g, 2, g->radius > 0 ? 8e-3 : 2e-4);
}
static bool is_double_sampled_medium(const caught_picture *p, const region *g)
{
    return has_expected_medium(p, g, 2, g->hole_count || g->is_outside ? 0.056 : 0.028);
}

/* The format %s is replaced by the layer's own clip, if it has one. */
#define MEDIUM "      - volume: {field: f, range: [-9, 9], opacity: [[0, 0.5], [1, 0.5]], unit_distance: 1%s}\n"
/* An invisible layer without a clip, beside which the other layers' clip cannot be handled as the clip of the whole
 * image. */
#define WHOLE "      - isosurface: {field: f, values: [99]}\n"

typedef struct clip_case {
    const char *name, *scene;
    bool (*is_right)(const caught_picture *picture, const region *g);
    double tolerance; /* allowed difference between the pictures of one and of several ranks; 0: bit-identical */
} clip_case;

static const clip_case cases[] = {
    {"surface", CLIPPED("", "      - surface: {opacity: 1%s}\n"), is_cube, 0},
    {"clear surface", CLIPPED("", "      - surface: {opacity: 0.5%s}\n"), has_transparent_cube_surface, 0},
    {"isosurface", CLIPPED("", "      - isosurface: {field: f, values: [0.2]%s}\n"), is_plane, 0},
    {"coloured", CLIPPED("", "      - isosurface: {field: f, values: [0.2], colour_by: {field: f}%s}\n"), is_plane, 0},
    {"clear isosurface", CLIPPED("", "      - isosurface: {field: f, values: [0.2], opacity: 0.25%s}\n"),
     has_transparent_isosurface_plane, 0},
    {"to an error", CLIPPED("", MEDIUM), is_exact_medium, 1e-6},
    {"to a small error", CLIPPED("    sampling: {max_error: 1e-4}\n", MEDIUM), is_exact_medium, 1e-6},
    {"segments", CLIPPED("    sampling: {method: segments}\n", MEDIUM), is_exact_medium, 1e-6},
    {"samples", CLIPPED("    sampling: {step: 0.01}\n", MEDIUM), is_sampled_medium, 1e-6},
    {"two by segments", CLIPPED("    sampling: {method: segments}\n", MEDIUM MEDIUM), is_double_medium, 1e-6},
    {"two by samples", CLIPPED("    sampling: {step: 0.01}\n", MEDIUM MEDIUM), is_double_sampled_medium, 1e-6},
    {"clear surface in a medium", CLIPPED("", MEDIUM "      - isosurface: {field: f, values: [0.2], opacity: 0%s}\n"),
     is_exact_medium, 1e-6},
};
enum { CASES = sizeof cases / sizeof *cases };

/* Which part of the scene has the clip: the image, each layer, or each layer beside a layer that is not clipped. */
typedef enum clip_place { OF_IMAGE, OF_LAYERS, BESIDE_A_WHOLE, PLACES } clip_place;

static const char *write_clip_scene(const clip_case *c, const region *g, clip_place place)
{
    char text[2048], filled[2048], own[256] = "", all[256] = "";
    const char *outputs = strstr(c->scene, "    outputs");
    if (place == OF_IMAGE)
        snprintf(all, sizeof all, "    clip: %s\n", g->text);
    else
        snprintf(own, sizeof own, ", clip: %s", g->text);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(outputs - c->scene), c->scene, place == BESIDE_A_WHOLE ? WHOLE : "",
             outputs);
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
#pragma GCC diagnostic ignored "-Wformat-extra-args"
    snprintf(filled, sizeof filled, text, all, own, own);
#pragma GCC diagnostic pop
    return write_scene(filled);
}

static double largest_difference(const caught_picture *a, const caught_picture *b)
{
    double worst = 0;
    for (int i = 0; i < 4 * PIXELS; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    return memcmp(a->depth, b->depth, PIXELS * sizeof(float)) == 0 ? worst : (double)INFINITY;
}

static void verify_case(test_mesh_kind kind, const clip_case *c, const region *g, clip_place place,
                        const session_input inputs[2])
{
    const char *scene = write_clip_scene(c, g, place);
    caught_picture ours = draw_scene(MPI_COMM_WORLD, scene, &inputs[1]), alone = {0};
    bool is_well = true;
    if (own_rank == 0) {
        alone = draw_scene(MPI_COMM_SELF, scene, &inputs[0]);
        const double off = largest_difference(&ours, &alone);
        is_well = c->is_right(&alone, g) && off <= c->tolerance;
        if (!is_well)
            fprintf(stderr, "%s, %s, clip %s of %d: ranks are off by %g\n", test_mesh_kind_name(kind), c->name, g->text,
                    (int)place, off);
    }
    everywhere(is_well);
    free_caught(&ours);
    free_caught(&alone);
}

/* Checks each case with two pairs of a region and a clip_place. The pairs differ from one kind of mesh to the next, so
 * that every case is checked with all pairs over all kinds. */
static void verify_all(test_mesh_kind kind, const session_input inputs[2])
{
    for (int i = 0; i < CASES; i++)
        for (int turn = 0; turn < 2; turn++) {
            const int pair = (2 * (int)kind + turn + i) % (REGIONS * PLACES);
            verify_case(kind, &cases[i], &regions[pair / PLACES], (clip_place)(pair % PLACES), inputs);
        }
}

static void layers_are_clipped(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input inputs[2]; /* the whole mesh, and this rank's part */
        memset(inputs, 0, sizeof inputs);
        test_mesh_make_lattice(kind, SIDE, 0.2, test_linear_field, &inputs[0].part);
        input_describe(&inputs[0]);
        extract_own_cells(&inputs[0].part, TEST_RANDOM, SIDE, kind % 2, &inputs[1].part);
        input_describe(&inputs[1]);
        verify_all(kind, inputs);
        input_free(&inputs[0]);
        input_free(&inputs[1]);
    }
}

/* Checks that a slice that coincides with a clipping plane is visible, wherever it is inside the mesh, and is in front
 * of all else. */
static void slices_in_the_clipping_plane_are_visible(void **state)
{
    (void)state;
    static const clip_case slice = {
        .scene = CLIPPED("", "      - slice: {field: f, planes: [{normal: [-1, -2, -2], point: [0.9, 0, 0]}]}\n"
                             "      - surface: {}\n")};
    session_input in = {0};
    input_create(&in, TEST_MIXED, SIDE, TEST_RANDOM, own_rank, rank_count);
    caught_picture picture = draw_scene(MPI_COMM_WORLD, write_clip_scene(&slice, &regions[0], OF_IMAGE), &in);
    int hits = 0;
    bool is_well = true;
    for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++) {
        const ray r = make_pixel_ray(pixel);
        const interval s = intersect_ray_with_cube(&r), box = clip_interval(&r, clips + 1, 4);
        const double depth = intersect_half_space(&r, &clips[0]);
        if (!(depth > fmax(s.begin, box.begin) + 1e-4 && depth < fmin(s.end, box.end) - 1e-4)) continue;
        hits++;
        is_well = is_well && fabs((double)picture.depth[pixel] - depth) < 1.5e-5;
    }
    everywhere(own_rank != 0 || (is_well && hits > PIXELS / 20));
    free_caught(&picture);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(layers_are_clipped),
        cmocka_unit_test(slices_in_the_clipping_plane_are_visible),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
