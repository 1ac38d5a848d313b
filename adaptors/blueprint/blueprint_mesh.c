#include "blueprint_mesh.h"

#include <stdlib.h>

void *owned_arrays_add(const node *of, owned_arrays *owned, int64_t bytes)
{
    void *made = owned->count < OWNED_ARRAYS_MAX ? calloc(bytes > 0 ? (size_t)bytes : 1, 1) : NULL;
    if (!made) {
        node_set_error(of, "", INSITU_ERROR_MEMORY, "no memory for %lld bytes", (long long)bytes);
        return NULL;
    }
    owned->arrays[owned->count++] = made;
    return made;
}

void owned_arrays_free(owned_arrays *owned)
{
    for (int i = 0; i < owned->count; i++) free(owned->arrays[i]);
    owned->count = 0;
}

void blueprint_mesh_free_tables(blueprint_mesh *mesh)
{
    free(mesh->type_map);
    mesh->type_map = NULL;
}

int64_t blueprint_count_spanned_elements(const int64_t counts[3], const int64_t strides[3])
{
    int64_t reach = 0;
    for (int axis = 0; axis < 3; axis++) reach += (counts[axis] > 0 ? counts[axis] - 1 : 0) * strides[axis];
    return reach + 1;
}

insitu_status blueprint_set_target(const mesh_target *target, const insitu_mesh *mesh)
{
    if (target->number == WHOLE_MESH) return insitu_set_mesh(target->session, target->name, mesh);
    return insitu_set_block(target->session, target->name, target->number, mesh);
}
