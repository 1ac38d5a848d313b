/* The catalogue lists the meshes and fields of all ranks. From it every rank determines, without communication and with
 * the same result, whether a picture can be drawn, so that no rank lacks a field in the middle of a collective call.
 *
 * A rank's table is a text of lines: "m <has cells> <has ids> <name>" begins a mesh, "f <components> <centring> <name>"
 * is a field of it, "e <status> 0 <message>" is the fault of the preceding mesh or field, if it has one. If all ranks'
 * tables are equal (the usual case, which the step's one reduction finds by hashes) nothing is exchanged; else all
 * ranks gather all texts. */
#include "session_catalogue.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_hash.h"

/* ---- a rank's table as text ---------------------------------------------------------------------------------- */

/* Writes a line within capacity bytes; returns the size of the text including the line, even if it does not fit. */
static size_t append_line(char *text, size_t capacity, size_t at, char kind, int a, int b, const char *name)
{
    const size_t room = at < capacity ? capacity - at : 0;
    const int size = snprintf(room ? text + at : NULL, room, "%c %d %d %s", kind, a, b, name);
    return at + (size_t)size + 1;
}

static size_t append_fault(char *text, size_t capacity, size_t at, const base_error *fault)
{
    return fault->status ? append_line(text, capacity, at, 'e', (int)fault->status, 0, fault->message) : at;
}

static size_t append_mesh(char *text, size_t capacity, size_t at, const session_mesh *mesh)
{
    at = append_line(text, capacity, at, 'm', mesh->given.cell_count > 0, mesh->given.vertex_ids.data != NULL,
                     mesh->name);
    at = append_fault(text, capacity, at, &mesh->problem);
    for (int f = 0; f < mesh->field_count; f++) {
        const insitu_field *field = &mesh->fields[f].given;
        if (mesh->fields[f].is_derived) continue;
        at = append_line(text, capacity, at, 'f', field->component_count, (int)field->centring, field->name);
        at = append_fault(text, capacity, at, &mesh->fields[f].problem);
    }
    return at;
}

static size_t write_table(const session_meshes *meshes, char *text, size_t capacity)
{
    size_t at = 0;
    if (meshes->pending_mesh && meshes->pending_field) {
        at = append_line(text, capacity, at, 'm', 0, 0, meshes->pending_mesh);
        at = append_line(text, capacity, at, 'f', 0, 0, meshes->pending_field);
    }
    at = append_fault(text, capacity, at, &meshes->pending);
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        if (mesh->is_given || mesh->problem.status) at = append_mesh(text, capacity, at, mesh);
    }
    return at;
}

uint64_t session_names_hash(const session_meshes *meshes)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        if (!mesh->is_given) continue;
        int given_count = 0;
        for (int f = 0; f < mesh->field_count; f++) given_count += !mesh->fields[f].is_derived;
        const int head[] = {mesh->given.cell_count > 0, mesh->given.vertex_ids.data != NULL, given_count};
        session_hash_bytes(&hash, head, sizeof head);
        session_hash_text(&hash, mesh->name);
        for (int f = 0; f < mesh->field_count; f++) {
            const insitu_field *field = &mesh->fields[f].given;
            if (mesh->fields[f].is_derived) continue;
            const int tail[] = {field->component_count, (int)field->centring};
            session_hash_bytes(&hash, tail, sizeof tail);
            session_hash_text(&hash, field->name);
        }
    }
    return hash;
}

/* ---- texts to a catalogue ------------------------------------------------------------------------------------ */

void session_hanging_free(session_hanging *hanging, int count, bool with_borders)
{
    session_border *borders = hanging->borders;
    const uint64_t twins = hanging->twins;
    base_free(hanging->vertices);
    base_free(hanging->sent_counts);
    base_free(hanging->sent_groups);
    for (int i = 0; i < count && borders && with_borders; i++) {
        base_free(borders[i].faces);
        base_free(borders[i].vertices);
        base_free(borders[i].twins);
    }
    if (with_borders) base_free(borders);
    *hanging = (session_hanging){0};
    if (with_borders) return;
    hanging->borders = borders;
    hanging->twins = twins;
}

void session_vertex_groups_free(session_vertex_groups *groups)
{
    base_free(groups->firsts);
    base_free(groups->of_vertex);
    base_free(groups->starts);
    session_keys_free(&groups->keys);
    base_free(groups->shared);
    base_free(groups->shared_keys);
    base_free(groups->shared_counts);
    *groups = (session_vertex_groups){0};
}

