/* The Blueprint adaptor: it determines which meshes a Conduit node contains and which of their data have changed, and
 * makes all ranks agree on errors. A session reads borrowed arrays during a step; therefore the adaptor keeps the
 * arrays that it allocated for a mesh, in known_mesh, until that mesh is set again. */
#include "insitu/blueprint.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blueprint_hash.h"
#include "blueprint_lattice.h"
#include "blueprint_mesh.h"

/* A mesh or block that was passed to the session. */
typedef struct known_mesh {
    char *name;
    int64_t number;      /* number of the block, or WHOLE_MESH */
    int64_t step_number; /* value of the step counter when the mesh was last set */
    uint64_t name_hash, coordinate_hash, cell_hash, fields_hash;
    insitu_mesh mesh; /* description that was passed to the session; mesh.lattice is invalid until it is set to &lattice
                         again */
    insitu_lattice lattice; /* grid that was passed to the session; used only for uniform blocks */
    uniform_block uniform;
    owned_arrays owned;
} known_mesh;

struct insitu_blueprint {
    insitu_session *session;
    const insitu_conduit *conduit;
    MPI_Comm comm;
    int known_count;
    known_mesh *known_meshes;
    int next_search;       /* index in known_meshes at which the next search begins */
    int64_t step_number;   /* step counter: the number of steps so far */
    bool has_pending_sets; /* true if insitu_blueprint_set() has been called since the last step */
    node_log log;          /* errors and reports of the calls since the last step */
    bool has_cycle; /* true if a domain that was set for the next step states state/cycle; `cycle` is then the largest
                       such value */
    int64_t cycle, last_cycle;
    bool has_time;
    double time;
    /* for each mesh with uniform blocks on this rank: common origin and spacings of these blocks, as they were when the
     * ranks last agreed on those of all blocks */
    named_lattices lattices;
    named_lattices common; /* for each mesh in `lattices`: the common origin and spacings of the blocks of all ranks, on
                              which the ranks agreed */
    insitu_blueprint_report report;
    char error[NODE_MESSAGE + 64];
};

static _Thread_local char create_error[256];

/* ---- meshes that were passed to the session --------------------------------------------------------------------- */

/* Finds a known mesh by its name and number. The search begins after the mesh that was found most recently, because
 * domains are set in the same order every step, and there may be thousands of them. */
static known_mesh *find_known_mesh(insitu_blueprint *adaptor, const char *name, int64_t number)
{
    for (int i = 0; i < adaptor->known_count; i++) {
        const int index = (adaptor->next_search + i) % adaptor->known_count;
        known_mesh *known = &adaptor->known_meshes[index];
        if (known->number != number || strcmp(known->name, name) != 0) continue;
        adaptor->next_search = index + 1;
        return known;
    }
    return NULL;
}

/* Finds a block with cells of the mesh of this name that has been set for the next step, or returns NULL. The search
 * runs backwards from the mesh that was set most recently: the domains of a node usually have the same topologies, so
 * that the previous domain's block of this mesh is found after a few comparisons. */
static const known_mesh *find_pending_block(const insitu_blueprint *adaptor, const char *name)
{
    for (int i = 1; i <= adaptor->known_count; i++) {
        const int index = (adaptor->next_search + adaptor->known_count - i) % adaptor->known_count;
        const known_mesh *known = &adaptor->known_meshes[index];
        if (known->step_number == adaptor->step_number && known->number != WHOLE_MESH && known->mesh.cell_count > 0 &&
            strcmp(known->name, name) == 0)
            return known;
    }
    return NULL;
}

static known_mesh *add_known_mesh(insitu_blueprint *adaptor, const node *of, const char *name, int64_t number)
{
    known_mesh *known_meshes =
        realloc(adaptor->known_meshes, (size_t)(adaptor->known_count + 1) * sizeof *known_meshes);
    if (known_meshes) adaptor->known_meshes = known_meshes;
    char *copy = known_meshes ? strdup(name) : NULL;
    if (!copy) {
        node_set_error(of, "", INSITU_ERROR_MEMORY, "no memory for a mesh's name");
        return NULL;
    }
    known_mesh *known = &known_meshes[adaptor->known_count++];
    *known = (known_mesh){.name = copy, .number = number, .step_number = -1, .name_hash = blueprint_hash_text(name)};
    adaptor->next_search = adaptor->known_count;
    return known;
}

