/* An image's layers on this rank's meshes, as the renderer takes them. */
#ifndef SESSION_LAYERS_H
#define SESSION_LAYERS_H

#include "session_plan.h"
#include "session_view.h"

typedef struct session_layers {
    int part_count;
    render_part *parts;
    render_surface_layer *surfaces;
    render_volume_layer *volumes;
    session_transfer *transfers; /* of surfaces, then of volumes */
    grid_field *fields;          /* part_count a surface, a surface's colour, and a volume */
    mmbvh_ranges *ranges;        /* as the fields */
    render_active_cells *kept;   /* the step's (session_kept.h), for the caller to set; NULL: nothing is kept */
} session_layers;

/* Collective: ranges from the data are over all ranks. On an error nothing is left to free. */
insitu_status session_make_layers(insitu_session *session, const scene_image *image, session_layers *out,
                                  base_error *error);

void session_layers_free(session_layers *layers);

#endif
