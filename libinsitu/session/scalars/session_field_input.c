/* insitu_set_field() stores fields in the table of fields. Only descriptions are checked here; the values are read by a
 * step. An error is returned immediately, and is also stored with the field until the field is set again, so that the
 * next step returns it on every rank. */
#include "session_field_input.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_mesh_input.h"
#include "session_nodes.h"

static session_field *add_field(session_mesh *mesh, const char *name, base_error *error)
{
    session_field *field = session_add_field(mesh, name);
    if (!field) session_fail_for_memory(error, (int64_t)sizeof *field, "a field's description");
    return field;
}

/* Returns the number of entries of the connectivity that are vertices of cells. Unused entries at the end of each
 * cell's entries (insitu_mesh.connectivity_row) are not counted. */
int64_t session_count_corners(const insitu_mesh *mesh)
{
    if (mesh->cell_count == 0) return 0;
    if (mesh->offsets.data) return mesh->connectivity_count;
    return mesh->cell_count * session_count_cell_nodes(mesh);
}

/* Returns the number of values that a field needs: the mesh's number of vertices, cells or corners, depending on the
 * field's centring. If the values at corners are stored with a fixed distance from cell to cell (corner_row), the
 * result is the number of all entries from the first to the last corner, including unused ones. */
int64_t session_count_field_entries(const insitu_mesh *mesh, const insitu_field *field)
{
    if (field->centring == INSITU_VERTEX) return mesh->vertex_count;
    if (field->centring == INSITU_CELL) return mesh->cell_count;
    if (field->corner_row == 0 || mesh->cell_count == 0) return session_count_corners(mesh);
    return (mesh->cell_count - 1) * field->corner_row + session_count_cell_nodes(mesh);
}

static const char *describe_centring(insitu_centring centring)
{
    return centring == INSITU_VERTEX ? "vertices" : centring == INSITU_CELL ? "cells" : "corners of cells";
}

/* Returns whether the field has an index array. If no values are needed, the address of this array may be NULL; the
 * field has an index if the array's type is given. */
static bool has_field_index(const session_mesh *mesh, const insitu_field *field)
{
    return field->index.data || (field->index.type && session_count_field_entries(&mesh->original, field) == 0);
}

/* Checks a field whose components are given as separate arrays. */
static insitu_status check_component_arrays(const insitu_field *field, int64_t count, base_error *error)
{
    if (field->values.data)
        return base_fail(error, INSITU_ERROR_FIELD, "values and components are given: values are given by one of them");
    for (int c = 0; c < field->component_count; c++) {
        const session_array_rule rule = {"values", count, SESSION_ALLOW_FLOATS | SESSION_ALLOW_ANY, 1};
        base_error what = {0};
        if (session_check_array(&field->components[c], &rule, INSITU_ERROR_FIELD, &what))
            return base_fail(error, what.status, "component %d: %s", c, what.message);
    }
    return INSITU_OK;
}

static insitu_status check_field_arrays(const session_mesh *mesh, const insitu_field *field, base_error *error)
{
    const int64_t position_count = session_count_field_entries(&mesh->original, field);
    const bool has_index = has_field_index(mesh, field), has_rows = field->corner_row != 0;
    if (field->count < 0 || (!has_index && (has_rows ? field->count < position_count : field->count != position_count)))
        return base_fail(error, INSITU_ERROR_FIELD, "has %lld values, the mesh has %lld %s%s", (long long)field->count,
                         (long long)position_count, describe_centring(field->centring),
                         has_rows ? ", rows' rests counted" : "");
    const session_array_rule values = {"values", has_index && !position_count ? 0 : field->count,
                                       SESSION_ALLOW_FLOATS | SESSION_ALLOW_ANY, field->component_count};
    const session_array_rule index = {"entries of index", position_count, SESSION_ALLOW_INTEGERS | SESSION_IS_OPTIONAL,
                                      1};
    insitu_status status = session_check_array(&field->index, &index, INSITU_ERROR_FIELD, error);
    if (!status && field->components) return check_component_arrays(field, values.count, error);
    if (!status) status = session_check_array(&field->values, &values, INSITU_ERROR_FIELD, error);
    if (status) return status;
    return session_check_components(&field->values, field->component_count, field->component_stride_bytes, true,
                                    "components of values", error);
}

/* Checks a field that has values at the corners of cells. For meshes of mixed cells, the cells' types are checked
 * later, when the mesh is made discontinuous. */
