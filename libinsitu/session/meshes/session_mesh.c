/* The table of meshes, sorted by name and block, so that all ranks visit their meshes in the same order. */
#include "session_mesh.h"

#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"

bool session_is_aligned(const insitu_array *array)
{
    const int64_t size = session_type_size(array->type);
    return array->stride_bytes % size == 0 && (uintptr_t)array->data % (uintptr_t)size == 0;
}

static grid_unusual_type find_unusual_type(const insitu_array *array)
{
    const bool is_aligned = session_is_aligned(array);
    switch (array->type) {
    case INSITU_FLOAT32: return is_aligned ? GRID_USUAL_TYPE : GRID_UNUSUAL_FLOAT32;
    case INSITU_FLOAT64: return is_aligned ? GRID_USUAL_TYPE : GRID_UNUSUAL_FLOAT64;
    case INSITU_INT32: return is_aligned ? GRID_USUAL_TYPE : GRID_UNUSUAL_INT32;
    case INSITU_INT64: return is_aligned ? GRID_USUAL_TYPE : GRID_UNUSUAL_INT64;
    case INSITU_UINT8: return GRID_UNUSUAL_UINT8;
    case INSITU_INT8: return GRID_UNUSUAL_INT8;
    case INSITU_INT16: return GRID_UNUSUAL_INT16;
    case INSITU_UINT16: return GRID_UNUSUAL_UINT16;
    case INSITU_UINT32: return GRID_UNUSUAL_UINT32;
    case INSITU_UINT64: return GRID_UNUSUAL_UINT64;
    }
    return GRID_USUAL_TYPE;
}

grid_array session_grid_array(const insitu_array *array)
{
    grid_array out = {0};
    if (!array->data) return out;
    out.data = array->data;
    out.stride = array->stride_bytes ? array->stride_bytes : session_type_size(array->type);
    out.is_wide = session_type_size(array->type) == 8;
    out.unusual_type = (unsigned char)find_unusual_type(array);
    out.is_integer = out.unusual_type || array->type == INSITU_INT32 || array->type == INSITU_INT64;
    return out;
}

grid_array session_coordinates(const insitu_mesh *mesh, int axis)
{
    static const double zero = 0; /* read as double or as float, because the first four bytes are a float 0 too */
    const insitu_array *given = &mesh->coordinates[axis];
    if (given->data) return session_grid_array(given);
    return (grid_array){.data = (const char *)&zero, .is_wide = session_type_size(mesh->coordinates[0].type) == 8};
}

grid_array session_index_array(const insitu_mesh *mesh, const insitu_array *array)
{
    grid_array out = session_grid_array(array);
    out.base = mesh->index_base;
    return out;
}

grid_array session_offset_array(const insitu_mesh *mesh, const insitu_array *array, int64_t count, int64_t entries)
{
    grid_array out = session_index_array(mesh, array);
    if (!mesh->open_offsets) return out;
    out.implied_end_count = count;
    out.implied_end = entries;
    return out;
}

bool session_allocate_indices(const session_mesh *mesh, const char *what, int64_t count, int64_t largest,
                              grid_array *out, base_error *error)
{
    const bool is_wide = largest > INT32_MAX;
    const int64_t size = is_wide ? (int64_t)sizeof(int64_t) : (int64_t)sizeof(int32_t);
    const long long bytes = size * (count + 1);
    const void *data = base_calloc((size_t)count + 1, (size_t)size);
    if (!data) {
        base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for %lld bytes of %s", mesh->label, bytes, what);
        return false;
    }
    *out = (grid_array){.data = data, .stride = size, .is_wide = is_wide, .is_integer = true};
    return true;
}

void session_drop_array(grid_array *array)
{
    base_free((void *)(uintptr_t)array->data);
    *array = (grid_array){0};
}

void session_drop_gradients(session_scalar *scalar)
{
    base_free(scalar->gradient_indices);
    base_free(scalar->gradients);
    scalar->gradient_indices = NULL;
    scalar->gradients = NULL;
    scalar->gradient_count = 0;
}