static mesh_target target_of(const insitu_blueprint *adaptor, const known_mesh *known)
{
    return (mesh_target){adaptor->session, known->name, known->number};
}

/* Returns whether blocks have been set under the name of `whole` after `whole` was set. `whole` is a mesh that was set
 * as one mesh. Such blocks replace it in the session. */
static bool is_replaced_by_blocks(const insitu_blueprint *adaptor, const known_mesh *whole)
{
    for (int i = 0; i < adaptor->known_count; i++) {
        const known_mesh *known = &adaptor->known_meshes[i];
        if (known->number != WHOLE_MESH && known->step_number > whole->step_number &&
            strcmp(known->name, whole->name) == 0)
            return true;
    }
    return false;
}

static void remove_known_mesh(insitu_blueprint *adaptor, int index)
{
    known_mesh *known = &adaptor->known_meshes[index];
    const mesh_target target = target_of(adaptor, known);
    if (known->number != WHOLE_MESH || !is_replaced_by_blocks(adaptor, known)) blueprint_set_target(&target, NULL);
    owned_arrays_free(&known->owned);
    free(known->name);
    *known = adaptor->known_meshes[--adaptor->known_count];
}

/* ---- set a topology --------------------------------------------------------------------------------------------- */

/* Reads state/insitu_changed, in which the domain may state what has changed. Returns false if the domain does not
 * state it; the caller must then compare hashes. */
static bool read_changes(const node *domain, unsigned *changed)
{
    const char *word;
    if (!node_has(domain, "state/insitu_changed")) return false;
    if (!node_read_string(domain, "state/insitu_changed", &word)) return false;
    if (strcmp(word, "all") == 0)
        *changed = INSITU_CHANGED_ALL;
    else if (strcmp(word, "geometry") == 0)
        *changed = INSITU_CHANGED_GEOMETRY;
    else if (strcmp(word, "nothing") == 0)
        *changed = INSITU_CHANGED_NOTHING;
    else
        return node_set_error(domain, "state/insitu_changed", INSITU_ERROR_MESH,
                              "is \"%s\", expected nothing, geometry or all", word);
    return true;
}

/* Returns what has changed in the mesh since the previous step, as INSITU_CHANGED flags. If the domain states the
 * changes, returns these; otherwise, compares hashes of the mesh's arrays. Stores the new hashes in *known. */
static unsigned find_changes(const node *domain, const blueprint_mesh *mesh, uint64_t fields_hash, known_mesh *known)
{
    unsigned changed = 0;
    const bool is_stated = read_changes(domain, &changed);
    const known_mesh last = *known;
    known->fields_hash = fields_hash;
    known->coordinate_hash = is_stated ? 0 : blueprint_hash_coordinates(&mesh->mesh);
    known->cell_hash = is_stated ? 0 : blueprint_hash_cells(&mesh->mesh);
    if (last.step_number < 0 || last.fields_hash != known->fields_hash) return INSITU_CHANGED_ALL;
    if (is_stated) return changed;
    return (last.cell_hash == known->cell_hash ? 0 : INSITU_CHANGED_TOPOLOGY) |
           (last.coordinate_hash == known->coordinate_hash ? 0 : INSITU_CHANGED_GEOMETRY);
}

/* Keeps the adaptor's own arrays of the previous step if the topology has not changed, because the session treats
 * arrays at other addresses as changed. */
static void reuse_owned_arrays(blueprint_mesh *mesh, known_mesh *known)
{
    insitu_array *const arrays[] = {&mesh->mesh.offsets, &mesh->mesh.face_offsets, &mesh->mesh.ghosts};
    if (mesh->owned.count != known->owned.count) return;
    for (int i = 0; i < mesh->owned.count; i++)
        for (int k = 0; k < 3; k++)
            if (arrays[k]->data == mesh->owned.arrays[i]) arrays[k]->data = known->owned.arrays[i];
    const owned_arrays made = mesh->owned;
    mesh->owned = known->owned;
    known->owned = made;
}

/* Passes the mesh to the session. *known takes over the arrays that the adaptor allocated. The origin, first index and
 * refinement of a uniform block are computed from the common lattice on which the ranks agreed in an earlier step. This
 * lattice rarely changes; if it does, place_blocks() corrects the block. */
