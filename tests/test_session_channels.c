/* Checks the data channels that an EXR file may contain besides colours: normal, value, index of the layer and index of
 * the surface, at the nearest surface of each pixel. They are compared with closed forms on planes in a cube of every
 * type of cell. If cells are distributed at random, the channels must be bit-identical to those of one rank. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 48, HEIGHT = 36, PIXELS = WIDTH * HEIGHT };
enum { NX, NY, NZ, VALUE, LAYER, SURFACE, CHANNELS };

/* The layers: 0: a volume; 1: a slice of two planes; 2: two transparent isosurfaces, not coloured by f; 3: an
 * isosurface coloured by f. test_linear_field() is 0.3 x - 0.7 y + 0.5 z + 0.1. */
#define SCENE(more)                                                                                                    \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 0, 0, 0]\n"                                         \
    "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n" more "    layers:\n"                          \
    "      - volume: {field: f, range: [-2, 2]}\n"                                                                     \
    "      - slice: {field: f, range: [-2, 2], planes: [{normal: [1, 0, 0], point: [-0.4, 0, 0]},\n"                   \
    "               {normal: [0, 0, 1], point: [0, 0, -0.3]}]}\n"                                                      \
    "      - isosurface: {field: f, values: [0.9, 0.5], opacity: 0.25}\n"                                              \
    "      - isosurface: {field: f, values: [-0.3], colour_by: {field: f, map: grey, discrete: 3}}\n"                  \
    "    outputs: [{path: a.exr, data: true}]\n"

typedef struct plane {
    double normal[3], distance;
    int layer, surface;
    bool has_isovalue;
    double isovalue; /* the expected value if has_isovalue is set; else the field at the hit is expected */
} plane;

static const plane planes[] = {{{1, 0, 0}, -0.4, 1, 0, false, 0},
                               {{0, 0, 1}, -0.3, 1, 1, false, 0},
                               {{0.3, -0.7, 0.5}, 0.8, 2, 0, true, 0.9},
                               {{0.3, -0.7, 0.5}, 0.4, 2, 1, true, 0.5},
                               {{0.3, -0.7, 0.5}, -0.4, 3, 0, false, 0}};
enum { PLANES = sizeof planes / sizeof *planes };

/* Computes the depth at which the pixel's ray meets the plane; returns false if that position is not inside the cube.
 * *close is set if rounding decides whether it is. */
static bool intersect_plane(const plane *p, const double base[3], const double direction[3], double *depth, bool *close)
{
    *depth = (p->distance - dot_product(p->normal, base)) / dot_product(p->normal, direction);
    bool is_within = true;
    for (int a = 0; a < 3; a++) {
        const double place = fabs(base[a] + *depth * direction[a]);
        *close = *close || fabs(place - 1) < 1e-4;
        is_within = is_within && place < 1;
    }
    return is_within;
}

/* Returns whether a pixel's channels are those of plane p, or those of no surface if p is NULL. Normals are rounded by
 * some units of 6e-8. The error of a value is its gradient of 0.91 times the position's error of 1.5e-5, which is
 * derived in test_session_surfaces.c. */
static bool has_expected_channels(const caught_picture *picture, int pixel, const plane *p, const double place[3],
                                  const double direction[3])
{
    double own[CHANNELS];
    for (int c = 0; c < CHANNELS; c++) own[c] = (double)picture->data[c * PIXELS + pixel];
    if (!p)
        return own[NX] == 0 && own[NY] == 0 && own[NZ] == 0 && isnan(own[VALUE]) && own[LAYER] == -1 &&
               own[SURFACE] == -1;
    const double length = sqrt(dot_product(p->normal, p->normal)) * (dot_product(p->normal, direction) > 0 ? -1 : 1);
    bool is_well = own[LAYER] == p->layer && own[SURFACE] == p->surface;
    for (int a = 0; a < 3; a++) is_well = is_well && fabs(own[NX + a] - p->normal[a] / length) < 1e-5;
    return is_well && (p->has_isovalue ? own[VALUE] == (double)(float)p->isovalue
                                       : fabs(own[VALUE] - test_linear_field(place)) < 1.5e-5);
}

static bool is_channel_picture_exact(const caught_picture *picture)
{
    int hits[PLANES] = {0};
    render_camera camera;
    render_camera_look_at(&camera, (const double[]){3, 2.2, 4}, (const double[]){0, 0, 0}, (const double[]){0, 1, 0},
                          40, WIDTH, HEIGHT);
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double base[3], direction[3], nearest = INFINITY, place[3];
        const plane *seen = NULL;
        bool is_close = false;
        render_camera_ray(&camera, pixel % WIDTH, pixel / WIDTH, base, direction);
        for (int i = 0; i < PLANES; i++) {
            double depth;
            if (!intersect_plane(&planes[i], base, direction, &depth, &is_close) || depth > nearest + 1e-4) continue;
            is_close = is_close || fabs(depth - nearest) < 1e-4;
            nearest = depth;
            seen = &planes[i];
        }
        if (is_close) continue;
        for (int a = 0; a < 3; a++) place[a] = base[a] + nearest * direction[a];
        if (seen) hits[seen - planes]++;
        if (has_expected_channels(picture, pixel, seen, place, direction)) continue;
        fprintf(stderr, "pixel %d, plane %d:", pixel, seen ? (int)(seen - planes) : -1);
        for (int c = 0; c < CHANNELS; c++) fprintf(stderr, " %.9g", (double)picture->data[c * PIXELS + pixel]);
        fprintf(stderr, "; the field there is %.9g\n", test_linear_field(place));
        return false;
    }
    for (int i = 0; i < PLANES; i++)
        if (hits[i] < 10) return false;
    return true;
}

static void compare_channels(test_mesh_kind kind, const char *text)
{
    session_input whole = {0}, part = {0};
    const char *scene = write_scene(text);
    test_mesh_make_lattice(kind, SIDE, 0.2, test_linear_field, &whole.part);
    input_describe(&whole);
    int *owners = test_calloc((size_t)whole.part.cell_count, sizeof *owners);
    test_partition_cells(&whole.part, TEST_RANDOM, SIDE, rank_count, owners);
    test_mesh_extract_part(&whole.part, owners, own_rank, &part.part);
    test_free(owners);
    input_describe(&part);
    caught_picture ours = draw_scene(MPI_COMM_WORLD, scene, &part), alone = {0};
    bool is_well = true;
    if (own_rank == 0) {
        alone = draw_scene(MPI_COMM_SELF, scene, &whole);
        is_well = alone.channel_count == CHANNELS && is_channel_picture_exact(&alone) &&
                  ours.channel_count == CHANNELS &&
                  memcmp(ours.data, alone.data, CHANNELS * PIXELS * sizeof(float)) == 0;
        if (!is_well) fprintf(stderr, "%s\n", test_mesh_kind_name(kind));
    }
    everywhere(is_well);
    free_caught(&ours);
    free_caught(&alone);
    input_free(&part);
    input_free(&whole);
}

static void data_are_those_of_the_nearest_surface(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) compare_channels(kind, SCENE(""));
}

static void samples_do_not_change_the_data(void **state)
{
    (void)state;
    compare_channels(TEST_HEXES, SCENE("    antialias: 4\n"));
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(data_are_those_of_the_nearest_surface),
        cmocka_unit_test(samples_do_not_change_the_data),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