static void free_scalar(session_scalar *scalar)
{
    base_free(scalar->vertex_values);
    base_free(scalar->distances);
    session_drop_gradients(scalar);
    base_free(scalar->node_ranges);
    base_free(scalar->intervals);
}

void session_drop_scalar(session_mesh *mesh, int number)
{
    free_scalar(&mesh->scalars[number]);
    mesh->scalar_count--;
    for (int i = number; i < mesh->scalar_count; i++) mesh->scalars[i] = mesh->scalars[i + 1];
}

void session_drop_scalars(session_mesh *mesh)
{
    for (int i = 0; i < mesh->scalar_count; i++) free_scalar(&mesh->scalars[i]);
    base_free(mesh->scalars);
    mesh->scalars = NULL;
    mesh->scalar_count = 0;
}

void session_drop_tree(session_mesh *mesh)
{
    if (mesh->has_tree) mmbvh_free(&mesh->tree);
    mesh->tree = (mmbvh){0};
    mesh->has_tree = mesh->is_partial = false;
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        base_free(scalar->node_ranges);
        scalar->node_ranges = NULL;
        scalar->has_own_ranges = false;
        scalar->are_ranges_stale = true;
    }
}

grid session_caller_grid(const insitu_mesh *mesh)
{
    grid g = {.vertex_count = mesh->vertex_count, .cell_count = mesh->cell_count, .cell_type = (int)mesh->cell_type};
    for (int axis = 0; axis < 3; axis++) g.coordinates[axis] = session_coordinates(mesh, axis);
    g.connectivity = session_index_array(mesh, &mesh->connectivity);
    g.offsets = session_offset_array(mesh, &mesh->offsets, mesh->cell_count, mesh->connectivity_count);
    g.face_count = mesh->face_count;
    g.face_offsets = session_offset_array(mesh, &mesh->face_offsets, mesh->face_count, mesh->face_connectivity_count);
    g.face_connectivity = session_index_array(mesh, &mesh->face_connectivity);
    if (mesh->cell_types.data) {
        const grid_array types = session_grid_array(&mesh->cell_types);
        g.cell_types = types.data;
        g.cell_types_stride = types.stride;
        g.cell_types_bytes = (int)session_type_size(mesh->cell_types.type);
    }
    if (mesh->ghosts.data) {
        const grid_array ghosts = session_grid_array(&mesh->ghosts);
        g.ghosts = ghosts.data;
        g.ghosts_stride = ghosts.stride;
        g.ghosts_bytes = (int)session_type_size(mesh->ghosts.type);
    }
    return g;
}

void session_drop_topology(session_topology *topology)
{
    session_drop_array(&topology->offsets);
    session_drop_array(&topology->connectivity);
    base_free(topology->cell_types);
    base_free(topology->parents);
    base_free(topology->first_pieces);
    base_free(topology->ghosts);
    session_drop_array(&topology->face_offsets);
    session_drop_array(&topology->face_connectivity);
    *topology = (session_topology){0};
}

void session_drop_discontinuous(session_discontinuous *discontinuous)
{
    session_drop_array(&discontinuous->corners);
    for (int axis = 0; axis < 3; axis++) session_drop_array(&discontinuous->coordinates[axis]);
    *discontinuous = (session_discontinuous){0};
}

void session_drop_piece_set(session_piece_set *set)
{
    base_free(set->first_words);
    base_free(set->bits);
    *set = (session_piece_set){0};
}

void session_drop_finer_lattices(session_finer *finer)
{
    session_drop_piece_set(&finer->pieces);
    base_free(finer->outer_faces);
    base_free(finer->coordinates);
    base_free(finer->offsets);
    base_free(finer->types);
    *finer = (session_finer){0};
}

void session_drop_axes(session_lattice *lattice)
{
    for (int axis = 0; axis < 3; axis++) {
        base_free(lattice->axis_coordinates[axis]);
        lattice->axis_coordinates[axis] = NULL;
        lattice->cells.axes[axis].axis_coordinates = NULL;
    }
    lattice->bytes = 0;
}

