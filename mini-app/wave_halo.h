/* Exchanges the values of halo cells between ranks. */
#ifndef WAVE_HALO_H
#define WAVE_HALO_H

#include <mpi.h>

#include "wave_mesh.h"

enum { WAVE_TAG_HALO = 1 };

typedef struct wave_halo {
    const wave_mesh *mesh; /* mesh whose halo is exchanged, borrowed from the solver */
    MPI_Comm comm;         /* communicator of the mesh's ranks, borrowed from the solver */
    int value_bytes;       /* size of a value in bytes: 4 or 8 */
    char *send, *receive;
    MPI_Request *requests;
} wave_halo;

/* Prepares exchanges of four components per cell, with value_bytes each. Returns false if memory ran out. Local. */
bool wave_halo_create(const wave_mesh *mesh, MPI_Comm comm, int value_bytes, wave_halo *halo);
void wave_halo_free(wave_halo *halo);

/* Sets the values of every halo cell to the values on the cell's owner. Component k of cell c is element c *
 * cell_stride + k * component_stride. Collective. */
void wave_halo_exchange(wave_halo *halo, void *values, int64_t cell_stride, int64_t component_stride);

#endif
