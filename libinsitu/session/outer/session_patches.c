/* A patch is a list of boundary faces with one value per face. A face is on the boundary if it belongs to only one
 * cell. In meshes with face owners, the owner and neighbour of a face tell whether it does. In other meshes the faces
 * of all cells are searched: a face's key is a hash of the first three power sums of its vertices' groups, which does
 * not depend on the order of vertices. The number of cells that have a face with this key must equal the number of
 * times that the caller gives the face. Therefore a face between two cells is detected as an error, while a baffle (a
 * wall without thickness inside the mesh) may be given once for each of its sides, because both sides have the same
 * vertices.
 *
 * The steps are: list the vertex groups and the value of each face of each patch; determine whether a drawn cell has
 * the face; output the pair (group, value) for each vertex. */
#include "session_patches.h"

#include <stdio.h>

#include "memory.h"
#include "session_agree.h"
#include "session_cell_faces.h"
#include "session_neighbours.h"
#include "session_topology.h"

typedef struct patch_faces {
    const session_mesh *mesh;
    const session_field *field;
    const session_vertex_numbers *numbers;
    int64_t count;         /* number of faces of all patches */
    int64_t *first_groups; /* index, in `groups`, of the first vertex of each face; count + 1 entries */
    /* for each vertex of each face, the group of equal vertices to which it belongs; -1: the vertex belongs to no drawn
     * cell */
    int64_t *groups;
    unsigned char *is_drawn; /* for each face, set if a drawn cell has the face */
} patch_faces;

/* A face of a patch. */
typedef struct patch_face {
    session_face_row row;
    int64_t number; /* index of the face in the mesh; -1: the caller gives the face by its vertices */
} patch_face;

static insitu_status fail_for_memory(int64_t entries, base_error *error)
{
    return session_fail_for_memory(error, entries * (int64_t)sizeof(int64_t), "faces of patches");
}

/* Stores an error about a face and returns its status. The message is 'mesh ...: field ...: patch 2: face 17' for a
 * face that is given by its number, or '... patch 2: its face 3' for a face that is given by its vertices, followed by
 * `what`. */
static insitu_status fail_at_face(const patch_faces *p, int patch, int64_t face, const char *what, base_error *error)
{
    const insitu_patch *given = &p->field->given.patches[patch];
    const grid_array faces = session_grid_array(&given->faces);
    const long long number = given->connectivity.data ? face + p->mesh->given.index_base
                             : given->faces.data      ? grid_read_index(&faces, face)
                                                      : given->first_face + face;
    return base_fail(error, INSITU_ERROR_FIELD, "mesh \"%s\": field \"%s\": patch %d: %sface %lld %s", p->mesh->label,
                     p->field->given.name, patch, given->connectivity.data ? "its " : "", number, what);
}

static insitu_status fail_for_index_range_at_face(const patch_faces *p, int patch, int64_t face, const char *what,
                                                  int64_t count, base_error *error)
{
    char words[128];
    const long long base = p->mesh->given.index_base;
    snprintf(words, sizeof words, "%s %lld..%lld (index_base is %lld)", what, base, (long long)count - 1 + base, base);
    return fail_at_face(p, patch, face, words, error);
}

/* ---- vertex groups of the faces of all patches ------------------------------------------------------------------- */

/* Reads a face's vertices from the patch's own list. */
static void read_listed_vertices(const insitu_mesh *mesh, const insitu_patch *patch, int64_t i, patch_face *out)
{
    session_face_row *row = &out->row;
    row->list = session_index_array(mesh, &patch->connectivity);
    row->limit = patch->connectivity_count;
    out->number = -1;
    if (!patch->offsets.data) {
        row->size = patch->connectivity_count / patch->count;
        row->first = i * row->size;
        return;
    }
    const grid_array offsets = session_index_array(mesh, &patch->offsets);
    row->first = grid_read_index(&offsets, i);
    row->size = grid_read_index(&offsets, i + 1) - row->first;
}