void session_drop_converted_arrays(session_conformed *conformed)
{
    for (int i = 0; i < SESSION_CONFORMED; i++) base_free(conformed->copies[i]);
    base_free(conformed->types);
    *conformed = (session_conformed){0};
}

void session_drop_field_tables(session_field *field)
{
    base_free(field->patches);
    base_free(field->components);
    base_free(field->component_arrays);
    field->patches = NULL;
    field->components = NULL;
    field->component_arrays = NULL;
}

void session_drop_copy(session_field *field)
{
    if (!field->has_borrowed_copy) base_free(field->copy);
    field->has_borrowed_copy = false;
    field->copy = NULL;
    field->copy_bytes = 0;
    field->is_copy_stale = true;
    field->inputs_hash = 0;
}

session_field *session_add_field(session_mesh *mesh, const char *name)
{
    char *copy = base_strdup(name);
    session_field *fields = base_realloc(mesh->fields, (size_t)(mesh->field_count + 1) * sizeof *fields);
    if (fields) mesh->fields = fields;
    if (!copy || !fields) {
        base_free(copy);
        return NULL;
    }
    session_field *field = &fields[mesh->field_count++];
    *field = (session_field){.given = {.name = copy}};
    return field;
}

void session_drop_fields(session_mesh *mesh)
{
    for (int i = 0; i < mesh->field_count; i++) {
        base_free((void *)(uintptr_t)mesh->fields[i].given.name);
        session_drop_field_tables(&mesh->fields[i]);
        session_drop_copy(&mesh->fields[i]);
    }
    base_free(mesh->fields);
    mesh->fields = NULL;
    mesh->field_count = 0;
}

void session_drop_derived_fields(session_mesh *mesh)
{
    int kept = 0;
    for (int i = 0; i < mesh->field_count; i++) {
        session_field *field = &mesh->fields[i];
        if (!field->is_derived) {
            mesh->fields[kept++] = *field;
            continue;
        }
        base_free((void *)(uintptr_t)field->given.name);
        session_drop_copy(field);
    }
    if (kept == mesh->field_count) return;
    mesh->field_count = kept;
    session_drop_scalars(mesh);
    session_drop_outer_surfaces(mesh, true);
}

void session_drop_outer_surface(session_outer *outer, bool with_faces)
{
    const session_outer last = *outer;
    if (outer->mesh) {
        session_drop_scalars(outer->mesh);
        session_drop_tree(outer->mesh);
    }
    base_free(outer->mesh);
    base_free(outer->coordinates);
    base_free(outer->connectivity);
    base_free(outer->offsets);
    base_free(outer->types);
    base_free(outer->loops);
    base_free(outer->vertex_origins);
    base_free(outer->cell_origins);
    if (with_faces) base_free(outer->faces);
    *outer = (session_outer){.threshold = last.threshold, .version = last.version, .is_needed = last.is_needed};
    if (with_faces) return;
    outer->are_faces_known = last.are_faces_known;
    outer->face_count = last.face_count;
    outer->faces = last.faces;
}

void session_drop_outer_surfaces(session_mesh *mesh, bool are_cells_new)
{
    for (int i = 0; i < mesh->outer_count; i++) {
        session_drop_outer_surface(mesh->outers[i], are_cells_new);
        if (are_cells_new) base_free(mesh->outers[i]);
    }
    if (!are_cells_new) return;
    base_free(mesh->outers);
    mesh->outers = NULL;
    mesh->outer_count = 0;
}

bool session_next_part(session_part_walk *walk)
{
    const session_meshes *meshes = walk->meshes;
    walk->whole = NULL;
    walk->outer = NULL;
    if (walk->mesh_index < meshes->count) {
        walk->part = meshes->items[walk->mesh_index++];
        return true;
    }
    for (; walk->whole_index < meshes->count; walk->whole_index++, walk->outer_index = 0) {
        session_mesh *whole = meshes->items[walk->whole_index];
        while (walk->outer_index < whole->outer_count) {
            session_outer *outer = whole->outers[walk->outer_index++];
            if (!outer->mesh) continue;
            walk->part = outer->mesh;
            walk->whole = whole;
            walk->outer = outer;
            return true;
        }
    }
    return false;
}