void session_drop_joints(session_catalogue *catalogue)
{
    for (int i = 0; i < catalogue->joint_count; i++) {
        session_joint *joint = catalogue->joints[i];
        session_hanging_free(&joint->hanging, joint->count, true);
        session_vertex_groups_free(&joint->groups);
        session_homes_free(&joint->own_homes);
        base_free(joint->meshes);
        base_free(joint);
    }
    base_free(catalogue->joints);
    catalogue->joints = NULL;
    catalogue->joint_count = 0;
    catalogue->are_joined = false;
}

session_joint *session_find_joint(const session_catalogue *catalogue, uint64_t name)
{
    for (int i = 0; i < catalogue->joint_count; i++)
        if (catalogue->joints[i]->name == name) return catalogue->joints[i];
    return NULL;
}

void session_catalogue_free(session_catalogue *catalogue)
{
    session_drop_joints(catalogue);
    for (int i = 0; i < catalogue->mesh_count; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        for (int f = 0; f < mesh->field_count; f++) {
            base_free(mesh->fields[f].name);
            base_free(mesh->fields[f].fault);
        }
        base_free(mesh->fields);
        base_free(mesh->fault);
        base_free(mesh->name);
        session_homes_free(&mesh->homes);
    }
    base_free(catalogue->meshes);
    base_free(catalogue->fault);
    *catalogue = (session_catalogue){0};
}