static insitu_status check_corner_field(const insitu_mesh *mesh, const insitu_field *field, base_error *error)
{
    const long long row = field->corner_row, vertices = session_count_cell_nodes(mesh);
    if (field->centring != INSITU_CORNER) {
        if (row == 0) return INSITU_OK;
        return base_fail(error, INSITU_ERROR_ARGUMENT, "corner_row is %lld, and its centring %d is not corners (%d)",
                         row, (int)field->centring, (int)INSITU_CORNER);
    }
    if (mesh->cell_count == 0) return INSITU_OK;
    if (!mesh->connectivity.data && mesh->order)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "has values at corners, and the mesh has no connectivity: its vertices are the cells' own, so "
                         "give the field at vertices");
    if (mesh->lattice)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "has values at corners, and the mesh is a lattice: corners need cells by connectivity");
    if (session_has_face_owners(mesh) || (!mesh->cell_types.data && mesh->cell_type == INSITU_POLYHEDRON))
        return base_fail(error, INSITU_ERROR_FIELD,
                         "has values at corners, and the mesh has polyhedra, whose corners have no order");
    if (row == 0) return INSITU_OK;
    if (mesh->offsets.data)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "corner_row is %lld and the mesh has offsets: rows are of cells of one type without offsets",
                         row);
    if (row < vertices)
        return base_fail(error, INSITU_ERROR_FIELD, "corner_row is %lld, a cell has %lld vertices", row, vertices);
    if (row > INT64_MAX / 32 / mesh->cell_count)
        return base_fail(error, INSITU_ERROR_FIELD, "corner_row is %lld: rows of %lld cells do not fit into memory",
                         row, (long long)mesh->cell_count);
    return INSITU_OK;
}

static insitu_status check_patch_arrays(const insitu_patch *patch, int components, base_error *error)
{
    const int integers = SESSION_ALLOW_INTEGERS, optional = SESSION_IS_OPTIONAL;
    const session_array_rule values = {"values", patch->count, SESSION_ALLOW_FLOATS | integers, components};
    const session_array_rule faces = {"faces", patch->count, integers | optional, 1};
    const session_array_rule vertices = {"connectivity indices", patch->connectivity_count, integers, 1};
    const session_array_rule offsets = {"offsets", patch->count, integers | optional | SESSION_HAS_END, 1};
    if (patch->count < 0 || patch->connectivity_count < 0)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "has %lld faces of %lld connectivity indices",
                         (long long)patch->count, (long long)patch->connectivity_count);
    insitu_status status = session_check_array(&patch->values, &values, INSITU_ERROR_FIELD, error);
    if (!status) status = session_check_array(&patch->faces, &faces, INSITU_ERROR_FIELD, error);
    if (!status) status = session_check_array(&patch->connectivity, &vertices, INSITU_ERROR_FIELD, error);
    if (!status) status = session_check_array(&patch->offsets, &offsets, INSITU_ERROR_FIELD, error);
    if (status) return status;
    return session_check_components(&patch->values, components, patch->component_stride_bytes, false,
                                    "components of values", error);
}

/* Checks the values of a patch, and how the patch identifies its faces. */
static insitu_status check_patch(const session_mesh *mesh, const insitu_patch *patch, int components, base_error *error)
{
    const bool has_vertices = patch->connectivity.data != NULL;
    const insitu_status status = check_patch_arrays(patch, components, error);
    if (status || !patch->count) return status;
    if (!mesh->original.cell_count)
        return base_fail(error, INSITU_ERROR_FIELD, "has %lld faces, and the mesh has no cells",
                         (long long)patch->count);
    if (has_vertices && patch->faces.data)
        return base_fail(error, INSITU_ERROR_FIELD, "faces and connectivity are given: name faces by one of them");
    if (patch->offsets.data && !has_vertices)
        return base_fail(error, INSITU_ERROR_FIELD, "offsets are given without connectivity");
    if (has_vertices && !patch->offsets.data && patch->connectivity_count % patch->count != 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "has %lld connectivity indices, no multiple of its %lld faces, and no offsets",
                         (long long)patch->connectivity_count, (long long)patch->count);
    const int64_t faces = session_face_count(&mesh->original);
    if (!has_vertices && !faces)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "names faces by their numbers, but the mesh has none: give their vertices");
    const long long base = mesh->original.index_base, last = faces - 1 + base;
    if (!has_vertices && !patch->faces.data &&
        (patch->first_face < base || patch->first_face > last || patch->count - 1 > last - patch->first_face))
        return base_fail(error, INSITU_ERROR_FIELD,
                         "has %lld faces from %lld on, outside %lld..%lld (index_base is %lld)",
                         (long long)patch->count, (long long)patch->first_face, base, last, base);
    return INSITU_OK;
}

