/* Checks faulty nodes. Only the last rank passes a faulty node. The node is refused there with the path of its error;
 * the step then returns the same status on all ranks and draws nothing. After the node is corrected, the next step
 * draws. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "conduit_stand_in.h"
#include "insitu/conduit.h"
#include "test_blueprint_layouts.h"

static const char scene[] = "images:\n"
                            "  - name: a\n"
                            "    size: [24, 18]\n"
                            "    layers: [{surface: {colour_by: {field: radial}}}]\n"
                            "    outputs: [{path: a.png}]\n";

/* What a node_fault stores at its path instead of the correct value. */
typedef enum fault_kind {
    REMOVED,
    A_WORD,     /* the text node_fault::word */
    A_NUMBER,   /* node_fault::number as an int64 */
    A_REAL,     /* node_fault::number as a float64 */
    SHORT,      /* the array without its last element */
    FLOATS,     /* the array as float64 instead of integers */
    AN_OBJECT,  /* a node with children */
    NO_ADDRESS, /* an array whose address is NULL */
    NO_STRIDE,  /* an array with stride 0 */
    ENTRY       /* the array with the element at index node_fault::place set to node_fault::number */
} fault_kind;

typedef struct node_fault {
    const char *layout, *path;
    fault_kind kind;
    const char *word;
    int64_t number, place;
    insitu_status status;
    /* the part of the message after the path; may begin with the path of a second entry, before ": " */
    const char *reported;
} node_fault;

#define MESH INSITU_ERROR_MESH
#define FIELD INSITU_ERROR_FIELD

