/* Checks meshes that the scene mirrors. Their pictures must be bit-identical to those of a mesh that consists of
 * blocks, of which every second one is the mirror image of the one before, made by the test. Tested are all forms of
 * meshes, lattices, blocks, levels of refinement and cells of higher order, warped or not, on any ranks. Colours by
 * derived fields must be those of the given mesh (the source). Statistics and counts must include only the cells of the
 * source. Steps must follow changes of the source and of the scene. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "session.h"
#include "session_scalars.h"
#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_transformed.h"

enum { SIDE = 3, MOST_TEXT = 1 << 13, MOST_IMAGES = 8 };

/* ---- images by hand ---------------------------------------------------------------------------------------------- */

/* The planes of a mirror, and the scene's text that defines it. axes: bits of the axes that have a plane; planes:
 * coordinate of the plane along each of these axes. */
typedef struct mirror {
    int axes;
    double planes[3];
    const char *text;
} mirror;

static const mirror mirrors[] = {
    {1, {-1, 0, 0}, "meshes: {m: {mirror: {x: -1}}}\n"},
    {6, {0, 1, -1}, "meshes: {m: {mirror: {y: 1, z: -1}}}\n"},
    {7, {1, 1, 1}, "meshes:\n  m: {mirror: {x: 1, y: 1, z: 1}}\n"},
    {2, {0, 0, 0}, "meshes: {m: {mirror: [y]}}\n"},
};
enum { MIRRORS = sizeof mirrors / sizeof mirrors[0] };

/* Returns whether a coordinate is that of the mirror plane, except for rounding. */
static bool is_in_plane(const mirror *by, int axis, double place)
{
    return fabs(place - by->planes[axis]) < 1e-6;
}

static double mirror_place(const mirror *by, int axis, double place)
{
    return is_in_plane(by, axis, place) ? place : 2 * by->planes[axis] - place;
}

/* The description of a mirror image, with its own arrays. */
typedef struct mirror_image {
    void *places[3];
    double *along[3];
    int64_t *ids;
    insitu_lattice lattice;
    insitu_mesh mesh;
} mirror_image;

static void mirror_by_vertex(const insitu_mesh *mesh, int axes, const mirror *by, mirror_image *out)
{
    for (int axis = 0; axis < 3; axis++) {
        const insitu_array *given = &mesh->coordinates[axis];
        if (!(axes >> axis & 1)) continue;
        const insitu_type type = mesh->coordinates[given->data ? axis : 0].type;
        out->places[axis] = test_calloc((size_t)mesh->vertex_count + 1, 8);
        for (int64_t v = 0; v < mesh->vertex_count; v++) {
            double place[3];
            compute_vertex_position(mesh, v, place);
            if (type == INSITU_FLOAT64)
                ((double *)out->places[axis])[v] = mirror_place(by, axis, place[axis]);
            else
                ((float *)out->places[axis])[v] = (float)mirror_place(by, axis, place[axis]);
        }
        out->mesh.coordinates[axis] = (insitu_array){out->places[axis], type, 0};
    }
}

/* Mirrors a lattice that has coordinates along its axes, or is uniform; the image is rectilinear. */
static void mirror_along_axes(const insitu_mesh *mesh, int axes, const mirror *by, mirror_image *out)
{
    int64_t stride = 1;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t count = mesh->lattice->cells[axis] + 1;
        out->along[axis] = test_calloc((size_t)count, sizeof(double));
        for (int64_t n = 0; n < count; n++) {
            double place[3];
            compute_vertex_position(mesh, n * stride, place);
            out->along[axis][n] = axes >> axis & 1 ? mirror_place(by, axis, place[axis]) : place[axis];
        }
        stride *= count;
        out->lattice.axes[axis] = (insitu_array){out->along[axis], INSITU_FLOAT64, 0};
        out->lattice.spacing[axis] = out->lattice.origin[axis] = 0;
    }
}

/* Gives new ids to the image's vertices, except for those in the mirror planes, which are the source's own. */
static void renumber_vertices(const insitu_mesh *mesh, int axes, const mirror *by, mirror_image *out)
{
    out->ids = test_calloc((size_t)mesh->vertex_count + 1, sizeof *out->ids);
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double place[3];
        out->ids[v] = ((const int64_t *)mesh->vertex_ids.data)[v];
        compute_vertex_position(mesh, v, place);
        for (int axis = 0; axis < 3; axis++)
            if (axes >> axis & 1 && !is_in_plane(by, axis, place[axis])) out->ids[v] += (int64_t)1 << (45 + axis);
    }
    out->mesh.vertex_ids = (insitu_array){out->ids, INSITU_INT64, 0};
}

