/* Checks meshes that the scene warps. Their pictures must be bit-identical to those of a mesh that is passed with
 * vertices at x + scale * u, which the test computes in double. Tested are all forms of meshes, lattices, blocks and
 * cells of higher order, with displacements in arrays of any layout, on any ranks. Only what depends on a change may be
 * recomputed. Statistics must be those of the warped mesh, in closed form. A fault of the displacement field must be
 * reported on all ranks, with the line and the key of the scene. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "session.h"
#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_transformed.h"

enum { SIDE = 3, MOST_TEXT = 1 << 13 };

#define WARP "meshes: {m: {warp: {field: u, scale: 0.3}}}\n"
static const double scale = 0.3;

/* ---- displacements and moved coordinates ------------------------------------------------------------------------ */

static void compute_displacement(const double p[3], double out[3])
{
    out[0] = 0.3 * sin(2 * p[1] + p[2]) + 0.1 * p[0];
    out[1] = 0.25 * cos(3 * p[2] - p[0]);
    out[2] = 0.3 * sin(2 * p[0]) * cos(p[1]);
}

/* A packed field "u" at the vertices, and a mesh that is moved by it. Both have arrays of their own. */
typedef struct warped {
    int components;
    double *u;
    insitu_field field;
    void *places[3];
    insitu_lattice lattice;
    insitu_mesh moved;
} warped;

static void make_field(const insitu_mesh *mesh, int components, warped *out)
{
    *out = (warped){.components = components};
    out->u = test_calloc((size_t)(components * mesh->vertex_count) + 1, sizeof(double));
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double place[3], u[3];
        compute_vertex_position(mesh, v, place);
        compute_displacement(place, u);
        memcpy(out->u + components * v, u, (size_t)components * sizeof *u);
    }
    insitu_field_defaults(&out->field);
    out->field.name = "u";
    out->field.count = mesh->vertex_count;
    out->field.component_count = components;
    out->field.values = (insitu_array){out->u, INSITU_FLOAT64, 0};
}

/* Makes the moved mesh. Its coordinates have the types of the given ones, or are doubles if a lattice has coordinates
 * only along its axes. */
static void move_mesh(const insitu_mesh *mesh, double factor, warped *w)
{
    const bool has_axes = mesh->lattice && !mesh->coordinates[0].data;
    w->moved = *mesh;
    for (int axis = 0; axis < 3; axis++) {
        const insitu_array *given = &mesh->coordinates[axis];
        if (!given->data && axis >= w->components && !has_axes) continue;
        const insitu_type type = has_axes ? INSITU_FLOAT64 : mesh->coordinates[given->data ? axis : 0].type;
        test_free(w->places[axis]);
        w->places[axis] = test_calloc((size_t)mesh->vertex_count + 1, 8);
        for (int64_t v = 0; v < mesh->vertex_count; v++) {
            double place[3];
            compute_vertex_position(mesh, v, place);
            const double moved = place[axis] + (axis < w->components ? factor * w->u[w->components * v + axis] : 0);
            if (type == INSITU_FLOAT64)
                ((double *)w->places[axis])[v] = moved;
            else
                ((float *)w->places[axis])[v] = (float)moved;
        }
        w->moved.coordinates[axis] = (insitu_array){w->places[axis], type, 0};
    }
    if (!mesh->lattice) return;
    w->lattice = *mesh->lattice;
    for (int axis = 0; axis < 3; axis++) {
        w->lattice.spacing[axis] = w->lattice.origin[axis] = 0;
        w->lattice.axes[axis] = (insitu_array){0};
    }
    w->moved.lattice = &w->lattice;
}

static void create_warped_mesh(const insitu_mesh *mesh, int components, warped *out)
{
    make_field(mesh, components, out);
    move_mesh(mesh, scale, out);
}

static void free_warped(warped *w)
{
    test_free(w->u);
    for (int axis = 0; axis < 3; axis++) test_free(w->places[axis]);
    *w = (warped){0};
}

/* ---- all forms --------------------------------------------------------------------------------------------------- */

