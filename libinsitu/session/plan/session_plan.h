/* Makes the plan of a step: the list of the images that are due and can be drawn, and the list of the data that these
 * images need. An image is an entry of the scene's `images`; drawing it in a step makes one or several pictures. */
#ifndef SESSION_PLAN_H
#define SESSION_PLAN_H

#include "scene.h"
#include "session_catalogue.h"
#include "session_events.h"
#include "session_report.h"
#include "session_space.h"

/* A request to average cell values at vertices. There is one for each combination of meshes, field and component. */
typedef struct session_recentring {
    session_mesh_group *mesh_group;
    const char *field;
    int component; /* index of the component, or -1 for the magnitude (grid_field.component) */
} session_recentring;

/* The images to draw and the data that they need; the same on every rank. Pointers refer to the scene and the
 * catalogue. */
typedef struct session_plan {
    int image_count; /* number of images that can be drawn */
    const scene_image **images;
    /* Total numbers of slice layers and of surface layers in all images that can be drawn. The views of an orbit have
     * the same layers, which are counted once. surface_count also counts isosurface layers if some meshes contain only
     * shells, because isosurfaces are drawn as surface layers on such meshes (session_shells.h). */
    int slice_count, surface_count;
    int recentring_count;
    session_recentring *recentrings;
    /* working memory of session_recentre(): for each element of `recentrings`, nonzero if its averaged values are out
     * of date on some rank */
    int *stale;
    int64_t cell_count; /* number of drawn cells over all ranks */
    base_error refusal; /* error of the first due image that cannot be drawn */
} session_plan;

/* The cycle and time of a step, and the time of the previous one; the same on every rank. */
typedef struct session_moment {
    int64_t cycle;
    double time, last_time;
    bool is_first; /* set if there is no previous step */
} session_moment;

/* Input for making a plan; the same on every rank. */
typedef struct session_plan_basis {
    const scene *scene;
    const char *scene_path; /* path of the scene file, for messages */
    const session_moment *moment;
    /* one bit per image of the scene file; the bit is set if the image may be drawn in this step according to its
     * condition and its key `once` (session_find_drawable_images()) */
    uint64_t allowed_images;
    const session_catalogue *catalogue;
    const session_extent *extent;
    bool is_filled;      /* set if some rank has a field with a fill function (insitu_field.fill) */
    bool keeps_pictures; /* set if pictures are kept in memory */
} session_plan_basis;

/* Returns whether an image is due, without regard to its condition. Local. */
bool session_is_image_due(const scene_image *image, const session_moment *moment);
/* Returns the number of images that are due, without regard to conditions. Local. */
int session_count_due_images(const scene *scene, const session_moment *moment);

/* Checks the fields of the statistics that are due and, if `images` is set, the fields in conditions of images. Returns
 * the sets of all statistics and all images except those whose field does not exist or has an error. The first error is
 * stored in *error. Local, the same on every rank. */
session_valid_events session_check_event_fields(const session_plan_basis *basis, bool images, base_error *error);

/* Determines which of the due images can be drawn, marks on this rank's meshes and scalars the data that they need, and
 * calls fill functions, and copies the values of fields that have an index. If an image cannot be drawn, the error is
 * stored in out->refusal, and this call succeeds. A field with invalid values is an error of this call, which is also
 * stored in session_field.problem. Collective. */
insitu_status session_make_plan(const session_plan_basis *basis, session_meshes *meshes, const session_team *team,
                                session_report *report, session_plan *out, base_error *error);

void session_plan_free(session_plan *plan);

#endif