static insitu_status check_patches(const session_mesh *mesh, const insitu_field *field, base_error *error)
{
    if (field->patch_count < 0 || (field->patch_count && !field->patches))
        return base_fail(error, INSITU_ERROR_ARGUMENT, "patch_count is %d%s", field->patch_count,
                         field->patches ? "" : ", and patches are not given");
    if (field->patch_count && field->centring != INSITU_CELL)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "has patches, and its centring %d is not cells (%d)",
                         (int)field->centring, (int)INSITU_CELL);
    if (field->patch_count && session_get_linear_type((int)mesh->original.cell_type) != GRID_NO_TYPE)
        return base_fail(error, INSITU_ERROR_FIELD, "has patches, and the mesh has cells of higher order");
    for (int i = 0; i < field->patch_count; i++) {
        base_error what = {0};
        if (check_patch(mesh, &field->patches[i], field->component_count, &what))
            return base_fail(error, what.status, "patch %d: %s", i, what.message);
    }
    return INSITU_OK;
}

/* Checks the description of a field with a fill function. The function has not been called yet. */
static insitu_status check_fill_description(const insitu_field *field, base_error *error)
{
    if (field->patch_count)
        return base_fail(error, INSITU_ERROR_FIELD, "patches and fill are given: patches are given by fill");
    if (!field->values.data && !field->components && !field->index.data) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_FIELD, "values and fill are given: values are given by one of them");
}

static insitu_status check_field(const session_mesh *mesh, const insitu_field *field, base_error *error)
{
    if (field->centring != INSITU_VERTEX && field->centring != INSITU_CELL && field->centring != INSITU_CORNER)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "unknown centring %d", (int)field->centring);
    if (field->component_count < 1)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "component_count is %d", field->component_count);
    if (field->changed & ~(unsigned)INSITU_CHANGED_ALL)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "changed is %u, unknown bits are set", field->changed);
    insitu_status status = check_corner_field(&mesh->original, field, error);
    if (!status && field->fill) return check_fill_description(field, error);
    if (!status) status = check_field_arrays(mesh, field, error);
    if (!status) status = check_patches(mesh, field, error);
    return status;
}

void session_mark_scalars_stale(session_mesh *mesh, int field)
{
    mesh->fields[field].version++;
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (scalar->field != field) continue;
        scalar->are_values_stale = true;
        scalar->may_have_changed = true;
    }
}

static bool is_same_patch(const insitu_patch *a, const insitu_patch *b)
{
    return a->count == b->count && a->first_face == b->first_face && session_is_same_array(&a->faces, &b->faces) &&
           a->connectivity_count == b->connectivity_count &&
           session_is_same_array(&a->connectivity, &b->connectivity) &&
           session_is_same_array(&a->offsets, &b->offsets) && session_is_same_array(&a->values, &b->values) &&
           a->component_stride_bytes == b->component_stride_bytes;
}

static bool are_same_patches(const insitu_field *a, const insitu_field *b)
{
    bool is_same = a->patch_count == b->patch_count;
    for (int i = 0; is_same && i < a->patch_count; i++) is_same = is_same_patch(&a->patches[i], &b->patches[i]);
    return is_same;
}

static bool are_same_components(const insitu_field *a, const insitu_field *b)
{
    bool is_same = !a->components == !b->components;
    for (int c = 0; a->components && is_same && c < a->component_count; c++)
        is_same = session_is_same_array(&a->components[c], &b->components[c]);
    return is_same;
}

/* Returns whether the new description has the same addresses and layout of values as the stored one. */
static bool is_same_layout(const insitu_field *a, const insitu_field *b)
{
    return session_is_same_array(&a->values, &b->values) && a->component_stride_bytes == b->component_stride_bytes &&
           session_is_same_array(&a->index, &b->index) && a->count == b->count && a->corner_row == b->corner_row &&
           a->component_count == b->component_count && are_same_components(a, b) && are_same_patches(a, b);
}

/* Replaces the field's tables of patches and components by copies of the given tables. The given tables may be the
 * tables that the field already owns. Returns false if memory runs out. */