static void make_image(const insitu_mesh *mesh, int axes, const mirror *by, mirror_image *out)
{
    *out = (mirror_image){.mesh = *mesh};
    if (mesh->lattice) {
        out->lattice = *mesh->lattice;
        out->mesh.lattice = &out->lattice;
    }
    if (mesh->lattice && !mesh->coordinates[0].data)
        mirror_along_axes(mesh, axes, by, out);
    else
        mirror_by_vertex(mesh, axes, by, out);
    if (mesh->vertex_ids.data) renumber_vertices(mesh, axes, by, out);
}

static void free_image(mirror_image *i)
{
    for (int axis = 0; axis < 3; axis++) {
        test_free(i->places[axis]);
        test_free(i->along[axis]);
    }
    test_free(i->ids);
}

/* ---- pictures --------------------------------------------------------------------------------------------------- */

/* Passes a mesh and all its mirror images as blocks with these fields; the blocks' numbers begin at `first`. Returns
 * the number after the last block. */
static int set_mirrored_blocks(insitu_session *session, int first, const insitu_mesh *mesh, const mirror *by,
                               const insitu_field *fields, int count, mirror_image images[MOST_IMAGES])
{
    int block = first;
    for (int axes = 0; axes < 8; axes++) {
        if (axes & ~by->axes) continue;
        make_image(mesh, axes, by, &images[axes]);
        everywhere(insitu_set_block(session, "m", block, &images[axes].mesh) == INSITU_OK);
        for (int f = 0; f < count; f++)
            everywhere(insitu_set_block_field(session, "m", block, &fields[f]) == INSITU_OK);
        block++;
    }
    return block - first;
}

static void free_images(const mirror *by, mirror_image images[MOST_IMAGES])
{
    for (int axes = 0; axes < 8; axes++)
        if (!(axes & ~by->axes)) free_image(&images[axes]);
}

static drawn draw_blocks(const char *scene, const insitu_mesh *mesh, const mirror *by, const insitu_field *fields,
                         int count)
{
    mirror_image images[MOST_IMAGES];
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, "", scene);
    set_mirrored_blocks(session, 0, mesh, by, fields, count, images);
    drawn out = step_and_take_pictures(session, 0);
    insitu_destroy(&session);
    free_images(by, images);
    return out;
}

static void check_mirrored_session_by(const char *keys, const insitu_mesh *mesh, const insitu_field *f,
                                      const mirror *by, const char *what)
{
    char text[MOST_TEXT];
    snprintf(text, sizeof text, "%s%s", keys, all_layers);
    drawn a = draw_mesh(open_session_from_texts(MPI_COMM_WORLD, by->text, text), mesh, f, NULL);
    drawn b = draw_blocks(text, mesh, by, f, 1);
    expect_same(&a, &b, what);
}

static void check_mirrored_session(const insitu_mesh *mesh, const insitu_field *f, const mirror *by, const char *what)
{
    check_mirrored_session_by("", mesh, f, by, what);
}

static void forms_draw_their_images(void **state)
{
    (void)state;
    for (mesh_form form = 0; form < MESH_FORM_COUNT; form++)
        for (int with_corners = 0; with_corners <= formed_mesh_has_corners(form); with_corners++) {
            const char *scene = with_corners ? formed_corner_scene : formed_scene;
            const mirror *by = &mirrors[form % 2];
            formed_mesh m;
            formed_mesh_create(form, SIDE, own_rank, rank_count, &m);
            drawn a =
                draw_formed(open_session_from_texts(MPI_COMM_WORLD, by->text, scene), &m, &m.mesh, with_corners, NULL);
            drawn b = draw_blocks(scene, &m.mesh, by, m.fields, with_corners ? FORMED_FIELDS : FORMED_D);
            expect_same(&a, &b, mesh_form_name(form));
            formed_mesh_free(&m);
        }
}

static void all_mirror_planes_draw_images(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_MIXED, SIDE, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 3; i++) check_mirrored_session(&in.mesh, &in.field, &mirrors[i], mirrors[i].text);
    input_free(&in);
}

static void cells_of_higher_order_draw_their_images(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k += test_case_count(8, 4)) {
        order_mesh m;
        order_mesh_create(&order_kinds[k], 2, 0.1, test_wave_field, own_rank, rank_count, &m);
        check_mirrored_session(&m.mesh, &m.field, &mirrors[0], order_kinds[k].name);
        check_mirrored_session_by("finer_pieces: 2\n", &m.mesh, &m.field, &mirrors[0], order_kinds[k].name);
        order_mesh_free(&m);
    }
}

