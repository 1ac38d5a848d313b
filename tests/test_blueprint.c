/* Checks that meshes passed as Mesh Blueprint nodes are drawn bit-identically to the same meshes passed by the public
 * header, in every layout and also if the arrays are packed at odd addresses. Checks that nothing is copied if the
 * header can describe the node's arrays. Wrong nodes must be reported with their path and with the same status on all
 * ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "conduit_stand_in.h"
#include "insitu/conduit.h"
#include "test_blueprint_door.h"
#include "test_blueprint_layouts.h"

static const char scene[] =
    "images:\n"
    "  - name: a\n"
    "    size: [48, 36]\n"
    "    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n"
    "    layers:\n"
    "      - isosurface: {field: braid, values: [0.1], colour_by: {field: vel, component: 1}}\n"
    "      - surface: {colour_by: {field: radial}, opacity: 0.4}\n"
    "      - volume: {field: vel, component: magnitude, range: [0, 20], opacity: [[0, 0.3], [1, 0]]}\n"
    "    outputs: [{path: a.png}]\n";
/* The scene for layouts without the field vel: it uses only braid and radial. */
static const char scene_of_two[] = "images:\n"
                                   "  - name: a\n"
                                   "    size: [48, 36]\n"
                                   "    camera: {automatic: {direction: [1, 0.7, 0.9]}}\n"
                                   "    layers:\n"
                                   "      - isosurface: {field: braid, values: [0.1]}\n"
                                   "      - surface: {colour_by: {field: radial}, opacity: 0.4}\n"
                                   "    outputs: [{path: a.png}]\n";

static const char *write_scene_of(const layout_case *layout)
{
    return write_scene(layout->field_count == 3 ? scene : scene_of_two);
}

static void expect_step_succeeds(doorway *d)
{
    discard_pictures();
    const insitu_status status = insitu_blueprint_step(d->adaptor, NULL, NULL);
    if (status) fprintf(stderr, "%s\n", insitu_blueprint_error(d->adaptor));
    everywhere(status == INSITU_OK);
    everywhere(insitu_last_report(d->session)->images == 1 && caught_count == (own_rank == 0));
}

static void expect_set_succeeds(doorway *d, const char *name, const conduit_node *node)
{
    const insitu_status status = insitu_blueprint_set(d->adaptor, name, node);
    if (status) fprintf(stderr, "%s\n", insitu_blueprint_error(d->adaptor));
    everywhere(status == INSITU_OK);
}

/* Draws the mesh passed by the public header. *copied receives the number of bytes copied for it. */
static caught_picture draw_mesh_by_header(const char *path, const layout_case *layout, int64_t *copied)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, path);
    everywhere(layout_submit(session, "mesh", layout) == INSITU_OK);
    check_step_succeeds(session, 100);
    *copied = insitu_last_report(session)->bytes_copied;
    insitu_destroy(&session);
    return pop_caught_picture();
}

static bool has_colour(const caught_picture *picture)
{
    bool has = own_rank != 0;
    for (int i = 0; !has && i < 4 * picture->width * picture->height; i++) has = picture->rgba[i] > 0.05F;
    return has;
}

static void each_layout_draws_same_picture_as_header(void **state)
{
    (void)state;
    for (int i = 0; i < layout_kind_count; i++) {
        layout_case layout;
        layout_make(&layout_kinds[i], &layout);
        const char *path = write_scene_of(&layout);
        int64_t copied;
        caught_picture truth = draw_mesh_by_header(path, &layout, &copied);
        everywhere(has_colour(&truth));
        for (int packed = 0; packed < 2; packed++) {
            doorway d = open_adaptor_session(path);
            if (packed) stand_in_pack(layout.node);
            expect_set_succeeds(&d, "", layout.node);
            expect_step_succeeds(&d);
            const insitu_blueprint_report *report = insitu_blueprint_last_report(d.adaptor);
            caught_picture picture = pop_caught_picture();
            const bool is_same = own_rank || are_same_pictures(&picture, &truth);
            if (!is_same) fprintf(stderr, "%s%s: another picture\n", layout_kinds[i].name, packed ? ", packed" : "");
            everywhere(is_same);
            everywhere(report->meshes == 1 && report->fields == layout.field_count && !*report->left_out);
            everywhere(report->cells == layout.mesh.cell_count || report->cells > layout.mesh.cell_count);
            everywhere(layout_kinds[i].is_copied == (report->bytes_copied > 0));
            everywhere(insitu_last_report(d.session)->cycle == 100);
            everywhere(insitu_last_report(d.session)->time == 3.1415);
            free_caught(&picture);
            close_adaptor_session(&d);
        }
        free_caught(&truth);
        layout_free(&layout);
    }
}