static insitu_status read_patch_face(const patch_faces *p, int patch, int64_t i, patch_face *out, base_error *error)
{
    const insitu_mesh *mesh = &p->mesh->given;
    const insitu_patch *given = &p->field->given.patches[patch];
    const session_face_row *row = &out->row;
    if (given->connectivity.data) {
        read_listed_vertices(mesh, given, i, out);
    } else {
        const grid_array faces = session_index_array(mesh, &given->faces);
        const int64_t number =
            given->faces.data ? grid_read_index(&faces, i) : given->first_face - mesh->index_base + i;
        if (number < 0 || number >= session_face_count(mesh))
            return fail_for_index_range_at_face(p, patch, i, "is outside", session_face_count(mesh), error);
        *out = (patch_face){session_find_vertices_of_caller_face(mesh, number), number};
    }
    if (row->size < 3) return fail_at_face(p, patch, i, "has fewer than three vertices", error);
    if (row->first < 0 || row->first > row->limit || row->size > row->limit - row->first)
        return fail_at_face(p, patch, i, "has vertices beyond the connectivity", error);
    return INSITU_OK;
}

static insitu_status read_vertex_groups_of_face(const patch_faces *p, int patch, int64_t i, const patch_face *face,
                                                int64_t *groups, base_error *error)
{
    const int64_t count = p->mesh->given.vertex_count;
    for (int64_t k = 0; k < face->row.size; k++) {
        const int64_t vertex = grid_read_index(&face->row.list, face->row.first + k);
        if (vertex < 0 || vertex >= count)
            return fail_for_index_range_at_face(p, patch, i, "has a vertex index outside", count, error);
        groups[k] = p->mesh->discontinuous.is_active ? -1 : p->numbers->group_of_vertex[vertex];
        if (groups[k] >= 0) continue;
        const session_key key = session_caller_vertex_key(p->mesh, vertex, p->numbers->by_id);
        groups[k] = session_keys_find(p->numbers->keys, &key);
    }
    return INSITU_OK;
}

/* Lists all faces of all patches, in two passes. The first pass only computes the memory that the lists require. */
static insitu_status list_faces(patch_faces *p, base_error *error)
{
    const insitu_field *field = &p->field->given;
    int64_t entries = 0, f = 0;
    for (int patch = 0; patch < field->patch_count; patch++)
        for (int64_t i = 0; i < field->patches[patch].count; i++) {
            patch_face face;
            if (read_patch_face(p, patch, i, &face, error)) return error->status;
            p->first_groups[f++] = entries;
            entries += face.row.size;
        }
    p->first_groups[f] = entries;
    p->groups = base_alloc((size_t)entries * sizeof *p->groups);
    if (!p->groups) return fail_for_memory(entries, error);
    f = 0;
    for (int patch = 0; patch < field->patch_count; patch++)
        for (int64_t i = 0; i < field->patches[patch].count; i++, f++) {
            patch_face face;
            if (read_patch_face(p, patch, i, &face, error) ||
                read_vertex_groups_of_face(p, patch, i, &face, p->groups + p->first_groups[f], error))
                return error->status;
        }
    return INSITU_OK;
}

/* ---- cells that have the faces, from the owners and neighbours of faces ------------------------------------------ */

/* Checks that a face is on the boundary and is given only once, and sets p->is_drawn[f]. i: index of the face in the
 * patch; f: its index among the faces of all patches. is_taken: one bit per face of the mesh, set for the faces that
 * have been checked before. */
static insitu_status check_face_by_owner(patch_faces *p, int patch, int64_t i, int64_t f, unsigned char *is_taken,
                                         base_error *error)
{
    const session_face_sides sides = session_get_owner_arrays(&p->mesh->given);
    patch_face face;
    int64_t cells[2];
    if (read_patch_face(p, patch, i, &face, error)) return error->status;
    session_find_cells_of_face(&sides, face.number, cells);
    if (cells[1] >= 0) return fail_at_face(p, patch, i, "is between two cells, not on the boundary", error);
    unsigned char *taken = &is_taken[face.number / 8], bit = (unsigned char)(1u << face.number % 8);
    if (*taken & bit) return fail_at_face(p, patch, i, "is given twice", error);
    *taken |= bit;
    p->is_drawn[f] = cells[0] >= 0 && !grid_is_ghost(&p->mesh->cells, cells[0]);
    return INSITU_OK;
}

static bool are_all_faces_numbered(const insitu_field *field)
{
    bool all = true;
    for (int i = 0; i < field->patch_count; i++)
        all = all && !(field->patches[i].count && field->patches[i].connectivity.data);
    return all;
}

static insitu_status check_faces_by_owner(patch_faces *p, base_error *error)
{
    const insitu_field *field = &p->field->given;
    const int64_t bytes = session_face_count(&p->mesh->given) / 8 + 1;
    unsigned char *is_taken = base_calloc((size_t)bytes, 1);
    int64_t f = 0;
    if (!is_taken) return fail_for_memory(bytes / 8, error);
    for (int patch = 0; patch < field->patch_count; patch++)
        for (int64_t i = 0; i < field->patches[patch].count && !error->status; i++)
            check_face_by_owner(p, patch, i, f++, is_taken, error);
    base_free(is_taken);
    return error->status;
}