static void planes_and_lattices_draw_their_images(void **state)
{
    (void)state;
    for (int is_wide = 0; is_wide < 2; is_wide++) {
        plane p;
        make_plane(is_wide, &p);
        check_mirrored_session(&p.mesh, &p.field, &mirrors[3], "a plane");
    }
    for (lattice_form form = 0; form < LATTICE_FORMS; form++) {
        block b;
        make_block(form, own_rank, &b);
        check_mirrored_session(&b.mesh, &b.field, &mirrors[0], lattice_form_name(form));
        if (form != QUADS) check_mirrored_session(&b.mesh, &b.field, &mirrors[1], lattice_form_name(form));
    }
}

static void blocks_draw_their_images(void **state)
{
    (void)state;
    for (lattice_form form = 0; form < LATTICE_FORMS; form++) {
        drawn pictures[2];
        const mirror *by = &mirrors[0];
        for (int by_hand = 0; by_hand < 2; by_hand++) {
            insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, by_hand ? "" : by->text, all_layers);
            block b[2];
            mirror_image images[2][MOST_IMAGES];
            for (int i = 0, number = 0; i < 2; i++) {
                make_block(form, 2 * own_rank + i, &b[i]);
                if (by_hand)
                    number += set_mirrored_blocks(session, number, &b[i].mesh, by, &b[i].field, 1, images[i]);
                else
                    everywhere(insitu_set_block(session, "m", i, &b[i].mesh) == INSITU_OK &&
                               insitu_set_block_field(session, "m", i, &b[i].field) == INSITU_OK);
            }
            pictures[by_hand] = step_and_take_pictures(session, 0);
            insitu_destroy(&session);
            for (int i = 0; by_hand && i < 2; i++) free_images(by, images[i]);
        }
        expect_same(&pictures[0], &pictures[1], "blocks");
    }
}

/* ---- planes at decimal numbers ----------------------------------------------------------------------------------- */

/* A mirror plane at 0.3. Neither 0.3 as a float32 number nor 3 * 0.1 is equal to it. */
static const mirror decimal_mirror = {1, {0.3, 0, 0}, "meshes: {m: {mirror: {x: 0.3}}}\n"};

/* Moves vertices at x = -1 to x = 3 * 0.1, which exceeds 0.3, and all others to larger x. */
static void move_to_decimal_plane(double *coordinates, int64_t vertex_count)
{
    for (int64_t v = 0; v < vertex_count; v++) coordinates[3 * v] = (3 + 2 * (1 + coordinates[3 * v])) * 0.1;
}

static void check_forms_at_decimal_plane(const mirror *by)
{
    session_input in;
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    move_to_decimal_plane(in.part.coordinates, in.part.vertex_count);
    check_mirrored_session(&in.mesh, &in.field, by, "cells with float64 coordinates");
    input_free(&in);
    for (int k = 0; k < order_kind_count; k += 8) {
        order_mesh m;
        order_mesh_create(&order_kinds[k], 2, 0, test_wave_field, own_rank, rank_count, &m);
        move_to_decimal_plane(m.coordinates, m.vertex_count);
        check_mirrored_session(&m.mesh, &m.field, by, order_kinds[k].name);
        order_mesh_free(&m);
    }
    for (lattice_form form = UNIFORM; form <= RECTILINEAR; form++) {
        block b;
        make_block(form, own_rank, &b);
        for (int n = 0; n <= ACROSS; n++) b.axes[0][n] = (float)(0.3 + 0.1 * n);
        if (form == UNIFORM) {
            b.lattice.origin[0] = 0;
            b.lattice.spacing[0] = 0.1;
            b.lattice.first[0] = 3;
        }
        check_mirrored_session(&b.mesh, &b.field, by, lattice_form_name(form));
    }
}

/* Checks that vertices in a plane that is a rounded decimal number belong to the mesh and to its image, although they
 * are rounded in another way, and that no other vertices do. */
static void vertices_in_decimal_planes_belong_to_both_sides(void **state)
{
    (void)state;
    plane p;
    make_plane(0, &p);
    for (int v = 0; v < 16; v++) p.narrow[v][0] = (float)(0.3 + 0.2 * (v % 4));
    check_mirrored_session(&p.mesh, &p.field, &decimal_mirror, "quads with float32 coordinates");
    check_forms_at_decimal_plane(&decimal_mirror);
}

/* ---- levels of refinement ---------------------------------------------------------------------------------------- */

enum { COARSE = 4, FINE = 4 };

/* Makes the coarse block of 4^3 cells from x = 0 on, or the fine block that covers its first half along x, y and z. If
 * is_mirrored is set, makes the mirror image at negative x, whose indices and values begin at the other end. */
