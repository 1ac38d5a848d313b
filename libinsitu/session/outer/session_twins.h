/* Vertices of several meshes that are equal up to rounding.
 *
 * Codes compute the positions of each block's or level's vertices from its own origin and spacing, so that the same
 * vertex has different last bits in two meshes. Among such vertices on outer faces the least position is used for all.
 * They are equal if their distance is below 1e-5 of the shortest edge of the faces there, or below the rounding of
 * coordinates. */
#ifndef SESSION_TWINS_H
#define SESSION_TWINS_H

#include "session_catalogue.h"
#include "session_team.h"

/* Finds the twins of the joint's vertices; its borders and homes must be up to date. parts: this rank's. Errors of this
 * rank alone are stored in *error and not returned. Collective. */
insitu_status session_find_twins(session_joint *joint, const session_joint_parts *parts, const session_team *team,
                                 base_error *error);

#endif
