/* The Blueprint adaptor: it determines which meshes a node contains and what has changed in them, and makes all ranks
 * agree on errors. A session reads borrowed arrays during a step; arrays that the adaptor allocated itself are
 * therefore kept in a part until the mesh is set again. */
#include "insitu/blueprint.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "blueprint_hash.h"
#include "blueprint_mesh.h"

/* A mesh that was passed to the session. */
typedef struct door_part {
    char *name;
    int64_t round; /* step counter when the mesh was last set */
    uint64_t places, cells, fields;
    door_owned owned;
} door_part;

struct insitu_blueprint {
    insitu_session *session;
    const insitu_conduit *conduit;
    MPI_Comm comm;
    int part_count;
    door_part *parts;
    int next_part;  /* index at which the next search begins */
    int64_t round;  /* number of steps so far */
    bool is_begun;  /* true if something has been set for the next step */
    node_log log;   /* messages of the calls since the last step */
    bool has_cycle; /* a domain of the next step has state/cycle; cycle is the largest */
    int64_t cycle, last_cycle;
    bool has_time;
    double time;
    insitu_blueprint_report report;
    char error[NODE_MESSAGE + 64];
};

static _Thread_local char create_error[256];

/* ---- parts ------------------------------------------------------------------------------------------------------- */

/* Finds the part of a mesh. The search begins behind the part found last, because domains are set in the same order
 * every step, and there may be thousands. */
static door_part *find_part(insitu_blueprint *door, const char *name)
{
    for (int i = 0; i < door->part_count; i++) {
        const int number = (door->next_part + i) % door->part_count;
        if (strcmp(door->parts[number].name, name) != 0) continue;
        door->next_part = number + 1;
        return &door->parts[number];
    }
    return NULL;
}

static door_part *add_part(insitu_blueprint *door, const node *of, const char *name)
{
    door_part *parts = realloc(door->parts, (size_t)(door->part_count + 1) * sizeof *parts);
    if (parts) door->parts = parts;
    char *copy = parts ? malloc(strlen(name) + 1) : NULL;
    if (!copy) {
        node_fail(of, "", INSITU_ERROR_MEMORY, "no memory for a mesh's name");
        return NULL;
    }
    strcpy(copy, name);
    door->parts[door->part_count] = (door_part){.name = copy, .round = -1};
    return &door->parts[door->part_count++];
}

static void remove_part(insitu_blueprint *door, int number)
{
    door_part *part = &door->parts[number];
    insitu_set_mesh(door->session, part->name, NULL);
    door_owned_free(&part->owned);
    free(part->name);
    *part = door->parts[--door->part_count];
}

/* ---- one topology ------------------------------------------------------------------------------------------------ */

/* Reads state/insitu_changed, in which the domain may state what has changed; returns false if it does not, so that
 * hashes must be compared. */
static bool read_changes(const node *domain, unsigned *changed)
{
    const char *word;
    if (!node_has(domain, "state/insitu_changed")) return false;
    if (!node_string(domain, "state/insitu_changed", &word)) return false;
    if (strcmp(word, "all") == 0)
        *changed = INSITU_CHANGED_ALL;
    else if (strcmp(word, "geometry") == 0)
        *changed = INSITU_CHANGED_GEOMETRY;
    else if (strcmp(word, "nothing") == 0)
        *changed = INSITU_CHANGED_NOTHING;
    else
        return node_fail(domain, "state/insitu_changed", INSITU_ERROR_MESH,
                         "is \"%s\", expected nothing, geometry or all", word);
    return true;
}

/* Stores the hashes of the mesh's arrays and field names in the part, and returns the INSITU_CHANGED flags of those
 * that differ from the previous step. */
static unsigned find_changes(const node *domain, const char *topology, const door_mesh *mesh, door_part *part)
{
    unsigned changed = 0;
    const bool is_said = read_changes(domain, &changed);
    const door_part last = *part;
    part->fields = door_field_names(domain, topology);
    part->places = is_said ? 0 : door_hash_places(&mesh->mesh);
    part->cells = is_said ? 0 : door_hash_cells(&mesh->mesh);
    if (last.round < 0 || last.fields != part->fields) return INSITU_CHANGED_ALL;
    if (is_said) return changed;
    return (last.cells == part->cells ? 0 : INSITU_CHANGED_TOPOLOGY) |
           (last.places == part->places ? 0 : INSITU_CHANGED_GEOMETRY);
}

/* Keeps the adaptor's own arrays of the previous step if the topology has not changed, because the session treats
 * arrays at other addresses as changed. */
static void keep_owned(door_mesh *mesh, door_part *part)
{
    insitu_array *const arrays[] = {&mesh->mesh.offsets, &mesh->mesh.face_offsets, &mesh->mesh.ghosts};
    if (mesh->owned.count != part->owned.count) return;
    for (int i = 0; i < mesh->owned.count; i++)
        for (int k = 0; k < 3; k++)
            if (arrays[k]->data == mesh->owned.arrays[i]) arrays[k]->data = part->owned.arrays[i];
    const door_owned made = mesh->owned;
    mesh->owned = part->owned;
    part->owned = made;
}

