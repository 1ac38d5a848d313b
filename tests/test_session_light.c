/* Checks shadows and ambient occlusion. Outlines of shadows have closed forms: a disk, cut from a slice by a spherical
 * clip, casts an ellipse on another slice, and an isosurface that is a plane darkens everything behind it. Ambient
 * occlusion in a corner of two planes, whose closed form is a segment of a disk, and in a valley of an isosurface is
 * compared ray by ray with planes in double. All pictures must be bit-identical for any partition, for all kinds of
 * cells. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "test_effort.h"
#include "test_hemisphere.h"
#include "test_session_fixture.h"

enum { SIDE = 4, WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT, SAMPLES = 16 };

static const double eye[3] = {3, 2.2, 4};
#define IMAGE(more, layers)                                                                                            \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 0, 0, 0]\n"                                         \
    "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n" more "    layers:\n" layers                   \
    "    outputs: [{path: a.exr, data: true}]\n"

/* ---- pictures ------------------------------------------------------------------------------------------------ */

static caught_picture draw_lit_scene(MPI_Comm comm, const char *scene, const session_input *in)
{
    insitu_session *session = NULL;
    assert_int_equal(insitu_create_from_text(comm, scene, &session), INSITU_OK);
    return submit_and_draw(&session, in);
}

static void make_camera_ray(int pixel, double base[3], double direction[3])
{
    render_camera camera;
    render_camera_look_at(&camera, eye, (const double[]){0, 0, 0}, (const double[]){0, 1, 0}, 40, WIDTH, HEIGHT);
    render_camera_ray(&camera, pixel % WIDTH, pixel / WIDTH, base, direction);
}

/* Computes the position on the pixel's ray at a depth. */
static void compute_ray_position(int pixel, double depth, double out[3])
{
    double base[3], direction[3];
    make_camera_ray(pixel, base, direction);
    for (int a = 0; a < 3; a++) out[a] = base[a] + depth * direction[a];
}

static void decode_normal(const caught_picture *picture, int pixel, double out[3])
{
    for (int a = 0; a < 3; a++) out[a] = (double)picture->data[a * PIXELS + pixel];
}

/* Makes the part of one rank of `count`, from a mesh with jitter. A count of 1 gives the whole mesh. */
static void make_jittered_part(session_input *in, test_mesh_kind kind, double jitter, test_function *f,
                               test_partition_kind distributed, int rank, int count)
{
    test_mesh whole;
    test_mesh_make_lattice(kind, SIDE, jitter, f, &whole);
    int *owners = calloc((size_t)whole.cell_count, sizeof *owners);
    assert_non_null(owners);
    test_partition_cells(&whole, distributed, SIDE, count, owners);
    test_mesh_extract_part(&whole, owners, rank, &in->part);
    free(owners);
    test_mesh_free(&whole);
    input_describe(in);
}

static void make_part(session_input *in, test_mesh_kind kind, test_function *f, test_partition_kind distributed,
                      int rank, int count)
{
    make_jittered_part(in, kind, 0.2, f, distributed, rank, count);
}

/* ---- shadows in closed form ---------------------------------------------------------------------------------- */

/* A floor, a disk above it, and light from the side. The material has an ambient coefficient of 0.2 and a diffuse one
 * of 0.8. */
static const double to_light[3] = {2. / 7, 6. / 7, 3. / 7};
#define FLOOR                                                                                                          \
    "      - slice: {field: f, map: {colours: [[0.5, 0.5, 0.5], [1, 1, 1]]}, planes: [{normal: [0, 1, 0], point: [0, " \
    "-0.5, 0]}], " MATTE "}\n"
#define MATTE "material: {ambient: 0.2, diffuse: 0.8, specular: 0}"
#define DISK(more)                                                                                                     \
    "      - slice: {field: f, map: {colours: [[0.5, 0.5, 0.5], [1, 1, 1]]}, planes: [{normal: [0, 1, 0], point: [0, " \
    "0.25, 0]}], " MATTE ", clip: {sphere: {centre: [0.1, 0.25, -0.2], radius: 0.5}}" more "}\n"
