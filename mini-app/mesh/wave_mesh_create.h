/* Creates a rank's part of the mesh from the partition. */
#ifndef WAVE_MESH_CREATE_H
#define WAVE_MESH_CREATE_H

#include "wave_mesh.h"

/* Returns false if memory ran out, or if the part is too large for 32-bit local indices; *mesh is then zeroed.
 * Local. */
bool wave_mesh_create(const wave_partition *partition, int rank, int index_bytes, wave_mesh *mesh);

#endif
