#include "catalyst_adaptor.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blueprint_node.h"

enum { PARAMETERS = 64 };

/* A parameter of the scene whose value the simulation reads from the results of Catalyst. */
typedef struct requested_parameter {
    char name[NODE_NAME];
    double value;
} requested_parameter;

static struct catalyst_state {
    const insitu_conduit *conduit;
    insitu_session *session;
    insitu_blueprint *adaptor;
    int rank;
    bool has_initialized_mpi;
    insitu_status status; /* status of the last call to Catalyst's API */
    char message[NODE_MESSAGE + 64];
    char last_left_out[2048]; /* most recent report about left out items that was printed to stderr */
    int parameter_count;
    requested_parameter parameters[PARAMETERS];
} state;

/* Stores the error, and prints the message to stderr on rank 0, because Catalyst's functions return only a status and
 * the simulation may never read the results. */
static insitu_status fail(insitu_status status, const char *message)
{
    state.status = status;
    snprintf(state.message, sizeof state.message, "%s", message);
    if (state.rank == 0) fprintf(stderr, "catalyst-insitu: %s\n", message);
    return status;
}

/* ---- initialize ------------------------------------------------------------------------------------------------- */

/* Initializes MPI if the simulation has not, and determines the communicator. */
static bool find_communicator(const node *root, MPI_Comm *comm)
{
    int is_initialized;
    int64_t handle = 0;
    MPI_Initialized(&is_initialized);
    if (!is_initialized) {
        if (MPI_Init(NULL, NULL)) return node_set_error(root, "", INSITU_ERROR_MPI, "MPI_Init returned an error");
        state.has_initialized_mpi = true;
    }
    *comm = MPI_COMM_WORLD;
    if (!node_read_integer(root, "catalyst/mpi_comm", false, &handle)) return false;
    if (node_has(root, "catalyst/mpi_comm")) *comm = MPI_Comm_f2c((MPI_Fint)handle);
    return true;
}

static bool is_yaml(const char *path)
{
    const char *dot = strrchr(path, '.');
    return dot && (strcmp(dot, ".yaml") == 0 || strcmp(dot, ".yml") == 0);
}

/* Returns the path of the first scene in catalyst/scripts, or NULL if there is none. A script is either a path, or a
 * node with a filename. */
static const char *find_catalyst_script(const node *root)
{
    node scripts, script, file;
    if (!node_find(root, "catalyst/scripts", &scripts)) return NULL;
    for (int64_t i = 0; i < node_child_count(&scripts); i++) {
        node_get_child(&scripts, i, &script);
        if (!node_find(&script, "filename", &file)) file = script;
        if (!file.conduit->is_string(file.conduit_node)) continue;
        const char *path = file.conduit->as_char8_str(file.conduit_node);
        if (path && is_yaml(path)) return path;
    }
    return NULL;
}

/* Finds the scene. *is_text is set to true if *scene is the text of a scene instead of a path. */
static bool find_scene(const node *root, const char **scene, bool *is_text)
{
    *is_text = false;
    if (node_has(root, "catalyst/insitu/scene")) return node_read_string(root, "catalyst/insitu/scene", scene);
    *is_text = node_has(root, "catalyst/insitu/scene_text");
    if (*is_text) return node_read_string(root, "catalyst/insitu/scene_text", scene);
    *scene = find_catalyst_script(root);
    if (!*scene) *scene = getenv("INSITU_SCENE");
    return *scene || node_set_error(root, "catalyst", INSITU_ERROR_SCENE,
                                    "there is no scene: give insitu/scene, a *.yaml among scripts, or INSITU_SCENE");
}

/* Reads catalyst/insitu/parameters: the names of the scene's parameters whose values the simulation requests, each with
 * the value to return if the scene lacks the parameter. */
