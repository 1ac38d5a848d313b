/* Makes a grid from a test_mesh in a chosen layout. */
#include "test_mesh_make.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void store_number(void *to, int64_t i, bool wide, bool is_integer, double number, int64_t index)
{
    if (is_integer && wide)
        ((int64_t *)to)[i] = index;
    else if (is_integer)
        ((int32_t *)to)[i] = (int32_t)index;
    else if (wide)
        ((double *)to)[i] = number;
    else
        ((float *)to)[i] = (float)number;
}

static grid_array view_numbers(const double *numbers, int64_t count, int from_stride, int stride, bool wide, void *to)
{
    const int64_t width = wide ? 8 : 4;
    for (int64_t i = 0; i < count; i++) store_number(to, i * stride, wide, false, numbers[i * from_stride], 0);
    return (grid_array){.data = to, .stride = stride * width, .is_wide = wide};
}

static grid_array view_indices(const int64_t *indices, int64_t count, bool wide, void *to)
{
    for (int64_t i = 0; i < count; i++) store_number(to, i, wide, true, 0, indices[i]);
    return (grid_array){.data = to, .stride = wide ? 8 : 4, .is_wide = wide, .is_integer = true};
}

static void view_coordinates(const test_mesh *mesh, test_layout layout, test_view *out)
{
    const bool wide = layout.wide_coordinates;
    const int64_t count = mesh->vertex_count, step = layout.is_interleaved ? 1 : count;
    char *block = out->storage[0] = test_allocate(3 * count, 8);
    for (int axis = 0; axis < 3; axis++)
        out->cells.coordinates[axis] = view_numbers(mesh->coordinates + axis, count, 3, layout.is_interleaved ? 3 : 1,
                                                    wide, block + axis * step * (wide ? 8 : 4));
}

static void view_values(const test_mesh *mesh, test_layout layout, test_view *out)
{
    const int stride = layout.is_interleaved ? 2 : 1;
    out->storage[1] = test_allocate(mesh->vertex_count * stride, 8);
    for (int64_t i = 0; i < mesh->vertex_count * stride; i++)
        store_number(out->storage[1], i, layout.wide_values, false, (double)NAN, 0);
    out->field.values = view_numbers(mesh->values, mesh->vertex_count, 1, stride, layout.wide_values, out->storage[1]);
    out->field.component_count = 1;
    out->field.component_stride = layout.wide_values ? 8 : 4;
}

static bool is_homogeneous(const test_mesh *mesh)
{
    for (int64_t i = 1; i < mesh->cell_count; i++)
        if (mesh->types[i] != mesh->types[0]) return false;
    return true;
}

void test_view_create(const test_mesh *mesh, test_layout layout, test_view *out)
{
    memset(out, 0, sizeof *out);
    grid *g = &out->cells;
    g->vertex_count = mesh->vertex_count;
    g->cell_count = mesh->cell_count;
    view_coordinates(mesh, layout, out);
    view_values(mesh, layout, out);
    out->storage[2] = test_allocate(mesh->connectivity_count, 8);
    g->connectivity = view_indices(mesh->connectivity, mesh->connectivity_count, layout.wide_indices, out->storage[2]);
    g->cell_type = mesh->cell_count ? mesh->types[0] : GRID_TET;
    if (mesh->face_count) {
        out->storage[6] = test_allocate(mesh->face_count + 1, 8);
        out->storage[7] = test_allocate(mesh->face_connectivity_count, 8);
        g->face_count = mesh->face_count;
        g->face_offsets = view_indices(mesh->face_offsets, mesh->face_count + 1, layout.wide_indices, out->storage[6]);
        g->face_connectivity =
            view_indices(mesh->face_connectivity, mesh->face_connectivity_count, layout.wide_indices, out->storage[7]);
    }
    if (layout.with_types || mesh->face_count || !is_homogeneous(mesh)) {
        out->storage[3] = test_allocate(mesh->cell_count + 1, 8);
        g->offsets = view_indices(mesh->offsets, mesh->cell_count + 1, layout.wide_indices, out->storage[3]);
        out->storage[4] = test_allocate(mesh->cell_count, 1);
        if (mesh->cell_count) memcpy(out->storage[4], mesh->types, (size_t)mesh->cell_count);
        g->cell_types = out->storage[4];
        g->cell_types_stride = g->cell_types_bytes = 1;
    }
    out->storage[5] = test_allocate(mesh->cell_count, 1);
    if (mesh->cell_count) memcpy(out->storage[5], mesh->ghosts, (size_t)mesh->cell_count);
    g->ghosts = out->storage[5];
    g->ghosts_stride = g->ghosts_bytes = 1;
}

void test_view_free(test_view *view)
{
    for (int i = 0; i < 8; i++) free(view->storage[i]);
    memset(view, 0, sizeof *view);
}
