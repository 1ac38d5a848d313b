/* Computes the layers of an image on this rank's meshes, in the renderer's form. */
#ifndef SESSION_LAYERS_H
#define SESSION_LAYERS_H

#include "render.h"
#include "scene.h"
#include "session_catalogue.h"
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
    int first_outer; /* index of the first outer surface in `surfaces` */
    /* surface layers in this order: isosurfaces; the same isosurfaces as contour lines on shells (cells without a
     * volume), if a mesh has only shells; outer surfaces; planes of slices */
    render_surface_layer *surfaces;
    render_volume_layer *volumes;
    session_transfer *transfers; /* transfer functions of the surfaces, followed by those of the volumes */
    /* for each surface that is a plane of a slice, the signed distance from the plane at which it is drawn; otherwise 0
     */
    double *distances;
    session_contours *contours; /* contour lines of each surface */
    /* sections of part_count fields, one field for each part: two sections per surface (its field and its colour
     * field), then one per volume, then one per surface for its contour lines */
    grid_field *fields;
    int64_t field_count;
    render_vertex_gradients *gradients; /* gradients at vertices, part_count entries per surface */
    /* arrays of values gathered at outer faces, parallel to `fields`; NULL for other fields */
    double **gathered_values;
    mmbvh_ranges *ranges; /* ranges of the fields, parallel to `fields` */
} session_layers;

/* Input for computing layers. */
typedef struct session_layer_basis {
    const session_meshes *meshes;
    const session_catalogue *catalogue;
    const session_team *team;
    double half_diagonal; /* half the diagonal of the global bounds */
    bool is_flat;         /* set if the data is flat (session_flat_axis()) */
    bool has_shells;      /* set if any mesh contains only shells (session_has_shells()) */
    session_report *report;
    session_image_ranges *run_ranges; /* colour ranges over all steps so far; NULL: no layer has such a range */
    const scene_image *image;
} session_layer_basis;

/* Computes an image's layers. Collective, because ranges of the data are computed over all ranks. If *error of any rank
 * holds an error on entry, all ranks return it. After an error nothing needs to be freed. If only this rank lacks
 * memory for colours, only *error is set, and the next phase passes the error to all ranks. */
insitu_status session_make_layers(const session_layer_basis *basis, const scene_image *image, session_layers *out,
                                  base_error *error);

void session_layers_free(session_layers *layers);

#endif
