/* Checks cells that must not be drawn, of every type and distributed over any number of ranks. A cell whose own value
 * is not finite shows nothing, not even an isosurface of the means that its neighbours give to its vertices: the
 * picture is bit-identical to that with the cell flagged as a ghost. A cell without volume shows no isosurface,
 * although the field differs between its front and its back: the picture is bit-identical to that without the cell. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_mesh_make.h"
#include "test_session_fixture.h"

enum { SIDE = 3, WIDTH = 40, HEIGHT = 30 };

#define IMAGE(layers)                                                                                                  \
    "images:\n  - name: a\n    size: [40, 30]\n    layers:\n" layers "    outputs:\n      - path: a.exr\n"

static const char surface_scene[] = IMAGE("      - isosurface: {field: f, values: [0.1]}\n");
static const char clear_scene[] = IMAGE("      - isosurface: {field: f, values: [-0.3, 0.1], opacity: 0.4}\n");
static const char volume_scene[] = IMAGE("      - volume: {field: f, range: [-1, 1]}\n");
static const char *const scenes[] = {surface_scene, clear_scene, volume_scene};
enum { SCENES = sizeof scenes / sizeof *scenes };

/* Number of meshes: one of each kind, and mixed cells converted to polyhedra. */
enum { MESHES = TEST_KIND_COUNT + 1 };

static void make_mesh(int kind, test_mesh *out)
{
    test_mesh_make_lattice(kind < TEST_KIND_COUNT ? (test_mesh_kind)kind : TEST_MIXED, SIDE, 0.1, test_wave_field, out);
    if (kind == TEST_KIND_COUNT) test_mesh_to_polyhedra(out, 1);
}

static void extract_rank_cells(test_mesh *whole, session_input *out)
{
    int *owners = test_calloc((size_t)whole->cell_count + 1, sizeof *owners);
    test_partition_cells(whole, TEST_RANDOM, SIDE, rank_count, owners);
    test_mesh_extract_part(whole, owners, own_rank, &out->part);
    test_free(owners);
    input_describe(out);
}

static void draw_step(insitu_session *session, const session_input *in, int cycle, caught_picture *out)
{
    discard_pictures();
    everywhere(submit_input(session, in) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, cycle, 0), INSITU_OK, "");
    if (own_rank != 0) return;
    *out = caught[0];
    caught_count = 0;
}

/* Returns whether all channels of two pictures differ by at most the bound, and the first picture is not empty. */
static bool are_same_within_bound(const caught_picture *a, const caught_picture *b, double bound)
{
    int shown = 0;
    double worst = 0;
    if (own_rank != 0) return true;
    for (int i = 1; i < WIDTH * HEIGHT; i++) shown += memcmp(a->rgba, a->rgba + 4 * i, 4 * sizeof *a->rgba) != 0;
    for (int i = 0; i < 4 * WIDTH * HEIGHT; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    if (shown <= WIDTH * HEIGHT / 60 || worst > bound) fprintf(stderr, "%d pixels shown, off by %g\n", shown, worst);
    return shown > WIDTH * HEIGHT / 60 && worst <= bound &&
           !memcmp(a->depth, b->depth, sizeof *a->depth * WIDTH * HEIGHT);
}

static void free_picture(caught_picture *picture)
{
    if (own_rank != 0) return;
    free(picture->rgba);
    free(picture->depth);
}

/* ---- cells without a value of their own ---------------------------------------------------------------------- */

/* Returns the cell's value: the mean of the wave field at the cell's vertices or, for a polyhedron, at one vertex of
 * each face. */
static double compute_cell_value(const test_mesh *part, int64_t cell)
{
    double sum = 0;
    for (int64_t i = part->offsets[cell]; i < part->offsets[cell + 1]; i++) {
        int64_t vertex = part->connectivity[i];
        if (part->types[cell] == GRID_POLYHEDRON) vertex = part->face_connectivity[part->face_offsets[vertex]];
        sum += part->values[vertex];
    }
    return sum / (double)(part->offsets[cell + 1] - part->offsets[cell]);
}

static bool is_value_missing(int64_t cell)
{
    return test_uniform((uint64_t)(cell + 100 * own_rank), 8) < 0.3;
}

static void verify_cells_without_value(int kind, const char *scene)
{
    session_input in = {0};
    test_mesh whole;
    caught_picture lacking = {0}, ghosts = {0};
    int64_t lacking_count = 0;
    make_mesh(kind, &whole);
    extract_rank_cells(&whole, &in);
    double *values = test_calloc((size_t)in.part.cell_count + 1, sizeof *values);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    in.field.centring = INSITU_CELL;
    in.field.count = in.part.cell_count;
    in.field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) {
        values[cell] = is_value_missing(cell) ? (double)NAN : compute_cell_value(&in.part, cell);
        lacking_count += is_value_missing(cell);
    }
    draw_step(session, &in, 0, &lacking);
    everywhere(insitu_last_report(session)->cells_unusable == lacking_count);
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) {
        values[cell] = is_value_missing(cell) ? 1e3 : values[cell];
        in.part.ghosts[cell] = is_value_missing(cell);
    }
    draw_step(session, &in, 1, &ghosts);
    everywhere(are_same_within_bound(&lacking, &ghosts, scene == volume_scene ? 5e-7 : 0));
    free_picture(&lacking);
    free_picture(&ghosts);
    insitu_destroy(&session);
    test_free(values);
    input_free(&in);
    test_mesh_free(&whole);
}

