/* Builds and updates the trees (bounding volume hierarchies) over the cells of this rank's meshes. Each node of a tree
 * also has the range of a field's values in its cells. */
#ifndef SESSION_TREES_H
#define SESSION_TREES_H

#include "scene.h"
#include "session_mesh.h"
#include "session_space.h"
#include "session_team.h"

/* Measured seconds per cell on this rank: for building a tree, for selecting the candidates of a partial tree, and for
 * refitting the ranges of a tree. 0: not measured yet. */
typedef struct session_rates {
    double build, select, refit;
} session_rates;

/* The state of trees that does not belong to a single mesh. */
typedef struct session_trees {
    session_rates rates;
    /* tree whose leaves are the trees of this rank's parts; it is empty if there are fewer than two such trees */
    mmbvh parent;
    uint64_t parent_key;  /* hash of the list of parts over whose trees `parent` was built */
    bool is_parent_stale; /* set if a part's tree has changed since `parent` was built */
} session_trees;

/* Updates the trees of the meshes that are marked as needed: builds or refits those that are out of date. choice: the
 * kind of tree that the scene requests. Adds the times to the report. Local; the next reduction passes errors to all
 * ranks. */
insitu_status session_update_trees(session_trees *trees, const session_meshes *meshes, const session_space *space,
                                   scene_tree choice, const session_team *team, insitu_report *report,
                                   base_error *error);

void session_trees_free(session_trees *trees);

#endif
