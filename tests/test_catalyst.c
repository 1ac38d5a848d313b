/* Checks the implementation of Catalyst's API, linked with a replacement of Conduit's functions: where it finds its
 * scene, which channels it draws, what it reports, and that errors are the same on all ranks. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "catalyst_adaptor.h"
#include "conduit_stand_in.h"
#include "insitu/conduit.h"
#include "test_blueprint_layouts.h"

static const char scene[] = "parameters: {inflow: 2.5}\n"
                            "images:\n"
                            "  - name: a\n"
                            "    size: [24, 18]\n"
                            "    layers: [{surface: {colour_by: {field: radial}}}]\n"
                            "    outputs: [{path: a.png}]\n";

static void set_string(void *node, const char *path, const char *value)
{
    conduit_node_set_path_char8_str(node, path, value);
}

static void set_integer(void *node, const char *path, int64_t value)
{
    conduit_node_set_path_int64(node, path, value);
}

static void set_real(void *node, const char *path, double value)
{
    conduit_node_set_path_float64(node, path, value);
}

static const catalyst_writer writer = {set_string, set_integer, set_real};

static insitu_status initialize_adaptor(conduit_node *node)
{
    const insitu_status status = catalyst_adaptor_initialize(&insitu_conduit_functions, node);
    conduit_node_destroy(node);
    return status;
}

static conduit_node *make_initialize_node(void)
{
    conduit_node *node = conduit_node_create();
    conduit_node_set_path_char8_str(node, "catalyst/insitu/scene_text", scene);
    conduit_node_set_path_int64(node, "catalyst/mpi_comm", MPI_Comm_c2f(MPI_COMM_WORLD));
    return node;
}

/* Stores the adaptor's results in a new node and returns it. */
static conduit_node *fetch_results(void)
{
    conduit_node *node = conduit_node_create();
    catalyst_adaptor_write_results(&writer, node);
    return node;
}

static bool has_word(conduit_node *node, const char *path, const char *word)
{
    const char *text = conduit_node_as_char8_str(conduit_node_fetch_existing(node, path));
    if (!strstr(text, word)) fprintf(stderr, "%s: \"%s\"\n", path, text);
    return strstr(text, word) != NULL;
}

static double read_number(conduit_node *node, const char *path)
{
    double real;
    int64_t whole;
    conduit_node *at = conduit_node_fetch_existing(node, path);
    const void *data = conduit_node_element_ptr(at, 0);
    memcpy(&real, data, sizeof real);
    memcpy(&whole, data, sizeof whole);
    return conduit_datatype_id(conduit_node_dtype(at)) == STAND_IN_INT64 ? (double)whole : real;
}

/* Moves the node of a layout into the node of a channel. */
static void store_channel(conduit_node *node, const char *channel, const char *type, const char *data, layout_case *l)
{
    char path[256];
    snprintf(path, sizeof path, "catalyst/channels/%s/type", channel);
    conduit_node_set_path_char8_str(node, path, type);
    snprintf(path, sizeof path, "catalyst/channels/%s/%s", channel, data);
    stand_in_swap(conduit_node_fetch(node, path), l->node);
}

static conduit_node *make_execute_node(int64_t step)
{
    conduit_node *node = conduit_node_create();
    conduit_node_set_path_int64(node, "catalyst/state/timestep", step);
    conduit_node_set_path_float64(node, "catalyst/state/time", 0.5 * (double)step);
    return node;
}

static bool has_drawn(int count)
{
    const bool is_well = caught_count == (own_rank == 0 ? count : 0);
    discard_pictures();
    return is_well;
}

static void scenes_are_read_from_the_node(void **state)
{
    (void)state;
    const char *path = write_scene(scene);
    for (int way = 0; way < 4; way++) {
        conduit_node *node = conduit_node_create();
        if (way == 0) conduit_node_set_path_char8_str(node, "catalyst/insitu/scene", path);
        if (way > 0) conduit_node_set_path_char8_str(node, "catalyst/scripts/first", "pipeline.py");
        if (way == 1) conduit_node_set_path_char8_str(node, "catalyst/scripts/second", path);
        if (way == 2) conduit_node_set_path_char8_str(node, "catalyst/scripts/second/filename", path);
        if (way == 3) setenv("INSITU_SCENE", path, 1);
        everywhere(initialize_adaptor(node) == INSITU_OK);
        everywhere(catalyst_adaptor_finalize() == INSITU_OK);
    }
    unsetenv("INSITU_SCENE");
    everywhere(initialize_adaptor(conduit_node_create()) == INSITU_ERROR_SCENE);
    conduit_node *node = fetch_results();
    everywhere(has_word(node, "insitu/error", "catalyst: there is no scene"));
    everywhere(has_word(node, "insitu/status", "INSITU_ERROR_SCENE"));
    conduit_node_destroy(node);
    node = conduit_node_create();
    conduit_node_set_path_char8_str(node, "catalyst/insitu/scene_text", "images: none");
    everywhere(initialize_adaptor(node) == INSITU_ERROR_SCENE);
    node = make_initialize_node();
    conduit_node_set_path_char8_str(node, "catalyst/mpi_comm", "world");
    everywhere(initialize_adaptor(node) == INSITU_ERROR_MESH);
}