static void forms_draw_their_moved_meshes(void **state)
{
    (void)state;
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++)
        for (int with_corners = 0; with_corners <= formed_mesh_has_corners(form); with_corners++) {
            const char *scene = with_corners ? formed_corner_scene : formed_scene;
            formed_mesh m;
            warped w;
            formed_mesh_create(form, SIDE, own_rank, rank_count, &m);
            create_warped_mesh(&m.mesh, 3, &w);
            drawn a =
                draw_formed(open_session_from_texts(MPI_COMM_WORLD, WARP, scene), &m, &m.mesh, with_corners, &w.field);
            drawn b = draw_formed(open_session_from_texts(MPI_COMM_WORLD, "", scene), &m, &w.moved, with_corners, NULL);
            expect_same(&a, &b, mesh_form_name(form));
            free_warped(&w);
            formed_mesh_free(&m);
        }
}

static void check_warped_session_by(const char *keys, const insitu_mesh *mesh, const insitu_field *f, int components,
                                    const char *what)
{
    warped w;
    char text[256];
    snprintf(text, sizeof text, "%s%s", keys, WARP);
    create_warped_mesh(mesh, components, &w);
    drawn a = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, text, all_layers), mesh, f, &w.field);
    drawn b = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, keys, all_layers), &w.moved, f, NULL);
    expect_same(&a, &b, what);
    free_warped(&w);
}

static void check_warped_session(const insitu_mesh *mesh, const insitu_field *f, int components, const char *what)
{
    check_warped_session_by("", mesh, f, components, what);
}

/* Checks every third kind of cells of higher order, and by default every sixth: tets, hexes, wedges and pyramids. Finer
 * pieces are by default those of wedges and pyramids here, and those of hexes in the next test. */
static void cells_of_higher_order_draw_their_moved_nodes(void **state)
{
    (void)state;
    for (int k = test_case_count(3, 0); k < order_kind_count; k += test_case_count(6, 3)) {
        order_mesh m;
        order_mesh_create(&order_kinds[k], 2, 0.1, test_wave_field, own_rank, rank_count, &m);
        check_warped_session(&m.mesh, &m.field, 3, order_kinds[k].name);
        if (test_is_long_run() || k % 4 == 1)
            check_warped_session_by("finer_pieces: 2\n", &m.mesh, &m.field, 3, order_kinds[k].name);
        order_mesh_free(&m);
    }
}

/* Checks finer pieces of cells of higher order. They must be made of the moved nodes, and must be remade if the
 * displacements change, if the scene's warp is removed or added, or if nodes move. The session `plain` receives the
 * moved nodes as a new mesh in each step. */
static void refined_pieces_follow_the_warp(void **state)
{
    (void)state;
    static const double factors[] = {0.3, 0.3, 0.6, 0, 0.3, 0.3};
    static const order_kind hex = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    char text[MOST_TEXT];
    order_mesh m;
    warped w;
    order_mesh_create(&hex, 2, 0.1, test_wave_field, own_rank, rank_count, &m);
    make_field(&m.mesh, 3, &w);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(all_layers));
    insitu_session *plain = open_session_from_texts(MPI_COMM_WORLD, "finer_pieces: 2\n", all_layers);
    for (int i = 0; i < 6; i++) {
        snprintf(text, sizeof text, "finer_pieces: 2\nmeshes: {m: {warp: {field: u, scale: %g}}}\n%s", factors[i],
                 all_layers);
        write_scene(text);
        if (i == 5)
            for (int64_t n = 0; n < 3 * m.vertex_count; n++) m.coordinates[n] *= 1.25;
        m.mesh.changed = i == 5 ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
        w.field.changed = i ? INSITU_CHANGED_NOTHING : INSITU_CHANGED_ALL;
        everywhere(insitu_set_mesh(session, "m", &m.mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &m.field) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &w.field) == INSITU_OK);
        move_mesh(&m.mesh, factors[i], &w);
        w.moved.changed = INSITU_CHANGED_ALL;
        drawn a = step_and_take_pictures(session, i);
        everywhere(strstr(insitu_last_report(session)->copied_why, "with 2 pieces") != NULL || m.cell_count == 0);
        m.field.changed = INSITU_CHANGED_ALL;
        everywhere(insitu_set_mesh(plain, "m", &w.moved) == INSITU_OK);
        everywhere(insitu_set_field(plain, "m", &m.field) == INSITU_OK);
        drawn b = step_and_take_pictures(plain, i);
        expect_same(&a, &b, "a step");
    }
    insitu_destroy(&plain);
    insitu_destroy(&session);
    free_warped(&w);
    order_mesh_free(&m);
}