static bool copy_tables(session_field *field, const insitu_field *given, base_error *error)
{
    const size_t components = given->components ? (size_t)given->component_count : 0;
    const size_t bytes = (size_t)given->patch_count * sizeof *given->patches;
    session_field copy = {0};
    copy.patches = bytes ? base_alloc(bytes) : NULL;
    copy.components = components ? base_alloc(components * sizeof *copy.components) : NULL;
    copy.component_arrays = components ? base_alloc(components * sizeof *copy.component_arrays) : NULL;
    if ((bytes && !copy.patches) || (components && (!copy.components || !copy.component_arrays))) {
        session_drop_field_tables(&copy);
        session_fail_for_memory(error, (int64_t)(bytes + components * sizeof *copy.component_arrays),
                                "a field's table of patches or components");
        return false;
    }
    if (bytes) memcpy(copy.patches, given->patches, bytes);
    for (size_t c = 0; c < components; c++) {
        copy.components[c] = given->components[c];
        copy.component_arrays[c] = session_grid_array(&given->components[c]);
    }
    session_drop_field_tables(field);
    field->patches = copy.patches;
    field->components = copy.components;
    field->component_arrays = copy.component_arrays;
    return true;
}

/* Sets the array from which the values are read: element i is the first component of tuple i. */
static void set_array_of_first_component(session_field *field, const insitu_field *given)
{
    const int64_t size = given->values.data ? session_type_size(given->values.type) : 1;
    insitu_array values = given->values;
    field->component_stride = given->component_stride_bytes ? given->component_stride_bytes : size;
    if (!values.stride_bytes) values.stride_bytes = size * given->component_count;
    field->values = field->component_arrays ? field->component_arrays[0] : session_grid_array(&values);
    if (!values.data || field->component_arrays || field->component_stride % size == 0) return;
    /* only the first component is known to be aligned, so that all components are read as unaligned values */
    values.stride_bytes = field->component_stride;
    const grid_array other = session_grid_array(&values);
    field->values.unusual_type = other.unusual_type;
    field->values.is_integer = other.is_integer;
}

/* Sets the arrays from which the field's values are read, and records whether the session's copy of these values must
 * be computed again. The tables of patches and components must have been copied before. */
static void set_value_arrays(const session_mesh *mesh, session_field *field, const insitu_field *given, bool is_other,
                             bool is_stale)
{
    const bool has_index = has_field_index(mesh, given), was_apart = field->given.components != NULL;
    if (is_other || field->has_index != has_index || field->given.corner_row != given->corner_row ||
        field->given.values.type != given->values.type || field->values.unusual_type || field->component_arrays ||
        was_apart)
        session_drop_copy(field);
    field->has_index = has_index;
    field->is_copy_stale = field->is_copy_stale || is_stale;
    const char *name = field->given.name;
    field->given = *given;
    field->given.name = name;
    field->given.patches = field->patches;
    field->given.components = field->components;
    set_array_of_first_component(field, given);
}

/* Stores a field's description. The tables of patches and components must have been copied before, unless is_same is
 * set, because all values have the same addresses as before. */
static void store_field(session_meshes *meshes, session_mesh *mesh, int index, const insitu_field *given, bool is_same)
{
    session_field *field = &mesh->fields[index];
    const bool is_other = (!field->values.data && !field->given.fill) || field->given.centring != given->centring ||
                          field->given.component_count != given->component_count || field->problem.status;
    const bool is_stale = is_other || given->changed & INSITU_CHANGED_VALUES || !is_same;
    if (is_other) {
        /* scalars are dropped, because the index of a component may now refer to another quantity */
        session_drop_scalars(mesh);
        field->version++;
        meshes->are_names_changed = true;
    } else if (is_stale) {
        session_mark_scalars_stale(mesh, index);
    }
    set_value_arrays(mesh, field, given, is_other, is_stale);
    field->problem = (base_error){0};
}

insitu_status session_set_part_field(session_meshes *meshes, session_mesh *mesh, const insitu_field *given,
                                     base_error *error)
{
    int index = session_find_field(mesh, given->name);
    if (index < 0) {
        if (!add_field(mesh, given->name, error)) return INSITU_ERROR_MEMORY;
        index = mesh->field_count - 1;
        meshes->are_names_changed = true;
    }
    base_error what = {0};
    session_field *field = &mesh->fields[index];
    if (field->is_derived) {
        /* the caller uses the name of a derived field; session_add_derived_fields() reports this error later */
        session_drop_copy(field);
        *field = (session_field){.given = {.name = field->given.name}};
    }
    if (check_field(mesh, given, &what) == INSITU_OK) {
        const bool is_same = is_same_layout(&field->given, given);
        if (is_same || copy_tables(field, given, &what)) {
            store_field(meshes, mesh, index, given, is_same);
            return INSITU_OK;
        }
    }
    field->problem = (base_error){0};
    field->is_problem_of_contents = false;
    session_prefix_error(&field->problem, mesh->label, given->name, &what);
    *error = field->problem;
    return error->status;
}

