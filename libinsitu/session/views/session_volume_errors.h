/* Estimates the errors of pixels of a volume that result from drawing cells of higher order as linear pieces. */
#ifndef SESSION_VOLUME_ERRORS_H
#define SESSION_VOLUME_ERRORS_H

#include "session_error_requests.h"

/* The range of a field's values at the nodes of all cells. minus_low is the negated lower end, so that one reduction by
 * maximum finds both ends. */
typedef struct session_value_range {
    const scene_field *field;
    double minus_low, high;
} session_value_range;

/* The ranges of values for those volumes of due images whose colour maps have no fixed range; the same on every
 * rank. */
typedef struct session_value_ranges {
    int count;
    session_value_range *items;
} session_value_ranges;

/* Finds the value ranges of all volumes that need them. The caller must free *out even after an error. Collective; all
 * ranks return the same status. */
insitu_status session_find_volume_ranges(const scene *scene, const session_due_views *views,
                                         const session_meshes *meshes, const session_team *team,
                                         session_value_ranges *out, base_error *error);
void session_free_volume_ranges(session_value_ranges *ranges);

/* Estimates the largest error of a colour channel in the pixels of all due views that show the volume, if cells of a
 * mesh have one piece between two nodes. With n pieces between two nodes, the error is this error divided by the square
 * of n. The result is the same on every rank and for every partition. parts: this rank's parts of the mesh. is_lobatto:
 * set if nodes along the axes of hexes and quads are Gauss-Lobatto points. Collective; all ranks return the same
 * status. */
insitu_status session_estimate_volume_error(const session_error_request *request, const session_value_ranges *ranges,
                                            const session_parts *parts, bool is_lobatto, const session_team *team,
                                            double *out, base_error *error);

#endif