#define LIGHT(more) "    lights: [{direction: [2, 6, 3], in: world" more "}]\n"

/* Returns 1 if the floor is lit in this pixel, 0 if it is in shadow, and -1 if rounding decides or the pixel does not
 * show the floor. */
static int compute_floor_light(int pixel, double depth)
{
    double place[3], across = 0;
    compute_ray_position(pixel, depth, place);
    if (fabs(place[1] + 0.5) > 1e-5) return -1;
    const double rise = 0.75 / to_light[1];
    const double at[2] = {place[0] + rise * to_light[0] - 0.1, place[2] + rise * to_light[2] + 0.2};
    if (fabs(place[0] + rise * to_light[0]) > 0.999 || fabs(place[2] + rise * to_light[2]) > 0.999) return 1;
    across = hypot(at[0], at[1]);
    return fabs(across - 0.5) < 1e-4 ? -1 : across > 0.5;
}

typedef struct tally {
    int lit, dark, wrong;
} tally;

/* Counts pixels in which the floor is lit, dark or wrong. lit is the picture without shadows, to which brightness is
 * relative. */
static tally verify_floor(const caught_picture *shadowed, const caught_picture *lit)
{
    tally out = {0};
    const double full = 0.2 + 0.8 * to_light[1];
    for (int p = 0; p < PIXELS; p++) {
        const double depth = (double)shadowed->depth[p];
        const int light = isfinite(depth) ? compute_floor_light(p, depth) : -1;
        if (light < 0) continue;
        out.lit += light;
        out.dark += !light;
        const double expected = (double)lit->rgba[4 * p] / full * (light ? full : 0.2);
        if (fabs((double)shadowed->rgba[4 * p] - expected) <= 1e-6) continue;
        if (!out.wrong++)
            fprintf(stderr, "pixel %d at depth %g: %g, expected %g\n", p, depth, (double)shadowed->rgba[4 * p],
                    expected);
    }
    return out;
}

static tally draw_floor(test_mesh_kind kind, const char *scene, const char *lit_scene)
{
    session_input in = {0};
    tally out = {0};
    make_part(&in, kind, test_linear_field, TEST_RANDOM, own_rank, rank_count);
    caught_picture shadowed = draw_lit_scene(MPI_COMM_WORLD, scene, &in),
                   lit = draw_lit_scene(MPI_COMM_WORLD, lit_scene, &in);
    if (own_rank == 0) out = verify_floor(&shadowed, &lit);
    free_caught(&shadowed);
    free_caught(&lit);
    input_free(&in);
    return out;
}

static void shadows_of_disks_are_ellipses(void **context)
{
    (void)context;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        const tally t =
            draw_floor(kind, IMAGE(LIGHT("") "    shadows: true\n", FLOOR DISK("")), IMAGE(LIGHT(""), FLOOR DISK("")));
        const bool is_right = own_rank != 0 || (t.wrong == 0 && t.lit > 100 && t.dark > 15);
        if (!is_right)
            fprintf(stderr, "%s: %d lit, %d dark, %d wrong\n", test_mesh_kind_name(kind), t.lit, t.dark, t.wrong);
        everywhere(is_right);
    }
}

/* A light below the floor. The half vector between the directions to the eye and to the light is the floor's normal, so
 * that a highlight would appear if the light's side were ignored. */
#define BELOW(more) "    lights: [{direction: [-3, -0.3, -4], in: world" more "}]\n"
#define GLOSSY                                                                                                         \
    "      - slice: {field: f, planes: [{normal: [0, 1, 0], point: [0, -0.5, 0]}],\n"                                  \
    "                material: {ambient: 0.2, diffuse: 0.4, specular: 1, shininess: 2}}\n"

