/* The catalogue lists the meshes and fields of all ranks. From it every rank determines, without communication and with
 * the same result, whether a picture can be drawn, so that no rank finds in the middle of a collective call that it
 * lacks a field.
 *
 * Each rank describes its meshes and fields by a table, a text of lines:
 * - "m <has cells> <bits: 1 has ids, 2 has levels of refinement> <name>" begins a mesh;
 * - "f <components> <centring> <name>" is a field of this mesh;
 * - "e <status> 0 <message>" is the error of the preceding mesh or field; meshes and fields without an error lack this
 * line.
 *
 * If all ranks' tables are equal (the usual case, which the step's one reduction detects by hashes of the tables),
 * nothing is exchanged; else all ranks gather all tables. */
#include "session_catalogue.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_hash.h"
#include "session_keys.h"

/* ---- writing this rank's table of meshes and fields -------------------------------------------------------------- */

/* Appends the line "kind a b name" to the text, which has `at` bytes so far, if it fits within `capacity` bytes.
 * Returns the size of the text including the line, even if the line does not fit. */
static size_t append_line(char *text, size_t capacity, size_t at, char kind, int a, int b, const char *name)
{
    const size_t space = at < capacity ? capacity - at : 0;
    const int size = snprintf(space ? text + at : NULL, space, "%c %d %d %s", kind, a, b, name);
    return at + (size_t)size + 1;
}

static size_t append_fault(char *text, size_t capacity, size_t at, const base_error *fault)
{
    return fault->status ? append_line(text, capacity, at, 'e', (int)fault->status, 0, fault->message) : at;
}

/* The properties of a mesh that this rank's table lists, found from all of this rank's parts of the mesh. */
typedef struct part_summary {
    bool is_given, has_cells, has_ids, is_refined;
    const base_error *problem; /* error of the first part that has one; NULL: no part has an error */
} part_summary;

/* Summarizes this rank's parts of a mesh. The mesh has vertex ids if at least one part has cells, and all parts with
 * cells have ids. */
static part_summary summarize_parts(const session_parts *parts)
{
    part_summary out = {.has_ids = true};
    bool has_any = false;
    for (int i = 0; i < parts->count; i++) {
        const session_mesh *part = parts->items[i];
        if (part->problem.status && !out.problem) out.problem = &part->problem;
        if (part->source) continue;
        const bool has_cells = part->given.cell_count > 0, has_ids = part->given.vertex_ids.data != NULL;
        out.is_given = out.is_given || part->is_given || part->problem.status;
        out.has_cells = out.has_cells || has_cells;
        out.is_refined = out.is_refined || session_has_refinement_level(&part->given);
        if (has_cells && !has_ids) out.has_ids = false;
        has_any = has_any || has_ids;
    }
    out.has_ids = out.has_ids && has_any;
    return out;
}

static const session_field *find_field_of_caller(const session_mesh *part, const char *name)
{
    const int index = part->source ? -1 : session_find_field(part, name);
    return index < 0 || part->fields[index].is_derived ? NULL : &part->fields[index];
}

/* Returns whether the part with index `part` is the first one that has the field. A rank's table lists each field once,
 * for the first part that has it. */
static bool is_first_with_field(const session_parts *parts, int part, const session_field *field)
{
    for (int i = 0; i < part; i++)
        if (find_field_of_caller(parts->items[i], field->given.name)) return false;
    return true;
}

/* Finds an error of a field on any of this rank's parts of a mesh: the field's description is invalid, the field is
 * missing, or its description differs from that of `first`, the field on the first part that has it. */
static void find_field_problem(const session_parts *parts, const session_field *first, base_error *problem)
{
    const insitu_field *as = &first->given;
    for (int i = 0; i < parts->count && !problem->status; i++) {
        const session_mesh *part = parts->items[i];
        const session_field *field = find_field_of_caller(part, as->name);
        if (part->source) continue;
        if (field && field->problem.status) {
            *problem = field->problem;
        } else if (!field && part->given.cell_count > 0) {
            base_fail(problem, INSITU_ERROR_FIELD, "mesh \"%s\": field \"%s\" is not set, other blocks have it",
                      part->label, as->name);
        } else if (field &&
                   (field->given.component_count != as->component_count || field->given.centring != as->centring)) {
            base_fail(problem, INSITU_ERROR_FIELD,
                      "mesh \"%s\": field \"%s\" has another centring or number of components than on other blocks",
                      part->label, as->name);
        }
    }
}