/* Checks layouts whose arrays the session can read in place: the adaptor and the session together copy no more bytes
 * than if the same arrays are passed by the public header. */
static void arrays_described_by_the_header_are_not_copied(void **state)
{
    (void)state;
    static const char *const names[] = {"uniform",  "rectilinear", "structured", "strided",  "tris",
                                        "quads",    "quads_poly",  "tets",       "hexs",     "wedges",
                                        "pyramids", "hexs_poly",   "polyhedra",  "mixed_2d", "vtkGhostType"};
    for (size_t n = 0; n < sizeof names / sizeof names[0]; n++)
        for (int i = 0; i < layout_kind_count; i++) {
            if (strcmp(layout_kinds[i].name, names[n]) != 0) continue;
            layout_case layout;
            layout_make(&layout_kinds[i], &layout);
            const char *path = write_scene_of(&layout);
            int64_t copied;
            caught_picture truth = draw_mesh_by_header(path, &layout, &copied);
            doorway d = open_adaptor_session(path);
            expect_set_succeeds(&d, "", layout.node);
            expect_step_succeeds(&d);
            everywhere(insitu_blueprint_last_report(d.adaptor)->bytes_copied == 0);
            if (insitu_last_report(d.session)->bytes_copied > copied)
                fprintf(stderr, "%s: %s\n", names[n], insitu_last_report(d.session)->copied_why);
            everywhere(insitu_last_report(d.session)->bytes_copied <= copied);
            discard_pictures();
            free_caught(&truth);
            close_adaptor_session(&d);
            layout_free(&layout);
        }
}

/* ---- several domains, names and steps --------------------------------------------------------------------------- */

/* Moves the contents of `child` to the node at parent's path. parent then owns them. */
static void move_child_node(conduit_node *parent, const char *path, conduit_node *child)
{
    conduit_node *at = conduit_node_fetch(parent, path);
    stand_in_swap(at, child);
    conduit_node_destroy(child);
}

/* Submits the mesh by the public header as a block with the given number. */
static bool submit_block(insitu_session *session, const char *name, int64_t number, const layout_case *layout)
{
    insitu_mesh mesh = layout->mesh;
    if (mesh.lattice) mesh.lattice = &layout->lattice;
    bool is_set = insitu_set_block(session, name, number, &mesh) == INSITU_OK;
    for (int i = 0; i < layout->field_count; i++)
        is_set = is_set && insitu_set_block_field(session, name, number, &layout->fields[i]) == INSITU_OK;
    return is_set;
}

/* Draws the two domains a and b as children of one node. */
static caught_picture draw_two_domains(const char *path, layout_case *a, layout_case *b,
                                       insitu_blueprint_report *report)
{
    conduit_node *both = conduit_node_create();
    move_child_node(both, "domain_000000", a->node);
    move_child_node(both, "domain_000001", b->node);
    a->node = conduit_node_create();
    b->node = conduit_node_create();
    doorway d = open_adaptor_session(path);
    expect_set_succeeds(&d, "grid", both);
    expect_step_succeeds(&d);
    *report = *insitu_blueprint_last_report(d.adaptor);
    close_adaptor_session(&d);
    conduit_node_destroy(both);
    return pop_caught_picture();
}