/* Sets the mesh and its fields on the session. The part takes over the mesh's own arrays. */
static bool hand_over(insitu_blueprint *door, const node *domain, const node *topology, door_mesh *mesh,
                      const char *name)
{
    door_part *part = find_part(door, name);
    if (!part) part = add_part(door, topology, name);
    if (!part) {
        door_owned_free(&mesh->owned);
        return false;
    }
    mesh->mesh.changed = find_changes(domain, topology->name, mesh, part);
    if (!(mesh->mesh.changed & INSITU_CHANGED_TOPOLOGY)) keep_owned(mesh, part);
    const insitu_status status = insitu_set_mesh(door->session, name, &mesh->mesh);
    door_owned_free(&part->owned);
    part->owned = mesh->owned;
    part->round = door->round;
    if (status) return node_fail(topology, "", status, "%s", insitu_error(door->session));
    door->report.meshes++;
    door->report.cells += mesh->mesh.cell_count;
    return door_set_fields(domain, topology->name, mesh, door->session, name, &door->report.fields);
}

static bool set_topology(insitu_blueprint *door, const node *domain, const node *topology, const char *name)
{
    door_mesh mesh;
    bool is_read = door_read_topology(domain, topology, &mesh);
    if (is_read && !mesh.is_left_out) is_read = door_read_ghosts(domain, topology->name, &mesh);
    if (is_read && !mesh.is_left_out)
        is_read = hand_over(door, domain, topology, &mesh, name);
    else
        door_owned_free(&mesh.owned);
    door_mesh_end(&mesh);
    return is_read;
}

/* ---- domains ----------------------------------------------------------------------------------------------------- */

static bool read_state(insitu_blueprint *door, const node *domain)
{
    int64_t cycle = 0;
    double time = 0;
    if (!node_integer(domain, "state/cycle", false, &cycle) || !node_real(domain, "state/time", false, &time))
        return false;
    if (node_has(domain, "state/cycle")) {
        door->cycle = door->has_cycle && door->cycle > cycle ? door->cycle : cycle;
        door->has_cycle = true;
    }
    if (node_has(domain, "state/time")) {
        door->time = door->has_time && door->time > time ? door->time : time;
        door->has_time = true;
    }
    return true;
}

/* Sets all topologies of a domain. `number` is the domain's index on this rank, or -1 if there is only one domain. */
static bool set_domain(insitu_blueprint *door, const node *domain, const char *name, int64_t number)
{
    node topologies, topology;
    char mesh[NODE_PATH];
    if (!read_state(door, domain)) return false;
    if (!node_need(domain, "coordsets", &topologies) || !node_need(domain, "topologies", &topologies)) return false;
    for (int64_t i = 0; i < node_child_count(&topologies); i++) {
        node_child(&topologies, i, &topology);
        int length = snprintf(mesh, sizeof mesh, "%s%s%s", name, *name ? "/" : "", topology.name);
        if (number >= 0 && length > 0 && length < NODE_PATH)
            snprintf(mesh + length, sizeof mesh - (size_t)length, "/%lld", (long long)number);
        if (!set_topology(door, domain, &topology, mesh)) return false;
    }
    return true;
}

static bool set_node(insitu_blueprint *door, const char *name, const node *root)
{
    node domain;
    if (node_has(root, "coordsets") || node_has(root, "topologies")) return set_domain(door, root, name, -1);
    for (int64_t i = 0; i < node_child_count(root); i++) {
        node_child(root, i, &domain);
        if (!set_domain(door, &domain, name, i)) return false;
    }
    return true;
}

static insitu_status fail(insitu_blueprint *door, insitu_status status, const char *message)
{
    snprintf(door->error, sizeof door->error, "%s", message);
    return status;
}

insitu_status insitu_blueprint_set(insitu_blueprint *door, const char *name, const void *at)
{
    if (!door) return INSITU_ERROR_ARGUMENT;
    if (!name) return fail(door, INSITU_ERROR_ARGUMENT, "insitu_blueprint_set: no name is given");
    if (!door->is_begun) {
        node_log_free(&door->log);
        door->report = (insitu_blueprint_report){.meshes = 0};
        door->has_cycle = door->has_time = false;
        door->is_begun = true;
    }
    if (!at || door->log.status) return door->log.status;
    node root = {door->conduit, &door->log, at, NULL, {0}};
    snprintf(root.name, sizeof root.name, "%s", name);
    if (set_node(door, name, &root)) return INSITU_OK;
    return fail(door, door->log.status, door->log.message);
}

void insitu_blueprint_refuse(insitu_blueprint *door, insitu_status status, const char *message)
{
    if (!door || !status) return;
    insitu_blueprint_set(door, "", NULL);
    if (door->log.status) return;
    door->log.status = status;
    snprintf(door->log.message, sizeof door->log.message, "%s", message);
}

