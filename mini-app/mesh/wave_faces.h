/* Finds the cell beyond each face. */
#ifndef WAVE_FACES_H
#define WAVE_FACES_H

#include "wave_mesh.h"

/* Fills neighbours, face_offsets and unmatched of a mesh that has its cells. Returns false where memory ran out. */
bool wave_faces_find_neighbours(wave_mesh *mesh);

#endif