/* ---- cells that have the faces, from a search of all cells if the mesh has no face owners ------------------------ */

typedef struct cell_search {
    session_key_table keys; /* keys of those faces of the patches all of whose vertices belong to drawn cells */
    int64_t *key_of_face;   /* for each face, the index of its key in `keys`; -1: the face has no key */
    /* for each key: number of the patches' faces with this key (given_counts), and number of cells that have a face
     * with this key (cell_counts) */
    int64_t *given_counts, *cell_counts;
    unsigned char *is_drawn; /* for each key, set if one of its cells is drawn */
    unsigned char *
        has_face; /* for each group of equal vertices, set if a face whose key is in `keys` has a vertex of the group */
} cell_search;

static void search_free(cell_search *s)
{
    session_keys_free(&s->keys);
    base_free(s->key_of_face);
    base_free(s->given_counts);
    base_free(s->cell_counts);
    base_free(s->is_drawn);
    base_free(s->has_face);
}

static bool search_create(cell_search *s, const patch_faces *p)
{
    const size_t count = (size_t)p->count;
    s->key_of_face = base_alloc(count * sizeof *s->key_of_face);
    s->given_counts = base_calloc(count, sizeof *s->given_counts);
    s->cell_counts = base_calloc(count, sizeof *s->cell_counts);
    s->is_drawn = base_calloc(count, 1);
    s->has_face = base_calloc((size_t)p->numbers->keys->count, 1);
    return s->key_of_face && s->given_counts && s->cell_counts && s->is_drawn && s->has_face &&
           session_keys_create(&s->keys, p->count);
}

static void add_group_to_key(session_key *key, int64_t group)
{
    const uint64_t h = session_key_hash(&(session_key){{(uint64_t)group + 1, 0, 0}});
    key->words[0] += h;
    key->words[1] += h * h;
    key->words[2] += h * h * h;
}

static void add_faces_to_table(cell_search *s, const patch_faces *p)
{
    for (int64_t f = 0; f < p->count; f++) {
        session_key key = {{0}};
        bool is_whole = true;
        for (int64_t k = p->first_groups[f]; k < p->first_groups[f + 1]; k++) {
            is_whole = is_whole && p->groups[k] >= 0;
            add_group_to_key(&key, p->groups[k]);
        }
        s->key_of_face[f] = is_whole ? session_keys_add(&s->keys, &key) : -1;
        for (int64_t k = p->first_groups[f]; k < p->first_groups[f + 1] && is_whole; k++) s->has_face[p->groups[k]] = 1;
        if (is_whole) s->given_counts[s->key_of_face[f]]++;
    }
}

/* Computes the key of a cell's face. Returns false if one of its vertices is not on any given face. */
static bool find_face_key(const cell_search *s, const patch_faces *p, const session_face_loop *loop, session_key *key)
{
    *key = (session_key){{0}};
    for (int64_t i = 0; i < loop->size; i++) {
        const int64_t group = p->numbers->group_of_vertex[session_face_vertex(loop, i)];
        if (group < 0 || !s->has_face[group]) return false;
        add_group_to_key(key, group);
    }
    return true;
}

/* Counts, for each key, the cells that have a face with this key, and records whether one of them is drawn. */
static void count_cells_of_keys(cell_search *s, const patch_faces *p)
{
    const grid *g = &p->mesh->cells;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        if (grid_is_shell_type(grid_cell_type(g, cell))) continue;
        const session_cell_faces faces = session_faces_of_cell(g, cell);
        for (int64_t i = 0; i < faces.count; i++) {
            const session_face_loop loop = session_find_face_loop(&faces, i);
            session_key key;
            const int64_t found = find_face_key(s, p, &loop, &key) ? session_keys_find(&s->keys, &key) : -1;
            if (found < 0) continue;
            s->cell_counts[found]++;
            if (!grid_is_ghost(g, cell)) s->is_drawn[found] = 1;
        }
    }
}

