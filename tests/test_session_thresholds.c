/* Checks the surfaces of thresholds, which are the faces between cells with values within the bounds and all other
 * cells. They are compared with a brute-force search over all pairs of faces, must be updated when the values change,
 * and must give the same picture on any number of ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "session_cell_faces.h"
#include "test_session_fixture.h"

enum { SIDE = 3, PIXELS = 48 * 36 };

#define LOW (-0.6)
#define HIGH 0.9
#define IMAGE(threshold)                                                                                               \
    "images:\n  - name: a\n    size: [48, 36]\n    background: [0, 0, 0, 0]\n"                                         \
    "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n    layers:\n"                                  \
    "      - surface: {colour_by: {field: f, map: turbo}, edges: {}, threshold: {" threshold "}}\n"                    \
    "    outputs: [{path: a.exr}]\n"

/* ---- faces ---------------------------------------------------------------------------------------------------- */

/* Mixes the bits of a hash. The hash of a face is the sum of the mixed hashes of its corners' positions, so that it
 * does not depend on their order. */
static uint64_t mix_bits(uint64_t h)
{
    h = (h ^ h >> 30) * 0xbf58476d1ce4e5b9u;
    h = (h ^ h >> 27) * 0x94d049bb133111ebu;
    return h ^ h >> 31;
}

static uint64_t hash_position(const double place[3])
{
    uint64_t out = 0;
    for (int a = 0; a < 3; a++) {
        uint64_t bits;
        memcpy(&bits, &place[a], sizeof bits);
        out = mix_bits(out + mix_bits(bits + 0x9e3779b97f4a7c15u));
    }
    return out;
}

/* A set of faces: number of faces, and a sum of hashes that differs between different sets. */
typedef struct face_set {
    uint64_t count, sum;
} face_set;

static void add_face(face_set *set, uint64_t face)
{
    set->count++;
    set->sum += mix_bits(face);
}

static bool is_value_within_bounds(const test_mesh *mesh, const grid *g, int64_t cell, bool is_cell_centred)
{
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    if (is_cell_centred) return mesh->values[cell] >= LOW && mesh->values[cell] <= HIGH;
    while (grid_walk_next(&walk, &vertex))
        if (!(mesh->values[vertex] >= LOW && mesh->values[vertex] <= HIGH)) return false;
    return true;
}

/* Finds the faces that belong to exactly one cell within the bounds, by comparing each face with every other face. */
static face_set find_faces_by_brute_force(const test_mesh *mesh, const grid *g, bool is_cell_centred)
{
    face_set out = {0};
    int64_t count = 0;
    uint64_t *faces = test_calloc((size_t)g->cell_count * 40, sizeof *faces);
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (!is_value_within_bounds(mesh, g, cell, is_cell_centred)) continue;
        const session_cell_faces of = session_faces_of_cell(g, cell);
        for (int64_t f = 0; f < of.count; f++) {
            const session_face_loop loop = session_find_face_loop(&of, f);
            double place[3];
            for (int64_t i = 0; i < loop.size; i++) {
                grid_read_vertex_position(g, session_face_vertex(&loop, i), place);
                faces[count] += hash_position(place);
            }
            count++;
        }
    }
    for (int64_t i = 0; i < count; i++) {
        int times = 0;
        for (int64_t k = 0; k < count; k++) times += faces[k] == faces[i];
        if (times == 1) add_face(&out, faces[i]);
    }
    test_free(faces);
    return out;
}

/* Collects the faces that this rank draws, and sums the sets of all ranks. The session stores faces as pyramids and
 * tets, whose last vertex is the apex. */