static insitu_status set_known_mesh(insitu_blueprint *adaptor, blueprint_mesh *mesh, known_mesh *known)
{
    const mesh_target target = target_of(adaptor, known);
    bool is_level;
    known->uniform = describe_uniform_block(mesh);
    if (known->uniform.exists)
        mesh->lattice =
            uniform_block_place(&known->uniform, named_lattices_find(&adaptor->common, known->name_hash), &is_level);
    const insitu_status status = blueprint_set_target(&target, &mesh->mesh);
    owned_arrays_free(&known->owned);
    known->owned = mesh->owned;
    known->mesh = mesh->mesh;
    known->lattice = mesh->lattice;
    known->step_number = adaptor->step_number;
    return status;
}

/* Sets the mesh and its fields on the session. */
static bool set_mesh_and_fields(insitu_blueprint *adaptor, const node *domain, const node *topology,
                                blueprint_mesh *mesh, uint64_t fields_hash, const char *name, int64_t number)
{
    known_mesh *known = find_known_mesh(adaptor, name, number);
    if (!known) known = add_known_mesh(adaptor, topology, name, number);
    if (!known) {
        owned_arrays_free(&mesh->owned);
        return false;
    }
    mesh->mesh.changed = find_changes(domain, mesh, fields_hash, known);
    if (!(mesh->mesh.changed & INSITU_CHANGED_TOPOLOGY)) reuse_owned_arrays(mesh, known);
    const mesh_target target = target_of(adaptor, known);
    const insitu_status status = set_known_mesh(adaptor, mesh, known);
    if (status) return node_set_error(topology, "", status, "%s", insitu_error(adaptor->session));
    adaptor->report.meshes++;
    adaptor->report.cells += mesh->mesh.cell_count;
    return blueprint_set_fields(domain, topology->name, mesh, &target, &adaptor->report.fields);
}

/* Passes the mesh `name`, or the block `number` of this mesh, to the session. The blocks of a mesh must have the same
 * fields. A block with other fields than the blocks before it becomes a mesh of its own, and the block's number is
 * added to the name. */
static bool set_mesh_or_block(insitu_blueprint *adaptor, const node *domain, const node *topology, blueprint_mesh *mesh,
                              const char *name, int64_t number)
{
    char own_name[NODE_PATH + 32];
    const uint64_t fields_hash = blueprint_hash_fields(domain, topology->name, mesh);
    const known_mesh *other =
        number == WHOLE_MESH || mesh->mesh.cell_count == 0 ? NULL : find_pending_block(adaptor, name);
    if (!other || other->fields_hash == fields_hash)
        return set_mesh_and_fields(adaptor, domain, topology, mesh, fields_hash, name, number);
    snprintf(own_name, sizeof own_name, "%s/%lld", name, (long long)number);
    return set_mesh_and_fields(adaptor, domain, topology, mesh, fields_hash, own_name, WHOLE_MESH);
}

static bool set_topology(insitu_blueprint *adaptor, const node *domain, const node *topology, const char *name,
                         int64_t number)
{
    blueprint_mesh mesh;
    bool is_read = blueprint_read_topology(domain, topology, &mesh);
    if (is_read && !mesh.is_left_out) is_read = blueprint_read_ghosts(domain, topology->name, &mesh);
    if (is_read && !mesh.is_left_out)
        is_read = set_mesh_or_block(adaptor, domain, topology, &mesh, name, number);
    else
        owned_arrays_free(&mesh.owned);
    blueprint_mesh_free_tables(&mesh);
    return is_read;
}

/* ---- set all topologies of a domain ----------------------------------------------------------------------------- */

static bool read_state(insitu_blueprint *adaptor, const node *domain)
{
    int64_t cycle = 0;
    double time = 0;
    if (!node_read_integer(domain, "state/cycle", false, &cycle) || !node_read_real(domain, "state/time", false, &time))
        return false;
    if (node_has(domain, "state/cycle")) {
        adaptor->cycle = adaptor->has_cycle && adaptor->cycle > cycle ? adaptor->cycle : cycle;
        adaptor->has_cycle = true;
    }
    if (node_has(domain, "state/time")) {
        adaptor->time = adaptor->has_time && adaptor->time > time ? adaptor->time : time;
        adaptor->has_time = true;
    }
    return true;
}