static void cells_without_a_value_are_not_drawn(void **context)
{
    (void)context;
    for (int kind = 0; kind < MESHES; kind++)
        for (int i = 0; i < SCENES; i++) verify_cells_without_value(kind, scenes[i]);
}

/* Checks cells that lose their value while the means at vertices stay the same. All cells have equal values; from one
 * step to the next some of them lose their value, and others get theirs back. */
static void cells_that_lose_their_value_disappear_at_the_next_step(void **context)
{
    (void)context;
    session_input in = {0};
    test_mesh whole;
    make_mesh(TEST_HEXES, &whole);
    extract_rank_cells(&whole, &in);
    double *values = test_calloc((size_t)in.part.cell_count + 1, sizeof *values);
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene(IMAGE("      - isosurface: {field: f, values: [0.1]}\n")));
    in.field.centring = INSITU_CELL;
    in.field.count = in.part.cell_count;
    in.field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) values[cell] = 2;
    for (int step = 0; step < 3; step++) {
        caught_picture picture = {0};
        int64_t lacking = 0;
        for (int64_t cell = 0; cell < in.part.cell_count && step; cell++) {
            const bool lacks = (cell + step) % 3 == 0;
            values[cell] = lacks ? (double)NAN : 2;
            lacking += lacks;
        }
        draw_step(session, &in, step, &picture);
        everywhere(insitu_last_report(session)->cells_unusable == lacking);
        free_picture(&picture);
    }
    insitu_destroy(&session);
    test_free(values);
    input_free(&in);
    test_mesh_free(&whole);
}

/* ---- cells without volume ------------------------------------------------------------------------------------ */

/* Computes the position of vertex i of a flat cell. In hexes and wedges the front and the back are the same face, which
 * can be bent; tets and pyramids are in the plane of the first three corners. */
static void compute_flat_position(int type, double corners[4][3], int i, double place[3])
{
    static const double in_plane[5][2] = {{0, 0}, {0.5, 0}, {0.5, 0.5}, {0, 0.5}, {0.2, 0.1}};
    const int tet[4] = {0, 1, 3, 4};
    const double *at = in_plane[type == GRID_TET ? tet[i] : i % 5];
    for (int axis = 0; axis < 3; axis++) {
        const double *o = corners[0], *u = corners[1], *v = corners[2];
        if (type == GRID_HEX || type == GRID_WEDGE)
            place[axis] = corners[i % (type == GRID_HEX ? 4 : 3)][axis];
        else
            place[axis] = o[axis] + at[0] * (u[axis] - o[axis]) + at[1] * (v[axis] - o[axis]);
    }
}

/* Adds a flat cell whose vertices belong to no other cell. The field is -1 at one half of them and 1 at the other
 * half. */
static void add_flat_cell(test_mesh *mesh, int type, double corners[4][3])
{
    const int count = grid_type_vertex_count(type);
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < count; i++) {
        double place[3];
        compute_flat_position(type, corners, i, place);
        vertices[i] = test_mesh_add_vertex(mesh, place);
        mesh->values[vertices[i]] = 2 * i < count ? -1 : 1;
    }
    test_mesh_add_cell(mesh, type, vertices, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
}