/* Checks Lagrange hexes without connectivity, which share no nodes. */
static void unshared_nodes_are_moved(void **state)
{
    (void)state;
    enum { ORDER = 2, NODES = 27, CELLS = 3 };
    static double places[CELLS * NODES][3], values[CELLS * NODES];
    for (int n = 0; n < CELLS * NODES; n++) {
        const int node = n % NODES, cell = n / NODES + CELLS * own_rank;
        places[n][0] = 0.5 * (node % 3) + cell;
        places[n][1] = 0.5 * (node / 3 % 3);
        places[n][2] = 0.5 * (node / 9);
        values[n] = test_wave_field(places[n]);
    }
    insitu_mesh mesh;
    insitu_field f;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = (int64_t)CELLS * NODES;
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_LAGRANGE_HEX;
    mesh.order = ORDER;
    mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    insitu_mesh_interleaved(&mesh, places, INSITU_FLOAT64);
    insitu_field_defaults(&f);
    f.name = "f";
    f.count = mesh.vertex_count;
    f.values = (insitu_array){values, INSITU_FLOAT64, 0};
    check_warped_session(&mesh, &f, 3, "own nodes");
}

/* ---- planes --------------------------------------------------------------------------------------------------- */

static void flat_meshes_move_by_two_or_three_components(void **state)
{
    (void)state;
    for (int is_wide = 0; is_wide < 2; is_wide++)
        for (int components = 2; components <= 3; components++) {
            plane p;
            make_plane(is_wide, &p);
            check_warped_session(&p.mesh, &p.field, components, "a plane without z");
            p.mesh.coordinates[2] = (insitu_array){p.values, INSITU_FLOAT64, 0};
            if (is_wide) check_warped_session(&p.mesh, &p.field, components, "a bent surface");
        }
}

/* ---- lattices and blocks ---------------------------------------------------------------------------------------- */

static void lattices_draw_their_moved_vertices(void **state)
{
    (void)state;
    for (lattice_form form = 0; form < LATTICE_FORMS; form++) {
        block b;
        make_block(form, own_rank, &b);
        check_warped_session(&b.mesh, &b.field, 3, lattice_form_name(form));
        if (form == QUADS) check_warped_session(&b.mesh, &b.field, 2, lattice_form_name(form));
    }
}

static void blocks_draw_their_moved_vertices(void **state)
{
    (void)state;
    for (lattice_form form = 0; form < LATTICE_FORMS; form++) {
        drawn pictures[2];
        for (int is_moved = 0; is_moved < 2; is_moved++) {
            insitu_session *session = is_moved ? open_session_from_texts(MPI_COMM_WORLD, "", all_layers)
                                               : open_session_from_texts(MPI_COMM_WORLD, WARP, all_layers);
            block b[2];
            warped w[2];
            for (int i = 0; i < 2; i++) {
                make_block(form, 2 * own_rank + i, &b[i]);
                create_warped_mesh(&b[i].mesh, 3, &w[i]);
                everywhere(insitu_set_block(session, "m", i, is_moved ? &w[i].moved : &b[i].mesh) == INSITU_OK);
                everywhere(insitu_set_block_field(session, "m", i, &b[i].field) == INSITU_OK);
                everywhere(insitu_set_block_field(session, "m", i, &w[i].field) == INSITU_OK);
            }
            pictures[is_moved] = step_and_take_pictures(session, 0);
            insitu_destroy(&session);
            for (int i = 0; i < 2; i++) free_warped(&w[i]);
        }
        expect_same(&pictures[0], &pictures[1], "blocks");
    }
}

/* ---- layouts of the displacements ------------------------------------------------------------------------------- */

typedef enum layout { TUPLES, FLOATS, APART, BY_INDEX, FILLED, LAYOUTS } layout;

/* Stores displacements, which are integers so that all types can represent them, in one of the layouts. room: memory
 * for the arrays. */
