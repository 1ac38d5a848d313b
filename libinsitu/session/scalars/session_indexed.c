/* Values that have an index are copied once, in the order of the vertices, cells or corners. Values at the vertices of
 * a discontinuous mesh are copied in the order of its corners. Without the copy, each tree and layer would read the
 * index at each vertex of each cell, and vectorized code could not be used. */
#include "session_indexed.h"

#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_field_input.h"
#include "session_finer.h"
#include "session_nodes.h"
#include "session_scalars.h"
#include "session_discontinuous.h"

void session_mark_field_for_statistics(const session_meshes *meshes, const scene_field *field)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        const int index = scene_field_selects_mesh(field, mesh->label) ? session_find_field(mesh, field->name) : -1;
        if (index >= 0 && !mesh->source) mesh->fields[index].is_in_statistics = true;
    }
}

void session_clear_statistics_marks(const session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++)
        for (int f = 0; f < meshes->items[m]->field_count; f++) meshes->items[m]->fields[f].is_in_statistics = false;
}

typedef struct indexed_values {
    /* the mesh, if it is discontinuous and the values are at vertices, so that they are copied once per corner;
     * otherwise NULL */
    const session_mesh *mesh;
    /* if there is one value per linear piece of split cells, the index of the caller's cell of each piece; otherwise
     * NULL */
    const uint32_t *parents;
    /* for each position of the copy, the index of the caller's tuple; without data, position i has tuple i */
    grid_array index;
    grid_field values; /* the caller's tuples */
    /* If values at corners have a corner_row: row_length is the number of the caller's entries from one cell to the
     * next, and used_length is the number of corners of a cell. Otherwise both are 1. */
    int64_t row_length, used_length;
    /* count: number of the caller's tuples; position_count: number of tuples of the copy */
    int64_t count, position_count;
    bool keeps_type; /* true: the copy has the type of the caller's values; false: values are converted to double */
} indexed_values;

static indexed_values make_indexed_values(const session_mesh *mesh, const session_field *field)
{
    const insitu_field *given = &field->given;
    indexed_values out = {.index = session_grid_array(&given->index),
                          .values = {.values = field->values,
                                     .component_stride = field->component_stride,
                                     .component_arrays = field->component_arrays,
                                     .component_count = given->component_count},
                          .keeps_type = session_does_copy_keep_type(mesh, field),
                          .row_length = 1,
                          .used_length = 1,
                          .count = given->count,
                          .position_count =
                              given->centring == INSITU_CELL ? mesh->cells.cell_count : session_vertex_count(mesh)};
    out.index.base = mesh->original.index_base;
    if (given->centring == INSITU_VERTEX && mesh->discontinuous.is_active) out.mesh = mesh;
    if (given->centring == INSITU_CELL) out.parents = mesh->topology.parents;
    if (given->corner_row) {
        out.row_length = given->corner_row;
        out.used_length = session_count_cell_nodes(&mesh->original);
    }
    return out;
}

/* Returns the index, in the caller's arrays, of the vertex, cell or corner whose value is stored at a position of the
 * copy. */
static int64_t find_value_entry(const indexed_values *v, int64_t position)
{
    if (v->mesh) return session_vertex_of_corner(v->mesh, position);
    if (v->parents) return v->parents[position];
    return v->row_length == v->used_length ? position
                                           : position / v->used_length * v->row_length + position % v->used_length;
}

/* Copies one tuple. Returns false if the index is out of range. */
static bool copy_tuple(const indexed_values *v, int64_t position, char *out)
{
    const int64_t entry = find_value_entry(v, position);
    const int64_t at = v->index.data ? grid_read_index(&v->index, entry) : entry;
    if (at < 0 || at >= v->count) return false;
    const int count = v->values.component_count;
    const size_t size = !v->keeps_type || v->values.values.is_wide ? 8 : 4;
    out += position * count * (int64_t)size;
    for (int i = 0; i < count; i++, out += size) {
        const grid_array from = grid_field_component(&v->values, i);
        const double number = v->keeps_type ? 0 : grid_read_number(&from, at);
        if (!v->keeps_type)
            memcpy(out, &number, 8);
        else if (size == 8)
            memcpy(out, from.data + at * from.stride, 8);
        else
            memcpy(out, from.data + at * from.stride, 4);
    }
    return true;
}