/* Adds for every hex a flat cell on one of its faces. If as_polyhedra is set, all cells become polyhedra with plane
 * faces. */
static void add_flat_cells(test_mesh *mesh, bool as_polyhedra)
{
    static const int types[4] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID, GRID_TET};
    test_mesh old = *mesh;
    test_mesh_allocate(mesh, old.vertex_count + 8 * old.cell_count, 2 * old.cell_count, 16 * old.cell_count);
    for (int64_t v = 0; v < old.vertex_count; v++)
        mesh->values[test_mesh_add_vertex(mesh, old.coordinates + 3 * v)] = old.values[v];
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        const int64_t *own = old.connectivity + old.offsets[cell];
        double corners[4][3];
        for (int i = 0; i < 4; i++) memcpy(corners[i], old.coordinates + 3 * own[i], sizeof corners[i]);
        test_mesh_add_cell(mesh, GRID_HEX, own, (const int[]){0, 1, 2, 3, 4, 5, 6, 7});
        add_flat_cell(mesh, types[(uint64_t)cell % 4], corners);
    }
    test_mesh_free(&old);
    if (as_polyhedra) test_mesh_to_polyhedra(mesh, 1);
}

static void verify_flat(bool as_polyhedra, const char *scene)
{
    session_input bare = {0}, more = {0};
    test_mesh whole;
    caught_picture without = {0}, with = {0};
    test_mesh_make_lattice(TEST_HEXES, SIDE, as_polyhedra ? 0 : 0.1, test_wave_field, &whole);
    extract_rank_cells(&whole, &bare);
    extract_rank_cells(&whole, &more);
    const int64_t flat = more.part.cell_count;
    add_flat_cells(&more.part, as_polyhedra);
    if (as_polyhedra) test_mesh_to_polyhedra(&bare.part, 1);
    input_describe(&bare);
    input_describe(&more);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    draw_step(session, &bare, 0, &without);
    everywhere(insitu_last_report(session)->cells_flat == 0);
    draw_step(session, &more, 1, &with);
    everywhere(insitu_last_report(session)->cells_flat == flat);
    everywhere(are_same_within_bound(&without, &with, 0));
    free_picture(&without);
    free_picture(&with);
    insitu_destroy(&session);
    input_free(&bare);
    input_free(&more);
    test_mesh_free(&whole);
}

static void flat_cells_between_differing_fields_change_no_pixel(void **context)
{
    (void)context;
    for (int as_polyhedra = 0; as_polyhedra < 2; as_polyhedra++)
        for (int i = 0; i < SCENES; i++) verify_flat(as_polyhedra, scenes[i]);
}

/* Checks vertices that move although the arrays stay the same: hexes are flat in one step and have a volume in the
 * next. */
static void flat_cells_that_gain_volume_are_drawn(void **context)
{
    (void)context;
    session_input in = {0};
    test_mesh whole;
    caught_picture fresh = {0}, risen = {0};
    test_mesh_make_lattice(TEST_HEXES, SIDE, 0.1, test_wave_field, &whole);
    extract_rank_cells(&whole, &in);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(surface_scene));
    draw_step(session, &in, 0, &fresh);
    double *heights = test_calloc((size_t)in.part.vertex_count + 1, sizeof *heights);
    for (int64_t v = 0; v < in.part.vertex_count; v++) {
        heights[v] = in.part.coordinates[3 * v + 2];
        in.part.coordinates[3 * v + 2] = in.part.coordinates[3 * v] < 0.5 ? 0 : heights[v];
    }
    in.mesh.changed = INSITU_CHANGED_GEOMETRY;
    caught_picture flat = {0};
    draw_step(session, &in, 1, &flat);
    for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.coordinates[3 * v + 2] = heights[v];
    draw_step(session, &in, 2, &risen);
    everywhere(are_same_within_bound(&fresh, &risen, 0));
    free_picture(&fresh);
    free_picture(&flat);
    free_picture(&risen);
    test_free(heights);
    insitu_destroy(&session);
    input_free(&in);
    test_mesh_free(&whole);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_without_a_value_are_not_drawn),
        cmocka_unit_test(cells_that_lose_their_value_disappear_at_the_next_step),
        cmocka_unit_test(flat_cells_between_differing_fields_change_no_pixel),
        cmocka_unit_test(flat_cells_that_gain_volume_are_drawn),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