static void store_displacements(layout as, warped *w, void *room, int64_t *index, filled_values *values)
{
    static insitu_array apart[3];
    const int64_t count = w->field.count;
    insitu_field *u = &w->field;
    for (int64_t i = 0; i < count && as == FLOATS; i++)
        for (int c = 0; c < 3; c++) ((float *)room)[5 * i + c] = (float)w->u[3 * i + c];
    if (as == FLOATS) {
        u->values = (insitu_array){room, INSITU_FLOAT32, 20};
        u->component_stride_bytes = 4;
    }
    for (int64_t i = 0; i < count && as == APART; i++) {
        ((double *)room)[2 * i] = w->u[3 * i];
        ((float *)room)[4 * count + i] = (float)w->u[3 * i + 1];
        ((int16_t *)room)[12 * count + i] = (int16_t)w->u[3 * i + 2];
    }
    if (as == APART) {
        apart[0] = (insitu_array){room, INSITU_FLOAT64, 16};
        apart[1] = (insitu_array){(float *)room + 4 * count, INSITU_FLOAT32, 0};
        apart[2] = (insitu_array){(int16_t *)room + 12 * count, INSITU_INT16, 0};
        u->values = (insitu_array){0};
        u->components = apart;
    }
    for (int64_t i = 0; i < count && as == BY_INDEX; i++) {
        memcpy((double *)room + 3 * (count - 1 - i), w->u + 3 * i, 3 * sizeof(double));
        index[i] = count - 1 - i;
    }
    if (as == BY_INDEX) {
        u->values = (insitu_array){room, INSITU_FLOAT64, 0};
        u->index = (insitu_array){index, INSITU_INT64, 0};
    }
    if (as != FILLED) return;
    *values = (filled_values){u->values, u->count, 0};
    u->fill = copy_filled_values;
    u->fill_data = values;
}

static void displacements_are_read_in_any_layout(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_MIXED, SIDE, TEST_RANDOM, own_rank, rank_count);
    const size_t count = (size_t)in.part.vertex_count;
    void *room = test_calloc(6 * count + 1, 8);
    int64_t *index = test_calloc(count + 1, sizeof *index);
    for (layout as = 0; as < LAYOUTS; as++) {
        warped w;
        filled_values values = {0};
        make_field(&in.mesh, 3, &w);
        for (size_t i = 0; i < 3 * count; i++) w.u[i] = round(2 * w.u[i] / scale / 3);
        move_mesh(&in.mesh, scale, &w);
        insitu_field u = w.field;
        store_displacements(as, &w, room, index, &values);
        drawn a;
        if (as == FILLED) {
            w.field.values = (insitu_array){0};
            const insitu_field promised = w.field;
            w.field = u;
            a = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, WARP, all_layers), &in.mesh, &in.field, &promised);
            everywhere(values.calls == 1);
        } else {
            a = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, WARP, all_layers), &in.mesh, &in.field, &w.field);
        }
        drawn b = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, "", all_layers), &w.moved, &in.field, NULL);
        expect_same(&a, &b, "a layout of the displacements");
        free_warped(&w);
    }
    test_free(room);
    test_free(index);
    input_free(&in);
}

/* ---- partitions -------------------------------------------------------------------------------------------------- */

static void any_partition_draws_one_picture(void **state)
{
    (void)state;
    for (test_partition_kind kind = 0; kind < TEST_PARTITION_COUNT; kind++) {
        session_input part, whole;
        warped of_part, of_whole;
        input_create(&part, TEST_MIXED, SIDE, kind, own_rank, rank_count);
        input_create(&whole, TEST_MIXED, SIDE, kind, 0, 1);
        create_warped_mesh(&part.mesh, 3, &of_part);
        create_warped_mesh(&whole.mesh, 3, &of_whole);
        drawn a = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, WARP, surface_layers), &part.mesh, &part.field,
                            &of_part.field);
        drawn b = draw_mesh(open_session_from_texts(MPI_COMM_SELF, WARP, surface_layers), &whole.mesh, &whole.field,
                            &of_whole.field);
        for (int i = 0; own_rank != 0 && i < b.count; i++) free_caught(&b.pictures[i]);
        if (own_rank != 0) b.count = 0;
        expect_same(&a, &b, test_partition_kind_name(kind));
        free_warped(&of_part);
        free_warped(&of_whole);
        input_free(&part);
        input_free(&whole);
    }
}

