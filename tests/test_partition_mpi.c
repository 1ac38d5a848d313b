/* Checks that any number of ranks gives the same image. The cells of a mesh are distributed in blocks, randomly or as a
 * checkerboard. Each rank draws its part with its own numbering of vertices, and the pictures are composited. Rank 0
 * draws the whole mesh by itself and compares the pictures. Surfaces must be bit-identical in depth and colour. Volumes
 * by samples, by exact segments and by segments under max_error must agree to 1e-6, because fragments are blended in
 * different groups. The test includes ranks without a cell, ranks without a mesh, and ranks that have the cells of
 * other ranks as ghosts. */
#include "comp.h"
#include "memory.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

typedef struct scene {
    const char *name;
    fixture_camera camera;
    float opacity; /* opacity of the surfaces; 0: there are no surfaces */
    bool has_volume;
    render_integration integration;
    double max_error;
} scene;

static const scene scenes[] = {
    {"opaque", CAMERA_OUTSIDE, 1, false, 0, 0},
    {"transparent", CAMERA_ORTHOGRAPHIC, 0.4f, false, 0, 0},
    {"samples", CAMERA_INSIDE, 0, true, RENDER_SAMPLES, 0},
    {"samples, opaque", CAMERA_ORTHOGRAPHIC, 1, true, RENDER_SAMPLES, 0},
    {"samples, transparent", CAMERA_OUTSIDE, 0.4f, true, RENDER_SAMPLES, 0},
    {"segments", CAMERA_INSIDE, 0, true, RENDER_SEGMENTS, 0},
    {"segments, opaque", CAMERA_ORTHOGRAPHIC, 1, true, RENDER_SEGMENTS, 0},
    {"segments, transparent", CAMERA_OUTSIDE, 0.4f, true, RENDER_SEGMENTS, 0},
    {"max_error", CAMERA_INSIDE, 0, true, RENDER_SEGMENTS, 1e-3},
    {"max_error, opaque", CAMERA_OUTSIDE, 1, true, RENDER_SEGMENTS, 1e-3},
    {"max_error, transparent", CAMERA_ORTHOGRAPHIC, 0.4f, true, RENDER_SEGMENTS, 1e-3},
};

enum { SCENE_COUNT = sizeof scenes / sizeof scenes[0] };

enum { WIDTH = 67, HEIGHT = 51, PIXELS = WIDTH * HEIGHT, SIDE = 4 };

static int my_rank, rank_count;
static double worst[SCENE_COUNT]; /* largest difference of each scene; set on rank 0 only */

