/* Mirror images of meshes, which the scene draws beside them. An image is a further part of the mesh, with the source's
 * arrays and mirrored coordinates; its cells are left-handed where the source's are right-handed. So pictures show what
 * a mesh that consists of both would show: vertices in the mirror plane are the same, and no wall is drawn there. */
#ifndef SESSION_MIRROR_H
#define SESSION_MIRROR_H

#include "session_mesh.h"

/* Makes the image of one of the caller's parts that is mirrored along these axes, or updates it after the part has
 * changed. Coordinates x become 2 * plane - x along each of the axes. The part must be warped before. Returns the
 * image, or NULL if memory runs out. Uses all threads. Local. */
session_mesh *session_mirror_mesh(session_meshes *meshes, session_mesh *source, int mirror_axes, const double planes[3],
                                  int threads, base_error *error);

#endif
