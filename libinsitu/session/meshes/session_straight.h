/* Checks whether the cells of higher order of a mesh are straight: each node is where the linear cell with the same
 * corners has it. The linear pieces on an outer face of a straight cell lie exactly on the face of this linear cell. */
#ifndef SESSION_STRAIGHT_H
#define SESSION_STRAIGHT_H

#include "session_mesh.h"

/* Returns whether some cell of higher order of a part of a mesh is bent: some nodes are not where the linear cell with
 * the same corners has them. Pyramids are ignored, because normals of their faces are not computed
 * (session_face_normals.h). Returns true if memory runs out. The cells must have been split. Parallel. Local. */
bool session_has_bent_cells(const session_mesh *mesh, int threads);

#endif