static void make_level(bool is_fine, bool is_mirrored, double values[125], insitu_lattice *l, insitu_mesh *mesh,
                       insitu_field *f)
{
    const int count = is_fine ? FINE : COARSE;
    *l = (insitu_lattice){.cells = {count, count, count}};
    for (int axis = 0; axis < 3; axis++) {
        l->spacing[axis] = is_fine ? 0.125 : 0.25;
        l->refinement[axis] = is_fine ? 2 : 1;
    }
    l->origin[1] = l->origin[2] = (double)own_rank;
    if (is_mirrored) l->first[0] = -count;
    for (int v = 0; v < 125; v++) {
        const int at[3] = {v % 5, v / 5 % 5, v / 25};
        double place[3];
        for (int axis = 0; axis < 3; axis++) place[axis] = l->origin[axis] + l->spacing[axis] * at[axis];
        const int to = is_mirrored ? v - at[0] + 4 - at[0] : v;
        values[to] = test_wave_field(place);
    }
    insitu_mesh_defaults(mesh);
    mesh->lattice = l;
    mesh->vertex_count = 125;
    mesh->cell_count = 64;
    insitu_field_defaults(f);
    f->name = "f";
    f->count = 125;
    f->values = (insitu_array){values, INSITU_FLOAT64, 0};
}

static void levels_draw_their_images(void **state)
{
    (void)state;
    static const char scene[] =
        "threads: 1\nimages:\n" LAYERS("a", "[{isosurface: {field: f, values: [0.1], normals: vertex}}]")
            LAYERS("b", "[{surface: {colour_by: {field: f}, edges: {}}}]") LAYERS("c", "[{surface: {opacity: 0.5}}]");
    drawn pictures[2];
    for (int by_hand = 0; by_hand < 2; by_hand++) {
        insitu_session *session =
            open_session_from_texts(MPI_COMM_WORLD, by_hand ? "" : "meshes: {m: {mirror: x}}\n", scene);
        double values[4][125];
        insitu_lattice l[4];
        insitu_mesh mesh[4];
        insitu_field f[4];
        for (int i = 0; i < (by_hand ? 4 : 2); i++) {
            make_level(i % 2, i / 2, values[i], &l[i], &mesh[i], &f[i]);
            everywhere(insitu_set_block(session, "m", i, &mesh[i]) == INSITU_OK &&
                       insitu_set_block_field(session, "m", i, &f[i]) == INSITU_OK);
        }
        pictures[by_hand] = step_and_take_pictures(session, 0);
        insitu_destroy(&session);
    }
    expect_same(&pictures[0], &pictures[1], "levels of refinement");
}

/* Returns whether the mirror image of each of this rank's blocks has the source's current flags of covered cells. */
static bool have_images_current_covers(const insitu_session *session)
{
    const session_parts parts = session_find_parts(&session->meshes, "m");
    bool are_current = true;
    for (int i = 0; i < parts.count; i++) {
        const session_mesh *source = parts.items[i]->source;
        are_current = are_current && (!source || parts.items[i]->given.ghosts.data == source->covered);
    }
    return are_current;
}

/* Checks that mirror images follow the covered cells of blocks that are not set again themselves: another block is set
 * again with the same cells, at another place, and removed. The image borrows the array of covered cells, which must
 * not be freed. */
static void covered_cells_of_images_follow_changes(void **state)
{
    (void)state;
    static const char scene[] = "threads: 1\nimages:\n" LAYERS("a", "[{surface: {colour_by: {field: f}, edges: {}}}]")
        LAYERS("b", "[{isosurface: {field: f, values: [0.1]}}]");
    static const char mirrored[] = "meshes: {m: {mirror: x}}\n";
    double values[2][125];
    insitu_lattice l[2];
    insitu_mesh mesh[2];
    insitu_field f[2];
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, mirrored, scene);
    for (int cycle = 0; cycle < 4; cycle++) {
        insitu_session *fresh = open_session_from_texts(MPI_COMM_WORLD, mirrored, scene);
        for (int i = 0; i < 2; i++) {
            const bool is_removed = i && cycle == 3;
            make_level(i, false, values[i], &l[i], &mesh[i], &f[i]);
            if (i && cycle == 2) l[i].first[0] = FINE;
            if (i || cycle == 0)
                everywhere(insitu_set_block(session, "m", i, is_removed ? NULL : &mesh[i]) == INSITU_OK &&
                           (is_removed || insitu_set_block_field(session, "m", i, &f[i]) == INSITU_OK));
            if (is_removed) continue;
            everywhere(insitu_set_block(fresh, "m", i, &mesh[i]) == INSITU_OK &&
                       insitu_set_block_field(fresh, "m", i, &f[i]) == INSITU_OK);
        }
        drawn a = step_and_take_pictures(session, cycle), b = step_and_take_pictures(fresh, cycle);
        everywhere(have_images_current_covers(session));
        expect_same(&a, &b, "covered cells");
        insitu_destroy(&fresh);
    }
    insitu_destroy(&session);
}

