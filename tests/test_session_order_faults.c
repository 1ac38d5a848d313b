/* Checks errors of a user in cells of higher order: types, orders, counts, layouts and indices. Each error must be
 * reported on all ranks, with the mesh, the position in the array and the value, and the next step after the correction
 * must draw. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_mesh_order.h"
#include "test_session_fixture.h"

static double evaluate_field(const double p[3])
{
    return p[0] + p[1] * p[2];
}

/* The input of a case: a mesh and its field, either of which the case may corrupt, and memory for its arrays. */
typedef struct input {
    order_mesh *whole;
    insitu_mesh mesh;
    insitu_field field;
    int64_t offsets[64];
    unsigned char types[64];
    double values[64];
} input;

typedef void corrupt_input(input *in);

typedef struct fault {
    int kind; /* index in kinds */
    corrupt_input *corrupt;
    insitu_status status;
    bool of_field, at_once;
    const char *words;
} fault;

static const order_kind kinds[] = {
    {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2},
    {"hex 27", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 2},
    {"tet 20", INSITU_LAGRANGE_TET, INSITU_ORDER_LEXICOGRAPHIC, 3},
    {"pyramid 30", INSITU_LAGRANGE_PYRAMID, INSITU_ORDER_LEXICOGRAPHIC, 3},
    {"wedge 15", INSITU_QUADRATIC_WEDGE, INSITU_ORDER_VTK, 2},
};

static void use_offsets(input *in)
{
    for (int64_t cell = 0; cell <= in->mesh.cell_count; cell++) in->offsets[cell] = cell * in->whole->nodes;
    in->mesh.offsets = (insitu_array){in->offsets, INSITU_INT64, 0};
}

static void use_types(input *in)
{
    use_offsets(in);
    memset(in->types, (int)in->mesh.cell_type, sizeof in->types);
    in->mesh.cell_types = (insitu_array){in->types, INSITU_UINT8, 0};
}

#define SPOIL(name, action)                                                                                            \
    static void name(input *in)                                                                                        \
    {                                                                                                                  \
        action;                                                                                                        \
    }

SPOIL(order_negative, in->mesh.order = -1)
SPOIL(order_large, in->mesh.order = 33)
SPOIL(order_other, in->mesh.order = 3)
SPOIL(order_of_fixed, in->mesh.order = 2)
SPOIL(order_and_offsets, (use_offsets(in), in->mesh.order = 2))
SPOIL(order_and_types, (use_types(in), in->mesh.order = 2))
SPOIL(order_of_linear, (in->mesh.cell_type = INSITU_HEX, in->mesh.order = 2))
SPOIL(layout_unknown, in->mesh.vertex_order = (insitu_vertex_order)6)
SPOIL(layout_negative, in->mesh.vertex_order = (insitu_vertex_order)-1)
SPOIL(layout_dmplex, in->mesh.vertex_order = INSITU_ORDER_DMPLEX)
SPOIL(layout_lexicographic, in->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC)
SPOIL(layout_gmsh, in->mesh.vertex_order = INSITU_ORDER_GMSH)
SPOIL(layout_exodus, in->mesh.vertex_order = INSITU_ORDER_EXODUS)
SPOIL(layout_vtk, in->mesh.vertex_order = INSITU_ORDER_VTK)
SPOIL(layout_old_vtk, in->mesh.vertex_order = INSITU_ORDER_VTK_BEFORE_9_1)
SPOIL(type_unknown, in->mesh.cell_type = (insitu_cell_type)30)
SPOIL(type_other, in->mesh.cell_type = INSITU_QUADRATIC_TET)
SPOIL(type_bezier, in->mesh.cell_type = (insitu_cell_type)79)
SPOIL(count_short, in->mesh.connectivity_count -= 1)
SPOIL(count_none, in->mesh.connectivity_count = 0)
SPOIL(count_of_no_order, in->mesh.connectivity_count = in->mesh.cell_count * 26)
SPOIL(connectivity_none, in->mesh.connectivity = (insitu_array){0})
SPOIL(implied_without_order, (in->mesh.connectivity = (insitu_array){0}, in->mesh.connectivity_count = 0))
SPOIL(implied_count, (implied_without_order(in), in->mesh.order = 2))
SPOIL(implied_other_order, (implied_without_order(in), in->mesh.order = 4))
SPOIL(implied_row, (implied_without_order(in), in->mesh.order = 2, in->mesh.connectivity_row = 27))
SPOIL(row_short, in->mesh.connectivity_row = 19)
SPOIL(row_long, in->mesh.connectivity_row = 40)
SPOIL(row_of_no_order, in->mesh.connectivity_row = 26)
SPOIL(index_large, in->whole->connectivity[33] = in->mesh.vertex_count)
SPOIL(index_negative, in->whole->connectivity[5] = -7)
SPOIL(index_base, in->mesh.index_base = 1)
SPOIL(coordinate_nan, in->whole->coordinates[3 * in->whole->connectivity[21] + 1] = (double)NAN)
SPOIL(coordinate_far, in->whole->coordinates[3 * in->whole->connectivity[21] + 1] = 1e200)
SPOIL(offsets_fall, (use_offsets(in), in->offsets[2] = 1))
SPOIL(offsets_beyond, (use_offsets(in), in->offsets[2] = 100000))
SPOIL(offsets_size, (use_offsets(in), in->offsets[1] -= 1))
SPOIL(offsets_last, (use_offsets(in), in->mesh.connectivity_count += 1))
SPOIL(types_without_offsets, (use_types(in), in->mesh.offsets = (insitu_array){0}))
SPOIL(types_polyhedron, (use_types(in), in->types[1] = INSITU_POLYHEDRON))
SPOIL(types_polygon, (use_types(in), in->types[1] = INSITU_POLYGON))
SPOIL(types_unknown, (use_types(in), in->types[1] = 99))
SPOIL(types_linear, (use_types(in), in->types[1] = INSITU_HEX))
SPOIL(types_layout, (use_types(in), in->mesh.vertex_order = INSITU_ORDER_DMPLEX))
SPOIL(no_z, in->mesh.coordinates[2] = (insitu_array){0})
SPOIL(field_of_cells, (in->field.centring = INSITU_CELL))
SPOIL(field_of_corners, (in->field.centring = INSITU_CORNER))