/* Sets all topologies of a domain. `number` is the domain's index on this rank, or WHOLE_MESH if the node is a domain
 * itself. */
static bool set_domain(insitu_blueprint *adaptor, const node *domain, const char *name, int64_t number)
{
    node topologies, topology;
    char mesh[NODE_PATH];
    if (!read_state(adaptor, domain)) return false;
    if (!node_require(domain, "coordsets", &topologies) || !node_require(domain, "topologies", &topologies))
        return false;
    for (int64_t i = 0; i < node_child_count(&topologies); i++) {
        node_get_child(&topologies, i, &topology);
        snprintf(mesh, sizeof mesh, "%s%s%s", name, *name ? "/" : "", topology.name);
        if (!set_topology(adaptor, domain, &topology, mesh, number)) return false;
    }
    return true;
}

static bool set_node(insitu_blueprint *adaptor, const char *name, const node *root)
{
    node domain;
    if (node_has(root, "coordsets") || node_has(root, "topologies")) return set_domain(adaptor, root, name, WHOLE_MESH);
    for (int64_t i = 0; i < node_child_count(root); i++) {
        node_get_child(root, i, &domain);
        if (!set_domain(adaptor, &domain, name, i)) return false;
    }
    return true;
}

static insitu_status fail(insitu_blueprint *adaptor, insitu_status status, const char *message)
{
    snprintf(adaptor->error, sizeof adaptor->error, "%s", message);
    return status;
}

insitu_status insitu_blueprint_set(insitu_blueprint *adaptor, const char *name, const void *at)
{
    if (!adaptor) return INSITU_ERROR_ARGUMENT;
    if (!name) return fail(adaptor, INSITU_ERROR_ARGUMENT, "insitu_blueprint_set: no name is given");
    if (!adaptor->has_pending_sets) {
        node_log_free(&adaptor->log);
        adaptor->report = (insitu_blueprint_report){.meshes = 0};
        adaptor->has_cycle = adaptor->has_time = false;
        adaptor->has_pending_sets = true;
    }
    if (!at || adaptor->log.status) return adaptor->log.status;
    node root = {adaptor->conduit, &adaptor->log, at, NULL, {0}};
    snprintf(root.name, sizeof root.name, "%s", name);
    if (set_node(adaptor, name, &root)) return INSITU_OK;
    return fail(adaptor, adaptor->log.status, adaptor->log.message);
}

void insitu_blueprint_refuse(insitu_blueprint *adaptor, insitu_status status, const char *message)
{
    if (!adaptor || !status) return;
    insitu_blueprint_set(adaptor, "", NULL);
    if (adaptor->log.status) return;
    adaptor->log.status = status;
    snprintf(adaptor->log.message, sizeof adaptor->log.message, "%s", message);
}

/* ---- steps ------------------------------------------------------------------------------------------------------ */

static insitu_status fail_by_mpi_error(insitu_blueprint *adaptor)
{
    return fail(adaptor, INSITU_ERROR_MPI, "insitu_blueprint_step: MPI returned an error");
}

/* Computes the largest cycle and the largest time over all ranks. *failed_rank receives the lowest rank with an error,
 * or -1 if there is none. *condition is set to true on all ranks if it is true on any rank. */
static insitu_status reduce_state(insitu_blueprint *adaptor, int *failed_rank, bool *condition)
{
    int rank, ranks;
    if (MPI_Comm_rank(adaptor->comm, &rank) || MPI_Comm_size(adaptor->comm, &ranks)) return fail_by_mpi_error(adaptor);
    int64_t whole[4] = {adaptor->log.status ? ranks - rank : 0, adaptor->has_cycle,
                        adaptor->has_cycle ? adaptor->cycle : INT64_MIN, *condition};
    double real[2] = {adaptor->has_time, adaptor->has_time ? adaptor->time : -1e300};
    if (MPI_Allreduce(MPI_IN_PLACE, whole, 4, MPI_INT64_T, MPI_MAX, adaptor->comm) ||
        MPI_Allreduce(MPI_IN_PLACE, real, 2, MPI_DOUBLE, MPI_MAX, adaptor->comm))
        return fail_by_mpi_error(adaptor);
    *failed_rank = whole[0] ? ranks - (int)whole[0] : -1;
    *condition = whole[3] != 0;
    adaptor->cycle = whole[1] ? whole[2] : adaptor->last_cycle + 1;
    adaptor->time = real[0] > 0 ? real[1] : (double)adaptor->cycle;
    return INSITU_OK;
}

