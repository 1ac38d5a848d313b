/* Finds hanging vertices, which lie on the face of a larger cell, and computes their values.
 *
 * If a mesh is refined, a vertex of small cells may lie on a triangle or quad of a large cell, or on its edge, without
 * being a vertex of that cell. The mean over the cells around such a vertex differs from the large cell's value at the
 * same position, so that an isosurface would have gaps. Therefore the vertex takes the value of the face, which is
 * linear or bilinear in the values at its corners.
 *
 * Vertices may hang on faces that belong to only one cell of all ranks' parts of the mesh. The vertices that are tested
 * are the corners of faces that belong to only one cell of this rank. A vertex hangs on a face that contains it if
 * faces with the opposite orientation have this vertex as a corner, and all of these faces are smaller. Then the vertex
 * lies between a large cell and small ones. The orientation is tested because of walls along which two meshes overlap:
 * there, a large cell and small ones lie on the same side of the vertex. If the vertex can hang on several faces, the
 * largest one is used; but a face of a cell with a volume is used rather than any shell, even a larger one. A corner of
 * a face may itself be a hanging vertex on a still larger face. The face, and the vertex's position on it, are
 * determined from coordinates alone, with the same result on all ranks, regardless of which mesh of a mesh group has
 * the face.
 *
 * Triangles and quads that are cells (shells) have no other side. There, a vertex hangs on an edge of a shell if edges
 * of other shells along the same line end at this vertex, and all of them are shorter. */
#ifndef SESSION_HANGING_H
#define SESSION_HANGING_H

#include "session_catalogue.h"
#include "session_exchange.h"

/* Input for finding hanging vertices: this rank's vertices, and the groups of equal vertices. The vertices of all parts
 * of the mesh group have consecutive indices, part after part. The groups contain the vertices of drawn cells. */
typedef struct session_hanging_basis {
    session_mesh_group *mesh_group;
    int part_count;
    const session_mesh *const *meshes; /* the parts of the mesh group's meshes on this rank */
    const int64_t *first_vertices;     /* for each part, the index of its first vertex among those of all parts */
    /* for each vertex of all parts, the index of its group; -1: it belongs to no drawn cell */
    const int64_t *group_of_vertex;
    int64_t group_count;
} session_hanging_basis;

/* Returns whether vertices of the mesh group are treated as equal if their positions differ only by rounding. They are
 * treated so in mesh groups of several meshes, and in meshes with levels of refinement. */
bool session_merges_close_vertices(const session_mesh_group *mesh_group);

/* Computes the mesh group's borders (the outer faces of its parts, session_border) and twins (vertices that coincide
 * except for rounding, session_twins.h), unless both are up to date. `parts` contains this rank's parts of the group's
 * meshes. Collective; all ranks return the same status. */
insitu_status session_update_borders(session_mesh_group *mesh_group, const session_mesh_group_parts *parts,
                                     const session_team *team, base_error *error);

/* Returns the border of a part of the mesh group's meshes; NULL if vertices of the group are compared bitwise. *at: an
 * index in `parts`, not after the part, which is increased to that of the part; 0 at the first call. The borders must
 * be up to date (session_update_borders()). */
const session_border *session_find_border_of_part(const session_mesh_group *mesh_group,
                                                  const session_mesh_group_parts *parts, const session_mesh *part,
                                                  int *at);

/* Computes the mesh group's hanging vertices, unless they are up to date. The group's borders must be up to date
 * (session_update_borders()). Collective; all ranks return the same status. */
insitu_status session_update_hanging_vertices(const session_hanging_basis *basis, const session_team *team,
                                              base_error *error);

/* Sets the value of each hanging vertex to the value interpolated at its position on the face on which it hangs. means:
 * the value of each group of equal vertices. If a value at a corner of the face is not finite, the hanging vertex keeps
 * its value. Collective; all ranks return the same status. */
insitu_status session_interpolate_hanging_vertices(const session_hanging *hanging, const session_team *team,
                                                   double *means, base_error *error);

#endif