/* Iterator over the fields of this rank's parts of a mesh. Each field is visited once, on the first part that has it.
 * part, next: indices of the part, and of the field on this part, at which the search for the next field begins. */
typedef struct field_visit {
    const session_parts *parts;
    int part, next;
} field_visit;

static const session_field *next_field_of_caller(field_visit *visit)
{
    for (; visit->part < visit->parts->count; visit->part++, visit->next = 0) {
        const session_mesh *part = visit->parts->items[visit->part];
        while (visit->next < part->field_count && !part->source) {
            const session_field *field = &part->fields[visit->next++];
            if (!field->is_derived && is_first_with_field(visit->parts, visit->part, field)) return field;
        }
    }
    return NULL;
}

static size_t append_mesh_to_table(char *text, size_t capacity, size_t at, const session_parts *parts)
{
    const part_summary of = summarize_parts(parts);
    if (!of.is_given) return at;
    at = append_line(text, capacity, at, 'm', of.has_cells, of.has_ids | 2 * of.is_refined, parts->items[0]->name);
    if (of.problem) at = append_fault(text, capacity, at, of.problem);
    field_visit visit = {.parts = parts};
    for (const session_field *field; (field = next_field_of_caller(&visit)) != NULL;) {
        base_error problem = {.status = INSITU_OK};
        find_field_problem(parts, field, &problem);
        at = append_line(text, capacity, at, 'f', field->given.component_count, (int)field->given.centring,
                         field->given.name);
        at = append_fault(text, capacity, at, &problem);
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
    at = append_fault(text, capacity, at, &meshes->pending_error);
    for (int i = 0; i < meshes->count;) {
        const session_parts parts = session_find_parts_from_index(meshes, i);
        at = append_mesh_to_table(text, capacity, at, &parts);
        i += parts.count;
    }
    return at;
}

static void hash_parts(const session_parts *parts, uint64_t *hash)
{
    const part_summary of = summarize_parts(parts);
    if (!of.is_given) return;
    const int head[] = {0, of.has_cells, of.has_ids, of.is_refined};
    session_hash_bytes(hash, head, sizeof head);
    session_hash_text(hash, parts->items[0]->name);
    field_visit visit = {.parts = parts};
    for (const session_field *field; (field = next_field_of_caller(&visit)) != NULL;) {
        const int tail[] = {1, field->given.component_count, (int)field->given.centring};
        base_error problem = {.status = INSITU_OK};
        find_field_problem(parts, field, &problem);
        session_hash_bytes(hash, tail, sizeof tail);
        session_hash_text(hash, field->given.name);
        if (problem.status) session_hash_text(hash, problem.message);
    }
}

/* The hash includes the errors of fields on all of this rank's parts. A rank with such an error therefore has another
 * hash than ranks without it, so that the tables are exchanged and all ranks receive the error. */
uint64_t session_hash_mesh_table(const session_meshes *meshes)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    for (int i = 0; i < meshes->count;) {
        const session_parts parts = session_find_parts_from_index(meshes, i);
        hash_parts(&parts, &hash);
        i += parts.count;
    }
    return hash;
}

/* ---- reading tables into the catalogue --------------------------------------------------------------------------- */

void session_hanging_free(session_hanging *hanging, bool with_borders)
{
    session_border *borders = hanging->borders;
    const int border_count = hanging->border_count;
    const uint64_t twins = hanging->twins_version;
    base_free(hanging->vertices);
    base_free(hanging->sent_counts);
    base_free(hanging->sent_groups);
    for (int i = 0; i < border_count && with_borders; i++) {
        base_free(borders[i].faces);
        base_free(borders[i].vertices);
        base_free(borders[i].twins);
    }
    if (with_borders) base_free(borders);
    *hanging = (session_hanging){0};
    if (with_borders) return;
    hanging->borders = borders;
    hanging->border_count = border_count;
    hanging->twins_version = twins;
}