/* ---- partitions and derived fields ------------------------------------------------------------------------------- */

static void any_partition_draws_one_picture(void **state)
{
    (void)state;
    for (test_partition_kind kind = 0; kind < TEST_PARTITION_COUNT; kind++) {
        session_input part, whole;
        input_create(&part, TEST_MIXED, SIDE, kind, own_rank, rank_count);
        input_create(&whole, TEST_MIXED, SIDE, kind, 0, 1);
        const char *text = mirrors[1].text;
        drawn a =
            draw_mesh(open_session_from_texts(MPI_COMM_WORLD, text, surface_layers), &part.mesh, &part.field, NULL);
        drawn b =
            draw_mesh(open_session_from_texts(MPI_COMM_SELF, text, surface_layers), &whole.mesh, &whole.field, NULL);
        if (own_rank != 0) free_picture_set(&b);
        expect_same(&a, &b, test_partition_kind_name(kind));
        input_free(&part);
        input_free(&whole);
    }
}

/* Returns the values of a derived field at the vertices of this rank's part. */
static double *get_derived_values(const insitu_session *session, const char *name, int64_t count)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    double *out = test_calloc((size_t)count + 1, sizeof *out);
    const int index = session_find_field(mesh, name);
    assert_true(index >= 0 && mesh->fields[index].is_derived);
    const grid_field values = session_get_caller_values(mesh, index, 0);
    for (int64_t v = 0; v < count; v++) out[v] = grid_field_value(&values, v);
    return out;
}

/* Checks that a mirror image has the colours of the source's gradients: means at vertices in the mirror plane do not
 * include cells of the image. */
static void derived_fields_are_those_of_the_source(void **state)
{
    (void)state;
    static const char scene[] =
        "threads: 1\nimages:\n" LAYERS("a", "[{surface: {colour_by: {field: g, range: [-6, 6]}}}]")
            LAYERS("b", "[{isosurface: {field: h, values: [0.2]}}]");
    session_input in;
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    char before[MOST_TEXT];
    snprintf(before, sizeof before, "%sfields: {g: {gradient: f, component: x}, h: f * f}\n", mirrors[0].text);
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, before, scene);
    everywhere(submit_input(session, &in) == INSITU_OK);
    for (int cycle = 0; cycle < 2; cycle++) {
        for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.values[v] *= cycle ? 1.5 : 1;
        everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
        drawn a = step_and_take_pictures(session, cycle);
        double *values[2] = {get_derived_values(session, "g", in.part.vertex_count),
                             get_derived_values(session, "h", in.part.vertex_count)};
        insitu_session *alone = open_session_from_texts(MPI_COMM_WORLD, before + strlen(mirrors[0].text), scene);
        everywhere(submit_input(alone, &in) == INSITU_OK);
        drawn of_alone = step_and_take_pictures(alone, cycle);
        double *expected = get_derived_values(alone, "g", in.part.vertex_count);
        everywhere(memcmp(values[0], expected, (size_t)in.part.vertex_count * sizeof *expected) == 0);
        insitu_destroy(&alone);
        free_picture_set(&of_alone);
        test_free(expected);
        insitu_field fields[2] = {in.field, in.field};
        for (int i = 0; i < 2; i++) {
            fields[i].name = i ? "h" : "g";
            fields[i].values = (insitu_array){values[i], INSITU_FLOAT64, 0};
        }
        drawn b = draw_blocks(scene, &in.mesh, &mirrors[0], fields, 2);
        expect_same(&a, &b, "derived fields");
        test_free(values[0]);
        test_free(values[1]);
    }
    insitu_destroy(&session);
    input_free(&in);
}

typedef enum copied_cells { INDEXED, FILLED, OF_HIGHER_ORDER, COPIED_CELLS } copied_cells;

/* Sets a mesh with a field of its cells whose values the library copies: because they have an index, because a fill
 * function computes them, or because cells of higher order are split into pieces. */