/* ---- steps ------------------------------------------------------------------------------------------------------ */

typedef struct stamps {
    int64_t cells, coordinates;
} stamps;

static stamps get_stamps(const insitu_session *session)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    return (stamps){mesh->cells_stamp, mesh->coordinates_stamp};
}

/* Makes a step of the warped session, and checks that it draws the same pictures as the session `plain`, which receives
 * the moved mesh and has made the same steps. */
static void expect_step(insitu_session *session, insitu_session *plain, const session_input *in, double factor,
                        warped *w, int cycle, const char *what)
{
    insitu_field f = in->field;
    move_mesh(&in->mesh, factor, w);
    w->moved.changed = cycle ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_ALL;
    f.changed = INSITU_CHANGED_ALL;
    everywhere(insitu_set_mesh(plain, "m", &w->moved) == INSITU_OK && insitu_set_field(plain, "m", &f) == INSITU_OK);
    drawn a = step_and_take_pictures(session, cycle);
    drawn b = step_and_take_pictures(plain, cycle);
    expect_same(&a, &b, what);
}

static void steps_compute_only_what_has_changed(void **state)
{
    (void)state;
    session_input in;
    warped w;
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_field(&in.mesh, 3, &w);
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, WARP, all_layers);
    insitu_session *plain = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    expect_step(session, plain, &in, scale, &w, 0, "the first step");
    const stamps first = get_stamps(session);

    in.mesh.changed = in.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    expect_step(session, plain, &in, scale, &w, 1, "the same values again");
    everywhere(get_stamps(session).coordinates == first.coordinates);

    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    expect_step(session, plain, &in, scale, &w, 2, "the same mesh again");
    everywhere(get_stamps(session).coordinates == first.coordinates);

    if (own_rank == rank_count - 1) /* the change on the last rank must reach all other ranks */
        for (int64_t i = 0; i < 3 * in.part.vertex_count; i++) w.u[i] *= 1.5;
    everywhere(insitu_set_field(session, "m", &w.field) == INSITU_OK);
    const int64_t before = insitu_last_report(session)->bytes_copied;
    expect_step(session, plain, &in, scale, &w, 3, "other values on the last rank");
    everywhere((get_stamps(session).coordinates != first.coordinates) == (own_rank == rank_count - 1));
    everywhere(get_stamps(session).cells == first.cells && insitu_last_report(session)->bytes_copied == before);
    everywhere(insitu_last_report(session)->refit_ms > 0 || own_rank != rank_count - 1);

    in.mesh.changed = INSITU_CHANGED_GEOMETRY;
    for (int64_t i = 0; i < 3 * in.part.vertex_count; i++) in.part.coordinates[i] *= 1.25;
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    expect_step(session, plain, &in, scale, &w, 4, "other coordinates");

    in.mesh.changed = in.field.changed = INSITU_CHANGED_ALL;
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    expect_step(session, plain, &in, scale, &w, 5, "everything anew");
    insitu_destroy(&session);
    insitu_destroy(&plain);
    free_warped(&w);
    input_free(&in);
}

static void edits_of_the_scene_warp_and_unwarp(void **state)
{
    (void)state;
    session_input in;
    warped w;
    char text[MOST_TEXT];
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_field(&in.mesh, 3, &w);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(all_layers));
    insitu_session *plain = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    static const double factors[] = {0, 0.3, -0.2, 0, 0.3};
    for (int i = 0; i < 5; i++) {
        snprintf(text, sizeof text, "meshes: {m: {warp: {field: u, scale: %g}}}\n%s", factors[i], all_layers);
        write_scene(i == 3 ? all_layers : text);
        expect_step(session, plain, &in, factors[i], &w, i, "an edited scene");
        const char *why = insitu_last_report(session)->copied_why;
        everywhere(!strstr(why, "the scene's warp") == (factors[i] == 0 || in.part.vertex_count == 0));
    }
    insitu_destroy(&session);
    insitu_destroy(&plain);
    free_warped(&w);
    input_free(&in);
}

