#include <cstdio>
#include <cstdlib>

#include <vtkNew.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>

#include "insitu/vtk.h"
#include "test_data_mesh.h"
#include "test_vtk_session_stub.h"

namespace
{

template <typename T> T *allocate_array(int64_t count)
{
    void *block = std::calloc(static_cast<size_t>(count > 0 ? count : 1), sizeof(T));
    if (!block) std::abort();
    return static_cast<T *>(block);
}

const char *get_element(const insitu_array &a, int64_t i, int64_t size)
{
    return static_cast<const char *>(a.data) + i * (a.stride_bytes ? a.stride_bytes : size);
}

double read_number(const insitu_array &a, int64_t i)
{
    switch (a.type) {
    case INSITU_FLOAT32: return static_cast<double>(*reinterpret_cast<const float *>(get_element(a, i, 4)));
    case INSITU_INT32: return *reinterpret_cast<const int32_t *>(get_element(a, i, 4));
    case INSITU_INT64: return static_cast<double>(*reinterpret_cast<const int64_t *>(get_element(a, i, 8)));
    default: return *reinterpret_cast<const double *>(get_element(a, i, 8));
    }
}

int64_t read_integer(const insitu_array &a, int64_t i)
{
    switch (a.type) {
    case INSITU_UINT8: return *reinterpret_cast<const uint8_t *>(get_element(a, i, 1));
    case INSITU_INT32: return *reinterpret_cast<const int32_t *>(get_element(a, i, 4));
    default: return *reinterpret_cast<const int64_t *>(get_element(a, i, 8));
    }
}

int64_t *read_integers(const insitu_array &a, int64_t count)
{
    auto *out = allocate_array<int64_t>(count);
    for (int64_t i = 0; i < count; i++) out[i] = read_integer(a, i);
    return out;
}

/* Replaces quadratic cells by the linear cells of their corners, which come first in the connectivity, because a
 * test_mesh has linear cells only. */
void convert_to_linear_cells(test_mesh *mesh)
{
    static const struct {
        int type, linear, corners;
    } quadratic[] = {{INSITU_QUADRATIC_TET, INSITU_TET, 4},
                     {INSITU_QUADRATIC_HEX, INSITU_HEX, 8},
                     {INSITU_QUADRATIC_WEDGE, INSITU_WEDGE, 6},
                     {INSITU_QUADRATIC_PYRAMID, INSITU_PYRAMID, 5}};
    int64_t at = 0;
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        const int64_t first = mesh->offsets[i];
        int64_t count = mesh->offsets[i + 1] - first;
        for (const auto &q : quadratic) {
            if (mesh->types[i] != q.type) continue;
            mesh->types[i] = static_cast<unsigned char>(q.linear);
            count = q.corners;
        }
        mesh->offsets[i] = at;
        for (int64_t n = 0; n < count; n++) mesh->connectivity[at++] = mesh->connectivity[first + n];
    }
    mesh->offsets[mesh->cell_count] = mesh->connectivity_count = at;
}

void copy_cells(const insitu_mesh &mesh, test_mesh *out)
{
    const bool is_mixed = mesh.cell_types.data != nullptr;
    out->cell_count = mesh.cell_count;
    out->connectivity_count = mesh.connectivity_count;
    out->connectivity = read_integers(mesh.connectivity, mesh.connectivity_count);
    out->types = allocate_array<unsigned char>(mesh.cell_count);
    out->ghosts = allocate_array<unsigned char>(mesh.cell_count);
    out->offsets = allocate_array<int64_t>(mesh.cell_count + 1);
    for (int64_t i = 0; i <= mesh.cell_count; i++) {
        const int64_t even = i * (mesh.connectivity_count / mesh.cell_count);
        out->offsets[i] = mesh.offsets.data ? read_integer(mesh.offsets, i) : even;
        if (i == mesh.cell_count) break;
        out->types[i] =
            static_cast<unsigned char>(is_mixed ? read_integer(mesh.cell_types, i) : int64_t{mesh.cell_type});
    }
    convert_to_linear_cells(out);
    if (!mesh.face_count) return;
    out->face_count = mesh.face_count;
    out->face_connectivity_count = mesh.face_connectivity_count;
    out->face_offsets = read_integers(mesh.face_offsets, mesh.face_count + 1);
    out->face_connectivity = read_integers(mesh.face_connectivity, mesh.face_connectivity_count);
}

void copy_vertices(const insitu_mesh &mesh, const insitu_field &field, test_mesh *out)
{
    out->vertex_count = mesh.vertex_count;
    out->coordinates = allocate_array<double>(3 * mesh.vertex_count);
    out->values = allocate_array<double>(mesh.vertex_count);
    for (int64_t i = 0; i < mesh.vertex_count; i++) {
        for (int axis = 0; axis < 3; axis++) out->coordinates[3 * i + axis] = read_number(mesh.coordinates[axis], i);
        out->values[i] = read_number(field.values, i);
    }
}

} // namespace

bool test_data_mesh(const char *path, const char *field, test_mesh *out)
{
    vtkNew<vtkXMLUnstructuredGridReader> reader;
    insitu_session session;
    insitu_vtk_adaptor *adaptor = nullptr;
    reader->SetFileName(path);
    reader->Update();
    *out = test_mesh{};
    bool is_read = insitu_vtk_create(&session, &adaptor) == INSITU_OK &&
                   insitu_vtk_set(adaptor, "m", reader->GetOutput(), nullptr) == INSITU_OK &&
                   session.meshes.count("m") && session.meshes["m"].mesh.cell_count > 0;
    if (is_read) {
        const stub_mesh &mesh = session.meshes["m"];
        const auto it = mesh.fields.find(field);
        is_read = it != mesh.fields.end() && it->second.component_count == 1 && it->second.centring == INSITU_VERTEX;
        if (is_read) {
            copy_cells(mesh.mesh, out);
            copy_vertices(mesh.mesh, it->second, out);
        }
    }
    if (!is_read) std::fprintf(stderr, "%s: no cells with a scalar \"%s\" at the points\n", path, field);
    insitu_vtk_destroy(&adaptor);
    return is_read;
}