static void set_short_corner_row(input *in)
{
    in->field.centring = INSITU_CORNER;
    in->field.count = 100000;
    in->field.corner_row = 26;
}

static void set_patches(input *in)
{
    static const insitu_patch patch = {0};
    in->field.centring = INSITU_CELL;
    in->field.count = in->mesh.cell_count;
    in->field.values = (insitu_array){in->values, INSITU_FLOAT64, 0};
    in->field.patch_count = 1;
    in->field.patches = &patch;
}

#define MESH INSITU_ERROR_MESH
#define ARGUMENT INSITU_ERROR_ARGUMENT
#define FIELD INSITU_ERROR_FIELD

static const fault faults[] = {
    {1, order_negative, ARGUMENT, false, true, "order is -1, expected 1..32"},
    {1, order_large, ARGUMENT, false, true, "order is 33, expected 1..32"},
    {1, order_other, MESH, false, true, "8 cells of 64 nodes need 512"},
    {0, order_of_fixed, MESH, false, true, "order is 2, and cell_type is 25"},
    {1, order_and_offsets, MESH, false, true, "order is 2 and offsets are given"},
    {1, order_and_types, MESH, false, true, "order is 2 and cell types are given"},
    {1, order_of_linear, MESH, false, true, "order is 2, and cell_type is 12"},
    {0, layout_unknown, ARGUMENT, false, true, "vertex_order is 6, expected 0"},
    {0, layout_negative, ARGUMENT, false, true, "vertex_order is -1, expected 0"},
    {0, layout_dmplex, MESH, false, true, "linear cells alone"},
    {0, layout_lexicographic, MESH, false, true, "needs cells with all nodes"},
    {2, layout_gmsh, MESH, false, true, "cells of type 71 and order 3: vertex_order is 4: Gmsh's"},
    {2, layout_exodus, MESH, false, true, "cells of type 71 and order 3: vertex_order is 5: Gmsh's"},
    {3, layout_vtk, MESH, false, true, "cells of type 74 and order 3: vertex_order is 0: pyramids"},
    {3, layout_old_vtk, MESH, false, true, "cells of type 74 and order 3: vertex_order is 3: pyramids"},
    {0, type_unknown, MESH, false, true, "unknown cell_type 30"},
    {0, type_other, MESH, false, true, "8 cells of 10 nodes need 80"},
    {0, type_bezier, MESH, false, true, "unknown cell_type 79"},
    {0, count_short, MESH, false, true, "connectivity_count is 159, 8 cells of 20 nodes need 160"},
    {1, count_short, MESH, false, true, "connectivity_count is 215, 8 cells of 26 nodes need 208"},
    {0, count_none, MESH, false, true, "connectivity_count is 0, 8 cells of 20 nodes need 160"},
    {1, count_of_no_order, MESH, false, true, "cells of type 72 have 26 nodes, which no order"},
    {0, connectivity_none, MESH, false, true, "connectivity indices"},
    {1, implied_without_order, MESH, false, true, "nor is order"},
    {1, implied_count, MESH, false, true, "8 cells of 27 nodes without connectivity need 216"},
    {1, implied_other_order, MESH, false, true, "8 cells of 125 nodes without connectivity need 1000"},
    {1, implied_row, MESH, false, true, "connectivity_row is 27, and connectivity indices are not given"},
    {0, row_short, MESH, false, true, "connectivity_row is 19, a cell has 20 vertices"},
    {0, row_long, MESH, false, true, "too few for 8 cells of 20 vertices in rows of 40"},
    {1, row_of_no_order, MESH, false, true, "cells of type 72 have 26 nodes, which no order"},
    {0, index_large, MESH, false, false, "cell 1: index 81 of its node 13 is outside 0..80"},
    {1, index_negative, MESH, false, false, "cell 0: index -7 of its node 5 is outside 0..124"},
    {1, index_base, MESH, false, false, "outside 1..125 (index_base is 1)"},
    {0, coordinate_nan, MESH, false, false, "has a coordinate that is not finite"},
    {0, coordinate_far, MESH, false, false, "hex of higher order"},
    {0, offsets_fall, MESH, false, false, "cell 1: offsets 20 and 1 do not rise"},
    {0, offsets_beyond, MESH, false, false, "cell 1: offsets 20 and 100000 do not rise or are outside 0..160"},
    {0, offsets_size, MESH, false, false, "cell 0 of type 25 has 19 nodes by its offsets"},
    {1, offsets_last, MESH, false, false, "the last offset is 216, not connectivity_count, 217"},
    {0, types_without_offsets, MESH, false, true, "cell types are given without offsets"},
    {0, types_polyhedron, MESH, false, false, "cell 1 is a polyhedron, and others are of higher order"},
    {0, types_polygon, MESH, false, false, "cell 1 is a polygon, and others are of higher order"},
    {0, types_unknown, MESH, false, false, "cell 1: unknown cell type 99"},
    {0, types_linear, MESH, false, false, "cell 1 of type 12 has 20 nodes"},
    {4, types_layout, MESH, false, false, "cell 0 of type 26 and order 2: vertex_order is 2"},
    {4, no_z, MESH, false, true, "z coordinates"},
    {0, field_of_cells, FIELD, true, true, "the mesh has 8 cells"},
    {0, field_of_corners, FIELD, true, true, "the mesh has 160 corners of cells"},
    {1, set_short_corner_row, FIELD, true, true, "corner_row is 26, a cell has 27 vertices"},
    {0, set_patches, FIELD, true, true, "has patches, and the mesh has cells of higher order"},
};

