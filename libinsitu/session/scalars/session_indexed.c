/* Values that are found by an index are copied into the order of the vertices or cells, once for all that reads them: a
 * cell would otherwise go through the index at each of its vertices, in each tree and in each layer, and no kernel that
 * takes many cells at once could be used. */
#include "session_indexed.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_scalars.h"
#include "session_topology.h"

void session_want_field(const session_meshes *meshes, const scene_field *field)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        const int index = scene_field_is_on(field, mesh->name) ? session_find_field(mesh, field->name) : -1;
        if (index >= 0) mesh->fields[index].is_wanted = true;
    }
}

typedef struct indexed_values {
    grid_array index, values;
    int64_t count, places; /* tuples, and those that have them */
    int64_t component_stride;
    int component_count;
} indexed_values;

static indexed_values values_of(const session_mesh *mesh, const session_field *field)
{
    const insitu_field *given = &field->given;
    indexed_values out = {.index = session_grid_array(&given->index),
                          .values = field->values,
                          .count = given->count,
                          .places =
                              given->centring == INSITU_VERTEX ? mesh->given.vertex_count : mesh->given.cell_count,
                          .component_stride = field->component_stride,
                          .component_count = given->component_count};
    out.index.base = mesh->given.index_base;
    return out;
}

/* One tuple; false where the index is out of range. */
static bool copy_tuple(const indexed_values *v, int64_t place, char *out)
{
    const int64_t at = grid_array_index(&v->index, place);
    if (at < 0 || at >= v->count) return false;
    const size_t size = v->values.is_wide ? 8 : 4;
    const char *from = v->values.data + at * v->values.stride;
    out += place * v->component_count * (int64_t)size;
    for (int i = 0; i < v->component_count; i++, out += size, from += v->component_stride)
        if (size == 8)
            memcpy(out, from, 8);
        else
            memcpy(out, from, 4);
    return true;
}

static insitu_status copy_values(const session_mesh *mesh, session_field *field, int threads, base_error *error)
{
    const indexed_values v = values_of(mesh, field);
    const int64_t bytes = v.places * v.component_count * (v.values.is_wide ? 8 : 4);
    int64_t bad = v.places;
    if (!field->copy) field->copy = base_alloc((size_t)(bytes ? bytes : 1));
    if (!field->copy) return session_no_memory(error, bytes, "a field's values by their index");
    field->copy_bytes = bytes;
#pragma omp parallel for num_threads(threads) schedule(static) reduction(min : bad)
    for (int64_t place = 0; place < v.places; place++)
        if (!copy_tuple(&v, place, field->copy) && place < bad) bad = place;
    const long long base = v.index.base;
    if (bad < v.places)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "mesh \"%s\": field \"%s\": the index of %s %lld is %lld, outside %lld..%lld (index_base is "
                         "%lld)",
                         mesh->name, field->given.name, field->given.centring == INSITU_VERTEX ? "vertex" : "cell",
                         field->given.centring == INSITU_VERTEX ? bad + base : bad,
                         (long long)grid_array_index(&v.index, bad) + base, base, v.count - 1 + base, base);
    field->is_copy_stale = false;
    return INSITU_OK;
}

/* Where it is due. Scalars have the values of cells beside those that are made of them. */
static insitu_status update_copy(session_mesh *mesh, int index, int threads, base_error *error)
{
    session_field *field = &mesh->fields[index];
    if (!field->has_index || !field->is_copy_stale) return INSITU_OK;
    const insitu_status status = copy_values(mesh, field, threads, error);
    for (int i = 0; i < mesh->scalar_count && !status; i++)
        if (mesh->scalars[i].field == index)
            mesh->scalars[i].own = session_given_field(mesh, index, mesh->scalars[i].component);
    return status;
}

insitu_status session_copy_wanted(const session_meshes *meshes, int threads, base_error *error)
{
    insitu_status status = INSITU_OK;
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int f = 0; f < mesh->field_count; f++) {
            if (mesh->fields[f].is_wanted && !status) status = update_copy(mesh, f, threads, error);
            mesh->fields[f].is_wanted = false;
        }
    }
    return status;
}

insitu_status session_copy_used(const session_meshes *meshes, int threads, base_error *error)
{
    insitu_status status = INSITU_OK;
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int i = 0; i < mesh->scalar_count && !status; i++)
            if (mesh->scalars[i].is_used && !session_is_distance(&mesh->scalars[i]))
                status = update_copy(mesh, mesh->scalars[i].field, threads, error);
    }
    return status;
}
