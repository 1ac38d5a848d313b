/* Trees over this rank's meshes and the ranges of their scalars, brought up to date. */
#ifndef SESSION_TREES_H
#define SESSION_TREES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"
#include "session_team.h"

/* Seconds a cell takes on this rank, as measured; 0: not yet. */
typedef struct session_rates {
    double build, select, refit;
} session_rates;

/* State beside the meshes' own trees. */
typedef struct session_trees {
    session_rates rates;
    mmbvh parent; /* over the trees of parent_key; none where that is one tree or none */
    uint64_t parent_key;
    bool is_parent_stale;
} session_trees;

/* Build or refit what the plan marked and what is out of date. choice: the scene's. Adds to the report's times.
 * Local: the next reduction tells what went wrong. */
insitu_status session_update_trees(session_trees *trees, const session_meshes *meshes, const session_space *space,
                                   scene_tree choice, const session_team *team, insitu_report *report,
                                   base_error *error);

void session_trees_free(session_trees *trees);

#endif
