/* Isosurfaces on triangles, quads and polygons: the contour lines of their values, on the outer surface of meshes that
 * have no other cells. */
#ifndef SESSION_SHELLS_H
#define SESSION_SHELLS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_mesh.h"

/* Tells whether any mesh has shells alone, on all ranks together. */
bool session_has_shells(const session_catalogue *catalogue);

/* Makes the surface whose lines are the isosurface's on shells. It borrows from the layer; height: of the picture. */
scene_surface session_shells_of(const scene_isosurface *layer, int height);

/* Tells whether the layer is on the mesh. */
bool session_surface_is_on(const scene_surface *layer, const session_mesh *mesh);

#endif
