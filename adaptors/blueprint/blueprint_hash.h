/* Hashes of a mesh's arrays, by which the adaptor detects changes between steps. */
#ifndef BLUEPRINT_HASH_H
#define BLUEPRINT_HASH_H

#include "insitu/insitu.h"

/* Returns a hash of the mesh's coordinates, including origin, spacing and axes of a lattice. */
uint64_t blueprint_hash_coordinates(const insitu_mesh *mesh);

/* Returns a hash of the mesh's cell types, connectivity, faces and ghost flags. */
uint64_t blueprint_hash_cells(const insitu_mesh *mesh);

#endif
