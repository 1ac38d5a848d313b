/* Finds what the due images need of the meshes. */
#ifndef SESSION_PLAN_H
#define SESSION_PLAN_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_events.h"
#include "session_report.h"
#include "session_space.h"

/* Cell values that a layer wants at vertices. There is one item for each set of meshes, field and component. */
typedef struct session_recentring {
    session_joint *joint;
    const char *field;
    int component; /* as grid_field.component */
} session_recentring;

/* What the due images need; the same on every rank. Borrows from the scene and the catalogue. */
typedef struct session_plan {
    int image_count; /* that can be drawn */
    const scene_image **images;
    int slice_count, surface_count; /* counts over all images, in which an orbit's views count once; surfaces: outer
                                       ones, and isosurfaces if there are meshes of shells alone */
    int recentring_count;
    session_recentring *recentrings;
    int *stale;         /* one for each, for session_recentre() */
    int64_t cell_count; /* drawn ones of all ranks */
    base_error refusal; /* the refusal of the first due image that cannot be drawn */
} session_plan;

/* A step, and the time of the one before; the same on every rank. */
typedef struct session_moment {
    int64_t cycle;
    double time, last_time;
    bool is_first; /* there is no step before */
} session_moment;

/* Input that a plan is made from; the same on every rank. */
typedef struct session_plan_basis {
    const scene *scene;
    const char *scene_path; /* for messages */
    const session_moment *moment;
    uint64_t let_images; /* a bit for each image of the file, set where no condition holds it back */
    const session_catalogue *catalogue;
    const session_extent *extent;
    bool is_filled; /* some field is filled on demand, on any rank */
    bool are_kept;  /* pictures, in memory */
} session_plan_basis;

/* Counts the images that are due, without regard to conditions. Local. */
int session_count_due(const scene *scene, const session_moment *moment);

/* Finds the statistics that the step wants, and, if images, the conditions, whose fields are there. The first fault is
 * in *error. Local, the same everywhere. */
session_sound_events session_check_event_fields(const session_plan_basis *basis, bool images, base_error *error);

/* Find which of the due images can be drawn, mark on this rank's meshes and scalars what they need, and copy values
 * that have an index. An image that cannot be drawn is no error of this call, but values
 * that are wrong are: the fields' problems say so. Collective. */
insitu_status session_make_plan(const session_plan_basis *basis, session_meshes *meshes, const session_team *team,
                                session_report *report, session_plan *out, base_error *error);

void session_plan_free(session_plan *plan);

#endif
