/* Finds the neighbour across each face of a mesh. */
#ifndef WAVE_FACES_H
#define WAVE_FACES_H

#include "wave_mesh.h"

/* Computes neighbours, face_offsets and unmatched of a mesh whose cells are complete. Returns false if memory ran
 * out. */
bool wave_faces_find_neighbours(wave_mesh *mesh);

#endif
