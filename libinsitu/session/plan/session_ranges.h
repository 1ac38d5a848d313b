/* Computes the ranges of colour maps for which the scene gives no fixed range. */
#ifndef SESSION_RANGES_H
#define SESSION_RANGES_H

#include "error.h"
#include "scene.h"
#include "session_mesh.h"
#include "session_team.h"

/* The scalar whose minimum and maximum are computed: a field or, if a plane is given, the distances from the plane on
 * the meshes that have the field. */
typedef struct session_range_subject {
    const scene_field *field;
    const scene_plane *plane; /* the plane; NULL: the field's own values are used */
    bool is_positive;         /* true: only positive values are used (session_scalars.h) */
} session_range_subject;

/* Computes the minimum and maximum over all ranks' drawn cells; low > high: there are no values. Collective. */
insitu_status session_find_extremes(const session_meshes *meshes, const session_team *team,
                                    const session_range_subject *of, double *low, double *high, base_error *error);

/* Computes the range of a layer's field over all ranks' drawn cells, as the colour map requires (extremes, percentiles
 * or symmetric). For SCENE_RANGE_RUN, this is the range of this step only. low > high: there are no values. The result
 * is bit-identical for any partition. Collective. */
insitu_status session_find_range(const session_meshes *meshes, const session_team *team, const scene_field *field,
                                 const scene_colour_map *map, double *low, double *high, base_error *error);

#endif