static int by_text(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

static int by_mesh_name(const void *a, const void *b)
{
    return strcmp(((const session_catalogue_mesh *)a)->name, ((const session_catalogue_mesh *)b)->name);
}

static session_catalogue_mesh *find_mesh(const session_catalogue *catalogue, const char *name)
{
    const session_catalogue_mesh key = {.name = (char *)(uintptr_t)name};
    return bsearch(&key, catalogue->meshes, (size_t)catalogue->mesh_count, sizeof key, by_mesh_name);
}

/* Stores the names of the meshes in the text, if names is not NULL. Returns their number. */
static size_t list_names(const char *text, size_t size, const char **names)
{
    size_t count = 0;
    for (const char *line = text; line < text + size; line += strlen(line) + 1) {
        if (line[0] != 'm') continue;
        char *end = NULL;
        strtol(line + 1, &end, 10);
        strtol(end, &end, 10);
        if (names) names[count] = end + 1;
        count++;
    }
    return count;
}

/* Adds the catalogue's meshes, sorted by name, from the tables of all ranks. */
static bool add_meshes(session_catalogue *catalogue, const char *text, size_t size)
{
    const size_t count = list_names(text, size, NULL);
    if (!count) return true;
    const char **names = base_alloc(count * sizeof *names);
    catalogue->meshes = base_calloc(count, sizeof *catalogue->meshes);
    bool has_memory = names && catalogue->meshes;
    if (has_memory) {
        list_names(text, size, names);
        qsort(names, count, sizeof *names, by_text);
    }
    for (size_t i = 0; i < count && has_memory; i++) {
        if (i > 0 && strcmp(names[i], names[i - 1]) == 0) continue;
        session_catalogue_mesh *mesh = &catalogue->meshes[catalogue->mesh_count];
        *mesh = (session_catalogue_mesh){.name = base_strdup(names[i]), .has_ids = true, .first_rank = -1};
        has_memory = mesh->name != NULL;
        catalogue->mesh_count += has_memory;
    }
    base_free(names);
    return has_memory;
}

static session_catalogue_field *add_field(session_catalogue_mesh *mesh, const char *name)
{
    for (int i = 0; i < mesh->field_count; i++)
        if (strcmp(mesh->fields[i].name, name) == 0) return &mesh->fields[i];
    session_catalogue_field *fields = base_realloc(mesh->fields, (size_t)(mesh->field_count + 1) * sizeof *fields);
    if (!fields) return NULL;
    mesh->fields = fields;
    session_catalogue_field *field = &fields[mesh->field_count];
    *field = (session_catalogue_field){.name = base_strdup(name),
                                       .first_rank = -1,
                                       .last_rank = -1,
                                       .odd_rank = -1,
                                       .lacking_rank = mesh->first_rank,
                                       .derived = -1};
    if (!field->name) return NULL;
    mesh->field_count++;
    return field;
}

static session_catalogue_field *take_field(session_catalogue_mesh *mesh, bool has_cells, int rank, int components,
                                           insitu_centring centring, const char *name)
{
    session_catalogue_field *field = add_field(mesh, name);
    if (!field) return NULL;
    if (field->first_rank < 0) {
        field->first_rank = rank;
        field->component_count = components;
        field->centring = centring;
    } else if (field->odd_rank < 0 && (field->component_count != components || field->centring != centring)) {
        field->odd_rank = rank;
    }
    if (has_cells) field->last_rank = rank;
    return field;
}

/* Ends a rank's table of a mesh: records the fields that were missing from it. */
static void close_mesh(session_catalogue_mesh *mesh, bool has_cells, bool has_ids, int rank)
{
    if (!mesh || !has_cells) return;
    if (mesh->first_rank < 0) mesh->first_rank = rank;
    if (!has_ids) mesh->has_ids = false;
    for (int i = 0; i < mesh->field_count; i++) {
        session_catalogue_field *field = &mesh->fields[i];
        if (field->lacking_rank < 0 && field->last_rank != rank) field->lacking_rank = rank;
    }
}

static bool keep_fault(base_error **fault, int rank, insitu_status status, const char *message)
{
    if (*fault) return true;
    *fault = base_calloc(1, sizeof **fault);
    base_fail(*fault, status, "rank %d: %.900s", rank, message);
    return *fault != NULL;
}

/* Records a fault of the rank. field: NULL if the mesh has the fault; mesh: NULL if its owner is unknown. Lack of
 * memory is also recorded for the catalogue, because callers then mostly skip the data that they would have passed
 * next. */
static bool take_fault(session_catalogue *catalogue, session_catalogue_mesh *mesh, session_catalogue_field *field,
                       int rank, insitu_status status, const char *message)
{
    base_error **fault = field ? &field->fault : mesh ? &mesh->fault : &catalogue->fault;
    catalogue->has_faults = true;
    return keep_fault(fault, rank, status, message) &&
           (status != INSITU_ERROR_MEMORY || keep_fault(&catalogue->fault, rank, status, message));
}

static bool take_table(session_catalogue *catalogue, const char *text, size_t size, int rank)
{
    session_catalogue_mesh *mesh = NULL;
    session_catalogue_field *field = NULL;
    bool has_cells = false, has_ids = false;
    for (const char *line = text; line < text + size; line += strlen(line) + 1) {
        char *end = NULL;
        const long a = strtol(line + 1, &end, 10);
        const long b = strtol(end, &end, 10);
        const char *name = end + 1;
        if (line[0] == 'm') {
            close_mesh(mesh, has_cells, has_ids, rank);
            mesh = find_mesh(catalogue, name);
            field = NULL;
            has_cells = a != 0;
            has_ids = b != 0;
        } else if (line[0] == 'e') {
            if (!take_fault(catalogue, mesh, field, rank, (insitu_status)a, name)) return false;
        } else {
            field = take_field(mesh, has_cells, rank, (int)a, (insitu_centring)b, name);
            if (!field) return false;
        }
    }
    close_mesh(mesh, has_cells, has_ids, rank);
    return true;
}

const session_catalogue_field *session_catalogue_find(const session_catalogue_mesh *mesh, const char *name)
{
    for (int i = 0; i < mesh->field_count; i++)
        if (strcmp(mesh->fields[i].name, name) == 0) return &mesh->fields[i];
    return NULL;
}

static int by_field_name(const void *a, const void *b)
{
    return strcmp(((const session_catalogue_field *)a)->name, ((const session_catalogue_field *)b)->name);
}

static void sort_fields(const session_catalogue *catalogue)
{
    for (int i = 0; i < catalogue->mesh_count; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        if (mesh->field_count) qsort(mesh->fields, (size_t)mesh->field_count, sizeof *mesh->fields, by_field_name);
    }
}

session_catalogue_field *session_catalogue_add(session_catalogue_mesh *mesh, const char *name, int component_count,
                                               insitu_centring centring, int derived)
{
    session_catalogue_field *field = add_field(mesh, name);
    if (!field) return NULL;
    field->component_count = component_count;
    field->centring = centring;
    field->derived = derived;
    field->first_rank = mesh->first_rank;
    field->lacking_rank = -1;
    return field;
}

void session_catalogue_drop_derived(session_catalogue *catalogue)
{
    for (int i = 0; i < catalogue->mesh_count; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        int kept = 0;
        for (int f = 0; f < mesh->field_count; f++) {
            if (mesh->fields[f].derived < 0) {
                mesh->fields[kept++] = mesh->fields[f];
                continue;
            }
            base_free(mesh->fields[f].name);
            base_free(mesh->fields[f].fault);
        }
        mesh->field_count = kept;
    }
    catalogue->are_derived = false;
}

/* ---- tables of all ranks ------------------------------------------------------------------------------------- */

typedef struct gathered_tables {
    char *mine, *all;
    int *sizes, *places;
    int64_t total;
} gathered_tables;

static void free_tables(gathered_tables *tables)
{
    base_free(tables->mine);
    base_free(tables->all);
    base_free(tables->sizes);
    base_free(tables->places);
}

static insitu_status write_mine(const session_meshes *meshes, gathered_tables *tables, int *size, base_error *error)
{
    const size_t bytes = write_table(meshes, NULL, 0);
    if (bytes > INT32_MAX / 2) return session_no_memory(error, (int64_t)bytes, "names of meshes and fields");
    *size = (int)bytes;
    tables->mine = base_alloc(bytes + 1);
    if (!tables->mine) return session_no_memory(error, (int64_t)bytes, "names of meshes and fields");
    write_table(meshes, tables->mine, bytes + 1);
    return INSITU_OK;
}

static insitu_status place_tables(int ranks, gathered_tables *tables, base_error *error)
{
    tables->total = 0;
    for (int rank = 0; rank < ranks; rank++) {
        tables->places[rank] = (int)tables->total;
        tables->total += tables->sizes[rank];
        if (tables->total > INT32_MAX) return session_no_memory(error, tables->total, "names of meshes and fields");
    }
    tables->all = base_alloc((size_t)tables->total + 1);
    return tables->all ? INSITU_OK : session_no_memory(error, tables->total, "names of meshes and fields");
}

static insitu_status gather_tables(const session_meshes *meshes, const session_team *team, gathered_tables *tables,
                                   base_error *error)
{
    int size = 0;
    write_mine(meshes, tables, &size, error);
    tables->sizes = base_calloc((size_t)team->ranks, sizeof(int));
    tables->places = base_calloc((size_t)team->ranks, sizeof(int));
    if (!tables->sizes || !tables->places) session_no_memory(error, 8 * (int64_t)team->ranks, "counts");
    insitu_status status = session_agree(team->comm, error);
    if (status) return status;
    status =
        session_mpi(error, MPI_Allgather(&size, 1, MPI_INT, tables->sizes, 1, MPI_INT, team->comm), "MPI_Allgather");
    if (status) return status;
    place_tables(team->ranks, tables, error);
    status = session_agree(team->comm, error);
    if (status) return status;
    return session_mpi(
        error,
        MPI_Allgatherv(tables->mine, size, MPI_CHAR, tables->all, tables->sizes, tables->places, MPI_CHAR, team->comm),
        "MPI_Allgatherv");
}

static bool take_tables(int ranks, const gathered_tables *tables, session_catalogue *out)
{
    if (!add_meshes(out, tables->all, (size_t)tables->total)) return false;
    for (int rank = 0; rank < ranks; rank++)
        if (!take_table(out, tables->all + tables->places[rank], (size_t)tables->sizes[rank], rank)) return false;
    return true;
}

static void put_faulty_aside(const session_catalogue *catalogue, session_meshes *meshes)
{
    for (int i = 0; i < catalogue->mesh_count; i++) {
        session_mesh *mesh = catalogue->meshes[i].fault ? session_find_mesh(meshes, catalogue->meshes[i].name) : NULL;
        if (mesh) session_put_aside(meshes, mesh);
    }
}

insitu_status session_update_catalogue(session_catalogue *catalogue, session_meshes *meshes, const session_team *team,
                                       bool is_shared, base_error *error)
{
    gathered_tables tables = {0};
    session_catalogue found = {.is_known = true};
    insitu_status status = INSITU_OK;
    if (is_shared) {
        int size = 0;
        if (write_mine(meshes, &tables, &size, error) == INSITU_OK &&
            !(add_meshes(&found, tables.mine, (size_t)size) && take_table(&found, tables.mine, (size_t)size, 0)))
            session_no_memory(error, size, "the catalogue of meshes and fields");
    } else {
        status = gather_tables(meshes, team, &tables, error);
        if (status == INSITU_OK && !take_tables(team->ranks, &tables, &found))
            session_no_memory(error, tables.total, "the catalogue of meshes and fields");
    }
    if (status == INSITU_OK) status = session_agree(team->comm, error);
    free_tables(&tables);
    if (status) {
        session_catalogue_free(&found);
        return status;
    }
    sort_fields(&found);
    session_catalogue_free(catalogue);
    *catalogue = found;
    meshes->are_names_changed = false;
    put_faulty_aside(catalogue, meshes);
    return INSITU_OK;
}

/* ---- homes ----------------------------------------------------------------------------------------------------- */

/* Returns a hash of the rank and the stamp; 0 if this rank has no part. */
static uint64_t stamp_of(int rank, int64_t stamp)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    session_hash_bytes(&hash, &rank, sizeof rank);
    session_hash_bytes(&hash, &stamp, sizeof stamp);
    return stamp ? hash : 0;
}