/* Checks that these do not change the picture: the shadow of a transparent disk, the shadow of a disk that is clipped
 * away, a light without shadows, and a light below the floor, which causes neither shadow nor highlight. */
static void transparent_layers_cast_no_shadow(void **context)
{
    static const char *const scenes[][2] = {
        {IMAGE(LIGHT("") "    shadows: true\n", FLOOR DISK(", opacity: 0.5")),
         IMAGE(LIGHT(""), FLOOR DISK(", opacity: 0.5"))},
        {IMAGE(LIGHT(", shadows: false") "    shadows: true\n    ambient_occlusion: {radius: 1e-3}\n", FLOOR DISK("")),
         IMAGE(LIGHT(""), FLOOR DISK(""))},
        {IMAGE(LIGHT("") "    shadows: true\n    clip: {planes: [{normal: [0, 1, 0], point: [0, 0, 0]}]}\n",
               FLOOR DISK("")),
         IMAGE(LIGHT("") "    clip: {planes: [{normal: [0, 1, 0], point: [0, 0, 0]}]}\n", FLOOR DISK(""))},
        {IMAGE(BELOW(", shadows: false") "    shadows: true\n    ambient_occlusion: {radius: 1e-3}\n", GLOSSY),
         IMAGE(BELOW(", intensity: 0"), GLOSSY)},
    };
    (void)context;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        session_input in = {0};
        double worst = 0;
        make_part(&in, TEST_MIXED, test_linear_field, TEST_RANDOM, own_rank, rank_count);
        caught_picture shadowed = draw_lit_scene(MPI_COMM_WORLD, scenes[i][0], &in),
                       lit = draw_lit_scene(MPI_COMM_WORLD, scenes[i][1], &in);
        for (int k = 0; k < 4 * PIXELS && own_rank == 0; k++)
            worst = fmax(worst, fabs((double)shadowed.rgba[k] - (double)lit.rgba[k]));
        free_caught(&shadowed);
        free_caught(&lit);
        input_free(&in);
        /* The test shades in double and the library in float: products of a few numbers below 1 differ by 5e-7. */
        if (worst > 5e-7) fprintf(stderr, "scene %zu: off by %g\n", i, worst);
        everywhere(worst <= 5e-7);
    }
}

/* ---- the same rays in double --------------------------------------------------------------------------------- */

#define BARE "material: {ambient: 0.6, diffuse: 0.1, specular: 0}"
#define DARK "    lights: [{direction: [0, 0, 1], intensity: 0}]\n"

/* Two perpendicular planes, of which the parts inside the cube occlude. */
typedef struct corner {
    struct {
        double normal[3], distance;
    } planes[2];
    double least; /* a surface nearer than this distance may occlude or not */
} corner;

static const corner slices = {{{{0, 0.8, 0.6}, -0.4}, {{0.8, -0.36, 0.48}, -0.3}}, 0};
static const double radius = 0.4;

static double compute_height_above_plane(const corner *c, int plane, const double place[3])
{
    const double *n = c->planes[plane].normal;
    return n[0] * place[0] + n[1] * place[1] + n[2] * place[2] - c->planes[plane].distance;
}

/* Returns 1 if the ray meets one of the planes within the radius, 0 if it does not, and -1 if rounding decides or the
 * hit is nearer than the corner's least distance. */
static int is_blocked_by_corner(const corner *c, const double from[3], const double d[3])
{
    for (int i = 0; i < 2; i++) {
        const double ahead[3] = {from[0] + d[0], from[1] + d[1], from[2] + d[2]};
        const double height = compute_height_above_plane(c, i, from),
                     way = height / (height - compute_height_above_plane(c, i, ahead));
        double most = 0;
        if (fabs(height) < 1e-5) continue; /* the ray begins on this plane */
        if (fabs(way - radius) < 1e-4) return -1;
        if (!(way > 0 && way < radius)) continue;
        for (int a = 0; a < 3; a++) most = fmax(most, fabs(from[a] + way * d[a]));
        if (fabs(most - 1) < 1e-4) return -1;
        if (most < 1) return way < c->least ? -1 : 1;
    }
    return 0;
}