/* Returns the error of the rank failed_rank on all ranks. */
static insitu_status broadcast_error(insitu_blueprint *adaptor, int failed_rank)
{
    int status = (int)adaptor->log.status;
    char message[NODE_MESSAGE];
    memcpy(message, adaptor->log.message, sizeof message);
    if (MPI_Bcast(&status, 1, MPI_INT, failed_rank, adaptor->comm) ||
        MPI_Bcast(message, NODE_MESSAGE, MPI_CHAR, failed_rank, adaptor->comm))
        return fail_by_mpi_error(adaptor);
    snprintf(adaptor->error, sizeof adaptor->error, "rank %d: %s", failed_rank, message);
    return (insitu_status)status;
}

static void remove_meshes_not_set(insitu_blueprint *adaptor)
{
    for (int i = adaptor->known_count - 1; i >= 0; i--)
        if (adaptor->known_meshes[i].step_number != adaptor->step_number) remove_known_mesh(adaptor, i);
}

/* Lists, for each mesh with uniform blocks on this rank, the common origin and spacings of these blocks. If memory runs
 * out, stores this as the step's error. */
static named_lattices list_lattices(insitu_blueprint *adaptor)
{
    named_lattices list = {NULL, 0};
    const node root = {adaptor->conduit, &adaptor->log, NULL, NULL, {0}};
    bool has_memory = true;
    for (int i = 0; i < adaptor->known_count && has_memory; i++) {
        const known_mesh *known = &adaptor->known_meshes[i];
        if (known->uniform.exists) has_memory = named_lattices_add(&list, known->name_hash, &known->uniform);
    }
    if (!has_memory) node_set_error(&root, "", INSITU_ERROR_MEMORY, "no memory for the lattices of blocks");
    return list;
}

/* Makes the ranks agree on the common origin and spacings of each mesh's uniform blocks. `list` contains those of this
 * rank's blocks. If the function succeeds, the adaptor takes ownership of `list`. Collective. */
static insitu_status agree_on_lattices(insitu_blueprint *adaptor, named_lattices *list)
{
    named_lattices common;
    if (!named_lattices_agree(adaptor->comm, list, &common))
        return fail(adaptor, INSITU_ERROR_MEMORY, "insitu_blueprint_step: no memory for the lattices of blocks");
    named_lattices_free(&adaptor->lattices);
    named_lattices_free(&adaptor->common);
    adaptor->lattices = *list;
    adaptor->common = common;
    *list = (named_lattices){NULL, 0};
    return INSITU_OK;
}

static bool is_same_lattice_position(const insitu_lattice *a, const insitu_lattice *b)
{
    bool is_same = true;
    for (int i = 0; i < 3; i++)
        is_same = is_same && a->origin[i] == b->origin[i] && a->first[i] == b->first[i] &&
                  a->refinement[i] == b->refinement[i];
    return is_same;
}

/* Passes a uniform block to the session again if its origin, first index or refinement has changed, because the ranks
 * have agreed on another common lattice since the block was passed. */
static void place_blocks(insitu_blueprint *adaptor)
{
    for (int i = 0; i < adaptor->known_count; i++) {
        known_mesh *known = &adaptor->known_meshes[i];
        const node root = {adaptor->conduit, &adaptor->log, NULL, NULL, {0}};
        const mesh_target target = target_of(adaptor, known);
        bool is_level;
        if (!known->uniform.exists) continue;
        const insitu_lattice lattice =
            uniform_block_place(&known->uniform, named_lattices_find(&adaptor->common, known->name_hash), &is_level);
        if (!is_level)
            node_report_left_out(&root, known->name,
                                 "block %lld is on no level, because its spacing or position does not fit the coarsest "
                                 "blocks: it covers no cells of theirs",
                                 (long long)known->number);
        if (is_same_lattice_position(&lattice, &known->lattice)) continue;
        known->lattice = lattice;
        known->mesh.lattice = &known->lattice;
        known->mesh.changed = INSITU_CHANGED_NOTHING;
        blueprint_set_target(&target, &known->mesh); /* if this fails, insitu_step() returns the error later */
    }
}

