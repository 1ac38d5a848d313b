/* An image's layers on this rank's meshes, in the renderer's form. */
#ifndef SESSION_LAYERS_H
#define SESSION_LAYERS_H

#include "render.h"
#include "scene.h"
#include "session_contours.h"
#include "session_mesh.h"
#include "session_report.h"
#include "session_run_ranges.h"
#include "session_team.h"
#include "session_transfer.h"

typedef struct session_layers {
    int part_count, transfer_count;
    render_part *parts;
    int surface_count;
    int first_outer;                /* the place of the first outer surface */
    render_surface_layer *surfaces; /* isosurfaces, their lines on shells if there are any, outer surfaces, planes */
    render_volume_layer *volumes;
    session_transfer *transfers; /* those of surfaces, then those of volumes */
    double *distances;           /* one for each surface: the isovalues of planes; 0 */
    session_contours *contours;  /* one for each surface */
    grid_field *fields;          /* part_count a surface and its colour, in turns, a volume, and a surface's lines */
    int64_t field_count;
    render_vertex_gradients *gradients; /* part_count entries per isosurface */
    double **gathered;                  /* same order as fields: values gathered at outer faces; else NULL */
    mmbvh_ranges *ranges;               /* same order as fields */
} session_layers;

/* Input of layers. */
typedef struct session_layer_basis {
    const session_meshes *meshes;
    const session_team *team;
    double half_diagonal; /* half the diagonal of the global bounds */
    bool is_flat;         /* session_flat_axis() found an axis */
    bool has_shells;      /* session_has_shells() */
    session_report *report;
    session_image_ranges *run_ranges; /* NULL: no layer has a range over the run */
    const scene_image *image;
} session_layer_basis;

/* Computes an image's layers. Collective, as ranges from the data are over all ranks. All ranks first agree on the
 * error in each one's *error; on an error nothing is left to free. If only this rank lacks memory for colours, *error
 * is set for the next agreement. */
insitu_status session_make_layers(const session_layer_basis *basis, const scene_image *image, session_layers *out,
                                  base_error *error);

void session_layers_free(session_layers *layers);

#endif
