/* Checks a volume for which the scene gives no sampling, range, unit distance or camera. They are derived from the data
 * of all ranks, so that the picture of all ranks must be the one that rank 0 draws of the whole mesh alone. Each rank
 * lists its cells in an order of its own: vertices and cells are permuted, the vertices of a face begin at another
 * vertex and run in the opposite direction, and a polyhedron's faces are permuted. The volume of a cell with warped
 * faces depends on how each face is divided into triangles, and this division must not depend on the order.
 *
 * The allowed difference is that of compositing, 1e-6, because fragments are blended in other groups. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "test_mesh_honeycomb.h"
#include "test_mesh_make.h"
#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 48, HEIGHT = 36 };

#define IMAGE(layers, sampling)                                                                                        \
    "images:\n  - name: a\n    size: [48, 36]\n    layers:\n" layers sampling "    outputs:\n      - path: a.exr\n"
#define VOLUME "      - volume: {field: f}\n"
#define DENSE "      - volume: {field: f, opacity: [[0, 0.2], [0.5, 0.2], [0.5, 0.9], [1, 0.4]]}\n"
#define SURFACE "      - isosurface: {field: f, values: [0.1]}\n"

#define CLEAR_SURFACE "      - isosurface: {field: f, values: [-0.2, 0.1], opacity: 0.4}\n"

typedef struct scene_case {
    const char *name, *text;
} scene_case;

static const scene_case scenes[] = {
    {"default", IMAGE(VOLUME, "")},
    {"default, dense", IMAGE(DENSE, "")},
    {"default, surface", IMAGE(VOLUME SURFACE, "")},
    {"default, clear surfaces", IMAGE(DENSE CLEAR_SURFACE, "")},
    {"samples", IMAGE(VOLUME, "    sampling: {method: samples}\n")},
    {"samples, dense", IMAGE(DENSE, "    sampling: {method: samples}\n")},
    {"segments", IMAGE(VOLUME, "    sampling: {method: segments}\n")},
    {"two volumes", IMAGE(VOLUME DENSE, "")},
};
/* FIRST_SAMPLED: index of the first scene that uses the default step */
enum { FIRST_SAMPLED = 4, SCENES = sizeof scenes / sizeof *scenes };

/* ---- meshes -------------------------------------------------------------------------------------------------- */

typedef enum mesh_kind { HONEYCOMB, WARPED_POLYHEDRA, WARPED_MIXED, HEXES, FLAT_AMONG_HEXES, MESHES } mesh_kind;

static const char *const mesh_names[MESHES] = {"honeycomb", "warped polyhedra", "polyhedra among others", "hexes",
                                               "flat cells among hexes"};

/* Adds a flat hex for every hex. Its eight vertices are in one oblique plane, so that the rounding of its volume
 * depends on which vertex is listed first. */
