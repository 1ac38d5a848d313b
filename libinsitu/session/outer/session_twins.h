/* Vertices of several meshes that are one but for rounding.
 *
 * Codes compute the places of each block's or level's vertices from an origin and a spacing of its own, so that the
 * same vertex has other last bits in two meshes. Of such vertices on outer faces the least place stands for all. They
 * are one where they are nearer than 1e-5 of the shortest edge of the faces there, or than coordinates round. */
#ifndef SESSION_TWINS_H
#define SESSION_TWINS_H

#include "session_catalogue.h"
#include "session_team.h"

/* Finds the twins of the joint's vertices; its borders and homes are known. meshes: of each of the joint's; NULL: this
 * rank has no part. What fails on this rank is in *error alone. Collective. */
insitu_status session_find_twins(session_joint *joint, const session_mesh *const *meshes, const session_team *team,
                                 base_error *error);

#endif