static void copies_and_gradients_are_reported(void **state)
{
    (void)state;
    session_input in;
    warped w;
    char words[160];
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_field(&in.mesh, 3, &w);
    insitu_session *session = open_session_from_texts(
        MPI_COMM_WORLD, WARP,
        "fields: {g: {gradient: f, component: x}}\nimages:\n" LAYERS("a", "[{surface: {colour_by: {field: "
                                                                          "g}}}]"));
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    drawn a = step_and_take_pictures(session, 0);
    const insitu_report *report = insitu_last_report(session);
    snprintf(words, sizeof words, "where the scene's warp moves them: %lld bytes",
             (long long)(24 * in.part.vertex_count));
    everywhere(strstr(report->copied_why, words) != NULL);
    everywhere(strstr(report->warnings, "derived field \"g\", are those of the warped mesh") != NULL);
    everywhere(!strstr(report->left_out, "\"u\""));
    free_picture_set(&a);
    insitu_destroy(&session);
    free_warped(&w);
    input_free(&in);
}

/* ---- statistics ------------------------------------------------------------------------------------------------- */

/* Checks the volume of a cube of volume 8 that is stretched by 1 + 0.3 along x. */
static void statistics_are_of_the_warped_mesh(void **state)
{
    (void)state;
    static char text[MOST_TEXT];
    session_input in;
    warped w;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    make_field(&in.mesh, 3, &w);
    for (int64_t v = 0; v < in.part.vertex_count; v++) {
        w.u[3 * v] = in.part.coordinates[3 * v];
        w.u[3 * v + 1] = w.u[3 * v + 2] = 0;
    }
    if (own_rank == 0) unlink("warp.csv");
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, WARP,
                                                      "statistics: [{field: f, path: warp.csv}]\nimages:\n" LAYERS(
                                                          "a", "[{surface: {}}]\n    when: {field: f, above: 1e30}"));
    everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &w.field) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    insitu_destroy(&session);
    read_file("warp.csv", sizeof text, text);
    everywhere(own_rank != 0 || fabs(read_last_number(text, 3) - 8 * 1.3) <= 1e-8); /* nine digits are written */
    free_warped(&w);
    input_free(&in);
}

/* ---- what is wrong ---------------------------------------------------------------------------------------------- */

typedef struct fault {
    const char *warp;
    void (*spoil)(insitu_field *u, insitu_mesh *mesh);
    const char *words[2];
} fault;

static void make_cell_field(insitu_field *u, insitu_mesh *mesh)
{
    u->centring = INSITU_CELL;
    u->count = mesh->cell_count;
}

static void make_corner_field(insitu_field *u, insitu_mesh *mesh)
{
    u->centring = INSITU_CORNER;
    u->count = mesh->connectivity_count;
}

static void set_one_component(insitu_field *u, insitu_mesh *mesh)
{
    (void)mesh;
    u->component_count = 1;
}

static void set_two_components(insitu_field *u, insitu_mesh *mesh)
{
    (void)mesh;
    u->component_count = 2;
}

static void set_four_components(insitu_field *u, insitu_mesh *mesh)
{
    (void)mesh;
    u->component_count = 4;
}

static void rename_field(insitu_field *u, insitu_mesh *mesh)
{
    (void)mesh;
    u->name = "v";
}

static void set_nan_component(insitu_field *u, insitu_mesh *mesh)
{
    (void)mesh;
    ((double *)(uintptr_t)u->values.data)[4] = (double)NAN;
}

static void set_bad_index(insitu_field *u, insitu_mesh *mesh)
{
    static int32_t index[1 << 12];
    assert_true(mesh->vertex_count <= 1 << 12);
    for (int64_t v = 0; v < mesh->vertex_count; v++) index[v] = (int32_t)v;
    index[2] = 1 << 20;
    u->index = (insitu_array){index, INSITU_INT32, 0};
}

