/* Draws isosurfaces on shells (triangles, quads and polygons) as contour lines at the isovalues. The lines are drawn on
 * the outer surfaces of meshes all of whose cells are shells. */
#ifndef SESSION_SHELLS_H
#define SESSION_SHELLS_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_mesh.h"

/* Returns whether there is a mesh whose cells are shells on all ranks. */
bool session_has_shells(const session_catalogue *catalogue);

/* Returns a surface layer that draws an isosurface layer as contour lines on shells. The result points to data of the
 * isosurface layer. height: height of the image in pixels. */
scene_surface session_make_shell_layer(const scene_isosurface *layer, int height);

/* Returns whether the surface layer is drawn on the mesh. */
bool session_is_surface_on_mesh(const scene_surface *layer, const session_mesh *mesh);

#endif