typedef struct sky {
    int pixels, wrong, undecided_rays;
    double sum; /* sum over the pixels of the fraction of rays that are not occluded, as drawn */
} sky;

/* Compares pictures lit by ambient light only: `drawn` must be `plain`, the picture without occlusion, times the
 * fraction of rays that are not occluded. */
static sky verify_ambient_occlusion(const corner *c, const caught_picture *drawn, const caught_picture *plain)
{
    sky out = {0};
    for (int p = 0; p < PIXELS; p++) {
        double place[3], n[3], d[3];
        int open = 0, undecided_rays = 0;
        if (!isfinite(drawn->depth[p])) continue;
        compute_ray_position(p, (double)drawn->depth[p], place);
        decode_normal(drawn, p, n);
        for (int k = 0; k < SAMPLES; k++) {
            test_hemisphere_direction((uint32_t)p, WIDTH, SAMPLES, k, n, d);
            const int blocked = is_blocked_by_corner(c, place, d);
            open += blocked == 0;
            undecided_rays += blocked < 0;
        }
        const double share = (double)drawn->rgba[4 * p] / (double)plain->rgba[4 * p], counted = SAMPLES * share;
        out.pixels++;
        out.undecided_rays += undecided_rays > 0;
        out.sum += share;
        if (fabs(counted - round(counted)) < 1e-4 && round(counted) >= open && round(counted) <= open + undecided_rays)
            continue;
        if (!out.wrong++)
            fprintf(stderr, "pixel %d: %.6g open, expected %d to %d\n", p, counted, open, open + undecided_rays);
    }
    return out;
}

static void ambient_occlusion_of_corners_matches_disk_segments(void **context)
{
#define CORNER                                                                                                         \
    "      - slice: {field: f, map: {colours: [[0.5, 0.5, 0.5], [1, 1, 1]]}, planes:\n"                                \
    "          [{normal: [0, 0.8, 0.6], point: [0, 0, 0], offset: -0.4},\n"                                            \
    "           {normal: [0.8, -0.36, 0.48], point: [0, 0, 0], offset: -0.3}], " BARE "}\n"
    (void)context;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in = {0};
        make_part(&in, kind, test_linear_field, TEST_RANDOM, own_rank, rank_count);
        caught_picture drawn = draw_lit_scene(
            MPI_COMM_WORLD, IMAGE(DARK "    ambient_occlusion: {samples: 16, radius: 0.4}\n", CORNER), &in);
        caught_picture plain = draw_lit_scene(MPI_COMM_WORLD, IMAGE(DARK, CORNER), &in);
        bool is_right = true;
        if (own_rank == 0) {
            const sky s = verify_ambient_occlusion(&slices, &drawn, &plain);
            double expected = 0;
            int count = 0;
            for (int p = 0; p < PIXELS; p++) {
                double at[3];
                if (!isfinite(drawn.depth[p])) continue;
                compute_ray_position(p, (double)drawn.depth[p], at);
                /* The angle follows from the distance to the plane that does not contain the position, so the larger
                 * distance is used. */
                const double ratio = fmax(fabs(compute_height_above_plane(&slices, 0, at)),
                                          fabs(compute_height_above_plane(&slices, 1, at))) /
                                     radius;
                expected += ratio < 1 ? 1 - (acos(ratio) - ratio * sqrt(1 - ratio * ratio)) / acos(-1.0) : 1;
                count++;
            }
            /* The error of a pixel's fraction is at most that of 16 independent rays, 1/8. The error of the mean over
             * the pixels is smaller by the square root of their number; five times that is allowed. Another 0.02 is
             * added because the planes end at the cube's faces, which matters in at most a tenth of the pixels. */
            const double off = fabs(s.sum - expected) / count;
            is_right = s.wrong == 0 && s.pixels > 200 && s.undecided_rays < s.pixels / 10 &&
                       off < 5 * 0.125 / sqrt(count) + 0.02;
            if (!is_right)
                fprintf(stderr, "%s: %d pixels, %d wrong, %d unsure, mean off by %g\n", test_mesh_kind_name(kind),
                        s.pixels, s.wrong, s.undecided_rays, off);
        }
        free_caught(&drawn);
        free_caught(&plain);
        input_free(&in);
        everywhere(is_right);
    }
}