/* Frees the data that the session has computed from the cells: outer surfaces, scalars, tree, topology, flat cells. */
static void drop_derived_data(session_mesh *mesh)
{
    session_drop_outer_surfaces(mesh, true);
    session_drop_scalars(mesh);
    session_drop_tree(mesh);
    session_drop_topology(&mesh->topology);
    session_drop_discontinuous(&mesh->discontinuous);
    base_free(mesh->flat_cells);
    mesh->flat_cells = NULL;
}

void session_drop_cell_data(session_meshes *meshes, session_mesh *mesh)
{
    drop_derived_data(mesh);
    mesh->partial_tree_seconds = 0;
    mesh->is_topology_stale = mesh->is_geometry_stale = mesh->is_check_stale = true;
    mesh->cells_stamp = mesh->coordinates_stamp = ++meshes->stamp;
    meshes->are_cells_changed = true;
}

void session_mark_moved(session_meshes *meshes, session_mesh *mesh)
{
    mesh->coordinates_stamp = ++meshes->stamp;
    mesh->is_check_stale = true;
    mesh->discontinuous.is_made = false;
    session_drop_outer_surfaces(mesh, false);
    mesh->is_geometry_stale = true;
    meshes->are_cells_changed = true;
    for (int i = 0; i < mesh->scalar_count; i++) mesh->scalars[i].are_values_stale = true;
}

void session_drop_moved_coordinates(session_mesh *mesh)
{
    base_free(mesh->warp.coordinate_memory);
    mesh->warp = (session_warp){0};
}

void session_drop_mirrored(session_mirrored *mirrored)
{
    base_free(mirrored->coordinate_memory);
    for (int axis = 0; axis < 3; axis++) base_free(mirrored->axes[axis]);
    *mirrored = (session_mirrored){0};
}

static void drop_cells(session_mesh *mesh)
{
    drop_derived_data(mesh);
    session_drop_moved_coordinates(mesh);
    session_drop_mirrored(&mesh->mirrored);
    session_drop_finer_lattices(&mesh->finer);
    session_drop_axes(&mesh->lattice);
    session_drop_converted_arrays(&mesh->conformed);
    base_free(mesh->covered);
    mesh->covered = NULL;
}

void session_drop_contents(session_mesh *mesh)
{
    drop_cells(mesh);
    session_drop_fields(mesh);
}

void session_drop_data_of_invalid_mesh(session_mesh *mesh)
{
    drop_cells(mesh);
    session_drop_derived_fields(mesh);
    for (int i = 0; i < mesh->field_count; i++) {
        session_field *field = &mesh->fields[i];
        const char *name = field->given.name;
        session_drop_field_tables(field);
        session_drop_copy(field);
        *field = (session_field){.given = {.name = name}};
    }
    mesh->is_given = false;
    mesh->given = mesh->original = (insitu_mesh){0};
    mesh->cells = (grid){0};
    mesh->drawn_count = 0;
}

static void free_mesh(session_mesh *mesh)
{
    if (!mesh) return;
    session_drop_contents(mesh);
    base_free(mesh->name);
    base_free(mesh->label);
    base_free(mesh);
}

/* Compares a mesh with a sort key that consists of a name, a block's number and the axes of a mirror image, compared in
 * this order. Returns a negative number, 0 or a positive number. */
static int compare_mesh(const session_mesh *mesh, const char *name, int64_t block, int mirror_axes)
{
    const int order = strcmp(mesh->name, name);
    if (order) return order;
    if (mesh->block != block) return mesh->block < block ? -1 : 1;
    return mesh->mirror_axes - mirror_axes;
}