/* Sums up, over the ranks, hashes of the stamps at which each mesh last changed. */
static insitu_status update_parts(session_catalogue *catalogue, const session_meshes *meshes, const session_team *team,
                                  base_error *error)
{
    const int count = catalogue->mesh_count;
    uint64_t *sums = base_calloc((size_t)count * 2 + 1, sizeof *sums);
    if (!sums) session_no_memory(error, count * 16LL, "hashes of meshes");
    for (int i = 0; i < count && sums; i++) {
        const session_mesh *mesh = session_find_mesh(meshes, catalogue->meshes[i].name);
        if (!mesh || !mesh->is_given) continue;
        sums[2 * i] = stamp_of(team->rank, mesh->cells_stamp);
        sums[2 * i + 1] = stamp_of(team->rank, mesh->places_stamp);
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, 2 * count, MPI_UINT64_T, MPI_SUM, team->comm),
                             "MPI_Allreduce");
    for (int i = 0; i < count && !status; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        if (mesh->places != (sums[2 * i + 1] | 1)) session_homes_free(&mesh->homes);
        mesh->cells = sums[2 * i] | 1;
        mesh->places = sums[2 * i + 1] | 1;
    }
    catalogue->are_parts_known = !status;
    base_free(sums);
    return status;
}

static insitu_status update_joint(session_joint *joint, const session_meshes *meshes, double half_diagonal,
                                  const session_team *team, base_error *error)
{
    uint64_t places = SESSION_HASH_BEGIN;
    for (int i = 0; i < joint->count; i++)
        session_hash_bytes(&places, &joint->meshes[i]->places, sizeof joint->meshes[i]->places);
    const bool is_known = (places | 1) == joint->places && joint->homes && joint->homes->is_known;
    joint->places = places | 1;
    joint->homes = joint->count == 1 ? &joint->meshes[0]->homes : &joint->own_homes;
    if (is_known || joint->count == 1) return INSITU_OK;
    const session_mesh **parts = base_calloc((size_t)joint->count, sizeof *parts);
    if (!parts) session_no_memory(error, joint->count * (int64_t)sizeof *parts, "homes of meshes");
    for (int i = 0; i < joint->count && parts; i++) parts[i] = session_find_mesh(meshes, joint->meshes[i]->name);
    const insitu_status status =
        session_homes_find(&joint->own_homes, parts, parts ? joint->count : 0, false, half_diagonal, team, error);
    if (status) joint->places = 0;
    base_free(parts);
    return status;
}

insitu_status session_update_homes(session_catalogue *catalogue, const session_meshes *meshes, double half_diagonal,
                                   const session_team *team, base_error *error)
{
    insitu_status status = INSITU_OK;
    if (!catalogue->are_parts_known) status = update_parts(catalogue, meshes, team, error);
    for (int i = 0; i < catalogue->mesh_count && !status; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        const session_mesh *part = session_find_mesh(meshes, mesh->name);
        if (!mesh->homes.is_known)
            status = session_homes_find(&mesh->homes, &part, 1, mesh->has_ids, half_diagonal, team, error);
    }
    for (int i = 0; i < catalogue->joint_count && !status; i++)
        status = update_joint(catalogue->joints[i], meshes, half_diagonal, team, error);
    return status;
}

void session_forget_homes(session_catalogue *catalogue)
{
    catalogue->are_parts_known = false;
}