static void create_input(const order_kind *kind, order_mesh *whole, input *in)
{
    order_mesh_create(kind, 2, 0, evaluate_field, 0, 1, whole);
    *in = (input){.whole = whole, .mesh = whole->mesh, .field = whole->field};
}

static void check_valid_input_draws(insitu_session *session, const order_kind *kind)
{
    order_mesh whole;
    input in;
    create_input(kind, &whole, &in);
    in.mesh.changed = INSITU_CHANGED_ALL;
    everywhere(insitu_set_mesh(session, "m", &in.mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    check_step_succeeds(session, 2);
    order_mesh_free(&whole);
}

static void is_reported(insitu_session *session, const fault *f)
{
    const bool is_bad = own_rank == rank_count - 1;
    order_mesh whole;
    input in;
    create_input(&kinds[f->kind], &whole, &in);
    if (is_bad) f->corrupt(&in);
    const insitu_status of_mesh = insitu_set_mesh(session, "m", &in.mesh);
    insitu_status at_once = of_mesh;
    if (!of_mesh) at_once = insitu_set_field(session, "m", &in.field);
    if (is_bad && f->at_once && !strstr(insitu_error(session), f->words))
        fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(at_once == (is_bad && f->at_once ? f->status : INSITU_OK));
    everywhere(!is_bad || !f->at_once || strstr(insitu_error(session), f->words) != NULL);
    everywhere(!is_bad || !f->of_field || of_mesh == INSITU_OK);
    for (int again = 0; again < 2; again++) {
        discard_pictures();
        const insitu_status status = insitu_step(session, 1, 0);
        if (!strstr(insitu_error(session), f->words)) fprintf(stderr, "%s: %s\n", f->words, insitu_error(session));
        check_reported_everywhere(session, status, f->status, "mesh \"m\"", f->words);
        everywhere(caught_count == 0);
    }
    check_valid_input_draws(session, &kinds[f->kind]);
    order_mesh_free(&whole);
}

static void mistakes_are_reported_on_all_ranks(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(error_scene));
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) is_reported(session, &faults[i]);
    insitu_destroy(&session);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(mistakes_are_reported_on_all_ranks)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