static const node_fault faults[] = {
    {"tets", "coordsets", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "state/cycle", A_REAL, "", 3, 0, MESH, "is no whole number"},
    {"tets", "state/cycle", A_WORD, "three", 0, 0, MESH, "is no array of numbers"},
    {"tets", "state/time", AN_OBJECT, "", 0, 0, MESH, "is no array of numbers"},
    {"tets", "state/insitu_changed", A_WORD, "some", 0, 0, MESH, "is \"some\", expected nothing, geometry or all"},
    {"tets", "state/insitu_changed", A_NUMBER, "", 1, 0, MESH, "is no string"},
    {"tets", "topologies/mesh/type", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies/mesh/type", A_WORD, "unstructed", 0, 0, MESH, "is \"unstructed\""},
    {"tets", "topologies/mesh/type", A_NUMBER, "", 3, 0, MESH, "is no string"},
    {"tets", "topologies/mesh/type", A_WORD, "structured", 0, 0, MESH, "elements/dims/i: is missing"},
    {"tets", "topologies/mesh/coordset", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies/mesh/coordset", A_WORD, "coord", 0, 0, MESH, "is \"coord\", which is not among the coordsets"},
    {"tets", "coordsets/coords/type", A_WORD, "uniform", 0, 0, MESH, "coordset: is of type \"uniform\""},
    {"tets", "coordsets/coords/type", A_WORD, "explicitly", 0, 0, MESH, "coordset: is of type \"explicitly\""},
    {"tets", "coordsets/coords/type", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "coordsets/coords/values/x", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "coordsets/coords/values/x", A_WORD, "0 1 2", 0, 0, MESH, "is no array of numbers"},
    {"tets", "coordsets/coords/values/y", SHORT, "", 0, 0, MESH, "elements, values/x has"},
    {"tets", "coordsets/coords/values/z", NO_ADDRESS, "", 0, 0, MESH, "elements and no address"},
    {"tets", "coordsets/coords/values/z", NO_STRIDE, "", 0, 0, MESH, "elements and a stride of 0"},
    {"tets", "topologies/mesh/elements", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies/mesh/elements/shape", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies/mesh/elements/shape", A_WORD, "tetra", 0, 0, MESH, "is \"tetra\", expected tri, quad"},
    {"tets", "topologies/mesh/elements/connectivity", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "topologies/mesh/elements/connectivity", FLOATS, "", 0, 0, MESH, "are no whole numbers"},
    {"tets", "topologies/mesh/elements/connectivity", SHORT, "", 0, 0, MESH, "no multiple of a tet's 4"},
    {"tets", "topologies/mesh/elements/connectivity", AN_OBJECT, "", 0, 0, MESH, "is no array of numbers"},
    {"uniform", "coordsets/coords/dims/i", REMOVED, "", 0, 0, MESH, "is missing"},
    {"uniform", "coordsets/coords/dims/j", A_NUMBER, "", 0, 0, MESH, "dims: has 0 vertices along j"},
    {"uniform", "coordsets/coords/dims/k", A_NUMBER, "", -4, 0, MESH, "dims: has -4 vertices along k"},
    {"uniform", "coordsets/coords/dims/i", A_REAL, "", 5, 0, MESH, "is no whole number"},
    {"uniform", "coordsets/coords/spacing/dy", A_REAL, "", 0, 0, MESH, "is 0"},
    {"uniform", "coordsets/coords/spacing/dx", A_WORD, "1", 0, 0, MESH, "is no array of numbers"},
    {"uniform", "coordsets/coords/origin/z", AN_OBJECT, "", 0, 0, MESH, "is no array of numbers"},
    {"uniform", "topologies/mesh/elements/origin/i", A_REAL, "", 1, 0, MESH, "is no whole number"},
    {"rectilinear", "coordsets/coords/values/x", REMOVED, "", 0, 0, MESH, "is missing"},
    {"rectilinear", "coordsets/coords/values/z", A_WORD, "", 0, 0, MESH, "is no array of numbers"},
    {"structured", "topologies/mesh/elements/dims/i", A_NUMBER, "", 400, 0, MESH, "dims: reaches vertex"},
    {"structured", "topologies/mesh/elements/dims/j", A_NUMBER, "", -1, 0, MESH, "is -1, expected at least 0"},
    {"structured", "topologies/mesh/elements/dims/k", A_WORD, "2", 0, 0, MESH, "is no array of numbers"},
    {"strided", "topologies/mesh/elements/dims/strides", ENTRY, "", 0, 1, MESH, "has 0 for j"},
    {"strided", "topologies/mesh/elements/dims/offsets", ENTRY, "", -1, 2, MESH, "has -1 for k"},
    {"strided", "topologies/mesh/elements/dims/offsets", ENTRY, "", 90, 2, MESH, "dims: reaches vertex"},
    {"strided", "topologies/mesh/elements/dims/strides", FLOATS, "", 0, 0, MESH, "are no whole numbers"},
    {"strided", "fields/braid/strides", ENTRY, "", -8, 1, FIELD, "has -8"},
    {"strided", "fields/radial/offsets", ENTRY, "", 700, 0, FIELD, "values: has 100 elements, the topology has"},
    {"quads_poly", "topologies/mesh/elements/sizes", REMOVED, "", 0, 0, MESH, "is missing"},
    {"quads_poly", "topologies/mesh/elements/sizes", ENTRY, "", 5, 2, MESH,
     "offsets: entry 2: 8 and size 5, but the next"},
    {"quads_poly", "topologies/mesh/elements/sizes", ENTRY, "", -1, 2, MESH,
     "offsets: entry 2: 8 and size -1, outside"},
    {"quads_poly", "topologies/mesh/elements/offsets", SHORT, "", 0, 0, MESH, "has 11 elements, expected 12"},
    {"quads_poly", "topologies/mesh/elements/offsets", ENTRY, "", 4000, 3, MESH, "but the next begins at 4000"},
    {"quads_poly", "topologies/mesh/elements/offsets", FLOATS, "", 0, 0, MESH, "are no whole numbers"},
    {"polyhedra", "topologies/mesh/subelements", REMOVED, "", 0, 0, MESH, "is missing"},
    {"polyhedra", "topologies/mesh/subelements/shape", A_WORD, "tet", 0, 0, MESH, "is \"tet\", expected tri, quad"},
    {"polyhedra", "topologies/mesh/subelements/shape", A_WORD, "polygon", 0, 0, MESH, "is \"polygon\""},
    {"polyhedra", "topologies/mesh/subelements/sizes", ENTRY, "", 99, 1, MESH, "offsets: entry 1: "},
    {"polyhedra", "topologies/mesh/subelements/connectivity", REMOVED, "", 0, 0, MESH, "is missing"},
    {"mixed_2d", "topologies/mesh/elements/shape_map", REMOVED, "", 0, 0, MESH, "is missing"},
    {"mixed_2d", "topologies/mesh/elements/shape_map/quad", A_NUMBER, "", 17, 0, MESH,
     "shapes: entry 0 is 9, which shape_map does not have"},
    {"mixed_2d", "topologies/mesh/elements/shape_map/quad", A_NUMBER, "", 70000, 0, MESH,
     "is 70000, expected 0..65535"},
    {"mixed_2d", "topologies/mesh/elements/shape_map/kite", A_NUMBER, "", 6, 0, MESH, "is \"kite\", expected tri"},
    {"mixed_2d", "topologies/mesh/elements/shapes", ENTRY, "", 8, 4, MESH,
     "entry 4 is 8, which shape_map does not have"},
    {"mixed_2d", "topologies/mesh/elements/shapes", SHORT, "", 0, 0, MESH, "elements, sizes has"},
    {"tets", "fields/braid/association", A_WORD, "node", 0, 0, FIELD, "is \"node\", expected vertex or element"},
    {"tets", "fields/braid/association", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "fields/braid/topology", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "fields/radial/values", REMOVED, "", 0, 0, MESH, "is missing"},
    {"tets", "fields/radial/values", SHORT, "", 0, 0, FIELD, "elements, the topology has"},
    {"tets", "fields/radial/values", A_WORD, "cold", 0, 0, MESH, "is no array of numbers"},
    {"tets", "fields/vel/values/v", SHORT, "", 0, 0, FIELD, "elements, the topology has"},
    {"tets", "fields/vel/values/w", AN_OBJECT, "", 0, 0, MESH, "is no array of numbers"},
    {"vtkGhostType", "fields/vtkGhostType/values", FLOATS, "", 0, 0, FIELD, "are no whole numbers, as flags"},
    {"vtkGhostType", "fields/vtkGhostType/values", SHORT, "", 0, 0, FIELD, "elements, the topology has"},
    {"covered cells", "nestsets/nest/windows", REMOVED, "", 0, 0, MESH, "is missing"},
    {"covered cells", "nestsets/nest/windows/window_0_1/domain_type", A_NUMBER, "", 1, 0, MESH, "is no string"},
    {"covered cells", "nestsets/nest/windows/window_0_1/origin/i", A_REAL, "", 1, 0, MESH, "is no whole number"},
};
enum { FAULTS = sizeof faults / sizeof faults[0] };