static const fault faults[] = {
    {"{field: u}",
     make_cell_field,
     {"scene text:1: meshes.m.warp.field: field \"u\" of mesh \"m\" has values at cells",
      "expected values at vertices"}},
    {"{field: u}",
     make_corner_field,
     {"meshes.m.warp.field: field \"u\" of mesh \"m\" has values at corners of cells", "expected values at vertices"}},
    {"{field: u}",
     set_one_component,
     {"meshes.m.warp.field: field \"u\" of mesh \"m\" has 1 component, expected 3", ""}},
    {"{field: u}",
     set_two_components,
     {"meshes.m.warp.field: field \"u\" of mesh \"m\" has 2 components, expected 3", ""}},
    {"{field: u}",
     set_four_components,
     {"meshes.m.warp.field: field \"u\" of mesh \"m\" has 4 components, expected 3", ""}},
    {"{field: u}",
     rename_field,
     {"meshes.m.warp.field: mesh \"m\" has no field \"u\", expected one at its vertices", ""}},
    {"{field: u}", set_bad_index, {"mesh \"m\": field \"u\": the index of vertex 2 is 1048576, outside 0..", ""}},
    {"{field: u}", set_nan_component, {"has a coordinate that is not finite", "the scene's warp moves its vertices"}},
    {"{field: g}",
     NULL,
     {"scene text:1: meshes.m.warp.field: \"g\" is derived by the scene, expected a field that the", ""}},
};

static void errors_are_reported_with_line_and_key(void **state)
{
    (void)state;
    session_input in;
    warped w;
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    /* patches of the last rank's cells use vertex 1 */
    const size_t size = (size_t)(4 * in.part.vertex_count + in.part.connectivity_count * 4) + 1;
    double *values = test_calloc(size, sizeof *values);
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        char text[MOST_TEXT];
        insitu_session *session = NULL;
        snprintf(text, sizeof text, "meshes: {m: {warp: %s}}\nfields: {g: {gradient: f}}\n%s", faults[i].warp,
                 surface_layers);
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, text, &session), INSITU_OK);
        make_field(&in.mesh, 3, &w);
        insitu_field u = w.field;
        memset(values, 0, size * sizeof *values);
        u.values.data = values;
        if (own_rank == rank_count - 1 && faults[i].spoil) faults[i].spoil(&u, &in.mesh);
        for (int cycle = 0; cycle < 2; cycle++) { /* the error is returned by each step until it is corrected */
            everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &u) == INSITU_OK);
            discard_pictures();
            const insitu_status status = insitu_step(session, cycle, 0);
            everywhere(status != INSITU_OK && caught_count == 0);
            check_reported_everywhere(session, status, status, faults[i].words[0], faults[i].words[1]);
        }
        const insitu_field good = w.field;
        everywhere(submit_input(session, &in) == INSITU_OK && insitu_set_field(session, "m", &good) == INSITU_OK);
        if (faults[i].spoil) {
            drawn a = step_and_take_pictures(session, 2);
            everywhere(own_rank != 0 || a.count == 2);
            free_picture_set(&a);
        }
        insitu_destroy(&session);
        free_warped(&w);
    }
    test_free(values);
    input_free(&in);
}

static void unknown_mesh_names_give_a_warning(void **state)
{
    (void)state;
    char text[MOST_TEXT];
    session_input in;
    insitu_session *session = NULL;
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    snprintf(text, sizeof text, "%s\nmeshes:\n  plate: {warp: u}\n", surface_layers);
    assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, text, &session), INSITU_OK);
    everywhere(submit_input(session, &in) == INSITU_OK);
    drawn a = step_and_take_pictures(session, 0);
    everywhere(strstr(insitu_last_report(session)->warnings, "meshes.plate (line ") != NULL);
    free_picture_set(&a);
    insitu_destroy(&session);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forms_draw_their_moved_meshes),
        cmocka_unit_test(cells_of_higher_order_draw_their_moved_nodes),
        cmocka_unit_test(refined_pieces_follow_the_warp),
        cmocka_unit_test(unshared_nodes_are_moved),
        cmocka_unit_test(flat_meshes_move_by_two_or_three_components),
        cmocka_unit_test(lattices_draw_their_moved_vertices),
        cmocka_unit_test(blocks_draw_their_moved_vertices),
        cmocka_unit_test(displacements_are_read_in_any_layout),
        cmocka_unit_test(any_partition_draws_one_picture),
        cmocka_unit_test(steps_compute_only_what_has_changed),
        cmocka_unit_test(edits_of_the_scene_warp_and_unwarp),
        cmocka_unit_test(copies_and_gradients_are_reported),
        cmocka_unit_test(statistics_are_of_the_warped_mesh),
        cmocka_unit_test(errors_are_reported_with_line_and_key),
        cmocka_unit_test(unknown_mesh_names_give_a_warning),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