static insitu_status describe_fault(const session_mesh *mesh, const session_field *field, const indexed_values *v,
                                    int64_t entry, base_error *error)
{
    static const char *const words[] = {"vertex", "cell", "corner"};
    const insitu_centring centring = field->given.centring;
    const long long base = v->index.base, number = centring == INSITU_VERTEX ? entry + base : entry;
    return base_fail(error, INSITU_ERROR_FIELD,
                     "mesh \"%s\": field \"%s\": the index of %s %lld is %lld, outside %lld..%lld (index_base is "
                     "%lld)",
                     mesh->label, field->given.name, words[centring], number,
                     (long long)grid_read_index(&v->index, entry) + base, base, v->count - 1 + base, base);
}

static insitu_status copy_values(const session_mesh *mesh, session_field *field, int threads, base_error *error)
{
    const indexed_values v = make_indexed_values(mesh, field);
    const int64_t bytes =
        v.position_count * v.values.component_count * (!v.keeps_type || v.values.values.is_wide ? 8 : 4);
    int64_t bad = v.position_count;
    if (!field->copy) field->copy = base_alloc((size_t)(bytes ? bytes : 1));
    if (!field->copy) return session_fail_for_memory(error, bytes, "a field's values by their index");
    field->copy_bytes = bytes;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : bad) nowait
        for (int64_t position = 0; position < v.position_count; position++)
            if (!copy_tuple(&v, position, field->copy) && position < bad) bad = position;
        region_leave();
    }
    if (bad < v.position_count) return describe_fault(mesh, field, &v, find_value_entry(&v, bad), error);
    field->is_copy_stale = false;
    return INSITU_OK;
}

/* Reads the tuple at a vertex or a corner of the caller's cells (session_node_values.read). */
static void read_node(const void *of, int64_t position, double *tuple)
{
    const indexed_values *v = of;
    const int64_t entry = find_value_entry(v, position);
    const int64_t at = v->index.data ? grid_read_index(&v->index, entry) : entry;
    for (int i = 0; i < v->values.component_count; i++) {
        const grid_array from = grid_field_component(&v->values, i);
        tuple[i] = grid_read_number(&from, at);
    }
}

/* Checks the entries of the field's index at all vertices or corners of the caller. Returns an error for the first
 * entry that is out of range. */
static insitu_status check_index(const session_mesh *mesh, const session_field *field, const indexed_values *v,
                                 base_error *error)
{
    const bool at_vertices = field->given.centring == INSITU_VERTEX;
    const int64_t count = at_vertices ? mesh->original.vertex_count : session_count_corners(&mesh->original);
    for (int64_t position = 0; position < count && v->index.data; position++) {
        const int64_t entry = find_value_entry(v, position), at = grid_read_index(&v->index, entry);
        if (at < 0 || at >= v->count) return describe_fault(mesh, field, v, entry, error);
    }
    return INSITU_OK;
}

/* Fills the field's copy with the values of the cells' polynomials at the nodes of finer lattices, which divide cells
 * of higher order into more pieces than their own nodes do (session_finer.h). */
static insitu_status interpolate_values(const session_mesh *mesh, session_field *field, int threads, base_error *error)
{
    const indexed_values v = make_indexed_values(mesh, field);
    const session_node_values values = {&v, field->given.centring == INSITU_CORNER, v.values.component_count,
                                        read_node};
    const int64_t bytes = v.position_count * v.values.component_count * (int64_t)sizeof(double);
    insitu_status status = check_index(mesh, field, &v, error);
    if (status) return status;
    if (!field->copy) field->copy = base_alloc((size_t)(bytes ? bytes : 1));
    if (!field->copy) return session_fail_for_memory(error, bytes, "a field's values in finer cells");
    field->copy_bytes = bytes;
    status = session_interpolate_values(mesh, &values, threads, (double *)(void *)field->copy, error);
    field->is_copy_stale = status != INSITU_OK;
    return status;
}