static const int64_t *replaced; /* an array that corrupt_node() has replaced and that the test must free, or NULL */

/* Replaces the array by a copy of type `id`, with the fault's entry set if the fault is an ENTRY. */
static void replace_array(conduit_node *node, const node_fault *f, int id)
{
    conduit_node *at = conduit_node_fetch_existing(node, f->path);
    const conduit_datatype *type = conduit_node_dtype(at);
    const int64_t count = conduit_datatype_number_of_elements(type),
                  size = stand_in_size((int)conduit_datatype_id(type));
    int64_t *copy = calloc((size_t)count, sizeof *copy);
    assert_non_null(copy);
    for (int64_t i = 0; i < count; i++) {
        int32_t narrow;
        memcpy(size == 4 ? (void *)&narrow : (void *)&copy[i], conduit_node_element_ptr(at, i), (size_t)size);
        if (size == 4) copy[i] = narrow;
    }
    if (f->kind == ENTRY) copy[f->place] = f->number;
    replaced = copy;
    stand_in_set_array(node, f->path, id, copy, count, 0);
}

static void corrupt_node(conduit_node *node, const node_fault *f)
{
    static const char nothing[8];
    conduit_node *at = f->kind >= SHORT && f->kind != AN_OBJECT ? conduit_node_fetch_existing(node, f->path) : NULL;
    const int id = at ? (int)conduit_datatype_id(conduit_node_dtype(at)) : 0;
    const int64_t count = at ? conduit_datatype_number_of_elements(conduit_node_dtype(at)) : 0;
    const int64_t stride = at ? conduit_datatype_stride(conduit_node_dtype(at)) : 0;
    char below[256];
    switch (f->kind) {
    case REMOVED: stand_in_remove(node, f->path); break;
    case A_WORD: conduit_node_set_path_char8_str(node, f->path, f->word); break;
    case A_NUMBER: conduit_node_set_path_int64(node, f->path, f->number); break;
    case A_REAL: conduit_node_set_path_float64(node, f->path, (double)f->number); break;
    case SHORT: stand_in_set_array(node, f->path, id, conduit_node_element_ptr(at, 0), count - 1, stride); break;
    case AN_OBJECT:
        stand_in_remove(node, f->path);
        snprintf(below, sizeof below, "%s/child/child", f->path);
        conduit_node_set_path_float64(node, below, 1);
        break;
    case NO_ADDRESS: stand_in_set_array(node, f->path, id, NULL, count, 0); break;
    case NO_STRIDE:
        stand_in_set_array(node, f->path, id, nothing, count, 0);
        stand_in_set_zero_stride(node, f->path);
        break;
    case FLOATS: replace_array(node, f, STAND_IN_FLOAT64); break;
    case ENTRY: replace_array(node, f, STAND_IN_INT64); break;
    }
}