void session_vertex_groups_free(session_vertex_groups *groups)
{
    base_free(groups->first_vertices);
    base_free(groups->group_of_vertex);
    base_free(groups->corner_starts);
    session_keys_free(&groups->keys);
    base_free(groups->shared_groups);
    base_free(groups->shared_keys);
    base_free(groups->shared_counts);
    *groups = (session_vertex_groups){0};
}

void session_drop_mesh_groups(session_catalogue *catalogue)
{
    for (int i = 0; i < catalogue->mesh_group_count; i++) {
        session_mesh_group *mesh_group = catalogue->mesh_groups[i];
        session_hanging_free(&mesh_group->hanging, true);
        session_vertex_groups_free(&mesh_group->groups);
        session_homes_free(&mesh_group->own_homes);
        base_free(mesh_group->meshes);
        base_free(mesh_group);
    }
    base_free(catalogue->mesh_groups);
    catalogue->mesh_groups = NULL;
    catalogue->mesh_group_count = 0;
    catalogue->are_meshes_grouped = false;
}

session_mesh_group *session_find_mesh_group(const session_catalogue *catalogue, uint64_t name)
{
    for (int i = 0; i < catalogue->mesh_group_count; i++)
        if (catalogue->mesh_groups[i]->name == name) return catalogue->mesh_groups[i];
    return NULL;
}

void session_catalogue_free(session_catalogue *catalogue)
{
    session_drop_mesh_groups(catalogue);
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

static int compare_texts(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

static int compare_mesh_names(const void *a, const void *b)
{
    return strcmp(((const session_catalogue_mesh *)a)->name, ((const session_catalogue_mesh *)b)->name);
}

static session_catalogue_mesh *find_mesh(const session_catalogue *catalogue, const char *name)
{
    const session_catalogue_mesh key = {.name = (char *)(uintptr_t)name};
    return bsearch(&key, catalogue->meshes, (size_t)catalogue->mesh_count, sizeof key, compare_mesh_names);
}

/* Finds the names of meshes in a text that consists of the tables of all ranks; a mesh that several ranks have is found
 * several times. names: receives pointers into the text, unless it is NULL. Returns the number of names found. */
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

/* Adds the meshes of all ranks' tables to the catalogue, sorted by name, each mesh once. */
static bool add_meshes(session_catalogue *catalogue, const char *text, size_t size)
{
    const size_t count = list_names(text, size, NULL);
    if (!count) return true;
    const char **names = base_alloc(count * sizeof *names);
    catalogue->meshes = base_calloc(count, sizeof *catalogue->meshes);
    bool has_memory = names && catalogue->meshes;
    if (has_memory) {
        list_names(text, size, names);
        qsort(names, count, sizeof *names, compare_texts);
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
                                       .differing_rank = -1,
                                       .lacking_rank = mesh->first_rank,
                                       .derived_index = -1};
    if (!field->name) return NULL;
    mesh->field_count++;
    return field;
}

static session_catalogue_field *record_field(session_catalogue_mesh *mesh, bool has_cells, int rank, int components,
                                             insitu_centring centring, const char *name)
{
    session_catalogue_field *field = add_field(mesh, name);
    if (!field) return NULL;
    if (field->first_rank < 0) {
        field->first_rank = rank;
        field->component_count = components;
        field->centring = centring;
    } else if (field->differing_rank < 0 && (field->component_count != components || field->centring != centring)) {
        field->differing_rank = rank;
    }
    if (has_cells) field->last_rank = rank;
    return field;
}

/* Called after all fields of a mesh in the table of `rank` have been read. If that rank has cells of the mesh, updates
 * the mesh's first_rank and has_ids, and stores `rank` as the lacking_rank of those fields of the mesh that its table
 * does not list, unless they already have one. */
static void record_missing_fields(session_catalogue_mesh *mesh, bool has_cells, bool has_ids, int rank)
{
    if (!mesh || !has_cells) return;
    if (mesh->first_rank < 0) mesh->first_rank = rank;
    if (!has_ids) mesh->has_ids = false;
    for (int i = 0; i < mesh->field_count; i++) {
        session_catalogue_field *field = &mesh->fields[i];
        if (field->lacking_rank < 0 && field->last_rank != rank) field->lacking_rank = rank;
    }
}

static bool store_fault(base_error **fault, int rank, insitu_status status, const char *message)
{
    if (*fault) return true;
    *fault = base_calloc(1, sizeof **fault);
    base_fail(*fault, status, "rank %d: %.900s", rank, message);
    return *fault != NULL;
}

/* Records an error that a rank's table contains. field: NULL if the error concerns the whole mesh; mesh: NULL if it is
 * not known to which mesh the error belongs. Lack of memory is also recorded for the whole catalogue, because a caller
 * whose call has failed for lack of memory usually skips its next calls, so that further meshes and fields may be
 * missing. */
static bool record_fault(session_catalogue *catalogue, session_catalogue_mesh *mesh, session_catalogue_field *field,
                         int rank, insitu_status status, const char *message)
{
    base_error **fault = field ? &field->fault : mesh ? &mesh->fault : &catalogue->fault;
    catalogue->has_faults = true;
    return store_fault(fault, rank, status, message) &&
           (status != INSITU_ERROR_MEMORY || store_fault(&catalogue->fault, rank, status, message));
}

static bool read_table(session_catalogue *catalogue, const char *text, size_t size, int rank)
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
            record_missing_fields(mesh, has_cells, has_ids, rank);
            mesh = find_mesh(catalogue, name);
            field = NULL;
            has_cells = a != 0;
            has_ids = b & 1;
            if (mesh && b & 2) mesh->is_refined = true;
        } else if (line[0] == 'e') {
            if (!record_fault(catalogue, mesh, field, rank, (insitu_status)a, name)) return false;
        } else {
            field = record_field(mesh, has_cells, rank, (int)a, (insitu_centring)b, name);
            if (!field) return false;
        }
    }
    record_missing_fields(mesh, has_cells, has_ids, rank);
    return true;
}