static bool read_requested_parameters(const node *root)
{
    node all, one;
    state.parameter_count = 0;
    if (!node_find(root, "catalyst/insitu/parameters", &all)) return true;
    for (int64_t i = 0; i < node_child_count(&all) && state.parameter_count < PARAMETERS; i++) {
        requested_parameter *p = &state.parameters[state.parameter_count++];
        node_get_child(&all, i, &one);
        snprintf(p->name, sizeof p->name, "%s", one.name);
        p->value = 0;
        if (!node_read_real(&all, one.name, true, &p->value)) return false;
    }
    return true;
}

/* Turns an error in the node of any rank into an error on all ranks. */
static insitu_status agree_on_error(MPI_Comm comm, const node_log *log)
{
    int worst = (int)log->status;
    MPI_Allreduce(MPI_IN_PLACE, &worst, 1, MPI_INT, MPI_MAX, comm);
    if (!worst) return INSITU_OK;
    return fail((insitu_status)worst, log->status ? log->message : "another rank's initialize node is wrong");
}

static insitu_status open_session(MPI_Comm comm, const char *scene, bool is_text)
{
    insitu_status status =
        is_text ? insitu_create_from_text(comm, scene, &state.session) : insitu_create(comm, scene, &state.session);
    if (status) return fail(status, insitu_error(NULL));
    status = insitu_blueprint_create(state.session, state.conduit, comm, &state.adaptor);
    return status ? fail(status, insitu_blueprint_error(NULL)) : status;
}

insitu_status catalyst_adaptor_initialize(const insitu_conduit *conduit, const void *params)
{
    node_log log = {.status = INSITU_OK};
    const node root = {conduit, &log, params, NULL, {0}};
    MPI_Comm comm = MPI_COMM_WORLD;
    const char *scene = NULL;
    bool is_text = false;
    if (state.session) return fail(INSITU_ERROR_ARGUMENT, "catalyst_initialize() is called for a second time");
    state = (struct catalyst_state){.conduit = conduit};
    if (find_communicator(&root, &comm) && read_requested_parameters(&root)) find_scene(&root, &scene, &is_text);
    MPI_Comm_rank(comm, &state.rank);
    insitu_status status = agree_on_error(comm, &log);
    if (!status) status = open_session(comm, scene, is_text);
    node_log_free(&log);
    return status;
}

/* ---- execute ---------------------------------------------------------------------------------------------------- */

/* Sets the data of a channel: a mesh of one or several domains, or several named meshes. */
static bool set_channel(const node *channel)
{
    const char *type;
    node data, mesh;
    char name[2 * NODE_NAME];
    if (!node_read_string(channel, "type", &type)) return false;
    if (!node_find(channel, "data", &data)) return true; /* a channel may have no data on this rank */
    const bool is_multimesh = strcmp(type, "multimesh") == 0;
    if (!is_multimesh && strcmp(type, "mesh") != 0 && strcmp(type, "amrmesh") != 0)
        return node_set_error(channel, "type", INSITU_ERROR_MESH, "is \"%s\", expected mesh, multimesh or amrmesh",
                              type);
    if (!is_multimesh) return !insitu_blueprint_set(state.adaptor, channel->name, data.conduit_node);
    for (int64_t i = 0; i < node_child_count(&data); i++) {
        node_get_child(&data, i, &mesh);
        snprintf(name, sizeof name, "%s/%s", channel->name, mesh.name);
        if (insitu_blueprint_set(state.adaptor, name, mesh.conduit_node)) return false;
    }
    return true;
}

static bool set_channels(const node *root)
{
    node channels, channel;
    if (!node_find(root, "catalyst/channels", &channels)) return true;
    for (int64_t i = 0; i < node_child_count(&channels); i++) {
        node_get_child(&channels, i, &channel);
        if (!set_channel(&channel)) return false;
    }
    return true;
}

