/* Hashes of a mesh's arrays, by which the door finds what changes from step to step. */
#ifndef BLUEPRINT_HASH_H
#define BLUEPRINT_HASH_H

#include "insitu/insitu.h"

/* Of the coordinates: as they are read, and their contents. */
uint64_t door_hash_places(const insitu_mesh *mesh);

/* Of the cells, their faces and ghosts. */
uint64_t door_hash_cells(const insitu_mesh *mesh);

#endif