const session_catalogue_field *session_catalogue_find_field(const session_catalogue_mesh *mesh, const char *name)
{
    for (int i = 0; i < mesh->field_count; i++)
        if (strcmp(mesh->fields[i].name, name) == 0) return &mesh->fields[i];
    return NULL;
}

static int compare_field_names(const void *a, const void *b)
{
    return strcmp(((const session_catalogue_field *)a)->name, ((const session_catalogue_field *)b)->name);
}

static void sort_fields(const session_catalogue *catalogue)
{
    for (int i = 0; i < catalogue->mesh_count; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        if (mesh->field_count)
            qsort(mesh->fields, (size_t)mesh->field_count, sizeof *mesh->fields, compare_field_names);
    }
}

session_catalogue_field *session_catalogue_add_field(session_catalogue_mesh *mesh, const char *name,
                                                     int component_count, insitu_centring centring, int derived)
{
    session_catalogue_field *field = add_field(mesh, name);
    if (!field) return NULL;
    field->component_count = component_count;
    field->centring = centring;
    field->derived_index = derived;
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
            if (mesh->fields[f].derived_index < 0) {
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

/* ---- gathering the tables of all ranks --------------------------------------------------------------------------- */

typedef struct gathered_tables {
    char *own_table, *tables;
    int *sizes, *offsets;
    int64_t total;
} gathered_tables;

static void free_tables(gathered_tables *tables)
{
    base_free(tables->own_table);
    base_free(tables->tables);
    base_free(tables->sizes);
    base_free(tables->offsets);
}

static insitu_status write_own_table(const session_meshes *meshes, gathered_tables *tables, int *size,
                                     base_error *error)
{
    const size_t bytes = write_table(meshes, NULL, 0);
    if (bytes > INT32_MAX / 2) return session_fail_for_memory(error, (int64_t)bytes, "names of meshes and fields");
    *size = (int)bytes;
    tables->own_table = base_alloc(bytes + 1);
    if (!tables->own_table) return session_fail_for_memory(error, (int64_t)bytes, "names of meshes and fields");
    write_table(meshes, tables->own_table, bytes + 1);
    return INSITU_OK;
}

static insitu_status compute_table_offsets(int ranks, gathered_tables *tables, base_error *error)
{
    tables->total = 0;
    for (int rank = 0; rank < ranks; rank++) {
        tables->offsets[rank] = (int)tables->total;
        tables->total += tables->sizes[rank];
        if (tables->total > INT32_MAX)
            return session_fail_for_memory(error, tables->total, "names of meshes and fields");
    }
    tables->tables = base_alloc((size_t)tables->total + 1);
    return tables->tables ? INSITU_OK : session_fail_for_memory(error, tables->total, "names of meshes and fields");
}

static insitu_status gather_tables(const session_meshes *meshes, const session_team *team, gathered_tables *tables,
                                   base_error *error)
{
    int size = 0;
    write_own_table(meshes, tables, &size, error);
    tables->sizes = base_calloc((size_t)team->ranks, sizeof(int));
    tables->offsets = base_calloc((size_t)team->ranks, sizeof(int));
    if (!tables->sizes || !tables->offsets) session_fail_for_memory(error, 8 * (int64_t)team->ranks, "counts");
    insitu_status status = session_agree(team->comm, error);
    if (status) return status;
    status = session_check_mpi(error, MPI_Allgather(&size, 1, MPI_INT, tables->sizes, 1, MPI_INT, team->comm),
                               "MPI_Allgather");
    if (status) return status;
    compute_table_offsets(team->ranks, tables, error);
    status = session_agree(team->comm, error);
    if (status) return status;
    return session_check_mpi(error,
                             MPI_Allgatherv(tables->own_table, size, MPI_CHAR, tables->tables, tables->sizes,
                                            tables->offsets, MPI_CHAR, team->comm),
                             "MPI_Allgatherv");
}

static bool read_tables(int ranks, const gathered_tables *tables, session_catalogue *out)
{
    if (!add_meshes(out, tables->tables, (size_t)tables->total)) return false;
    for (int rank = 0; rank < ranks; rank++)
        if (!read_table(out, tables->tables + tables->offsets[rank], (size_t)tables->sizes[rank], rank)) return false;
    return true;
}

static void exclude_faulty_meshes(const session_catalogue *catalogue, session_meshes *meshes)
{
    for (int i = 0; i < catalogue->mesh_count; i++) {
        if (!catalogue->meshes[i].fault) continue;
        const session_parts parts = session_find_parts(meshes, catalogue->meshes[i].name);
        for (int n = parts.count; n > 0; n--) session_exclude_mesh(meshes, parts.items[n - 1]);
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
        if (write_own_table(meshes, &tables, &size, error) == INSITU_OK &&
            !(add_meshes(&found, tables.own_table, (size_t)size) &&
              read_table(&found, tables.own_table, (size_t)size, 0)))
            session_fail_for_memory(error, size, "the catalogue of meshes and fields");
    } else {
        status = gather_tables(meshes, team, &tables, error);
        if (status == INSITU_OK && !read_tables(team->ranks, &tables, &found))
            session_fail_for_memory(error, tables.total, "the catalogue of meshes and fields");
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
    exclude_faulty_meshes(catalogue, meshes);
    return INSITU_OK;
}

/* ---- updating home ranks ----------------------------------------------------------------------------------------- */

/* Computes two hashes for this rank's parts of a mesh: hashes[0] from the stamps at which their cells last changed,
 * hashes[1] from the stamps at which their coordinates last changed. Both are 0 if this rank has no part. The caller
 * adds up the hashes of all ranks. Therefore the bits of each hash are mixed here. Without mixing, changes on two ranks
 * could cancel in the sum, because a changed bit could add to one rank's hash what it subtracts from another's. */
static void hash_stamps(const session_parts *parts, int rank, uint64_t hashes[2])
{
    bool has_any = false;
    for (int k = 0; k < 2; k++) {
        hashes[k] = SESSION_HASH_BEGIN;
        session_hash_bytes(&hashes[k], &rank, sizeof rank);
    }
    for (int i = 0; i < parts->count; i++) {
        const session_mesh *part = parts->items[i];
        if (!part->is_given) continue;
        has_any = true;
        session_hash_bytes(&hashes[0], &part->cells_stamp, sizeof part->cells_stamp);
        session_hash_bytes(&hashes[1], &part->coordinates_stamp, sizeof part->coordinates_stamp);
    }
    for (int k = 0; k < 2; k++) hashes[k] = has_any ? session_mix_bits(hashes[k]) : 0;
}

/* Computes cells_hash and positions_hash of each mesh: the sums over all ranks of the hashes of hash_stamps(). */
static insitu_status update_mesh_hashes(session_catalogue *catalogue, const session_meshes *meshes,
                                        const session_team *team, base_error *error)
{
    const int count = catalogue->mesh_count;
    uint64_t *sums = base_calloc((size_t)count * 2 + 1, sizeof *sums);
    if (!sums) session_fail_for_memory(error, count * 16LL, "hashes of meshes");
    for (int i = 0; i < count && sums; i++) {
        const session_parts parts = session_find_parts(meshes, catalogue->meshes[i].name);
        hash_stamps(&parts, team->rank, sums + 2 * (ptrdiff_t)i);
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allreduce(MPI_IN_PLACE, sums, 2 * count, MPI_UINT64_T, MPI_SUM, team->comm), "MPI_Allreduce");
    for (int i = 0; i < count && !status; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        if (mesh->positions_hash != (sums[2 * i + 1] | 1)) session_homes_free(&mesh->homes);
        mesh->cells_hash = sums[2 * i] | 1;
        mesh->positions_hash = sums[2 * i + 1] | 1;
    }
    catalogue->are_hashes_known = !status;
    base_free(sums);
    return status;
}

bool session_list_mesh_group_parts(const session_mesh_group *mesh_group, const session_meshes *meshes,
                                   session_mesh_group_parts *out)
{
    *out = (session_mesh_group_parts){0};
    out->first_parts = base_calloc((size_t)mesh_group->count + 1, sizeof *out->first_parts);
    out->items = base_calloc((size_t)meshes->count + 1, sizeof *out->items);
    if (!out->first_parts || !out->items) {
        session_mesh_group_parts_free(out);
        return false;
    }
    for (int m = 0; m < mesh_group->count; m++) {
        const session_parts parts = session_find_parts(meshes, mesh_group->meshes[m]->name);
        for (int i = 0; i < parts.count; i++)
            if (parts.items[i]->is_given) out->items[out->count++] = parts.items[i];
        out->first_parts[m + 1] = out->count;
    }
    return true;
}

void session_mesh_group_parts_free(session_mesh_group_parts *parts)
{
    base_free(parts->first_parts);
    base_free(parts->items);
    *parts = (session_mesh_group_parts){0};
}

static insitu_status update_mesh_group(session_mesh_group *mesh_group, const session_meshes *meshes,
                                       double half_diagonal, const session_team *team, base_error *error)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    for (int i = 0; i < mesh_group->count; i++)
        session_hash_bytes(&hash, &mesh_group->meshes[i]->positions_hash, sizeof mesh_group->meshes[i]->positions_hash);
    const bool is_known =
        (hash | 1) == mesh_group->positions_hash && mesh_group->homes && mesh_group->homes->is_computed;
    mesh_group->positions_hash = hash | 1;
    mesh_group->homes = mesh_group->count == 1 ? &mesh_group->meshes[0]->homes : &mesh_group->own_homes;
    if (is_known || mesh_group->count == 1) return INSITU_OK;
    session_mesh_group_parts parts;
    if (!session_list_mesh_group_parts(mesh_group, meshes, &parts))
        session_fail_for_memory(error, meshes->count * (int64_t)sizeof *parts.items, "homes of meshes");
    const insitu_status status =
        session_compute_home_ranks(&mesh_group->own_homes, parts.items, parts.count, false, half_diagonal, team, error);
    if (status) mesh_group->positions_hash = 0;
    session_mesh_group_parts_free(&parts);
    return status;
}

insitu_status session_update_home_ranks(session_catalogue *catalogue, const session_meshes *meshes,
                                        double half_diagonal, const session_team *team, base_error *error)
{
    insitu_status status = INSITU_OK;
    if (!catalogue->are_hashes_known) status = update_mesh_hashes(catalogue, meshes, team, error);
    for (int i = 0; i < catalogue->mesh_count && !status; i++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[i];
        const session_parts parts = session_find_parts(meshes, mesh->name);
        if (!mesh->homes.is_computed)
            status = session_compute_home_ranks(&mesh->homes, (const session_mesh *const *)parts.items, parts.count,
                                                mesh->has_ids, half_diagonal, team, error);
    }
    for (int i = 0; i < catalogue->mesh_group_count && !status; i++)
        status = update_mesh_group(catalogue->mesh_groups[i], meshes, half_diagonal, team, error);
    return status;
}

void session_invalidate_homes(session_catalogue *catalogue)
{
    catalogue->are_hashes_known = false;
}
