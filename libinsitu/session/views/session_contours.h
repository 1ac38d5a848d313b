/* Computes the values of a layer's contour lines. */
#ifndef SESSION_CONTOURS_H
#define SESSION_CONTOURS_H

#include "error.h"
#include "render.h"
#include "scene.h"
#include "session_mesh.h"
#include "session_team.h"

typedef struct session_contours {
    render_lines lines;                  /* the lines for the renderer; their count is 0 if the field has no range */
    double values[RENDER_MAX_LINES];     /* value of the field on each contour line */
    float colours[3 * RENDER_MAX_LINES]; /* colour of each line, linear RGB */
} session_contours;

/* Computes the contour lines, except the field that they show. If the scene gives no values, the lines divide a range
 * into equal parts. This is the range of `colours`, the transfer function of the layer's colours; if colours is NULL,
 * it is the range of the field whose contour lines are drawn. Collective; the result is the same on all ranks. */
insitu_status session_compute_contour_lines(const session_meshes *meshes, const session_team *team,
                                            const scene_lines *in, const render_transfer *colours,
                                            session_contours *out, base_error *error);

#endif