/* Checks that a domain that is a lattice and a domain that is a list of cells become two blocks of one mesh. If their
 * fields differ, the second domain becomes a separate mesh. */
static void domains_are_blocks_of_one_mesh(void **state)
{
    (void)state;
    for (int has_same = 0; has_same < 2; has_same++) {
        layout_case a, b;
        insitu_blueprint_report report;
        layout_make(&layout_kinds[0], &a);
        layout_make(&layout_kinds[16], &b);
        if (!has_same) {
            b.field_count--;
            stand_in_remove(b.node, "fields/vel");
        }
        const char *path = write_scene(has_same ? scene : scene_of_two);
        insitu_session *session = open_session(MPI_COMM_WORLD, path);
        everywhere(submit_block(session, "grid/mesh", 0, &a));
        everywhere(has_same ? submit_block(session, "grid/mesh", 1, &b)
                            : layout_submit(session, "grid/mesh/1", &b) == INSITU_OK);
        check_step_succeeds(session, 100);
        caught_picture truth = pop_caught_picture();
        insitu_destroy(&session);
        caught_picture picture = draw_two_domains(path, &a, &b, &report);
        const bool is_same = own_rank || are_same_pictures(&picture, &truth);
        everywhere(is_same);
        everywhere(report.meshes == 2 && report.fields == (has_same ? 6 : 5));
        free_caught(&picture);
        free_caught(&truth);
        layout_free(&a);
        layout_free(&b);
    }
}

/* Checks a mesh that is passed as a single domain, then as a list of domains, then as a single domain again. */
static void mesh_changes_to_blocks_and_back(void **state)
{
    (void)state;
    layout_case a;
    layout_make(&layout_kinds[16], &a);
    int64_t copied;
    const char *path = write_scene(scene);
    caught_picture truth = draw_mesh_by_header(path, &a, &copied);
    doorway d = open_adaptor_session(path);
    conduit_node *list = conduit_node_create(), *child = conduit_node_fetch(list, "domain_000000");
    for (int step = 0; step < 4; step++) {
        const bool is_list = step % 2;
        if (is_list) stand_in_swap(child, a.node);
        expect_set_succeeds(&d, "", is_list ? list : a.node);
        expect_step_succeeds(&d);
        if (is_list) stand_in_swap(child, a.node);
        caught_picture picture = pop_caught_picture();
        const bool is_same = own_rank || are_same_pictures(&picture, &truth);
        everywhere(is_same);
        free_caught(&picture);
    }
    close_adaptor_session(&d);
    conduit_node_destroy(list);
    free_caught(&truth);
    layout_free(&a);
}

/* Checks a mesh of which one rank has no domain, and then a mesh that is removed on all ranks. */
static void meshes_are_added_and_removed(void **state)
{
    (void)state;
    layout_case a, b;
    layout_make(&layout_kinds[0], &a);
    layout_make(&layout_kinds[16], &b);
    conduit_node *empty = conduit_node_create();
    const char *path = write_scene(scene);
    doorway d = open_adaptor_session(path);
    for (int step = 0; step < 6; step++) {
        const bool has_a = step % 3 != 2, has_b = step % 3 != 1, is_here = step < 3 || own_rank == 0;
        insitu_session *session = open_session(MPI_COMM_WORLD, path);
        if (has_a && is_here)
            everywhere(layout_submit(session, "a/mesh", &a) == INSITU_OK || true);
        else
            everywhere(true);
        if (has_b) layout_submit(session, "b/mesh", &b);
        check_step_succeeds(session, 100);
        caught_picture truth = pop_caught_picture();
        insitu_destroy(&session);
        if (has_a) expect_set_succeeds(&d, "a", is_here ? a.node : empty);
        if (has_b) expect_set_succeeds(&d, "b", b.node);
        expect_step_succeeds(&d);
        caught_picture picture = pop_caught_picture();
        const bool is_same = own_rank || are_same_pictures(&picture, &truth);
        everywhere(is_same);
        free_caught(&picture);
        free_caught(&truth);
    }
    close_adaptor_session(&d);
    conduit_node_destroy(empty);
    layout_free(&a);
    layout_free(&b);
}