insitu_status session_pass_node_values(const session_mesh *mesh, int index, session_use_values *use, void *of,
                                       base_error *error)
{
    const session_field *field = &mesh->fields[index];
    base_error fault = {.status = INSITU_OK};
    indexed_values v = make_indexed_values(mesh, field);
    v.mesh = NULL;
    const session_node_values values = {&v, field->given.centring == INSITU_CORNER, v.values.component_count,
                                        read_node};
    const bool has_values = field->values.data || field->component_arrays;
    if (!has_values || field->problem.status || field->given.centring == INSITU_CELL || field->is_derived ||
        check_index(mesh, field, &v, &fault))
        return INSITU_OK;
    return use(of, &values, error);
}

/* Updates the copy of a field's values if it is out of date. Then updates original_values of the field's scalars,
 * because this member contains the address of the copy. */
static insitu_status update_copy(session_mesh *mesh, int index, int threads, base_error *error)
{
    session_field *field = &mesh->fields[index];
    if (!session_is_copied(mesh, field) || field->is_derived || !field->is_copy_stale) return INSITU_OK;
    const insitu_status status = session_is_interpolated(mesh, field) ? interpolate_values(mesh, field, threads, error)
                                                                      : copy_values(mesh, field, threads, error);
    for (int i = 0; i < mesh->scalar_count && !status; i++)
        if (mesh->scalars[i].field == index)
            mesh->scalars[i].original_values = session_get_caller_values(mesh, index, mesh->scalars[i].component);
    return status;
}

/* Updates the copy of a field that statistics or derived fields need. Statistics of higher order read the caller's
 * values, so that they need no copy at the nodes of finer lattices. */
static insitu_status update_requested_copy(session_mesh *mesh, int index, int threads, base_error *error)
{
    session_field *field = &mesh->fields[index];
    if (field->is_source || !session_is_interpolated(mesh, field)) return update_copy(mesh, index, threads, error);
    const indexed_values v = make_indexed_values(mesh, field);
    return check_index(mesh, field, &v, error);
}

typedef insitu_status update_function(session_mesh *mesh, int index, int threads, base_error *error);

/* Updates the copy of a field by the function `update`. Only an error of the field's values is stored with the field.
 * Otherwise, as if memory has run out, the field remains valid, and images may still use it. */
static void copy_field_values(session_mesh *mesh, int index, int threads, update_function *update, base_error *error)
{
    base_error own = {.status = INSITU_OK};
    if (mesh->fields[index].problem.status) return;
    if (update(mesh, index, threads, &own) == INSITU_ERROR_FIELD)
        session_store_problem(&mesh->fields[index], &own, error);
    else if (!error->status)
        *error = own;
}

insitu_status session_copy_requested_fields(const session_meshes *meshes, int threads, base_error *error)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int f = 0; f < mesh->field_count; f++) {
            if (mesh->fields[f].is_in_statistics || mesh->fields[f].is_source)
                copy_field_values(mesh, f, threads, update_requested_copy, error);
            mesh->fields[f].is_in_statistics = false;
        }
    }
    return error->status;
}

insitu_status session_copy_used_fields(const session_meshes *meshes, int threads, base_error *error)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int i = 0; i < mesh->scalar_count; i++) {
            const session_scalar *scalar = &mesh->scalars[i];
            if (scalar->is_used && !session_is_distance(scalar))
                copy_field_values(mesh, scalar->field, threads, update_copy, error);
        }
        for (int f = 0; f < mesh->field_count; f++)
            if (mesh->fields[f].is_source) copy_field_values(mesh, f, threads, update_copy, error);
    }
    return error->status;
}