/* Refuses a field whose mesh was refused. The next step returns the mesh's own error. Images that show the field need
 * the mesh, and are not drawn. */
static insitu_status fail_for_refused_mesh(session_meshes *meshes, session_mesh *mesh, const char *name,
                                           base_error *error)
{
    if (session_find_field(mesh, name) < 0 && !add_field(mesh, name, error)) {
        session_store_pending(meshes, error, NULL, NULL);
        return error->status;
    }
    return base_fail(error, INSITU_ERROR_FIELD, "field \"%s\": its mesh \"%s\" was refused", name, mesh->label);
}

/* Reports that the mesh or block does not exist. If the mesh consists of blocks and a field of the whole mesh was set,
 * or the mesh has no blocks and a field of a block was set, the message names the function to call instead. */
static void fail_for_missing_mesh(const session_meshes *meshes, const char *name, int64_t block, const char *field,
                                  base_error *error)
{
    const session_parts parts = session_find_parts(meshes, name);
    if (parts.count && block == SESSION_WHOLE)
        base_fail(error, INSITU_ERROR_FIELD, "field \"%s\": its mesh \"%s\" is of blocks: use insitu_set_block_field",
                  field, name);
    else if (parts.count && parts.items[0]->block == SESSION_WHOLE)
        base_fail(error, INSITU_ERROR_FIELD, "field \"%s\": its mesh \"%s\" is not of blocks: use insitu_set_field",
                  field, name);
    else if (block == SESSION_WHOLE)
        base_fail(error, INSITU_ERROR_FIELD, "field \"%s\": its mesh \"%s\" is not set", field, name);
    else
        base_fail(error, INSITU_ERROR_FIELD, "field \"%s\": block %lld of its mesh \"%s\" is not set", field,
                  (long long)block, name);
}

insitu_status session_set_field(session_meshes *meshes, const char *name, int64_t block, const insitu_field *field,
                                base_error *error)
{
    const char *call = block == SESSION_WHOLE ? "insitu_set_field" : "insitu_set_block_field";
    *error = (base_error){0};
    session_mesh *mesh = name ? session_find_block(meshes, name, block) : NULL;
    const char *field_name = field ? field->name : NULL;
    if (!name || !field_name || !*field_name)
        base_fail(error, INSITU_ERROR_ARGUMENT, "%s: no mesh, no field, or a field without a name", call);
    else if (!mesh)
        fail_for_missing_mesh(meshes, name, block, field_name, error);
    else if (!mesh->is_given)
        return fail_for_refused_mesh(meshes, mesh, field_name, error);
    else if (session_set_part_field(meshes, mesh, field, error) != INSITU_ERROR_MEMORY)
        return error->status;
    session_store_pending(meshes, error, name, field_name && *field_name ? field_name : NULL);
    return error->status;
}

/* Checks that the filled field has the centring and the number of components that were declared. */
static insitu_status check_filled_field(const session_mesh *mesh, const insitu_field *promised,
                                        const insitu_field *filled, base_error *error)
{
    insitu_field values = *filled;
    values.fill = NULL;
    if (filled->centring != promised->centring || filled->component_count != promised->component_count)
        return base_fail(
            error, INSITU_ERROR_FIELD, "its fill made centring %d of %d, and %d components of %d: both must stay",
            (int)filled->centring, (int)promised->centring, filled->component_count, promised->component_count);
    return check_field(mesh, &values, error);
}

insitu_status session_store_filled_field(session_mesh *mesh, int index, const insitu_field *filled, base_error *error)
{
    session_field *field = &mesh->fields[index];
    const insitu_field promised = field->given;
    base_error what = {0};
    if (check_filled_field(mesh, &promised, filled, &what) || !copy_tables(field, filled, &what))
        return session_prefix_error(error, mesh->label, promised.name, &what);
    set_value_arrays(mesh, field, filled, false, (filled->changed & INSITU_CHANGED_VALUES) != 0);
    field->given.fill = promised.fill;
    field->given.fill_data = promised.fill_data;
    /* scalars may refer to the previous table of components */
    if (filled->changed & INSITU_CHANGED_VALUES || filled->components) session_mark_scalars_stale(mesh, index);
    return INSITU_OK;
}
