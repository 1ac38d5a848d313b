/* Values are packed, exchanged with each linked rank, and unpacked. They are copied as 4 or 8 bytes, so that float and
 * double use the same code. */
#include "wave_halo.h"

#include <stdlib.h>

enum { COMPONENTS = 4 };

bool wave_halo_create(const wave_mesh *mesh, MPI_Comm comm, int value_bytes, wave_halo *halo)
{
    size_t tuple = (size_t)COMPONENTS * (size_t)value_bytes;
    *halo = (wave_halo){.mesh = mesh, .comm = comm, .value_bytes = value_bytes};
    halo->send = malloc(((size_t)mesh->send_count + 1) * tuple);
    halo->receive = malloc(((size_t)(mesh->cells - mesh->own_cells) + 1) * tuple);
    halo->requests = malloc((2 * (size_t)mesh->link_count + 1) * sizeof *halo->requests);
    if (halo->send && halo->receive && halo->requests) return true;
    wave_halo_free(halo);
    return false;
}

void wave_halo_free(wave_halo *halo)
{
    free(halo->send);
    free(halo->receive);
    free(halo->requests);
    *halo = (wave_halo){0};
}

static void pack_values(const wave_halo *halo, const void *values, int64_t cell_stride, int64_t component_stride)
{
    for (int32_t i = 0; i < halo->mesh->send_count; ++i) {
        for (int k = 0; k < COMPONENTS; ++k) {
            int64_t from = halo->mesh->sends[i] * cell_stride + k * component_stride;
            int64_t to = (int64_t)i * COMPONENTS + k;
            if (halo->value_bytes == 8) {
                ((double *)halo->send)[to] = ((const double *)values)[from];
            } else {
                ((float *)halo->send)[to] = ((const float *)values)[from];
            }
        }
    }
}

static void unpack_values(const wave_halo *halo, void *values, int64_t cell_stride, int64_t component_stride)
{
    int32_t own = halo->mesh->own_cells, count = halo->mesh->cells - own;
    for (int32_t i = 0; i < count; ++i) {
        for (int k = 0; k < COMPONENTS; ++k) {
            int64_t from = (int64_t)i * COMPONENTS + k;
            int64_t to = ((int64_t)own + i) * cell_stride + k * component_stride;
            if (halo->value_bytes == 8) {
                ((double *)values)[to] = ((const double *)halo->receive)[from];
            } else {
                ((float *)values)[to] = ((const float *)halo->receive)[from];
            }
        }
    }
}

void wave_halo_exchange(wave_halo *halo, void *values, int64_t cell_stride, int64_t component_stride)
{
    const wave_mesh *mesh = halo->mesh;
    MPI_Datatype type = halo->value_bytes == 8 ? MPI_DOUBLE : MPI_FLOAT;
    size_t tuple = (size_t)COMPONENTS * (size_t)halo->value_bytes;
    int count = 0;
    for (int l = 0; l < mesh->link_count; ++l) {
        const wave_link *link = &mesh->links[l];
        MPI_Irecv(halo->receive + (size_t)(link->receive_begin - mesh->own_cells) * tuple,
                  COMPONENTS * (link->receive_end - link->receive_begin), type, link->rank, WAVE_TAG_HALO, halo->comm,
                  &halo->requests[count++]);
    }
    pack_values(halo, values, cell_stride, component_stride);
    for (int l = 0; l < mesh->link_count; ++l) {
        const wave_link *link = &mesh->links[l];
        MPI_Isend(halo->send + (size_t)link->send_begin * tuple, COMPONENTS * (link->send_end - link->send_begin), type,
                  link->rank, WAVE_TAG_HALO, halo->comm, &halo->requests[count++]);
    }
    MPI_Waitall(count, halo->requests, MPI_STATUSES_IGNORE);
    unpack_values(halo, values, cell_stride, component_stride);
}