/* Checks channels that contain one mesh, several meshes and domains. A rank may have no data for a channel. */
static void channels_are_drawn(void **state)
{
    (void)state;
    layout_case a, b, c;
    layout_make(&layout_kinds[0], &a);
    layout_make(&layout_kinds[10], &b);
    layout_make(&layout_kinds[15], &c);
    everywhere(initialize_adaptor(make_initialize_node()) == INSITU_OK);
    everywhere(initialize_adaptor(make_initialize_node()) == INSITU_ERROR_ARGUMENT); /* a second call is an error */
    conduit_node *node = make_execute_node(7);
    if (own_rank == 0) store_channel(node, "grid", "mesh", "data", &a);
    store_channel(node, "parts", "multimesh", "data/walls", &b);
    store_channel(node, "levels", "amrmesh", "data/domain_000000", &c);
    discard_pictures();
    everywhere(catalyst_adaptor_execute(node) == INSITU_OK && has_drawn(1));
    conduit_node *out = fetch_results();
    everywhere(read_number(out, "insitu/cycle") == 7 && read_number(out, "insitu/images") == 1);
    everywhere(has_word(out, "insitu/status", "INSITU_OK") && has_word(out, "insitu/error", ""));
    conduit_node_destroy(out);
    everywhere(catalyst_adaptor_finalize() == INSITU_OK);
    conduit_node_destroy(node);
    layout_free(&a);
    layout_free(&b);
    layout_free(&c);
}

static void errors_are_same_on_all_ranks(void **state)
{
    (void)state;
    layout_case l;
    layout_make(&layout_kinds[0], &l);
    everywhere(catalyst_adaptor_execute(NULL) == INSITU_ERROR_ARGUMENT);
    everywhere(initialize_adaptor(make_initialize_node()) == INSITU_OK);
    conduit_node *node = make_execute_node(0);
    store_channel(node, "grid", "mesh", "data", &l);
    discard_pictures();
    for (int wrong = 0; wrong < 3; wrong++) {
        const bool is_last = own_rank == rank_count - 1;
        if (is_last && wrong == 0) conduit_node_set_path_char8_str(node, "catalyst/channels/grid/type", "table");
        if (is_last && wrong == 1) conduit_node_set_path_float64(node, "catalyst/state/timestep", 1);
        if (is_last && wrong == 2)
            conduit_node_set_path_int64(node, "catalyst/channels/grid/data/topologies/mesh/type", 3);
        const insitu_status status = catalyst_adaptor_execute(node);
        everywhere(status == INSITU_ERROR_MESH && has_drawn(0));
        conduit_node *out = fetch_results();
        everywhere(has_word(out, "insitu/error",
                            wrong == 0   ? "catalyst/channels/grid/type: is \"table\""
                            : wrong == 1 ? "catalyst/state/timestep: is no whole number"
                                         : "grid/topologies/mesh/type: is no string"));
        conduit_node_destroy(out);
        conduit_node_set_path_char8_str(node, "catalyst/channels/grid/type", "mesh");
        conduit_node_set_path_int64(node, "catalyst/state/timestep", wrong + 1);
        conduit_node_set_path_char8_str(node, "catalyst/channels/grid/data/topologies/mesh/type", "uniform");
        everywhere(catalyst_adaptor_execute(node) == INSITU_OK && has_drawn(1));
    }
    everywhere(catalyst_adaptor_finalize() == INSITU_OK);
    conduit_node_destroy(node);
    layout_free(&l);
}

static void parameters_are_returned_as_results(void **state)
{
    (void)state;
    conduit_node *node = make_initialize_node();
    conduit_node_set_path_float64(node, "catalyst/insitu/parameters/inflow", 1);
    conduit_node_set_path_float64(node, "catalyst/insitu/parameters/outflow", 3);
    everywhere(initialize_adaptor(node) == INSITU_OK);
    node = make_execute_node(0);
    discard_pictures();
    catalyst_adaptor_execute(node); /* there is nothing to draw */
    conduit_node *out = fetch_results();
    everywhere(read_number(out, "insitu/parameters/inflow") == 2.5 &&
               read_number(out, "insitu/parameters/outflow") == 3);
    conduit_node_destroy(out);
    out = conduit_node_create();
    catalyst_adaptor_write_about(&writer, out);
    everywhere(has_word(out, "catalyst/implementation", "insitu"));
    conduit_node_destroy(out);
    conduit_node_destroy(node);
    everywhere(catalyst_adaptor_finalize() == INSITU_OK);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scenes_are_read_from_the_node),
        cmocka_unit_test(channels_are_drawn),
        cmocka_unit_test(errors_are_same_on_all_ranks),
        cmocka_unit_test(parameters_are_returned_as_results),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