#define VALLEY "      - isosurface: {field: f, values: [-0.3], " BARE "}\n"

/* A valley along y. Its bottom coincides with faces of cells, so that for most kinds of cells the field is linear in
 * every cell, and the isosurface consists of two planes. */
static double compute_valley_field(const double p[3])
{
    return p[2] - fabs(p[0]);
}

/* Checks ambient occlusion in valleys. Cells are up to half a unit wide. Parts of an isosurface that are nearer than a
 * fifth of a cell's width need not occlude (session_layers.c), but everything farther must. This includes the pixels
 * counted as `near`, for which the valley's other side is just beyond that distance. */
static void ambient_occlusion_darkens_valleys(void **context)
{
    static const double root = 0.70710678118654752;
    const corner valley = {{{{-root, 0, root}, -0.3 * root}, {{root, 0, root}, -0.3 * root}}, 0.2 * 2.0 / SIDE};
    (void)context;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        session_input in = {0};
        if (kind == TEST_POLYHEDRA) continue; /* some polyhedra have parts on both sides of the bottom */
        make_jittered_part(&in, kind, 0, compute_valley_field, TEST_RANDOM, own_rank, rank_count);
        caught_picture drawn = draw_lit_scene(
            MPI_COMM_WORLD, IMAGE(DARK "    ambient_occlusion: {samples: 16, radius: 0.4}\n", VALLEY), &in);
        caught_picture plain = draw_lit_scene(MPI_COMM_WORLD, IMAGE(DARK, VALLEY), &in);
        bool is_right = true;
        if (own_rank == 0) {
            const sky s = verify_ambient_occlusion(&valley, &drawn, &plain);
            int near = 0;
            for (int p = 0; p < PIXELS; p++) {
                double at[3];
                if (!isfinite(drawn.depth[p])) continue;
                compute_ray_position(p, (double)drawn.depth[p], at);
                const double height =
                    fmax(compute_height_above_plane(&valley, 0, at), compute_height_above_plane(&valley, 1, at));
                near += height > valley.least && height < 2 * valley.least;
            }
            is_right = s.wrong == 0 && s.pixels > 200 && near > 12 && s.undecided_rays < s.pixels / 10;
            if (!is_right)
                fprintf(stderr, "%s: %d pixels, %d wrong, %d unsure, %d near\n", test_mesh_kind_name(kind), s.pixels,
                        s.wrong, s.undecided_rays, near);
        }
        free_caught(&drawn);
        free_caught(&plain);
        input_free(&in);
        everywhere(is_right);
    }
}

/* ---- any partition ------------------------------------------------------------------------------------------- */

#define EVERYTHING                                                                                                     \
    IMAGE("    shadows: true\n    ambient_occlusion: {samples: 9, radius: 0.8}\n    antialias: 2\n",                   \
          "      - isosurface: {field: f, values: [0.1, 0.6]}\n"                                                       \
          "      - isosurface: {field: f, values: [-0.3], opacity: 0.4, normals: vertex}\n"                            \
          "      - slice: {field: f, planes: [{normal: [0, 1, 0], point: [0, -0.6, 0]}], material: {}}\n"              \
          "      - surface: {colour_by: {field: f}, clip: {planes: [{normal: [1, 1, 1], point: [-0.2, -0.2, "          \
          "-0.2]}]}}\n")