static void set_copied_cells(insitu_session *session, copied_cells kind, const insitu_mesh *mesh, double *values,
                             int32_t *index, filled_values *filled)
{
    insitu_field field;
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        values[i] = sin((double)(7 * i + own_rank));
        index[i] = (int32_t)(mesh->cell_count - 1 - i);
    }
    *filled = (filled_values){{values, INSITU_FLOAT64, 0}, mesh->cell_count, 0};
    insitu_field_defaults(&field);
    field.name = "c";
    field.centring = INSITU_CELL;
    if (kind == INDEXED) field.index = (insitu_array){index, INSITU_INT32, 0};
    if (kind == FILLED) {
        field.fill = copy_filled_values;
        field.fill_data = filled;
    } else {
        field.count = mesh->cell_count;
        field.values = filled->values;
    }
    everywhere(insitu_set_mesh(session, "m", mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
}

/* Checks that gradients of cell values that the library copies are those of the mesh without its mirror images. The
 * means at vertices, from which they are computed, read the copies on the images, too. */
static void gradients_of_copied_cell_values_are_those_of_the_source(void **state)
{
    (void)state;
    static const char scene[] = "fields: {g: {gradient: c, component: x}}\n"
                                "threads: 1\nimages:\n" LAYERS("a", "[{surface: {colour_by: {field: g}}}]");
    session_input in;
    order_mesh order;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    order_mesh_create(&order_kinds[1], 2, 0.1, test_wave_field, own_rank, rank_count, &order);
    for (copied_cells kind = 0; kind < COPIED_CELLS; kind++) {
        const insitu_mesh *mesh = kind == OF_HIGHER_ORDER ? &order.mesh : &in.mesh;
        double *values = test_calloc((size_t)mesh->cell_count + 1, sizeof *values);
        int32_t *index = test_calloc((size_t)mesh->cell_count + 1, sizeof *index);
        filled_values filled;
        const session_field *of_g[2];
        insitu_session *sessions[2];
        for (int i = 0; i < 2; i++) {
            sessions[i] = open_session_from_texts(MPI_COMM_WORLD, i ? "" : mirrors[0].text, scene);
            set_copied_cells(sessions[i], kind, mesh, values, index, &filled);
            drawn pictures = step_and_take_pictures(sessions[i], 0);
            free_picture_set(&pictures);
            const session_mesh *part = session_find_mesh(&sessions[i]->meshes, "m");
            of_g[i] = &part->fields[session_find_field(part, "g")];
        }
        everywhere(of_g[0]->copy_bytes == of_g[1]->copy_bytes &&
                   memcmp(of_g[0]->copy, of_g[1]->copy, (size_t)of_g[0]->copy_bytes) == 0);
        for (int i = 0; i < 2; i++) insitu_destroy(&sessions[i]);
        test_free(values);
        test_free(index);
    }
    order_mesh_free(&order);
    input_free(&in);
}

/* ---- steps ------------------------------------------------------------------------------------------------------- */

/* Makes a step of the mirrored session, and checks that it draws the same pictures as the session `blocks`, which
 * receives the mesh and its mirror images as blocks and has made the same steps. */
static void expect_step(insitu_session *session, insitu_session *blocks, const session_input *in, const mirror *by,
                        int cycle, const char *what)
{
    mirror_image images[MOST_IMAGES];
    insitu_mesh mesh = in->mesh;
    insitu_field f = in->field;
    mesh.changed = f.changed = INSITU_CHANGED_ALL;
    set_mirrored_blocks(blocks, 0, &mesh, by, &f, 1, images);
    drawn a = step_and_take_pictures(session, cycle);
    drawn b = step_and_take_pictures(blocks, cycle);
    expect_same(&a, &b, what);
    free_images(by, images);
}

static void mirrored_images_follow_changes(void **state)
{
    (void)state;
    session_input in;
    const mirror *by = &mirrors[0];
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, by->text, all_layers);
    insitu_session *blocks = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    everywhere(submit_input(session, &in) == INSITU_OK);
    expect_step(session, blocks, &in, by, 0, "the first step");
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_mesh *its_image = session_find_mirror_image(&session->meshes, mesh, 1);
    const int64_t stamp = its_image->coordinates_stamp;

    in.mesh.changed = in.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(submit_input(session, &in) == INSITU_OK);
    expect_step(session, blocks, &in, by, 1, "nothing new");
    everywhere(session_find_mirror_image(&session->meshes, mesh, 1) == its_image &&
               its_image->coordinates_stamp == stamp);

    for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.values[v] = cos(3 * in.part.values[v]);
    in.field.changed = INSITU_CHANGED_VALUES;
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    expect_step(session, blocks, &in, by, 2, "other values");
    everywhere(its_image->coordinates_stamp == stamp);

    double *elsewhere = test_calloc((size_t)in.part.vertex_count + 1, sizeof *elsewhere);
    for (int64_t v = 0; v < in.part.vertex_count; v++) elsewhere[v] = -in.part.values[v];
    in.field.values.data = elsewhere;
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    expect_step(session, blocks, &in, by, 3, "values elsewhere");

    for (int64_t i = 0; i < 3 * in.part.vertex_count; i++)
        in.part.coordinates[i] = i % 3 ? 1.1 * in.part.coordinates[i] : in.part.coordinates[i];
    in.mesh.changed = INSITU_CHANGED_GEOMETRY;
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    expect_step(session, blocks, &in, by, 4, "other coordinates");

    in.part.ghosts[0] = 1;
    in.mesh.changed = in.field.changed = INSITU_CHANGED_ALL;
    everywhere(submit_input(session, &in) == INSITU_OK);
    expect_step(session, blocks, &in, by, 5, "a ghost");

    everywhere(insitu_set_mesh(session, "m", NULL) == INSITU_OK && session->meshes.count == 0);
    everywhere(submit_input(session, &in) == INSITU_OK);
    expect_step(session, blocks, &in, by, 6, "the mesh removed and set again");
    insitu_destroy(&session);
    insitu_destroy(&blocks);
    test_free(elsewhere);
    input_free(&in);
}