static face_set find_drawn_faces(const insitu_session *session)
{
    face_set out = {0};
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_outer *outer = mesh->outers[0];
    for (int64_t cell = 0; cell < outer->mesh->cells.cell_count; cell++) {
        uint64_t face = 0;
        for (int64_t i = outer->offsets[cell]; i < outer->offsets[cell + 1] - 1; i++)
            face += hash_position(outer->coordinates + 3 * outer->connectivity[i]);
        add_face(&out, face);
    }
    MPI_Allreduce(MPI_IN_PLACE, &out, 2, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
    return out;
}

/* ---- sessions ------------------------------------------------------------------------------------------------- */

/* Sets the values to a wave that moves from step to step. The value of a cell is that of the wave at the cell's first
 * vertex. */
static void set_values(session_input *in, bool is_cell_centred, double step)
{
    test_mesh *part = &in->part;
    const int64_t count = is_cell_centred ? part->cell_count : part->vertex_count;
    free(part->values);
    part->values = calloc((size_t)count + 1, sizeof *part->values);
    assert_non_null(part->values);
    for (int64_t i = 0; i < count; i++) {
        /* the connectivity of a polyhedron lists faces, not vertices */
        int64_t vertex = is_cell_centred ? part->connectivity[part->offsets[i]] : i;
        if (is_cell_centred && part->types[i] == 42)
            vertex = part->face_connectivity[part->face_offsets[part->connectivity[part->offsets[i]]]];
        const double *p = part->coordinates + 3 * vertex;
        part->values[i] = sin(2 * p[0] + step) * cos(1.5 * p[1] - p[2]);
    }
    input_describe(in);
    if (!is_cell_centred) return;
    in->field.centring = INSITU_CELL;
    in->field.count = count;
}

static face_set compute_face_set(const char *scene, const session_input *whole, bool is_cell_centred)
{
    face_set out = {0};
    if (own_rank == 0) {
        insitu_session *session = open_session_and_draw(MPI_COMM_SELF, scene, whole);
        out =
            find_faces_by_brute_force(&whole->part, &session_find_mesh(&session->meshes, "m")->cells, is_cell_centred);
        insitu_destroy(&session);
    }
    MPI_Bcast(&out, 2, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    return out;
}

static void take_caught_picture(caught_picture *out)
{
    *out = (caught_picture){0};
    if (own_rank == 0) *out = caught[0];
    caught_count = 0;
}

/* Checks the faces and pictures of two steps with different values. */
static void check_threshold(test_mesh_kind kind, bool is_cell_centred, bool with_ghosts)
{
    session_input whole = {0}, part = {0};
    insitu_session *session = NULL;
    const char *scene = write_scene(IMAGE("field: f, from: -0.6, to: 0.9"));
    test_mesh_make_lattice(kind, SIDE, 0.2, test_linear_field, &whole.part);
    extract_own_cells(&whole.part, TEST_RANDOM, SIDE, with_ghosts, &part.part);
    for (int step = 0; step < 2; step++) {
        caught_picture alone = {0}, picture;
        set_values(&whole, is_cell_centred, step);
        const face_set truth = compute_face_set(scene, &whole, is_cell_centred);
        take_caught_picture(&alone);
        set_values(&part, is_cell_centred, step);
        part.mesh.changed = step ? 0 : INSITU_CHANGED_ALL;
        if (step == 0) session = open_session(MPI_COMM_WORLD, scene);
        discard_pictures();
        assert_int_equal(submit_input(session, &part), INSITU_OK);
        everywhere(insitu_step(session, step, step) == INSITU_OK);
        const face_set drawn = find_drawn_faces(session);
        if ((!truth.count || drawn.sum != truth.sum) && own_rank == 0)
            fprintf(stderr, "%s, step %d, cells %d: %d faces, expected %d\n", test_mesh_kind_name(kind), step,
                    is_cell_centred, (int)drawn.count, (int)truth.count);
        everywhere(truth.count > 0 && drawn.count == truth.count && drawn.sum == truth.sum);
        take_caught_picture(&picture);
        everywhere(own_rank != 0 || are_same_pictures(&picture, &alone));
        free_caught(&picture);
        free_caught(&alone);
    }
    insitu_destroy(&session);
    input_free(&part);
    input_free(&whole);
}

static void faces_enclose_the_cells_within_bounds(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int way = 0; way < 3; way++) check_threshold(kind, way == 1, way == 2);
}

/* Checks thresholds that select all cells or no cell, and a threshold on a field that the mesh does not have. */
static void bounds_can_select_all_or_no_cells(void **state)
{
    (void)state;
    static const char *const scenes[] = {IMAGE("field: f, from: -1e30"), IMAGE("field: f, to: -1e30"),
                                         IMAGE("field: g, from: 0")};
    session_input part = {0};
    input_create(&part, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 2; i++) {
        insitu_session *session = open_session_and_draw(MPI_COMM_WORLD, write_scene(scenes[i]), &part);
        everywhere(find_drawn_faces(session).count == (i ? 0 : 6 * SIDE * SIDE));
        caught_picture picture;
        take_caught_picture(&picture);
        free_caught(&picture);
        insitu_destroy(&session);
    }
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scenes[2]));
    assert_int_equal(submit_input(session, &part), INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "\"g\"");
    insitu_destroy(&session);
    input_free(&part);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(faces_enclose_the_cells_within_bounds),
                                       cmocka_unit_test(bounds_can_select_all_or_no_cells)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
