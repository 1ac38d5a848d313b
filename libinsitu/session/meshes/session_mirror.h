/* Mirror images of meshes, which the scene draws in addition to the meshes themselves. A mirror image is a further part
 * of the mesh, with the arrays of the part that is mirrored (its source) and mirrored coordinates; left-handed cells
 * become right-handed, and right-handed cells left-handed. The picture is the same as that of one mesh that consists of
 * both parts: vertices in the mirror plane are shared, and no surface is drawn in this plane. */
#ifndef SESSION_MIRROR_H
#define SESSION_MIRROR_H

#include "session_mesh.h"

/* Makes the mirror image, along these axes, of one of the caller's parts, or updates the mirror image after the part
 * has changed. Coordinates x become 2 * plane - x along each of the axes. A warp of the part must already have been
 * applied. Returns the mirror image, or NULL if memory runs out. Uses all threads. Local. */
session_mesh *session_mirror_mesh(session_meshes *meshes, session_mesh *source, int mirror_axes, const double planes[3],
                                  int threads, base_error *error);

#endif