static void print_left_out(const insitu_blueprint_report *report)
{
    if (state.rank || strncmp(state.last_left_out, report->left_out, sizeof state.last_left_out - 1) == 0) return;
    snprintf(state.last_left_out, sizeof state.last_left_out, "%s", report->left_out);
    if (*state.last_left_out) fprintf(stderr, "catalyst-insitu: left out:\n%s\n", state.last_left_out);
}

/* Reads the cycle and time, and whether the node has them. */
static bool read_state(const node *root, int64_t *cycle, double *time, bool *has_cycle, bool *has_time)
{
    const char *path = node_has(root, "catalyst/state/timestep") ? "catalyst/state/timestep" : "catalyst/state/cycle";
    *has_cycle = node_has(root, path);
    *has_time = node_has(root, "catalyst/state/time");
    return node_read_integer(root, path, false, cycle) && node_read_real(root, "catalyst/state/time", false, time);
}

insitu_status catalyst_adaptor_execute(const void *params)
{
    node_log log = {.status = INSITU_OK};
    const node root = {state.conduit, &log, params, NULL, {0}};
    int64_t cycle = 0;
    double time = 0;
    bool has_cycle = false, has_time = false;
    if (!state.session || !state.adaptor) return fail(INSITU_ERROR_ARGUMENT, "catalyst_initialize() has not succeeded");
    insitu_blueprint_set(state.adaptor, "", NULL); /* makes the adaptor begin a step even if there is no channel */
    if (read_state(&root, &cycle, &time, &has_cycle, &has_time)) set_channels(&root);
    if (log.status) insitu_blueprint_refuse(state.adaptor, log.status, log.message);
    state.status = insitu_blueprint_step(state.adaptor, has_cycle ? &cycle : NULL, has_time ? &time : NULL);
    print_left_out(insitu_blueprint_last_report(state.adaptor));
    node_log_free(&log);
    *state.message = 0;
    for (int i = 0; i < state.parameter_count; i++)
        insitu_parameter(state.session, state.parameters[i].name, &state.parameters[i].value);
    return state.status ? fail(state.status, insitu_blueprint_error(state.adaptor)) : INSITU_OK;
}

/* ---- finalize, results, about ----------------------------------------------------------------------------------- */

insitu_status catalyst_adaptor_finalize(void)
{
    insitu_blueprint_destroy(&state.adaptor);
    insitu_status status = insitu_destroy(&state.session);
    if (status) fail(status, insitu_error(NULL));
    if (state.has_initialized_mpi) MPI_Finalize();
    state.has_initialized_mpi = false;
    return status;
}

void catalyst_adaptor_write_results(const catalyst_writer *writer, void *node)
{
    char path[NODE_NAME + 32];
    writer->set_string(node, "insitu/status", insitu_status_name(state.status));
    writer->set_string(node, "insitu/error", state.message);
    if (!state.session || !state.adaptor) return;
    const insitu_report *report = insitu_last_report(state.session);
    const insitu_blueprint_report *adaptor_report = insitu_blueprint_last_report(state.adaptor);
    writer->set_integer(node, "insitu/cycle", report->cycle);
    writer->set_integer(node, "insitu/images", report->images);
    writer->set_real(node, "insitu/total_ms", report->total_ms);
    writer->set_integer(node, "insitu/bytes_copied", report->bytes_copied + adaptor_report->bytes_copied);
    writer->set_string(node, "insitu/warnings", report->warnings ? report->warnings : "");
    writer->set_string(node, "insitu/left_out", adaptor_report->left_out);
    for (int i = 0; i < state.parameter_count; i++) {
        snprintf(path, sizeof path, "insitu/parameters/%s", state.parameters[i].name);
        writer->set_real(node, path, state.parameters[i].value);
    }
}

void catalyst_adaptor_write_about(const catalyst_writer *writer, void *node)
{
    writer->set_string(node, "catalyst/implementation", "insitu");
    writer->set_string(node, "catalyst/tpl/libinsitu/license", "Apache-2.0");
    writer->set_integer(node, "catalyst/use_mpi", 1);
}
