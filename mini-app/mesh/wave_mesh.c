#include "wave_mesh.h"

#include <stdlib.h>

void wave_mesh_free(wave_mesh *mesh)
{
    free(mesh->cell_ids);
    free(mesh->vertex_ids);
    free(mesh->walls);
    free(mesh->types);
    free(mesh->connectivity);
    free(mesh->offsets);
    free(mesh->face_offsets);
    free(mesh->neighbours);
    free(mesh->vertex_cell_offsets);
    free(mesh->vertex_cells);
    free(mesh->links);
    free(mesh->sends);
    *mesh = (wave_mesh){0};
}

const wave_cell_shape *wave_mesh_cell(const wave_mesh *mesh, int32_t cell, int32_t vertex[8])
{
    const wave_cell_shape *shape = wave_cell_shape_of(wave_mesh_type(mesh, cell));
    int64_t first = mesh->offsets ? wave_mesh_index(mesh, mesh->offsets, cell) : (int64_t)cell * shape->vertex_count;
    for (int i = 0; i < shape->vertex_count; ++i) {
        vertex[i] = (int32_t)wave_mesh_index(mesh, mesh->connectivity, first + i);
    }
    return shape;
}