/* Returns the index of the part among the meshes, or the index at which it would be inserted. */
static int find_mesh_index(const session_meshes *meshes, const char *name, int64_t block, int mirror_axes)
{
    int low = 0, high = meshes->count;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (compare_mesh(meshes->items[middle], name, block, mirror_axes) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* exceeds each value of mirror_axes, which is a combination of three bits */
enum { ALL_AXES = 8 };

/* Returns the index after the last part of this name among the sorted meshes. */
static int find_end_of_name(const session_meshes *meshes, const char *name)
{
    return find_mesh_index(meshes, name, INT64_MAX, ALL_AXES);
}

session_parts session_find_parts_from_index(const session_meshes *meshes, int first)
{
    const char *name = meshes->items[first]->name;
    const bool has_more = first + 1 < meshes->count && strcmp(meshes->items[first + 1]->name, name) == 0;
    return (session_parts){has_more ? find_end_of_name(meshes, name) - first : 1, meshes->items + first};
}

session_parts session_find_parts(const session_meshes *meshes, const char *name)
{
    const int first = find_mesh_index(meshes, name, INT64_MIN, 0), end = find_end_of_name(meshes, name);
    return (session_parts){end - first, meshes->items + first};
}

static session_mesh *find_part(const session_meshes *meshes, const char *name, int64_t block, int mirror_axes)
{
    const int at = find_mesh_index(meshes, name, block, mirror_axes);
    session_mesh *mesh = at < meshes->count ? meshes->items[at] : NULL;
    return mesh && compare_mesh(mesh, name, block, mirror_axes) == 0 ? mesh : NULL;
}

session_mesh *session_find_block(const session_meshes *meshes, const char *name, int64_t block)
{
    return find_part(meshes, name, block, 0);
}

session_mesh *session_find_mirror_image(const session_meshes *meshes, const session_mesh *source, int mirror_axes)
{
    return find_part(meshes, source->name, source->block, mirror_axes);
}

/* Ensures that there is space for one more mesh. Returns false if memory runs out. */
static bool reserve_mesh(session_meshes *meshes)
{
    if (meshes->count < meshes->capacity) return true;
    const int capacity = meshes->capacity ? 2 * meshes->capacity : 8;
    session_mesh **items = base_realloc(meshes->items, (size_t)capacity * sizeof *items);
    if (!items) return false;
    meshes->items = items;
    meshes->capacity = capacity;
    return true;
}

void session_store_problem(session_field *field, const base_error *problem, base_error *first)
{
    field->problem = *problem;
    field->is_problem_of_contents = true;
    if (!first->status) *first = *problem;
}

static void insert_mesh(session_meshes *meshes, session_mesh *mesh)
{
    const int at = find_mesh_index(meshes, mesh->name, mesh->block, mesh->mirror_axes);
    memmove(meshes->items + at + 1, meshes->items + at, (size_t)(meshes->count - at) * sizeof *meshes->items);
    meshes->items[at] = mesh;
    meshes->count++;
}

/* Returns the name of a mesh or block for messages; NULL if memory runs out. */
static char *make_label(const char *name, int64_t block, bool is_image)
{
    const char *end = is_image ? " (mirrored)" : "";
    const size_t size = strlen(name) + 40;
    char *label = base_alloc(size);
    if (label && block == SESSION_WHOLE) snprintf(label, size, "%s%s", name, end);
    if (label && block != SESSION_WHOLE) snprintf(label, size, "%s[%lld]%s", name, (long long)block, end);
    return label;
}

static session_mesh *add_part(session_meshes *meshes, const char *name, int64_t block, int mirror_axes,
                              base_error *error)
{
    session_mesh *mesh = base_calloc(1, sizeof *mesh);
    if (mesh) {
        mesh->name = base_strdup(name);
        mesh->label = make_label(name, block, mirror_axes != 0);
        mesh->block = block;
        mesh->mirror_axes = mirror_axes;
    }
    if (!mesh || !mesh->name || !mesh->label || !reserve_mesh(meshes)) {
        session_fail_for_memory(error, (int64_t)sizeof *mesh, "a mesh's description");
        free_mesh(mesh);
        return NULL;
    }
    insert_mesh(meshes, mesh);
    return mesh;
}

session_mesh *session_add_mesh(session_meshes *meshes, const char *name, int64_t block, base_error *error)
{
    return add_part(meshes, name, block, 0, error);
}

session_mesh *session_add_mirror_image(session_meshes *meshes, session_mesh *source, int mirror_axes, base_error *error)
{
    session_mesh *image = add_part(meshes, source->name, source->block, mirror_axes, error);
    if (image) image->source = source;
    return image;
}

/* Removes `count` meshes, beginning with the one at index `first`. */
static void remove_meshes(session_meshes *meshes, int first, int count)
{
    for (int i = first; i < first + count; i++) {
        meshes->are_levels_changed =
            meshes->are_levels_changed || session_has_refinement_level(&meshes->items[i]->given);
        free_mesh(meshes->items[i]);
    }
    meshes->count -= count;
    for (int i = first; i < meshes->count; i++) meshes->items[i] = meshes->items[i + count];
    if (!count) return;
    meshes->are_cells_changed = true;
    meshes->are_names_changed = true;
}

void session_remove_block(session_meshes *meshes, const char *name, int64_t block)
{
    const int first = find_mesh_index(meshes, name, block, 0), end = find_mesh_index(meshes, name, block, ALL_AXES);
    remove_meshes(meshes, first, end - first);
}

void session_remove_mirror_image(session_meshes *meshes, session_mesh *image)
{
    remove_meshes(meshes, find_mesh_index(meshes, image->name, image->block, image->mirror_axes), 1);
}

void session_remove_mesh(session_meshes *meshes, const char *name)
{
    const session_parts parts = session_find_parts(meshes, name);
    if (parts.count) remove_meshes(meshes, (int)(parts.items - meshes->items), parts.count);
}

int session_find_field(const session_mesh *mesh, const char *name)
{
    for (int i = 0; i < mesh->field_count; i++)
        if (strcmp(mesh->fields[i].given.name, name) == 0) return i;
    return -1;
}

const base_error *session_find_pending_error(const session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        if (mesh->problem.status && !mesh->is_problem_of_contents) return &mesh->problem;
        for (int f = 0; f < mesh->field_count; f++)
            if (mesh->fields[f].problem.status && !mesh->fields[f].is_problem_of_contents)
                return &mesh->fields[f].problem;
    }
    return meshes->pending_error.status ? &meshes->pending_error : NULL;
}

void session_drop_pending(session_meshes *meshes)
{
    meshes->pending_error = (base_error){0};
    base_free(meshes->pending_mesh);
    base_free(meshes->pending_field);
    meshes->pending_mesh = meshes->pending_field = NULL;
}

void session_store_pending(session_meshes *meshes, const base_error *error, const char *mesh, const char *field)
{
    session_drop_pending(meshes);
    meshes->pending_error = *error;
    if (mesh && field) {
        meshes->pending_mesh = base_strdup(mesh);
        meshes->pending_field = base_strdup(field);
    }
}

void session_exclude_mesh(session_meshes *meshes, session_mesh *mesh)
{
    int at = 0;
    while (meshes->items[at] != mesh) at++;
    meshes->count--;
    for (int i = at; i < meshes->count + meshes->excluded_count; i++) meshes->items[i] = meshes->items[i + 1];
    meshes->items[meshes->count + meshes->excluded_count++] = mesh;
    mesh->is_needed = false;
    for (int i = 0; i < mesh->outer_count; i++) mesh->outers[i]->is_needed = false;
}

void session_restore_excluded(session_meshes *meshes)
{
    if (meshes->excluded_count) meshes->are_cells_changed = meshes->are_names_changed = true;
    for (; meshes->excluded_count; meshes->excluded_count--) insert_mesh(meshes, meshes->items[meshes->count]);
}

bool session_refuse_call_in_fill(session_meshes *meshes, const char *call)
{
    session_filling *filling = &meshes->filling;
    if (!filling->mesh) return false;
    base_fail(&filling->refused_error, INSITU_ERROR_ARGUMENT,
              "mesh \"%s\": field \"%s\": its fill called %s() of its session, which a fill must not", filling->mesh,
              filling->field, call);
    return true;
}

void session_meshes_free(session_meshes *meshes)
{
    session_drop_pending(meshes);
    for (int i = 0; i < meshes->count; i++) free_mesh(meshes->items[i]);
    base_free(meshes->items);
    base_free(meshes->level_boxes);
    *meshes = (session_meshes){0};
}