static void edits_of_the_scene_mirror_and_unmirror(void **state)
{
    (void)state;
    session_input in;
    char text[MOST_TEXT];
    static const int order[] = {-1, 0, 1, 0, -1, 2};
    static const mirror none = {0, {0, 0, 0}, ""};
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(all_layers));
    insitu_session *blocks = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    everywhere(submit_input(session, &in) == INSITU_OK);
    for (int i = 0; i < 6; i++) {
        const mirror *by = order[i] < 0 ? &none : &mirrors[order[i]];
        snprintf(text, sizeof text, "%s# %d\n%s", by->text, i, all_layers);
        write_scene(text);
        if (i) everywhere(insitu_set_mesh(blocks, "m", NULL) == INSITU_OK);
        expect_step(session, blocks, &in, by, i, "an edited scene");
    }
    insitu_destroy(&session);
    insitu_destroy(&blocks);
    input_free(&in);
}

static void errors_name_the_source_mesh(void **state)
{
    (void)state;
    session_input in;
    const mirror *by = &mirrors[1];
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, by->text, all_layers);
    insitu_session *blocks = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    for (int cycle = 0; cycle < 2; cycle++) {
        const double good = in.part.coordinates[4];
        if (own_rank == rank_count - 1) in.part.coordinates[4] = (double)NAN;
        everywhere(submit_input(session, &in) == INSITU_OK);
        insitu_status status = insitu_step(session, cycle, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_MESH, "mesh \"m\": cell",
                                  "vertex 1 has a coordinate that is not");
        in.part.coordinates[4] = good;
        if (cycle) continue;
        everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
        expect_step(session, blocks, &in, by, cycle, "a mended mesh");
        insitu_field wrong = in.field; /* only the field is set, with too few values */
        wrong.count--;
        everywhere(insitu_set_field(session, "m", &wrong) == INSITU_ERROR_FIELD);
        status = insitu_step(session, cycle, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "mesh \"m\": field \"f\"");
        everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
        expect_step(session, blocks, &in, by, cycle, "a mended field");
    }
    insitu_destroy(&session);
    insitu_destroy(&blocks);
    input_free(&in);
}

/* ---- with a warp, and filled fields ------------------------------------------------------------------------------ */

static void warped_meshes_are_mirrored_after_the_warp(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    const int64_t count = 3 * in.part.vertex_count;
    double *u = test_calloc((size_t)count + 1, sizeof *u);
    for (int64_t i = 0; i < count; i++) u[i] = i % 3 ? 0.3 * sin(3 * in.part.coordinates[i - i % 3]) : 0;
    filled_values values = {{u, INSITU_FLOAT64, 0}, in.part.vertex_count, 0};
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "u";
    field.component_count = 3;
    field.fill = copy_filled_values;
    field.fill_data = &values;
    static const char scene[] =
        "threads: 1\nimages:\n" LAYERS("a", "[{surface: {colour_by: {field: u, component: y}}}]")
            LAYERS("b", "[{volume: {field: f}}]");
    drawn a = draw_mesh(open_session_from_texts(
                            MPI_COMM_WORLD, "meshes: {m: {warp: {field: u, scale: 0.5}, mirror: {x: -1}}}\n", scene),
                        &in.mesh, &in.field, &field);
    everywhere(values.calls == 1);
    for (int64_t i = 0; i < count; i++) in.part.coordinates[i] += 0.5 * u[i];
    insitu_field fields[2] = {in.field, field};
    fields[1].fill = NULL;
    fields[1].count = in.part.vertex_count;
    fields[1].values = (insitu_array){u, INSITU_FLOAT64, 0};
    drawn b = draw_blocks(scene, &in.mesh, &mirrors[0], fields, 2);
    expect_same(&a, &b, "a warped mesh");
    test_free(u);
    input_free(&in);
}

