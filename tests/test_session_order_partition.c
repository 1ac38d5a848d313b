/* Checks cells of higher order that are dealt to ranks at random, one by one: the numbers of pieces and the pictures
 * must be bit-identical to those of rank 0 with all cells. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

#define FRONT "{position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.6}"
#define IMAGE(name, camera, layer)                                                                                     \
    "  - name: " name "\n    size: [96, 72]\n    background: [0, 0, 0, 0]\n    camera: " camera                        \
    "\n    layers:\n      - " layer "\n    outputs: [{path: \"" name ".exr\", data: true}]\n"
#define ISOSURFACES "isosurface: {field: f, values: [0.1, 0.4], opacity: 0.6}"
#define SLICE "slice: {field: f, planes: [{normal: [1, 2, 3]}]}"
#define REPRODUCIBLE "    sampling: {reproducible: true}\n"

/* In the first and the last scene all cells are refined; in the others those that isosurfaces and slices cross, and
 * those that have outer faces. */
static const char *const scenes[] = {
    "finer_pieces: 3\nimages:\n" IMAGE("a", FRONT, ISOSURFACES) IMAGE("b", FRONT, SLICE)
        IMAGE("c", FRONT, "surface: {threshold: {field: f, from: -0.9}, colour_by: {field: f}, edges: {}}")
            IMAGE("d", FRONT, "volume: {field: f}") IMAGE("e", FRONT, "volume: {field: f}") REPRODUCIBLE,
    "finer_pieces: 3\nimages:\n" IMAGE("a", FRONT, ISOSURFACES) IMAGE("b", FRONT, SLICE),
    "surface_error: 1.5\nimages:\n" IMAGE("a", FRONT, "surface: {colour_by: {field: f}, edges: {}}")
        IMAGE("b", "automatic", ISOSURFACES),
    "surface_error: 1.5\nimages:\n" IMAGE("a", FRONT, ISOSURFACES) IMAGE("b", "automatic", SLICE)
        IMAGE("c{view}", "{orbit: {views: 2}}", "isosurface: {field: f, values: [0.2]}"),
    "images:\n" IMAGE("a", FRONT, ISOSURFACES) IMAGE("b", FRONT, "volume: {field: f}") REPRODUCIBLE,
};
enum { SCENES = sizeof scenes / sizeof *scenes, VOLUME_SCENE = 0, VOLUME = 3 };

/* Returns whether a kind is tested by default. These kinds cover all methods to split and to refine cells. */
static bool is_usual(const order_kind *kind)
{
    static const char *const names[] = {"tet 10", "hex 20", "hex 27", "wedge 18", "hex 4", "pyramid 13"};
    bool is_one = false;
    for (int i = 0; i < 6; i++) is_one = is_one || strcmp(kind->name, names[i]) == 0;
    return is_one;
}

/* Keeps only the cells that are dealt to this rank, in reverse order. */
static void keep_random_cells(order_mesh *mesh, uint64_t seed)
{
    const size_t row = (size_t)mesh->nodes;
    int64_t *own = malloc((size_t)(mesh->cell_count + 1) * row * sizeof *own), count = 0;
    for (int64_t cell = mesh->cell_count - 1; cell >= 0; cell--)
        if ((int)(test_uniform((uint64_t)cell, seed) * rank_count) == own_rank)
            memcpy(own + (size_t)count++ * row, mesh->connectivity + (size_t)cell * row, row * sizeof *own);
    free(mesh->connectivity);
    mesh->connectivity = own;
    mesh->cell_count = mesh->mesh.cell_count = count;
    mesh->mesh.connectivity = (insitu_array){own, INSITU_INT64, 0};
    mesh->mesh.connectivity_count = count * mesh->nodes;
}

/* Draws a scene file that exists already. pieces: receives what the report states about pieces. */
static drawn draw_and_report(MPI_Comm comm, const char *file, const order_mesh *mesh, char pieces[512])
{
    insitu_session *session = open_session(comm, file);
    assert_int_equal(insitu_set_mesh(session, "m", &mesh->mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &mesh->field), INSITU_OK);
    discard_pictures();
    if (insitu_step(session, 0, 0)) fail_msg("%s", insitu_error(session));
    snprintf(pieces, 512, "%s", insitu_last_report(session)->pieces);
    insitu_destroy(&session);
    return take_caught_pictures();
}

/* Returns whether a picture of all ranks equals that of rank 0 alone: bit by bit or, for volumes that are not
 * reproducible, up to 1e-6, because they are blended in float, the part of each rank first. */
static bool is_same_picture(int scene, int picture, const drawn *all, const drawn *alone)
{
    const caught_picture *one = &all->pictures[picture], *other = &alone->pictures[picture];
    if (scene == VOLUME_SCENE && picture == VOLUME) return largest_colour_difference(one, other) <= 1e-6;
    return are_same_pictures(one, other);
}

static bool draws_same_as_rank_0_alone(const order_kind *kind, int scene, const order_mesh *whole,
                                       const order_mesh *part)
{
    char pieces[2][512];
    const char *file = write_scene(scenes[scene]);
    drawn all = draw_and_report(MPI_COMM_WORLD, file, part, pieces[0]);
    if (own_rank != 0) return true;
    drawn alone = draw_and_report(MPI_COMM_SELF, file, whole, pieces[1]);
    bool are_same = strcmp(pieces[0], pieces[1]) == 0 && all.count == alone.count && all.count > 1;
    if (!are_same) fprintf(stderr, "%s: %s; alone: %s\n", kind->name, pieces[0], pieces[1]);
    for (int i = 0; are_same && i < all.count; i++) {
        are_same = is_same_picture(scene, i, &all, &alone);
        if (!are_same) fprintf(stderr, "%s, scene %d: picture %d depends on ranks\n", kind->name, scene, i);
    }
    free_picture_set(&all);
    free_picture_set(&alone);
    return are_same;
}

static void pictures_are_the_same_on_any_ranks(void **state)
{
    (void)state;
    bool are_all_same = true;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        /* runs on many ranks take long */
        if (!is_usual(&order_kinds[k]) && (!test_is_long_run() || rank_count > 7)) continue;
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wave_field, 0, 1, &part);
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wave_field, 0, 1, &whole);
        keep_random_cells(&part, (uint64_t)k);
        for (int scene = 0; scene < SCENES; scene++)
            are_all_same = draws_same_as_rank_0_alone(&order_kinds[k], scene, &whole, &part) && are_all_same;
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
    everywhere(are_all_same);
}

static int enter_test_group_folder(void **state)
{
    (void)state;
    return enter_test_folder("order_partition") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pictures_are_the_same_on_any_ranks)};
    return run_session_tests(argc, argv, tests, enter_test_group_folder, NULL);
}