static const layout_kind *find_layout(const char *name)
{
    for (int i = 0; i < layout_kind_count; i++)
        if (strcmp(layout_kinds[i].name, name) == 0) return &layout_kinds[i];
    abort();
}

static bool check_message(const char *message, const node_fault *f, const char *rank)
{
    char path[256];
    snprintf(path, sizeof path, "grid/%s", f->path);
    const bool has_path = strstr(message, path) || (strstr(message, "grid/") && strstr(f->reported, ": "));
    const bool is_well = has_path && strstr(message, f->reported) && strstr(message, rank);
    if (!is_well) fprintf(stderr, "%s, %s: \"%s\"\n", f->layout, f->path, message);
    return is_well;
}

/* Checks that the adaptor draws the corrected node as if the faulty node had never been passed. */
static void draw_corrected_node(insitu_session *session, insitu_blueprint *adaptor, const conduit_node *node)
{
    discard_pictures();
    everywhere(insitu_blueprint_set(adaptor, "grid", node) == INSITU_OK);
    everywhere(insitu_blueprint_step(adaptor, NULL, NULL) == INSITU_OK);
    everywhere(insitu_last_report(session)->images == 1 && caught_count == (own_rank == 0));
}

static void wrong_nodes_are_reported_on_all_ranks(void **state)
{
    (void)state;
    const int bad = rank_count - 1;
    char rank[32];
    snprintf(rank, sizeof rank, "rank %d: ", bad);
    const char *path = write_scene(scene);
    for (int i = 0; i < FAULTS; i++) {
        const node_fault *f = &faults[i];
        layout_case right, wrong;
        insitu_session *session = open_session(MPI_COMM_WORLD, path);
        insitu_blueprint *adaptor = NULL;
        everywhere(insitu_blueprint_create(session, &insitu_conduit_functions, MPI_COMM_WORLD, &adaptor) == INSITU_OK);
        layout_make(find_layout(f->layout), &right);
        layout_make(find_layout(f->layout), &wrong);
        if (own_rank == bad) corrupt_node(wrong.node, f);
        discard_pictures();
        const insitu_status at_once = insitu_blueprint_set(adaptor, "grid", wrong.node);
        const bool is_reported =
            own_rank != bad ? !at_once : at_once && check_message(insitu_blueprint_error(adaptor), f, "");
        everywhere(is_reported);
        const insitu_status status = insitu_blueprint_step(adaptor, NULL, NULL);
        if (status != f->status) fprintf(stderr, "%s, %s: status %d\n", f->layout, f->path, (int)status);
        everywhere(status == f->status && check_message(insitu_blueprint_error(adaptor), f, rank));
        everywhere(caught_count == 0);
        draw_corrected_node(session, adaptor, right.node);
        insitu_blueprint_destroy(&adaptor);
        insitu_destroy(&session);
        layout_free(&right);
        layout_free(&wrong);
        free((void *)(uintptr_t)replaced);
        replaced = NULL;
    }
    everywhere(FAULTS >= 60);
}