#define WITH_VOLUME                                                                                                    \
    IMAGE("    shadows: true\n    ambient_occlusion: {}\n    clip: {sphere: {centre: [0, 0, 0], radius: 1.2}}\n",      \
          "      - isosurface: {field: f, values: [0.3]}\n"                                                            \
          "      - volume: {field: f, opacity: [[0, 0], [1, 0.4]]}\n")

static double largest_difference(const caught_picture *a, const caught_picture *b)
{
    double worst = 0;
    for (int i = 0; i < 4 * PIXELS; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    for (int i = 0; i < PIXELS; i++)
        if (memcmp(&a->depth[i], &b->depth[i], sizeof *a->depth) != 0) return INFINITY;
    return worst;
}

/* Compares the picture that all ranks draw together with the one that rank 0 draws from the whole mesh. most: the
 * largest allowed difference; 0 if the scene has only surfaces, which are bit-identical. */
static void verify_partition(const char *scene, const session_input *whole, const session_input *part, double most,
                             const char *what)
{
    double off = 0;
    caught_picture distributed = draw_lit_scene(MPI_COMM_WORLD, scene, part);
    if (own_rank == 0) {
        caught_picture alone = draw_lit_scene(MPI_COMM_SELF, scene, whole);
        off = largest_difference(&distributed, &alone);
        free_caught(&alone);
    }
    free_caught(&distributed);
    if (!(off <= most)) fprintf(stderr, "%s, %d ranks: off by %g\n", what, rank_count, off);
    everywhere(off <= most);
}

static void lit_pictures_are_the_same_on_any_partition(void **context)
{
    (void)context;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind distributed = 0; distributed < TEST_PARTITION_COUNT; distributed++) {
            session_input whole = {0}, part = {0};
            /* The usual run takes every second partition for each kind of cells. */
            if (!test_is_long_run() && ((int)kind + (int)distributed) % 2) continue;
            /* In random partitions the last of several ranks has no cells. */
            const int count = distributed == TEST_RANDOM && rank_count > 1 ? rank_count - 1 : rank_count;
            make_part(&whole, kind, test_wave_field, TEST_BLOCK, 0, 1);
            make_part(&part, kind, test_wave_field, distributed, own_rank, count);
            verify_partition(EVERYTHING, &whole, &part, 0, test_mesh_kind_name(kind));
            if (distributed == TEST_CHECKERBOARD)
                verify_partition(WITH_VOLUME, &whole, &part, 1e-6, test_mesh_kind_name(kind));
            input_free(&whole);
            input_free(&part);
        }
}

/* Checks that ghost cells cast no shadow. Every rank has all cells of the mesh; those of other ranks are ghosts. */
static void ghost_cells_cast_no_shadow(void **context)
{
    session_input whole = {0}, part = {0};
    (void)context;
    make_part(&whole, TEST_HEXES, test_wave_field, TEST_BLOCK, 0, 1);
    make_part(&part, TEST_HEXES, test_wave_field, TEST_BLOCK, 0, 1);
    int *owners = calloc((size_t)part.part.cell_count, sizeof *owners);
    assert_non_null(owners);
    test_partition_cells(&part.part, TEST_RANDOM, SIDE, rank_count, owners);
    for (int64_t cell = 0; cell < part.part.cell_count; cell++) part.part.ghosts[cell] = owners[cell] != own_rank;
    free(owners);
    input_describe(&part);
    verify_partition(EVERYTHING, &whole, &part, 0, "ghost cells");
    input_free(&whole);
    input_free(&part);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(shadows_of_disks_are_ellipses),
        cmocka_unit_test(transparent_layers_cast_no_shadow),
        cmocka_unit_test(ambient_occlusion_of_corners_matches_disk_segments),
        cmocka_unit_test(ambient_occlusion_darkens_valleys),
        cmocka_unit_test(lit_pictures_are_the_same_on_any_partition),
        cmocka_unit_test(ghost_cells_cast_no_shadow),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
