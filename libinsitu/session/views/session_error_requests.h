/* Lists requests: the isosurfaces, slices and volumes of a mesh with cells of higher order that due images show, and
 * whose errors are measured. Also determines which cells must be refined. */
#ifndef SESSION_ERROR_REQUESTS_H
#define SESSION_ERROR_REQUESTS_H

#include "render.h"
#include "session_finer.h"
#include "session_plan.h"

/* The cameras of the images that are due, that is, that are drawn in this step. */
typedef struct session_due_views {
    const scene *scene;
    int count;              /* number of images of the scene */
    bool *are_due;          /* for each image, whether it is due and its camera has a direction of view */
    render_camera *cameras; /* camera of each image; set only for images that are due */
    session_extent extent;  /* bounds of the caller's nodes; not computed if no due image needs them for a camera, a
                               slice or a volume */
} session_due_views;

/* Computes the cameras of the images that are due at `moment`. If a camera has no direction of view, its image is
 * treated as not due; drawing the image returns the error. The caller must free *out even after an error.
 * Collective. */
insitu_status session_compute_cameras_of_due_images(const scene *scene, const session_moment *moment,
                                                    const session_meshes *meshes, MPI_Comm comm, session_due_views *out,
                                                    base_error *error);
void session_free_due_views(session_due_views *views);

/* A quantity of a mesh whose error, by the division of cells into linear pieces, is measured: the isosurfaces of a
 * field, a plane of a slice, a volume, or the positions of all cells. */
typedef struct session_error_request {
    const session_due_views *views;
    bool *images;  /* one flag per image of the scene: set if the image shows what the request measures */
    bool is_shown; /* set if a due image shows what the request measures; otherwise nothing is measured */
    /* name of the field whose isosurfaces or volume are measured; NULL: the request is for a plane or for positions */
    const char *field;
    int component;
    int value_count;
    double *values; /* isovalues of the field */
    bool has_plane;
    session_plane plane;
    const scene_volume *volume; /* the volume whose error is measured; NULL: the request is not for a volume */
    double allowed;             /* allowed error of the volume in each colour channel of a pixel */
} session_error_request;

enum { SESSION_MOST_ERROR_REQUESTS = 256 };

/* All requests of a mesh. The first request is for the positions of all cells. */
typedef struct session_error_requests {
    int count;
    bool is_complete; /* false if memory has run out */
    bool is_shown;    /* set if some due image shows the mesh */
    bool needs_outer; /* set if a due image shows the outer surface, so that cells with outer faces are refined */
    /* true: all cells are refined; false: only cells with outer faces, and cells that isosurfaces or slices may
     * cross */
    bool needs_all;
    session_error_request items[SESSION_MOST_ERROR_REQUESTS];
} session_error_requests;

/* Lists the requests of a mesh. has_shells: true if some cells of the mesh, on any rank, are triangles or quads.
 * report: receives warnings of isosurfaces whose error has no bound; may be NULL. Local; the result is the same on
 * every rank. The caller must free *out. */
void session_list_error_requests(const scene *scene, const session_due_views *views, const session_catalogue_mesh *mesh,
                                 bool has_shells, session_error_requests *out, session_report *report);
void session_free_error_requests(session_error_requests *requests);

/* Returns a lower bound of the size of a pixel, in scene units, at any point of a sphere, in the images that show the
 * session_error_request `of`; INFINITY if none of these images shows the sphere. */
double session_find_smallest_pixel_size(const void *of, const double centre[3], double radius);

#endif