static void add_flat_hexes(test_mesh *mesh)
{
    test_mesh old = *mesh;
    test_mesh_allocate(mesh, old.vertex_count + 8 * old.cell_count, 2 * old.cell_count, 16 * old.cell_count);
    for (int64_t v = 0; v < old.vertex_count; v++)
        mesh->values[test_mesh_add_vertex(mesh, old.coordinates + 3 * v)] = old.values[v];
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        int64_t vertices[8];
        for (int i = 0; i < 8; i++) {
            const uint64_t index = (uint64_t)(16 * cell + 2 * i);
            const double x = test_uniform_between(index, 3, -1, 1) / 2,
                         y = test_uniform_between(index + 1, 3, -1, 1) / 2;
            vertices[i] = test_mesh_add_vertex(mesh, (const double[]){x, y, 0.1 * x - 0.7 * y});
            mesh->values[vertices[i]] = 0.25;
        }
        test_mesh_add_cell(mesh, GRID_HEX, old.connectivity + old.offsets[cell], (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
        test_mesh_add_cell(mesh, GRID_HEX, vertices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
    }
    test_mesh_free(&old);
}

static void make_mesh(mesh_kind kind, test_mesh *out)
{
    if (kind == HONEYCOMB) {
        test_mesh_make_honeycomb(SIDE, 0.2, test_wave_field, out);
        return;
    }
    test_mesh_make_lattice(kind == WARPED_MIXED ? TEST_MIXED : TEST_HEXES, SIDE, 0.2, test_wave_field, out);
    if (kind == WARPED_POLYHEDRA || kind == WARPED_MIXED) test_mesh_to_polyhedra(out, kind == WARPED_MIXED ? 0.5 : 1);
    if (kind == FLAT_AMONG_HEXES) add_flat_hexes(out);
}

/* Makes this rank's part of a random partition, with vertices, faces and cells in an order of its own. */
static void extract_rank_cells(const test_mesh *whole, session_input *out)
{
    int *owners = test_calloc((size_t)whole->cell_count, sizeof *owners);
    test_partition_cells(whole, TEST_RANDOM, SIDE, rank_count, owners);
    test_mesh_extract_part(whole, owners, own_rank, &out->part);
    test_free(owners);
    test_mesh_reorder_vertices(&out->part, 11 + (uint64_t)own_rank);
    test_mesh_shuffle_cells(&out->part, 77 + (uint64_t)own_rank);
    input_describe(out);
}

/* ---- pictures ------------------------------------------------------------------------------------------------ */

/* Draws the scene and returns the mean size of cells that the session derives. On rank 0, *out receives the picture,
 * which the caller frees. */
static double draw_and_get_cell_size(MPI_Comm comm, const char *scene, const session_input *in, caught_picture *out)
{
    insitu_session *session = open_session(comm, scene);
    discard_pictures();
    assert_int_equal(submit_input(session, in), INSITU_OK);
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    const double size = session->space.extent.cell_size;
    if (own_rank == 0) {
        *out = caught[0];
        caught_count = 0;
    }
    insitu_destroy(&session);
    return size;
}

static bool is_one_picture(const scene_case *scene, const char *file, mesh_kind kind, const session_input *whole,
                           const session_input *part)
{
    caught_picture ours = {0}, alone = {0};
    const double size = draw_and_get_cell_size(MPI_COMM_WORLD, file, part, &ours);
    if (own_rank != 0) return true;
    const double alone_size = draw_and_get_cell_size(MPI_COMM_SELF, file, whole, &alone);
    const double off = largest_colour_difference(&ours, &alone);
    const bool is_one = off <= 1e-6 && size == alone_size;
    if (!is_one)
        fprintf(stderr, "%s, %s, %d ranks: off by %.3g; cells of size %.17g and %.17g\n", mesh_names[kind], scene->name,
                rank_count, off, size, alone_size);
    free_caught(&ours);
    free_caught(&alone);
    return is_one;
}

static void verify_kind(mesh_kind kind)
{
    session_input whole = {0}, part = {0};
    bool is_one = true;
    make_mesh(kind, &whole.part);
    input_describe(&whole);
    extract_rank_cells(&whole.part, &part);
    for (int i = kind == FLAT_AMONG_HEXES ? FIRST_SAMPLED : 0; i < SCENES; i++)
        is_one = is_one_picture(&scenes[i], write_scene(scenes[i].text), kind, &whole, &part) && is_one;
    everywhere(is_one);
    input_free(&part);
    input_free(&whole);
}

/* ---- error of the default ------------------------------------------------------------------------------------ */

/* Returns whether the default picture, which has an error of at most 0.01, agrees with a picture that has an error of
 * at most 1e-4. */
static bool is_nearly_equal(const char *layers, const session_input *in)
{
    char text[1024];
    caught_picture standard = {0}, fine = {0};
    snprintf(text, sizeof text, IMAGE("%s", "%s"), layers, "");
    draw_and_get_cell_size(MPI_COMM_WORLD, write_scene(text), in, &standard);
    snprintf(text, sizeof text, IMAGE("%s", "%s"), layers, "    sampling: {max_error: 1e-4}\n");
    draw_and_get_cell_size(MPI_COMM_WORLD, write_scene(text), in, &fine);
    if (own_rank != 0) return true;
    const double off = largest_colour_difference(&standard, &fine);
    if (off > 0.01 + 1e-4) fprintf(stderr, "off by %.3g: %s", off, layers);
    free_caught(&standard);
    free_caught(&fine);
    return off <= 0.01 + 1e-4;
}

static void default_volumes_are_off_by_a_hundredth_at_most(void **context)
{
    static const char *const layers[] = {VOLUME, VOLUME SURFACE, VOLUME CLEAR_SURFACE};
    (void)context;
    for (mesh_kind kind = HONEYCOMB; kind <= HEXES; kind++)
        for (size_t i = 0; i < sizeof layers / sizeof *layers; i++) {
            session_input whole = {0}, part = {0};
            make_mesh(kind, &whole.part);
            extract_rank_cells(&whole.part, &part);
            everywhere(is_nearly_equal(layers[i], &part));
            input_free(&part);
            test_mesh_free(&whole.part);
        }
}

/* ---- one picture --------------------------------------------------------------------------------------------- */

static void default_volumes_of_honeycombs_give_one_picture(void **context)
{
    (void)context;
    verify_kind(HONEYCOMB);
}

static void default_volumes_of_warped_polyhedra_give_one_picture(void **context)
{
    (void)context;
    verify_kind(WARPED_POLYHEDRA);
}

static void default_volumes_of_polyhedra_among_others_give_one_picture(void **context)
{
    (void)context;
    verify_kind(WARPED_MIXED);
}

static void default_volumes_of_hexes_give_one_picture(void **context)
{
    (void)context;
    verify_kind(HEXES);
}

/* Checks only scenes that are sampled with the default step. In scenes integrated to max_error, pixels in which flat
 * cells overlap others agree only up to max_error. */
static void flat_cells_do_not_change_the_default_step(void **context)
{
    (void)context;
    verify_kind(FLAT_AMONG_HEXES);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(default_volumes_of_honeycombs_give_one_picture),
        cmocka_unit_test(default_volumes_of_warped_polyhedra_give_one_picture),
        cmocka_unit_test(default_volumes_of_polyhedra_among_others_give_one_picture),
        cmocka_unit_test(default_volumes_of_hexes_give_one_picture),
        cmocka_unit_test(flat_cells_do_not_change_the_default_step),
        cmocka_unit_test(default_volumes_are_off_by_a_hundredth_at_most),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
