/* The cells of refined blocks that finer blocks of the same mesh cover, on any rank.
 *
 * Which cells these are follows from whole numbers: a block's first cell, its cells without ghost layers, and its
 * refinement. A cell is covered by one finer block as a whole or not at all, as long as finer blocks begin and end at
 * borders of coarser cells; one that does not is an error. */
#ifndef SESSION_COVERS_H
#define SESSION_COVERS_H

#include "session_mesh.h"
#include "session_outer_faces.h"
#include "session_team.h"

/* Finds the covered cells of all refined blocks, and marks them as ghosts of the session's own. Blocks whose covered
 * cells are others than before are to be checked again; those that do not fit have a misfit. Collective, agreed. */
insitu_status session_update_covers(session_meshes *meshes, const session_team *team, base_error *error);

/* Drops the outer faces beyond which blocks of another level lie, of whatever rank; those of thresholds and of quads
 * stay. Blanked cells are not known: a face beside one of another level is dropped too. Local. */
insitu_status session_drop_faces_between_levels(const session_meshes *meshes, const session_face_part *parts, int count,
                                                base_error *error);

#endif
