/* Hashes of names, and of a mesh's arrays, by which the adaptor detects changes between steps. */
#ifndef BLUEPRINT_HASH_H
#define BLUEPRINT_HASH_H

#include "insitu/insitu.h"

uint64_t blueprint_hash_text(const char *text);

/* Combines a hash with more bits. The result depends on the order of the calls. */
uint64_t blueprint_mix_hash(uint64_t hash, uint64_t bits);

/* Returns a hash of the mesh's coordinates, including origin, spacing and axes of a lattice. */
uint64_t blueprint_hash_coordinates(const insitu_mesh *mesh);

/* Returns a hash of the mesh's cell types, connectivity, faces and ghost flags. */
uint64_t blueprint_hash_cells(const insitu_mesh *mesh);

#endif