/* Checks that the session detects new coordinates, values and flags in the same arrays, and that it builds no tree if
 * the arrays are unchanged. */
static void changed_arrays_are_detected(void **state)
{
    (void)state;
    layout_case l;
    for (int i = 0; i < layout_kind_count; i++)
        if (strcmp(layout_kinds[i].name, "vtkGhostType of bits") == 0 || strcmp(layout_kinds[i].name, "hexs") == 0) {
            layout_make(&layout_kinds[i], &l);
            const char *path = write_scene(scene);
            doorway d = open_adaptor_session(path);
            double *places = (double *)(uintptr_t)l.mesh.coordinates[0].data;
            double *values = (double *)(uintptr_t)l.fields[0].values.data;
            for (int step = 0; step < 5; step++) {
                for (int64_t v = 0; step == 1 && places && v < l.mesh.vertex_count; v++) places[3 * v] *= 1.25;
                for (int64_t v = 0; step == 3 && v < l.mesh.vertex_count; v++) values[v] *= -0.5;
                int64_t copied;
                caught_picture truth = draw_mesh_by_header(path, &l, &copied);
                expect_set_succeeds(&d, "", l.node);
                expect_step_succeeds(&d);
                caught_picture picture = pop_caught_picture();
                const bool is_same = own_rank || are_same_pictures(&picture, &truth);
                everywhere(is_same);
                const double built = insitu_last_report(d.session)->build_ms;
                everywhere(step == 2 || step == 4 ? built == 0 : true);
                free_caught(&picture);
                free_caught(&truth);
            }
            close_adaptor_session(&d);
            layout_free(&l);
        }
}

/* Checks steps whose node has no state/cycle: the cycle is then that of the previous step plus 1. */
static void cycles_are_counted(void **state)
{
    (void)state;
    static const int64_t said[] = {-1, -1, 40, -1}, expected[] = {0, 1, 40, 41};
    layout_case l;
    layout_make(&layout_kinds[0], &l);
    doorway d = open_adaptor_session(write_scene(scene));
    for (int step = 0; step < 4; step++) {
        if (step == 0) stand_in_remove(l.node, "state");
        if (said[step] >= 0) conduit_node_set_path_int64(l.node, "state/cycle", said[step]);
        expect_set_succeeds(&d, "", l.node);
        expect_step_succeeds(&d);
        everywhere(insitu_last_report(d.session)->cycle == expected[step]);
        everywhere(insitu_last_report(d.session)->time == (double)expected[step]);
        if (said[step] >= 0) stand_in_remove(l.node, "state");
    }
    discard_pictures();
    close_adaptor_session(&d);
    layout_free(&l);
}

/* ---- nodes that are left out ------------------------------------------------------------------------------------ */

typedef void corrupt_node(conduit_node *node);

typedef struct left_out_case {
    const char *layout;
    corrupt_node *corrupt;
    const char *words;
    int meshes, fields;
} left_out_case;

static void make_point_cells(conduit_node *n)
{
    conduit_node_set_path_char8_str(n, "topologies/mesh/type", "points");
}

static void make_line_cells(conduit_node *n)
{
    conduit_node_set_path_char8_str(n, "topologies/mesh/elements/shape", "line");
}

static void make_streamed_topology(conduit_node *n)
{
    conduit_node_set_path_char8_str(n, "topologies/mesh/elements/element_types/tets/shape", "tet");
}

static void make_polar_coordinates(conduit_node *n)
{
    static const double at[2] = {0, 1};
    stand_in_set_array(n, "coordsets/coords/values/theta", STAND_IN_FLOAT64, at, 2, 0);
}

static void make_basis_field(conduit_node *n)
{
    stand_in_remove(n, "fields/braid/association");
    conduit_node_set_path_char8_str(n, "fields/braid/basis", "H1_3D_P2");
}

