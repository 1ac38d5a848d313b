/* Handles meshes with adaptive refinement: finds the cells of coarse blocks that are covered by finer blocks of the
 * same mesh. The finer blocks may be on other ranks.
 *
 * The covered cells are determined from integers: the index of a block's first cell, the number of its cells along each
 * axis without ghost layers, and its refinement. Finer blocks must begin and end at borders of coarser cells, so that a
 * cell is either covered completely or not at all. A block that begins or ends within a coarser cell is an error. */
#ifndef SESSION_COVERS_H
#define SESSION_COVERS_H

#include "session_mesh.h"
#include "session_outer_faces.h"
#include "session_team.h"

/* Finds the covered cells of all refined blocks, and marks them as ghosts in an array of the session. Blocks whose
 * covered cells have changed must be checked again. If a finer block covers only part of a cell, session_mesh.misfit of
 * the block that has this cell describes the finer block. Collective; all ranks return the same status. */
insitu_status session_update_covered_cells(session_meshes *meshes, const session_team *team, base_error *error);

/* Removes the outer faces on whose other side is a block of another level, on any rank. No faces are removed from outer
 * surfaces of thresholds, or from two-dimensional blocks, whose cells are quads. Ghost flags of the caller are not
 * taken into account, so that a face next to a ghost cell of another level is also removed. Local. */
insitu_status session_drop_faces_between_levels(const session_meshes *meshes, const session_face_part *parts, int count,
                                                base_error *error);

#endif