/* Checks faulty contents of arrays. The session detects the fault, so the message names the mesh and the cell. */
static void wrong_indices_are_reported_on_all_ranks(void **state)
{
    (void)state;
    static const node_fault f = {"tets", "topologies/mesh/elements/connectivity", ENTRY, "", 4000, 5, MESH, ""};
    layout_case layout;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    insitu_blueprint *adaptor = NULL;
    insitu_blueprint_create(session, &insitu_conduit_functions, MPI_COMM_WORLD, &adaptor);
    layout_make(find_layout("tets"), &layout);
    corrupt_node(layout.node, &f);
    everywhere(insitu_blueprint_set(adaptor, "grid", layout.node) == INSITU_OK);
    const insitu_status status = insitu_blueprint_step(adaptor, NULL, NULL);
    const char *message = insitu_blueprint_error(adaptor);
    everywhere(status == INSITU_ERROR_MESH && strstr(message, "mesh \"grid/mesh\": cell 1 (tet)") &&
               strstr(message, "4000"));
    insitu_blueprint_destroy(&adaptor);
    insitu_destroy(&session);
    layout_free(&layout);
    free((void *)(uintptr_t)replaced);
    replaced = NULL;
}

static void adaptors_require_session_and_node(void **state)
{
    (void)state;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    insitu_blueprint *adaptor = (insitu_blueprint *)(void *)session;
    everywhere(insitu_blueprint_create(NULL, &insitu_conduit_functions, MPI_COMM_WORLD, &adaptor) ==
               INSITU_ERROR_ARGUMENT);
    everywhere(!adaptor && strstr(insitu_blueprint_error(NULL), "no session"));
    everywhere(insitu_blueprint_create(session, NULL, MPI_COMM_WORLD, &adaptor) == INSITU_ERROR_ARGUMENT && !adaptor);
    everywhere(insitu_blueprint_create(session, &insitu_conduit_functions, MPI_COMM_WORLD, &adaptor) == INSITU_OK);
    everywhere(insitu_blueprint_set(adaptor, NULL, NULL) == INSITU_ERROR_ARGUMENT);
    everywhere(insitu_blueprint_set(NULL, "", NULL) == INSITU_ERROR_ARGUMENT);
    everywhere(insitu_blueprint_step(NULL, NULL, NULL) == INSITU_ERROR_ARGUMENT);
    insitu_blueprint_refuse(adaptor, INSITU_ERROR_FIELD, "the code's own reason");
    const insitu_status status = insitu_blueprint_step(adaptor, NULL, NULL);
    everywhere(status == INSITU_ERROR_FIELD &&
               strstr(insitu_blueprint_error(adaptor), "rank 0: the code's own reason"));
    insitu_blueprint_destroy(&adaptor);
    insitu_blueprint_destroy(&adaptor);
    insitu_blueprint_destroy(NULL);
    insitu_destroy(&session);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_nodes_are_reported_on_all_ranks),
        cmocka_unit_test(wrong_indices_are_reported_on_all_ranks),
        cmocka_unit_test(adaptors_require_session_and_node),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