/* ---- steps ------------------------------------------------------------------------------------------------------- */

static insitu_status mpi_failure(insitu_blueprint *door)
{
    return fail(door, INSITU_ERROR_MPI, "insitu_blueprint_step: MPI returned an error");
}

/* Computes the largest cycle and time over all ranks, and finds the lowest rank with an error, or -1. */
static insitu_status reduce(insitu_blueprint *door, int *at_fault)
{
    int rank, ranks;
    if (MPI_Comm_rank(door->comm, &rank) || MPI_Comm_size(door->comm, &ranks)) return mpi_failure(door);
    int64_t whole[3] = {door->log.status ? ranks - rank : 0, door->has_cycle,
                        door->has_cycle ? door->cycle : INT64_MIN};
    double real[2] = {door->has_time, door->has_time ? door->time : -1e300};
    if (MPI_Allreduce(MPI_IN_PLACE, whole, 3, MPI_INT64_T, MPI_MAX, door->comm) ||
        MPI_Allreduce(MPI_IN_PLACE, real, 2, MPI_DOUBLE, MPI_MAX, door->comm))
        return mpi_failure(door);
    *at_fault = whole[0] ? ranks - (int)whole[0] : -1;
    door->cycle = whole[1] ? whole[2] : door->last_cycle + 1;
    door->time = real[0] > 0 ? real[1] : (double)door->cycle;
    return INSITU_OK;
}

/* Returns the error of the rank at_fault on all ranks. */
static insitu_status share_error(insitu_blueprint *door, int at_fault)
{
    int status = (int)door->log.status;
    char message[NODE_MESSAGE];
    memcpy(message, door->log.message, sizeof message);
    if (MPI_Bcast(&status, 1, MPI_INT, at_fault, door->comm) ||
        MPI_Bcast(message, NODE_MESSAGE, MPI_CHAR, at_fault, door->comm))
        return mpi_failure(door);
    snprintf(door->error, sizeof door->error, "rank %d: %s", at_fault, message);
    return (insitu_status)status;
}

static void take_away_others(insitu_blueprint *door)
{
    for (int i = door->part_count - 1; i >= 0; i--)
        if (door->parts[i].round != door->round) remove_part(door, i);
}

insitu_status insitu_blueprint_step(insitu_blueprint *door, const int64_t *cycle, const double *time)
{
    int at_fault;
    if (!door) return INSITU_ERROR_ARGUMENT;
    if (!door->is_begun) insitu_blueprint_set(door, "", NULL);
    door->is_begun = false;
    take_away_others(door);
    door->round++;
    door->report.left_out = door->log.left_out ? door->log.left_out : "";
    door->report.copied_why = door->log.copied_why ? door->log.copied_why : "";
    door->report.bytes_copied = door->log.bytes_copied;
    insitu_status status = reduce(door, &at_fault);
    if (status) return status;
    if (at_fault >= 0) return share_error(door, at_fault);
    door->last_cycle = cycle ? *cycle : door->cycle;
    status = insitu_step(door->session, door->last_cycle, time ? *time : door->time);
    return status ? fail(door, status, insitu_error(door->session)) : status;
}

const insitu_blueprint_report *insitu_blueprint_last_report(const insitu_blueprint *door)
{
    return door ? &door->report : NULL;
}

/* ---- doors ------------------------------------------------------------------------------------------------------- */

insitu_status insitu_blueprint_create(insitu_session *session, const insitu_conduit *conduit, MPI_Comm comm,
                                      insitu_blueprint **out)
{
    *create_error = 0;
    if (out) *out = NULL;
    insitu_blueprint *door = session && conduit && out ? calloc(1, sizeof *door) : NULL;
    if (!door) {
        const bool is_given = session && conduit && out;
        snprintf(create_error, sizeof create_error, "insitu_blueprint_create: %s",
                 is_given ? "no memory" : "no session, no functions, or no place for the door");
        return is_given ? INSITU_ERROR_MEMORY : INSITU_ERROR_ARGUMENT;
    }
    door->session = session;
    door->conduit = conduit;
    door->last_cycle = -1;
    door->report.left_out = door->report.copied_why = "";
    if (MPI_Comm_dup(comm, &door->comm) || MPI_Comm_set_errhandler(door->comm, MPI_ERRORS_RETURN)) {
        snprintf(create_error, sizeof create_error, "insitu_blueprint_create: MPI_Comm_dup returned an error");
        free(door);
        return INSITU_ERROR_MPI;
    }
    *out = door;
    return INSITU_OK;
}

const char *insitu_blueprint_error(const insitu_blueprint *door)
{
    return door ? door->error : create_error;
}

void insitu_blueprint_destroy(insitu_blueprint **door)
{
    if (!door || !*door) return;
    while ((*door)->part_count) remove_part(*door, (*door)->part_count - 1);
    MPI_Comm_free(&(*door)->comm);
    node_log_free(&(*door)->log);
    free((*door)->parts);
    free(*door);
    *door = NULL;
}