static void make_material_field(conduit_node *n)
{
    stand_in_remove(n, "fields/radial/values");
    conduit_node_set_path_float64(n, "fields/radial/matset_values/a", 1);
}

static void make_vertex_ghosts(conduit_node *n)
{
    conduit_node_set_path_char8_str(n, "state/metadata/vtk_fields/vel/attribute_type", "Ghosts");
}

static void remove_other_dimensions(conduit_node *n)
{
    conduit_node_set_path_int64(n, "coordsets/coords/dims/j", 1);
    conduit_node_set_path_int64(n, "coordsets/coords/dims/k", 1);
}

static void change_strides(conduit_node *n)
{
    static const int64_t strides[3] = {1, 5, 23};
    static const double room[200];
    stand_in_set_array(n, "fields/braid/strides", STAND_IN_INT64, strides, 3, 0);
    stand_in_set_array(n, "fields/braid/values", STAND_IN_FLOAT64, room, 200, 0);
}

static const left_out_case left_out_cases[] = {
    {"tets", make_point_cells, "grid/topologies/mesh/type: points are not drawn", 0, 0},
    {"tets", make_line_cells, "grid/topologies/mesh/elements/shape: is \"line\"", 0, 0},
    {"tets", make_streamed_topology, "grid/topologies/mesh/elements/element_types: ", 0, 0},
    {"rectilinear", make_polar_coordinates, "grid/coordsets/coords/values/theta: ", 0, 0},
    {"tets", make_basis_field, "grid/fields/braid/basis: ", 1, 2},
    {"tets", make_material_field, "grid/fields/radial/values: ", 1, 2},
    {"tets", make_vertex_ghosts, "grid/fields/vel/values: ghosts at vertices", 1, 2},
    {"uniform", remove_other_dimensions, "grid/coordsets/coords/dims: 5 x 1 x 1 vertices", 0, 0},
    {"uniform", change_strides, "grid/fields/braid/strides: has other strides", 1, 2},
};

static const layout_kind *find_layout(const char *name)
{
    for (int i = 0; i < layout_kind_count; i++)
        if (strcmp(layout_kinds[i].name, name) == 0) return &layout_kinds[i];
    abort();
}

static void unsupported_items_are_named_in_the_report(void **state)
{
    (void)state;
    const char *path = write_scene(scene);
    for (size_t i = 0; i < sizeof left_out_cases / sizeof left_out_cases[0]; i++) {
        const left_out_case *c = &left_out_cases[i];
        layout_case layout;
        layout_make(find_layout(c->layout), &layout);
        c->corrupt(layout.node);
        doorway d = open_adaptor_session(path);
        const insitu_status status = insitu_blueprint_set(d.adaptor, "grid", layout.node);
        insitu_blueprint_step(d.adaptor, NULL, NULL);
        const insitu_blueprint_report *r = insitu_blueprint_last_report(d.adaptor);
        const bool is_well =
            !status && strstr(r->left_out, c->words) && r->meshes == c->meshes && r->fields == c->fields;
        if (!is_well)
            fprintf(stderr, "%s: \"%s\", %d meshes, %d fields: %s\n", c->words, r->left_out, r->meshes, r->fields,
                    insitu_blueprint_error(d.adaptor));
        everywhere(is_well);
        discard_pictures();
        close_adaptor_session(&d);
        layout_free(&layout);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_layout_draws_same_picture_as_header),
        cmocka_unit_test(arrays_described_by_the_header_are_not_copied),
        cmocka_unit_test(domains_are_blocks_of_one_mesh),
        cmocka_unit_test(mesh_changes_to_blocks_and_back),
        cmocka_unit_test(meshes_are_added_and_removed),
        cmocka_unit_test(changed_arrays_are_detected),
        cmocka_unit_test(cycles_are_counted),
        cmocka_unit_test(unsupported_items_are_named_in_the_report),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