static void draw_mesh(const test_mesh *mesh, const scene *scene, MPI_Comm comm, bool is_alone, image *out)
{
    static const double values[2] = {-0.2, 0.3};
    render_fixture f;
    fragment_list list = {0};
    base_error error = {0};
    fixture_create(&f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / SIDE, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(&f, scene->camera, WIDTH, HEIGHT);
    if (scene->opacity > 0) fixture_add_surface(&f, values, 2, scene->opacity);
    if (scene->has_volume) fixture_set_volume(&f, 0.3);
    f.job.integration = scene->integration;
    f.job.max_error = scene->max_error;
    f.job.extent = 3.5; /* any length not below the cube's diagonal, about 3.46 */
    f.job.is_alone = is_alone;
    assert_int_equal(render_frame(&f.job, &list, NULL, &error), INSITU_OK);
    out->width = WIDTH;
    out->height = HEIGHT;
    out->rgba = malloc(4 * PIXELS * sizeof(float));
    out->depth = malloc(PIXELS * sizeof(float));
    int ranks = 1;
    MPI_Comm_size(comm, &ranks);
    const comp_group group = {comm, {1, false}, COMP_AUTOMATIC, 0, comp_claims_create(ranks)};
    assert_non_null(group.claims);
    assert_int_equal(comp_composite(&group, &list, fixture_background, 0, out, NULL, &error), INSITU_OK);
    base_free(list.items);
    comp_claims_free(group.claims);
    fixture_free(&f);
}

static void free_image(image *picture)
{
    free(picture->rgba);
    free(picture->depth);
}

static bool are_same_images_to_rounding(const image *whole, const image *other, const scene *scene, const char *what)
{
    int depths = 0;
    double colour = 0;
    for (int p = 0; p < PIXELS; p++) {
        depths += memcmp(whole->depth + p, other->depth + p, sizeof(float)) != 0;
        for (int c = 0; c < 4; c++) {
            const double off = fabs((double)whole->rgba[4 * p + c] - (double)other->rgba[4 * p + c]);
            colour = test_larger_error(colour, off);
        }
    }
    const double bound = scene->has_volume ? 1e-6 : 0;
    worst[scene - scenes] = test_larger_error(worst[scene - scenes], colour);
    if (depths || !(colour <= bound))
        fprintf(stderr, "%s, %d ranks, %s: %d depths differ, colour by %g\n", what, rank_count, scene->name, depths,
                colour);
    return !depths && colour <= bound;
}

/* Makes this rank's part of the mesh. If `ghosts` is set, the part has all cells, and those of other ranks are
 * ghosts. */
static void extract_rank_cells(const test_mesh *mesh, const int *owners, bool ghosts, test_mesh *out)
{
    int *all = calloc((size_t)mesh->cell_count, sizeof *all);
    test_mesh_extract_part(mesh, ghosts ? all : owners, ghosts ? 0 : my_rank, out);
    for (int64_t i = 0; ghosts && i < mesh->cell_count; i++) out->ghosts[i] = owners[i] != my_rank;
    free(all);
}

static void compare_with_whole(const test_mesh *mesh, const int *owners, bool ghosts, const scene *scene,
                               const char *what)
{
    test_mesh part;
    image whole = {0}, ours = {0};
    int good = 1;
    extract_rank_cells(mesh, owners, ghosts, &part);
    draw_mesh(&part, scene, MPI_COMM_WORLD, rank_count == 1, &ours);
    if (my_rank == 0) {
        draw_mesh(mesh, scene, MPI_COMM_SELF, true, &whole);
        good = are_same_images_to_rounding(&whole, &ours, scene, what);
        free_image(&whole);
    }
    MPI_Bcast(&good, 1, MPI_INT, 0, MPI_COMM_WORLD);
    free_image(&ours);
    test_mesh_free(&part);
    assert_true(good);
}

/* Returns whether a case is drawn. In the usual run, each scene with each kind of mesh is drawn on one rank, and with
 * each partition on one of the numbers of ranks 2, 3, 4 and 7. */
static bool is_case_selected(test_partition_kind partition, test_mesh_kind kind, int scene)
{
    if (rank_count == 1) return partition == TEST_RANDOM;
    return test_is_long_run() || ((int)partition + (int)kind + scene + (rank_count == 7 ? 1 : rank_count)) % 4 == 0;
}

static void compare_partition(test_partition_kind partition)
{
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, &mesh);
        int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
        test_partition_cells(&mesh, partition, SIDE, rank_count, owners);
        for (int i = 0; i < SCENE_COUNT; i++)
            if (is_case_selected(partition, kind, i))
                compare_with_whole(&mesh, owners, false, &scenes[i], test_partition_kind_name(partition));
        free(owners);
        test_mesh_free(&mesh);
    }
}

static void block_partition_draws_the_whole_image(void **state)
{
    (void)state;
    compare_partition(TEST_BLOCK);
}

static void random_partition_draws_the_whole_image(void **state)
{
    (void)state;
    compare_partition(TEST_RANDOM);
}

static void checkerboard_partition_draws_the_whole_image(void **state)
{
    (void)state;
    compare_partition(TEST_CHECKERBOARD);
}

/* Checks ranks without cells: first the last rank has all cells, then there are fewer cells than ranks. */
static void ranks_without_cells_participate(void **state)
{
    (void)state;
    test_mesh mesh;
    test_mesh_make_lattice(TEST_MIXED, SIDE, 0.2, test_wave_field, &mesh);
    int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
    for (int64_t i = 0; i < mesh.cell_count; i++) owners[i] = rank_count - 1;
    for (int i = 0; i < SCENE_COUNT; i++) compare_with_whole(&mesh, owners, false, &scenes[i], "all with the last");
    free(owners);
    test_mesh_free(&mesh);
    test_mesh_make_single_cell(TEST_UNIT_HEX, test_linear_field, &mesh);
    const int nobody_else[1] = {0};
    for (int i = 0; i < SCENE_COUNT; i++)
        compare_with_whole(&mesh, nobody_else, false, &scenes[i], "fewer cells than ranks");
    test_mesh_free(&mesh);
}

static void ghosts_of_other_ranks_change_nothing(void **state)
{
    (void)state;
    test_mesh mesh;
    test_mesh_make_lattice(TEST_MIXED, SIDE, 0.2, test_wave_field, &mesh);
    int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
    test_partition_cells(&mesh, TEST_RANDOM, SIDE, rank_count, owners);
    for (int i = 0; i < SCENE_COUNT; i++) compare_with_whole(&mesh, owners, true, &scenes[i], "ghosts");
    free(owners);
    test_mesh_free(&mesh);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(block_partition_draws_the_whole_image),
        cmocka_unit_test(random_partition_draws_the_whole_image),
        cmocka_unit_test(checkerboard_partition_draws_the_whole_image),
        cmocka_unit_test(ranks_without_cells_participate),
        cmocka_unit_test(ghosts_of_other_ranks_change_nothing),
    };
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &my_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int i = 0; i < SCENE_COUNT && my_rank == 0; i++)
        printf("%s: colours differ by %.2g at most\n", scenes[i].name, worst[i]);
    MPI_Finalize();
    return failed;
}