static void finish_report(insitu_blueprint *adaptor)
{
    adaptor->report.left_out = adaptor->log.left_out ? adaptor->log.left_out : "";
    adaptor->report.copied_why = adaptor->log.copied_why ? adaptor->log.copied_why : "";
    adaptor->report.bytes_copied = adaptor->log.bytes_copied;
}

/* Agrees with all ranks on errors, on the cycle and time, and on the common lattices of uniform blocks. Collective. */
static insitu_status agree_on_step(insitu_blueprint *adaptor)
{
    int failed_rank;
    named_lattices list = list_lattices(adaptor);
    bool is_new = !named_lattices_are_same(&list, &adaptor->lattices);
    insitu_status status = reduce_state(adaptor, &failed_rank, &is_new);
    if (!status && failed_rank >= 0) status = broadcast_error(adaptor, failed_rank);
    if (!status && is_new) status = agree_on_lattices(adaptor, &list);
    named_lattices_free(&list);
    return status;
}

insitu_status insitu_blueprint_step(insitu_blueprint *adaptor, const int64_t *cycle, const double *time)
{
    if (!adaptor) return INSITU_ERROR_ARGUMENT;
    if (!adaptor->has_pending_sets) insitu_blueprint_set(adaptor, "", NULL);
    adaptor->has_pending_sets = false;
    remove_meshes_not_set(adaptor);
    adaptor->step_number++;
    insitu_status status = agree_on_step(adaptor);
    if (!status) place_blocks(adaptor);
    finish_report(adaptor);
    if (status) return status;
    adaptor->last_cycle = cycle ? *cycle : adaptor->cycle;
    status = insitu_step(adaptor->session, adaptor->last_cycle, time ? *time : adaptor->time);
    return status ? fail(adaptor, status, insitu_error(adaptor->session)) : status;
}

const insitu_blueprint_report *insitu_blueprint_last_report(const insitu_blueprint *adaptor)
{
    return adaptor ? &adaptor->report : NULL;
}

/* ---- create and destroy ----------------------------------------------------------------------------------------- */

insitu_status insitu_blueprint_create(insitu_session *session, const insitu_conduit *conduit, MPI_Comm comm,
                                      insitu_blueprint **out)
{
    *create_error = 0;
    if (out) *out = NULL;
    insitu_blueprint *adaptor = session && conduit && out ? calloc(1, sizeof *adaptor) : NULL;
    if (!adaptor) {
        const bool is_given = session && conduit && out;
        snprintf(create_error, sizeof create_error, "insitu_blueprint_create: %s",
                 is_given ? "no memory" : "no session, no functions, or no place for the adaptor");
        return is_given ? INSITU_ERROR_MEMORY : INSITU_ERROR_ARGUMENT;
    }
    adaptor->session = session;
    adaptor->conduit = conduit;
    adaptor->last_cycle = -1;
    adaptor->report.left_out = adaptor->report.copied_why = "";
    if (MPI_Comm_dup(comm, &adaptor->comm) || MPI_Comm_set_errhandler(adaptor->comm, MPI_ERRORS_RETURN)) {
        snprintf(create_error, sizeof create_error, "insitu_blueprint_create: MPI_Comm_dup returned an error");
        free(adaptor);
        return INSITU_ERROR_MPI;
    }
    *out = adaptor;
    return INSITU_OK;
}

const char *insitu_blueprint_error(const insitu_blueprint *adaptor)
{
    return adaptor ? adaptor->error : create_error;
}

void insitu_blueprint_destroy(insitu_blueprint **adaptor)
{
    if (!adaptor || !*adaptor) return;
    while ((*adaptor)->known_count) remove_known_mesh(*adaptor, (*adaptor)->known_count - 1);
    MPI_Comm_free(&(*adaptor)->comm);
    node_log_free(&(*adaptor)->log);
    named_lattices_free(&(*adaptor)->lattices);
    named_lattices_free(&(*adaptor)->common);
    free((*adaptor)->known_meshes);
    free(*adaptor);
    *adaptor = NULL;
}