/* Checks that each given face is on the boundary and is given once for each cell that has it, and sets p->is_drawn. */
static insitu_status check_cell_counts(const cell_search *s, patch_faces *p, base_error *error)
{
    const insitu_field *field = &p->field->given;
    int64_t f = 0;
    for (int patch = 0; patch < field->patch_count; patch++)
        for (int64_t i = 0; i < field->patches[patch].count; i++, f++) {
            const int64_t key = s->key_of_face[f];
            if (key < 0) continue; /* the key was not added, because all cells with this face are ghosts */
            if (s->cell_counts[key] > s->given_counts[key])
                return fail_at_face(p, patch, i, "is between two cells, not on the boundary", error);
            if (s->cell_counts[key] == 0) return fail_at_face(p, patch, i, "is no face of a cell", error);
            if (s->cell_counts[key] < s->given_counts[key]) return fail_at_face(p, patch, i, "is given twice", error);
            p->is_drawn[f] = s->is_drawn[key];
        }
    return INSITU_OK;
}

static insitu_status check_faces_by_cells(patch_faces *p, base_error *error)
{
    cell_search search = {0};
    insitu_status status = INSITU_OK;
    if (search_create(&search, p)) {
        add_faces_to_table(&search, p);
        count_cells_of_keys(&search, p);
        status = check_cell_counts(&search, p, error);
    } else {
        status = fail_for_memory(p->count * 6, error);
    }
    search_free(&search);
    return status;
}

/* ---- values of the patches --------------------------------------------------------------------------------------- */

static grid_field describe_patch_values(const patch_faces *p, int patch, int component)
{
    const insitu_field *field = &p->field->given;
    const insitu_patch *given = &field->patches[patch];
    const int64_t size = session_type_size(given->values.type);
    grid_field out = {.values = session_grid_array(&given->values),
                      .component_stride = given->component_stride_bytes ? given->component_stride_bytes : size,
                      .component_count = field->component_count,
                      .component = component};
    if (!given->values.stride_bytes) out.values.stride = size * field->component_count;
    return out;
}

static bool is_first_of_equal_groups(const int64_t *groups, int64_t i)
{
    for (int64_t k = 0; k < i; k++)
        if (groups[k] == groups[i]) return false;
    return groups[i] >= 0;
}

static insitu_status store_patch_values(const patch_faces *p, int component, session_patch_values *out,
                                        base_error *error)
{
    const int64_t most = p->first_groups[p->count];
    int64_t f = 0;
    out->groups = base_alloc((size_t)most * sizeof *out->groups);
    out->values = base_alloc((size_t)most * sizeof *out->values);
    if (!out->groups || !out->values) return fail_for_memory(most * 2, error);
    for (int patch = 0; patch < p->field->given.patch_count; patch++) {
        const grid_field values = describe_patch_values(p, patch, component);
        for (int64_t i = 0; i < p->field->given.patches[patch].count; i++, f++) {
            const double value = grid_field_value(&values, i);
            const int64_t *groups = p->groups + p->first_groups[f], size = p->first_groups[f + 1] - p->first_groups[f];
            for (int64_t k = 0; k < size && p->is_drawn[f] && isfinite(value); k++) {
                if (!is_first_of_equal_groups(groups, k)) continue;
                out->groups[out->count] = groups[k];
                out->values[out->count++] = value;
            }
        }
    }
    return INSITU_OK;
}

void session_patch_values_free(session_patch_values *values)
{
    base_free(values->groups);
    base_free(values->values);
    *values = (session_patch_values){0};
}

insitu_status session_find_patch_values(const session_mesh *mesh, int field, int component,
                                        const session_vertex_numbers *numbers, session_patch_values *out,
                                        base_error *error)
{
    patch_faces p = {.mesh = mesh, .field = &mesh->fields[field], .numbers = numbers};
    const insitu_field *given = &p.field->given;
    for (int i = 0; i < given->patch_count; i++) p.count += given->patches[i].count;
    if (p.count == 0) return INSITU_OK;
    p.first_groups = base_alloc((size_t)(p.count + 1) * sizeof *p.first_groups);
    p.is_drawn = base_calloc((size_t)p.count, 1);
    insitu_status status = p.first_groups && p.is_drawn ? list_faces(&p, error) : fail_for_memory(p.count * 2, error);
    const bool has_sides = session_has_face_owners(&mesh->given) && are_all_faces_numbered(given);
    if (!status) status = has_sides ? check_faces_by_owner(&p, error) : check_faces_by_cells(&p, error);
    if (!status) status = store_patch_values(&p, component, out, error);
    base_free(p.first_groups);
    base_free(p.groups);
    base_free(p.is_drawn);
    return status;
}