static void fill_functions_are_called_once(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_MIXED, SIDE, TEST_BLOCK, own_rank, rank_count);
    filled_values values = {{in.part.values, INSITU_FLOAT64, 0}, in.part.vertex_count, 0};
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "f";
    field.fill = copy_filled_values;
    field.fill_data = &values;
    insitu_session *session = open_session_from_texts(MPI_COMM_WORLD, mirrors[0].text, all_layers);
    insitu_session *blocks = open_session_from_texts(MPI_COMM_WORLD, "", all_layers);
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
    for (int cycle = 0; cycle < 3; cycle++) {
        for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.values[v] *= 0.9;
        expect_step(session, blocks, &in, &mirrors[0], cycle, "filled values");
        everywhere(values.calls == cycle + 1);
    }
    insitu_destroy(&session);
    insitu_destroy(&blocks);
    input_free(&in);
}

/* ---- numbers and warnings ---------------------------------------------------------------------------------------- */

static void counts_include_only_source_cells(void **state)
{
    (void)state;
    static char text[MOST_TEXT];
    session_input in;
    input_create(&in, TEST_HEXES, SIDE, TEST_RANDOM, own_rank, rank_count);
    if (own_rank == 0) unlink("mirror.csv");
    insitu_session *session =
        open_session_from_texts(MPI_COMM_WORLD, mirrors[2].text,
                                "statistics: [{field: f, path: mirror.csv}]\nimages:\n" LAYERS("a", "[{surface: {}}]"));
    everywhere(submit_input(session, &in) == INSITU_OK);
    drawn a = step_and_take_pictures(session, 0);
    const insitu_report *report = insitu_last_report(session);
    char words[100];
    snprintf(words, sizeof words, "coordinates of its mirror images: %lld bytes",
             (long long)(7 * 3 * 8 * in.part.vertex_count));
    everywhere(report->cells == in.part.cell_count && report->cells_inverted == 0);
    everywhere(strstr(report->copied_why, words) != NULL);
    everywhere(*report->warnings == '\0');
    insitu_destroy(&session);
    read_file("mirror.csv", sizeof text, text);
    everywhere(own_rank != 0 ||
               (fabs(read_last_number(text, 3) - 8) <= 1e-8 && fabs(read_last_number(text, 2) - 27) <= 0));
    free_picture_set(&a);
    input_free(&in);
}

static void unlikely_mirror_planes_give_a_warning(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session_from_texts(
        MPI_COMM_WORLD, "meshes:\n  m: {mirror: {y: 0.5}}\n  plate: {mirror: z}\n", surface_layers);
    everywhere(submit_input(session, &in) == INSITU_OK);
    drawn a = step_and_take_pictures(session, 0);
    const char *warnings = insitu_last_report(session)->warnings;
    everywhere(strstr(warnings,
                      "meshes.m (line 2 of the scene): the mesh lies on both sides of its mirror plane y = 0.5, "
                      "from -1 to 1") != NULL);
    everywhere(strstr(warnings, "meshes.plate (line 3 of the scene): no mesh has this name") != NULL);
    free_picture_set(&a);
    insitu_destroy(&session);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forms_draw_their_images),
        cmocka_unit_test(all_mirror_planes_draw_images),
        cmocka_unit_test(cells_of_higher_order_draw_their_images),
        cmocka_unit_test(planes_and_lattices_draw_their_images),
        cmocka_unit_test(blocks_draw_their_images),
        cmocka_unit_test(vertices_in_decimal_planes_belong_to_both_sides),
        cmocka_unit_test(levels_draw_their_images),
        cmocka_unit_test(covered_cells_of_images_follow_changes),
        cmocka_unit_test(any_partition_draws_one_picture),
        cmocka_unit_test(derived_fields_are_those_of_the_source),
        cmocka_unit_test(gradients_of_copied_cell_values_are_those_of_the_source),
        cmocka_unit_test(mirrored_images_follow_changes),
        cmocka_unit_test(edits_of_the_scene_mirror_and_unmirror),
        cmocka_unit_test(errors_name_the_source_mesh),
        cmocka_unit_test(warped_meshes_are_mirrored_after_the_warp),
        cmocka_unit_test(fill_functions_are_called_once),
        cmocka_unit_test(counts_include_only_source_cells),
        cmocka_unit_test(unlikely_mirror_planes_give_a_warning),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
